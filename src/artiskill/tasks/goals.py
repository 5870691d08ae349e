"""Goals of several environments as one: every array of a goal has the batch dimension first."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

ROW = "row"  # the field that numbers the environments
# A goal's class may name, in `PADDING`, fields of which one goal has more entries (along the second axis) than
# another, and what fills them up; None: their first entry again.
_PADDING = "PADDING"


def stack_goals(goals: Sequence[Any]) -> Any:
    """One goal of B = sum of the goals' batches; fields of unequal length are padded to the longest."""
    kind = type(goals[0])
    columns = {}
    for f in fields(kind):
        values = [getattr(goal, f.name) for goal in goals]
        if f.name in _padding(kind):
            most = max(value.shape[1] for value in values)
            values = [_filled(value, most, _padding(kind)[f.name]) for value in values]
        columns[f.name] = np.concatenate(values)
    columns[ROW] = np.arange(len(columns[ROW]))
    return kind(**columns)


def put_goal(stacked: Any, slot: int, goal: Any) -> bool:
    """Write a goal of B = 1 into a place of a stacked one.

    Returns:
        False, and nothing is written, where a field of the goal is too long: then stack anew.
    """
    padding = _padding(type(goal))
    if any(getattr(goal, name).shape[1] > getattr(stacked, name).shape[1] for name in padding):
        return False
    for f in fields(goal):
        if f.name != ROW:
            value, places = getattr(goal, f.name), getattr(stacked, f.name)
            if f.name in padding:
                value = _filled(value, places.shape[1], padding[f.name])
            places[slot] = value[0]
    return True


def _padding(kind: type) -> Mapping[str, np.ndarray | None]:
    return getattr(kind, _PADDING, {})


def _filled(values: np.ndarray, count: int, padding: np.ndarray | None) -> np.ndarray:
    """Rows (B, N, ...) filled up to `count` with `padding`, or with the first entry, which then counts no less."""
    missing = count - values.shape[1]
    fill = values[:, :1] if padding is None else padding
    return np.concatenate((values, np.broadcast_to(fill, (len(values), missing, *values.shape[2:]))), axis=1)

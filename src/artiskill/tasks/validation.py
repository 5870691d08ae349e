"""Checks of what a task is made of and of what its functions return, once each: steps cost no more."""

import math
from collections.abc import Iterable, Mapping
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from artiskill.config import check
from artiskill.errors import ConfigError, closest, shown
from artiskill.tasks.staged_reward import STAGE_TERM

if TYPE_CHECKING:  # a task checks itself
    from artiskill.tasks.task import Task


def check_parts(task: "Task") -> None:
    """Refuse a task that cannot be right, whatever its functions return.

    Raises:
        ConfigError: no condition of success, one that is named twice, no step to hold it, or a weight that is no
            finite number.
    """
    names = task.flag_names
    check(
        isinstance(names, tuple) and len(set(names)) == len(names) > 0,
        f"task {task.name}: flag_names must be a tuple of one or more different names, not {shown(names)}",
    )
    check(
        task.hold_steps >= 1,
        f"task {task.name}: hold_steps must be at least 1, not {shown(task.hold_steps)}",
    )
    for name, weight in task.reward_weights.items():
        legal = isinstance(weight, Real) and math.isfinite(weight)
        check(legal, f"task {task.name}: the weight of {name!r} must be a finite number, not {shown(weight)}")


def check_flags(task: "Task", flags: Any, count: int) -> None:
    """Refuse what a task's `flags` returned for `count` environments, unless it is as `Task` says.

    Raises:
        ConfigError: no mapping, a flag of `flag_names` is missing, or one is no array of (B,) bool.
    """
    _check_mapping(task, "flags", flags)
    for name in task.flag_names:
        if name not in flags:
            raise ConfigError(
                f"task {task.name}: flag_names has {name!r}, but flags returns no such flag"
                f"{_hint(name, flags, 'It returns')}"
            )
    for name, flag in flags.items():
        _check_array(task, f"flag {name!r}", flag, count, "b")


def check_terms(task: "Task", terms: Any, count: int) -> None:
    """Refuse what a task's `reward_terms` returned for `count` environments, unless it is as `Task` says.

    Raises:
        ConfigError: no mapping, a weight without a term, a term without a weight that is none of the stages', or a
            term that is no array of (B,) numbers.
    """
    _check_mapping(task, "reward_terms", terms)
    for name in task.reward_weights:
        if name not in terms:
            raise ConfigError(
                f"task {task.name}: there is a weight for {name!r}, but reward_terms returns no such term"
                f"{_hint(name, terms, 'It returns')}"
            )
    for name, term in terms.items():
        if name not in {*task.reward_weights, *task.reward_table.terms, STAGE_TERM}:
            raise ConfigError(
                f"task {task.name}: reward_terms returns {name!r}, which has no weight"
                f"{_hint(name, task.reward_weights, 'Weights (0 only reports a term)')}"
            )
        _check_array(task, f"reward term {name!r}", term, count, "biuf")


def _check_mapping(task: "Task", function: str, given: Any) -> None:
    check(
        isinstance(given, Mapping),
        f"task {task.name}: {function} must return a dict, name -> array of (B,), not {shown(given)}",
    )


def _check_array(task: "Task", what: str, given: Any, count: int, kinds: str) -> None:
    """Raise ConfigError unless `given` is an array with one number, or truth value, for each environment."""
    if isinstance(given, np.ndarray) and given.shape == (count,) and given.dtype.kind in kinds:
        return
    found = f"{given.shape} {given.dtype}" if isinstance(given, np.ndarray) else f"a {type(given).__name__}"
    raise ConfigError(
        f"task {task.name}: {what} must be an array of shape (B,), here ({count},), with a "
        f"{'bool' if kinds == 'b' else 'number'} for each environment; not {found}"
    )


def _hint(given: str, legal: Iterable[str], what: str) -> str:
    names = list(map(str, legal))
    near = closest(given, names)
    return f"{'.' if near is None else f'; did you mean {near!r}?'} {what}: {', '.join(names) or 'none'}"

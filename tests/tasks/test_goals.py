"""Goals of several environments as one, for every task."""

from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from artiskill.assets.catalog import list_objects, load_object
from artiskill.tasks.goals import ROW, put_goal, stack_goals
from artiskill.tasks.registry import make_task, task_names


def goals_of(name: str) -> list[Any]:
    task = make_task(name)
    objects = [
        load_object(i)
        for i in (*list_objects(split="test", task=name)[:3], list_objects(split="ood", task=name)[0])
    ]
    return [
        task.make_goal(obj, target) for obj in objects for target in (task.targets(obj) or (obj.links[0].name,))
    ]


def assert_row_is(stacked: Any, row: int, goal: Any) -> None:
    for f in fields(goal):
        if f.name != ROW:
            value, place = getattr(goal, f.name)[0], getattr(stacked, f.name)[row]
            np.testing.assert_array_equal(place[: len(value)] if value.ndim else place, value, err_msg=f.name)


@pytest.mark.parametrize("name", task_names())
def test_each_row_is_its_goal(name: str) -> None:
    goals = goals_of(name)
    stacked = stack_goals(goals)
    np.testing.assert_array_equal(stacked.row, np.arange(len(goals)))
    for row, goal in enumerate(goals):
        assert_row_is(stacked, row, goal)


@pytest.mark.parametrize("name", task_names())
def test_putting_a_goal_is_stacking_it_there(name: str) -> None:
    goals = goals_of(name)
    longest = stack_goals(goals)
    for goal in reversed(goals):
        assert put_goal(longest, 1, goal)
        assert_row_is(longest, 1, goal)
        assert_row_is(longest, 0, goals[0])


def test_a_goal_that_is_too_long_is_not_put() -> None:
    goals = goals_of("OpenCabinetDrawer")
    by_planes = sorted(goals, key=lambda goal: goal.handle_planes.shape[1])
    short, long = by_planes[0], by_planes[-1]
    assert short.handle_planes.shape[1] < long.handle_planes.shape[1], "this test means handles of two kinds"
    stacked = stack_goals([short, short])
    assert not put_goal(stacked, 0, long)
    assert_row_is(stacked, 0, short)
    assert put_goal(stack_goals([short, long]), 0, long)

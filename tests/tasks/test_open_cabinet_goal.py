"""Goals of handles with different numbers of grasps become one batch, in which each keeps its own."""

import numpy as np

from artiskill.assets.cabinets import GENERATOR
from artiskill.tasks.goals import stack_goals
from artiskill.tasks.open_cabinet.goal import OpenGoal, make_open_goal


def goal_with(kind: str, grasps: int) -> OpenGoal:
    """The goal of the first drawer or door with such a handle."""
    for seed in range(200):
        obj = GENERATOR.make(seed, f"cabinet-{seed}")
        for handle in obj.handles:
            if handle.kind == kind and len(handle.grasp_positions) == grasps:
                return make_open_goal(obj, handle.link, 0.9)
    raise AssertionError(f"no {kind} with {grasps} grasps")


def test_grasps_are_padded_with_the_best() -> None:
    bar, knob = goal_with("bar", 2), goal_with("knob", 8)
    both = stack_goals([bar, knob])
    assert both.grasp_rotations.shape == (2, 8, 3, 3)
    np.testing.assert_array_equal(both.grasp_rotations[0, :2], bar.grasp_rotations[0])
    np.testing.assert_array_equal(both.grasp_rotations[0, 2:], np.repeat(bar.grasp_rotations[:, 0], 6, axis=0))
    np.testing.assert_array_equal(both.grasp_positions[1], knob.grasp_positions[0])
    most = max(len(bar.handle_planes[0]), len(knob.handle_planes[0]))
    assert both.handle_planes.shape == (2, most, 4)

"""Inputs of networks, by hand: a base at (1, 2) that faces the world's y axis, a hand at (1, 3, 0.6)."""

import math
from typing import Any

import numpy as np
import pytest

from artiskill.learning.features import Features, Scale, feature_sizes, make_features
from artiskill.learning.network_config import InputConfig
from artiskill.learning.observation import ObservationArrays

PLAIN = {
    "near_m": 0.0,
    "colors": False,
    "masks": False,
    "state_per_point": False,
    "state_in_head": True,
    "velocities": True,
    "extents": False,
}
POINT_W, POINT_ROBOT, POINT_HAND = [0.0, 3.0, 1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 0.4]
HAND_ROBOT, ORIGIN_ROBOT = [1.0, 0.0, 0.6], [-2.0, 1.0]


def one_arm() -> np.ndarray:
    agent = np.zeros((1, 38), dtype=np.float32)
    agent[0, :6] = [1, 3, 0.5, 1, 3, 0.7]  # fingertips
    agent[0, 12:15] = [1, 2, math.pi / 2]
    return agent


def observe(points: Any, masks: Any = None, agent: np.ndarray | None = None, real: int = 9) -> ObservationArrays:
    """One cloud; points from number `real` on are padding."""
    n = len(points)
    return ObservationArrays(
        np.array([points], dtype=np.float32),
        np.full((1, n, 3), 0.5, dtype=np.float32),
        np.zeros((1, n, 1), dtype=np.float32) if masks is None else np.array([masks], dtype=np.float32),
        np.arange(n)[None] < real,
        one_arm() if agent is None else agent,
    )


def features(
    seen: ObservationArrays, frame: str = "world", scale: Scale | None = None, **changes: Any
) -> Features:
    count = seen.agent.shape[1]
    plain = Scale(*(np.full(n, value, np.float32) for n, value in ((3, 0), (3, 1), (count, 0), (count, 1))))
    return make_features(seen, InputConfig(**{**PLAIN, "frames": ("cloud",), **changes}), scale or plain, frame)


def test_coordinates_in_three_frames() -> None:
    seen = features(observe([POINT_W, [4.0, 3.0, 1.0]]), frames=("cloud", "robot", "hand"))
    np.testing.assert_allclose(seen.points[0, 0], [-2, 0, 0, *POINT_ROBOT, *POINT_HAND], atol=1e-6)


def test_points_that_are_given_in_the_robots_frame() -> None:
    seen = features(observe([POINT_ROBOT]), "robot", frames=("robot", "hand"))
    np.testing.assert_allclose(seen.points[0, 0], [*POINT_ROBOT, *POINT_HAND], atol=1e-6)


def test_points_that_are_given_in_the_hands_frame_have_no_other() -> None:
    seen = features(observe([POINT_HAND]), "end_effector", frames=("cloud", "robot", "hand"))
    np.testing.assert_allclose(seen.points[0, 0], [0, 0, 0, *POINT_HAND], atol=1e-6)


def test_two_hands_give_coordinates_each() -> None:
    agent = np.zeros((1, 68), dtype=np.float32)
    agent[0, [0, 3]], agent[0, [6, 9]] = 1.0, -2.0  # x of the fingertips of each hand
    seen = features(observe([[3.0, 0.0, 0.0]], agent=agent), frames=("hand",))
    np.testing.assert_allclose(seen.points[0, 0], [2, 0, 0, 5, 0, 0])


def test_another_robot_has_coordinates_in_the_cloud_alone() -> None:
    seen = features(observe([POINT_W], agent=np.ones((1, 5), np.float32)), frames=("robot", "hand"))
    np.testing.assert_allclose(seen.points[0, 0], [0, 0, 0])


def test_the_state_knows_hand_and_origin() -> None:
    seen = features(observe([POINT_W]), frames=("hand",))
    state = [*one_arm()[0], *POINT_W, *HAND_ROBOT, *ORIGIN_ROBOT, *np.tanh(ORIGIN_ROBOT)]
    np.testing.assert_allclose(seen.state[0], state, atol=1e-6)


def test_the_state_is_normalised_and_bounded() -> None:
    agent = np.array([[3.0, 100.0]], dtype=np.float32)
    scale = Scale(*(np.array(one, np.float32) for one in ([1, 1, 1], [2, 2, 2], [1, 0], [4, 1])))
    seen = features(observe([[3.0, 5.0, 1.0]], agent=agent), scale=scale)
    np.testing.assert_allclose(seen.state[0], [0.5, 10, 1, 2, 0])


def test_a_squashed_copy() -> None:
    seen = features(observe([POINT_W]), frames=("cloud", "hand"), near_m=0.5)
    np.testing.assert_allclose(seen.points[0, 0, 6:], np.tanh(2 * np.array(POINT_HAND)), atol=1e-6)


def test_colors_and_masks() -> None:
    seen = features(observe([POINT_W], masks=[[1]]), colors=True, masks=True)
    np.testing.assert_allclose(seen.points[0, 0, 3:], [0.5, 0.5, 0.5, 1])


def test_extents_of_masks_and_of_the_rest() -> None:
    points = [[0, 0, 0], [2, 0, 4], [4, 6, 2], [9, 9, 9]]
    seen = features(observe(points, masks=[[1, 0], [1, 0], [0, 0], [0, 1]], real=3), extents=True)
    mean = np.array([2, 2, 2])
    first = [*([1, 0, 2] - mean), *([0, 0, 0] - mean), *([2, 0, 4] - mean)]
    rest = [*([4, 6, 2] - mean)] * 3
    np.testing.assert_allclose(seen.state[0, 41:], [*first, *[0] * 9, *rest], atol=1e-6)


def test_padding_is_zero_and_does_not_move_the_mean() -> None:
    seen = features(observe([[1, 1, 1], [3, 1, 1], [50, 50, 50]], masks=[[1], [1], [1]], real=2), masks=True)
    np.testing.assert_allclose(seen.points[0], [[-1, 0, 0, 1], [1, 0, 0, 1], [0, 0, 0, 0]])
    assert not seen.masks[0, 2].any()


def test_blindness_to_the_robots_mask() -> None:
    seen = features(observe([POINT_W], masks=[[1, 1, 1]]), masks=True, blind_to_robot=True)
    np.testing.assert_allclose(seen.points[0, 0, 3:], [1, 1, 0])
    only = features(observe([POINT_W], masks=[[1]]), masks=True, blind_to_robot=True)
    np.testing.assert_allclose(only.points[0, 0, 3:], [1])


@pytest.mark.parametrize("frame", ["world", "robot", "end_effector"])
@pytest.mark.parametrize("agent", [5, 38, 68])
def test_sizes(frame: str, agent: int) -> None:
    changes = {"frames": ("cloud", "robot", "hand"), "near_m": 0.1, "colors": True, "masks": True, "extents": True}
    seen = features(observe([POINT_W], [[0, 1, 0]], np.zeros((1, agent), np.float32)), frame, **changes)
    sizes = feature_sizes(InputConfig(**{**PLAIN, **changes}), masks=3, agent=agent, frame=frame)
    assert sizes == (seen.points.shape[2], seen.state.shape[1])
    assert {part.dtype for part in seen[:3]} == {np.dtype(np.float32)}


@pytest.mark.parametrize(
    ("size", "kept"), [(38, [*range(6), *range(12, 15), *range(18, 28)]), (68, None), (5, None)]
)
def test_velocities_are_left_out(size: int, kept: list[int] | None) -> None:
    """Fingertips, base, joints: positions, then velocities, as docs/tasks has them. Another state is kept."""
    if kept is None:
        kept = [*range(12), *range(24, 27), *range(30, 49)] if size == 68 else list(range(5))
    agent = np.arange(size, dtype=np.float32)[None] / 10
    config = InputConfig(frames=("cloud",), **(PLAIN | {"velocities": False}))
    scale = Scale(np.zeros(3), np.ones(3), np.zeros(size, np.float32), np.ones(size, np.float32))
    state = make_features(observe([[0, 0, 0]], agent=agent), config, scale).state[0]
    np.testing.assert_array_equal(state[: len(kept)], agent[0, kept])
    assert len(state) == len(kept) + 3, "the cloud's mean is the rest"

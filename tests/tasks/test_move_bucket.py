"""MoveBucket: where it starts, when it is solved, what it rewards."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from artiskill.assets.catalog import list_objects, load_object
from artiskill.errors import ConfigError
from artiskill.geometry.rotations import quat_to_matrix
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.levels import RngStream, level_generator
from artiskill.tasks.move_bucket import ball_depth_m, body_box, bucket_centre_w, hand_placement
from artiskill.tasks.registry import make_task

TASK = make_task("MoveBucket")
BUCKET = "bucket-0001"
FLAGS = ("balls_in_bucket", "bucket_above_platform", "bucket_standing", "bucket_static")


@pytest.fixture(scope="module")
def instant(play) -> tuple[Snapshot, Any]:
    return play(TASK, BUCKET, 20)


def held(snapshot: Snapshot, xyz: tuple[float, float, float], lean_rad: float = 0.0, **changes: Any) -> Snapshot:
    """The bucket somewhere, leaning, still, its ball inside, unless changes say otherwise."""
    position, quaternion = snapshot.link_position_w.copy(), snapshot.link_quaternion_w.copy()
    position[0, 0] = xyz
    quaternion[0, 0] = (math.cos(lean_rad / 2), math.sin(lean_rad / 2), 0.0, 0.0)
    rotation = quat_to_matrix(quaternion)
    values = {
        "link_position_w": position,
        "link_quaternion_w": quaternion,
        "link_rotation_w": rotation,
        "previous_link_position_w": position.copy(),
        "previous_link_quaternion_w": quaternion.copy(),
        "root_velocity_w": np.zeros((1, 6)),
        "prop_position_w": (position[0, 0] + rotation[0, 0] @ (0.0, 0.0, 0.07)).reshape(1, 1, 3),
    }
    return dataclasses.replace(snapshot, **{**values, **changes})


def flags_of(snapshot: Snapshot, goal: Any) -> tuple[bool, ...]:
    return tuple(bool(value[0]) for value in TASK.flags(snapshot, goal).values())


def test_initial_states_lie_in_their_ranges() -> None:
    bucket = load_object(BUCKET)
    own = np.array(bucket.links[1].joint.limits)
    for level in range(100):
        state = TASK.sample_initial_state(bucket, level_generator(level, RngStream.INITIAL_STATE))
        place, robot = state.root_pose_w[:2], state.robot_qpos[:2]
        assert 0.8 <= np.linalg.norm(place) <= 1.2
        assert 0.6 <= np.linalg.norm(robot - place) <= 0.8
        away = (robot - place) @ place / np.linalg.norm(robot - place) / np.linalg.norm(place)
        assert np.arccos(np.clip(away, -1, 1)) <= 0.4 * np.pi + 1e-6
        np.testing.assert_allclose(state.object_limits[0], own + 0.1 * np.ptp(own) * np.array((1, -1)))
        assert state.object_qpos[0] == state.object_limits[0, 0]
        ball = state.prop_positions_w[0]
        assert ball[2] == pytest.approx(body_box(bucket)[1, 2] - 0.05)


@pytest.mark.parametrize("object_id", list_objects("bucket", "test")[:3] + list_objects("bucket", "ood")[:3])
def test_the_ball_falls_in_and_stays(play, object_id: str) -> None:
    snapshot, goal = play(dataclasses.replace(TASK), object_id, 0)
    assert bool(TASK.flags(snapshot, goal)["balls_in_bucket"][0])
    later, _ = play(TASK, object_id, 25)
    assert bool(TASK.flags(later, goal)["balls_in_bucket"][0])
    assert later.prop_position_w[0, 0, 2] < snapshot.prop_position_w[0, 0, 2]


@pytest.mark.parametrize(
    ("xyz", "lean", "expected"),
    [
        ((0.0, 0.0, 0.1), 0.0, (True, True, True, True)),
        ((0.2, 0.2, 0.5), 0.0, (True, True, True, True)),  # held in the air above it
        ((0.301, 0.0, 0.1), 0.0, (True, False, True, True)),
        ((0.0, 0.0, 0.1), 0.099 * math.pi, (True, True, True, True)),
        ((0.0, 0.0, 0.1), 0.101 * math.pi, (True, True, False, True)),
    ],
)
def test_flags(
    instant: tuple[Snapshot, Any], xyz: tuple[float, float, float], lean: float, expected: tuple[bool, ...]
) -> None:
    snapshot, goal = instant
    assert tuple(TASK.flags(snapshot, goal)) == FLAGS == TASK.flag_names
    assert flags_of(held(snapshot, xyz, lean), goal) == expected


def test_a_lost_ball_is_no_success_and_the_first_stage(instant: tuple[Snapshot, Any]) -> None:
    snapshot, goal = instant
    lost = held(snapshot, (0.0, 0.0, 0.1), prop_position_w=np.array([[[0.5, 0.0, 0.05]]]))
    assert flags_of(lost, goal) == (False, True, True, True)
    assert stage_of(lost, goal) == 0
    assert stage_of(held(snapshot, (0.0, 0.0, 0.1)), goal) == 4


def stage_of(snapshot: Snapshot, goal: Any) -> int:
    terms = TASK.reward_terms(snapshot, goal, TASK.flags(snapshot, goal))
    return int(np.searchsorted(TASK.config.reward.stage_bonus, float(terms["stage"][0]), side="right")) - 1


def with_hands(snapshot: Snapshot, goal: Any) -> Snapshot:
    """Fingertips on the bucket's wall, the hands on opposite sides."""
    centre, half = bucket_centre_w(snapshot, goal)[0], np.ptp(goal.box[0], axis=0) / 2
    aside = np.array((0.0, half[1], 0.0))
    sides = np.array([centre + aside, centre - aside])
    lines = np.repeat(sides, 2, axis=0)[None, :, None].repeat(2, axis=2)
    return dataclasses.replace(snapshot, finger_line_w=lines, tool_position_w=sides[None])


def test_stages_on_the_way(instant: tuple[Snapshot, Any]) -> None:
    snapshot, goal = instant
    assert stage_of(held(snapshot, (1.0, 0.0, 0.0)), goal) == 0
    assert stage_of(with_hands(held(snapshot, (1.0, 0.0, 0.0)), goal), goal) == 1
    assert stage_of(with_hands(held(snapshot, (1.0, 0.0, 0.21)), goal), goal) == 2
    carried = held(snapshot, (0.2, 0.0, 0.21))
    before = carried.link_position_w + np.array((0.05, 0.0, 0.0))
    moving = dataclasses.replace(carried, previous_link_position_w=before)
    assert stage_of(with_hands(moving, goal), goal) == 3
    assert stage_of(with_hands(carried, goal), goal) == 4


def test_hands_on_one_side_do_not_hold_a_bucket(instant: tuple[Snapshot, Any]) -> None:
    """They would tip it."""
    gripped = with_hands(held(instant[0], (1.0, 0.0, 0.0)), instant[1])
    first = gripped.tool_position_w[:, :1].repeat(2, axis=1)
    one_side = dataclasses.replace(
        gripped, tool_position_w=first, finger_line_w=first[:, :, None].repeat(2, axis=2).repeat(2, axis=1)
    )
    assert stage_of(gripped, instant[1]) == 1
    assert stage_of(one_side, instant[1]) == 0


def earned(snapshot: Snapshot, goal: Any) -> float:
    terms = TASK.reward_terms(snapshot, goal, TASK.flags(snapshot, goal))
    return sum(weight * float(terms[name][0]) for name, weight in TASK.reward_weights.items())


def with_ball(snapshot: Snapshot, local: np.ndarray) -> Snapshot:
    """The ball at a place in the bucket's frame."""
    place = snapshot.link_position_w[0, 0] + snapshot.link_rotation_w[0, 0] @ local
    return dataclasses.replace(snapshot, prop_position_w=place.reshape(1, 1, 3))


@pytest.mark.parametrize("height", [0.0, 0.1, 0.18])  # from 0.16 m on the stage is being left for the next one
@pytest.mark.parametrize("way", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, -0.6, 0.8)])
def test_nothing_jumps_while_the_ball_leaves_a_bucket_in_the_hands(
    instant: tuple[Snapshot, Any], height: float, way: tuple[float, float, float]
) -> None:
    """Over the rim or through a wall, 0.2 mm at a time: from the second stage to the first, without a step."""
    snapshot, goal = instant
    gripped = with_hands(held(snapshot, (1.0, 0.0, height)), goal)
    middle = goal.box[0].mean(axis=0)
    balls = [with_ball(gripped, middle + d * np.array(way)) for d in np.arange(0.0, 0.5, 2e-4)]
    assert (stage_of(balls[0], goal), stage_of(balls[-1], goal)) == (1, 0)
    rewards = np.array([earned(ball, goal) for ball in balls])
    assert np.abs(np.diff(rewards)).max() < 0.06
    assert np.ptp(rewards) > 1
    assert (np.diff(rewards) < 1e-9).all(), "further out never earns more"


def test_a_bucket_without_its_ball_earns_less_than_any_with_it_in_the_hands(instant: tuple[Snapshot, Any]) -> None:
    snapshot, goal = instant
    gripped = with_hands(held(snapshot, (1.0, 0.0, 0.1)), goal)
    lost = with_ball(gripped, np.array((0.6, 0.0, 0.0)))
    bonus = TASK.config.reward.stage_bonus
    assert bonus[0] < earned(lost, goal) < bonus[1] - 0.4
    assert earned(gripped, goal) > bonus[1]


def test_the_ball_is_as_deep_as_its_way_out_is_long(instant: tuple[Snapshot, Any]) -> None:
    snapshot, goal = instant
    low, high = goal.box[0]
    middle = (low + high) / 2
    leaning = held(snapshot, (0.3, -0.2, 0.4), lean_rad=0.7)
    for local, depth in (
        (middle, (high - low).min() / 2),
        ((middle[0], middle[1], high[2] - 0.01), 0.01),
        ((middle[0], middle[1], high[2] + 0.02), -0.02),
        ((low[0] - 0.05, middle[1], high[2] + 0.02), -0.05),
    ):
        ball = with_ball(leaning, np.array(local))
        assert ball_depth_m(ball, goal)[0] == pytest.approx(depth, abs=1e-9)
        assert bool(TASK.flags(ball, goal)["balls_in_bucket"][0]) is bool(depth >= 0)


def test_hands_on_opposite_sides_are_seen(instant: tuple[Snapshot, Any]) -> None:
    snapshot, goal = instant
    around = with_hands(held(snapshot, (1.0, 0.0, 0.0)), goal)
    cosine, level = hand_placement(around, bucket_centre_w(around, goal))
    assert cosine[0] == pytest.approx(-1)
    assert level[0] == pytest.approx(0, abs=1e-12)
    tools = around.tool_position_w.copy()
    tools[0, 1] = tools[0, 0] + (0, 0, 0.1)
    cosine, level = hand_placement(
        dataclasses.replace(around, tool_position_w=tools), bucket_centre_w(around, goal)
    )
    assert cosine[0] == pytest.approx(1)
    assert level[0] == pytest.approx(0.1)


def test_torch_gives_the_same_answers(instant: tuple[Snapshot, Any], assert_torch_agrees) -> None:
    assert_torch_agrees(TASK, *instant)


def test_one_arm_is_too_few() -> None:
    with pytest.raises(ConfigError, match="two arms; one_arm has 1"):
        make_task("MoveBucket", {"robot": "one_arm"})

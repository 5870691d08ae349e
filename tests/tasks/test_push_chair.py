"""PushChair: where it starts, when it is solved, what it rewards."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from artiskill.assets.catalog import load_object
from artiskill.errors import ConfigError
from artiskill.geometry.rotations import quat_rotate, quat_to_matrix
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.free_object import ObjectPose
from artiskill.tasks.levels import RngStream, level_generator
from artiskill.tasks.registry import make_task

TASK = make_task("PushChair")
CHAIR = "chair-0002"


@pytest.fixture(scope="module")
def instant(play) -> tuple[Snapshot, Any]:
    return play(TASK, CHAIR, 5)


def standing(snapshot: Snapshot, xy: tuple[float, float], lean_rad: float = 0.0, **changes: Any) -> Snapshot:
    """The chair put somewhere, leaning, and still unless changes say otherwise."""
    position, quaternion = snapshot.link_position_w.copy(), snapshot.link_quaternion_w.copy()
    position[0, 0] = (*xy, 0.0)
    quaternion[0, 0] = (math.cos(lean_rad / 2), math.sin(lean_rad / 2), 0.0, 0.0)
    values = {
        "link_position_w": position,
        "link_quaternion_w": quaternion,
        "link_rotation_w": quat_to_matrix(quaternion),
        "previous_link_position_w": position.copy(),
        "previous_link_quaternion_w": quaternion.copy(),
        "root_velocity_w": np.zeros((1, 6)),
    }
    return dataclasses.replace(snapshot, **{**values, **changes})


def flags_of(snapshot: Snapshot, goal: Any) -> tuple[bool, ...]:
    return tuple(bool(value[0]) for value in TASK.flags(snapshot, goal).values())


def test_initial_states_lie_in_their_ranges() -> None:
    chair = load_object(CHAIR)
    rolling = np.array(
        [any(s.part in ("wheel", "caster") for s in chair.links[i].collisions) for i in chair.jointed_links]
    )
    assert rolling.any()
    assert not rolling.all()
    for level in range(100):
        state = TASK.sample_initial_state(chair, level_generator(level, RngStream.INITIAL_STATE))
        place, robot = state.root_pose_w[:2], state.robot_qpos[:2]
        assert 0.8 <= np.linalg.norm(place) <= 1.2
        assert 0.8 <= np.linalg.norm(robot - place) <= 1.2
        angle = np.arccos(
            np.clip((robot - place) @ place / np.linalg.norm(robot - place) / np.linalg.norm(place), -1, 1)
        )
        assert angle <= 0.2 * np.pi + 1e-6, "the robot stands beyond the chair"
        heading = np.array((np.cos(state.robot_qpos[2]), np.sin(state.robot_qpos[2])))
        facing = (place - robot) / np.linalg.norm(place - robot)
        assert np.arccos(np.clip(heading @ facing, -1, 1)) <= 0.05 * np.pi + 1e-6
        back = quat_rotate(state.root_pose_w[3:], np.array((1.0, 0.0, 0.0)))[:2]
        assert np.arccos(np.clip(back @ -place / np.linalg.norm(place), -1, 1)) <= 0.4 * np.pi + 1e-6
        assert (state.joint_friction[rolling] <= 0.01).all()
        assert (state.joint_friction[~rolling] >= 0.05).all()
        assert state.robot_qpos[3] == 0.9


@pytest.mark.parametrize(
    ("xy", "lean", "expected"),
    [
        ((0.1, 0.1), 0.0, (True, True, True)),
        ((0.149, 0.0), 0.0, (True, True, True)),
        ((0.151, 0.0), 0.0, (False, True, True)),
        ((0.0, 0.0), 0.049 * math.pi, (True, True, True)),
        ((0.0, 0.0), 0.051 * math.pi, (True, False, True)),
    ],
)
def test_flags(
    instant: tuple[Snapshot, Any], xy: tuple[float, float], lean: float, expected: tuple[bool, ...]
) -> None:
    snapshot, goal = instant
    assert flags_of(standing(snapshot, xy, lean), goal) == expected


@pytest.mark.parametrize(("speed", "still"), [(0.099, True), (0.101, False)])
def test_static_compares_with_the_previous_step(instant: tuple[Snapshot, Any], speed: float, still: bool) -> None:
    snapshot, goal = instant
    before = standing(snapshot, (0.0, 0.0)).link_position_w - (speed * snapshot.step_s, 0, 0)
    assert flags_of(standing(snapshot, (0.0, 0.0), previous_link_position_w=before), goal)[2] is still
    turn = 2 * speed * snapshot.step_s  # the limit is 0.2 rad/s
    turned = standing(snapshot, (0.0, 0.0)).link_quaternion_w.copy()
    turned[0, 0] = (math.cos(turn / 2), 0.0, 0.0, math.sin(turn / 2))
    assert flags_of(standing(snapshot, (0.0, 0.0), previous_link_quaternion_w=turned), goal)[2] is still


def test_nearing_the_target_is_positive_speed(instant: tuple[Snapshot, Any]) -> None:
    snapshot, _ = instant
    moving = standing(snapshot, (1.0, 0.0), root_velocity_w=np.array([[-0.3, 0.4, 0, 0, 0, 0]]))
    assert ObjectPose(moving).approach_speed_m_s[0] == pytest.approx(0.3)


def stage_of(snapshot: Snapshot, goal: Any) -> int:
    terms = TASK.reward_terms(snapshot, goal, TASK.flags(snapshot, goal))
    return int(np.searchsorted(TASK.config.reward.stage_bonus, float(terms["stage"][0]), side="right")) - 1


def test_stages(instant: tuple[Snapshot, Any]) -> None:
    snapshot, goal = instant
    far = standing(snapshot, (1.0, 0.0))
    assert stage_of(far, goal) == 0
    on_the_chair = np.broadcast_to(far.link_position_w[0, 0] + (0, 0, 0.4), (1, 4, 2, 3)).copy()
    assert stage_of(dataclasses.replace(far, finger_line_w=on_the_chair), goal) == 1
    fast = standing(snapshot, (0.05, 0.0), previous_link_position_w=far.link_position_w)
    assert stage_of(fast, goal) == 2
    assert stage_of(standing(snapshot, (0.05, 0.0)), goal) == 3
    assert stage_of(standing(snapshot, (0.05, 0.0), 0.3 * math.pi), goal) == 0, "a tipped chair starts over"


def test_pushing_nearer_earns_more(instant: tuple[Snapshot, Any]) -> None:
    snapshot, goal = instant
    earned = []
    for x in (1.2, 1.0, 0.8, 0.5, 0.3, 0.2, 0.151, 0.149, 0.14, 0.1):
        here = standing(snapshot, (x, 0.0))
        hands = np.broadcast_to(here.link_position_w[0, 0] + (0, 0, 0.4), (1, 4, 2, 3)).copy()
        here = dataclasses.replace(here, finger_line_w=hands)
        terms = TASK.reward_terms(here, goal, TASK.flags(here, goal))
        earned.append(sum(TASK.reward_weights[name] * float(value[0]) for name, value in terms.items()))
    assert (np.diff(earned) > 0).all()


def test_a_chair_that_is_knocked_away_earns_less_than_one_that_waits(instant: tuple[Snapshot, Any]) -> None:
    snapshot, goal = instant
    earned = []
    for x, moved in ((1.0, 0.0), (1.0, 0.02), (1.6, 0.0), (1.6, 0.02)):  # m from the target, m in the last step
        here = standing(snapshot, (x, 0.0))
        before = here.link_position_w - np.array((moved, 0.0, 0.0))  # away from the target
        velocity = np.array([[moved / here.step_s, 0, 0, 0, 0, 0]])
        here = dataclasses.replace(here, previous_link_position_w=before, root_velocity_w=velocity)
        assert stage_of(here, goal) == 0
        terms = TASK.reward_terms(here, goal, TASK.flags(here, goal))
        away = {name: value for name, value in terms.items() if not name.startswith("hand_")}  # hands stay behind
        earned.append(sum(TASK.reward_weights[name] * float(value[0]) for name, value in away.items()))
    assert (np.diff(earned) < 0).all()


def test_torch_gives_the_same_answers(instant: tuple[Snapshot, Any], assert_torch_agrees) -> None:
    assert_torch_agrees(TASK, *instant)


def test_bad_values_are_refused() -> None:
    for values, message in (
        ({"success.near_m": 0}, "near_m must be positive"),
        ({"initial.chair_distance_m": [1.2, 0.8]}, "range"),
        ({"reward.stage_bonus": [-16, -8.8, -8.7, 0]}, "must rise by more than"),
        (
            {"reward.stage_bonus": [-16, -8.8, -1.2, 0]},
            r"^config: reward.*still\) can earn 0.75: lower every bonus",
        ),
        ({"reward.weights.upwright": 1}, "unknown terms"),
        ({"initial.lift_m": 5}, "lift_m"),
    ):
        with pytest.raises(ConfigError, match=message):
            make_task("PushChair", values)

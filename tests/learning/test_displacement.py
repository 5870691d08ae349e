"""Robots that stand elsewhere: what is seen fits them, and their commands lead back."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from artiskill.errors import ConfigError
from artiskill.experts.whole_body import Command, Grip, WholeBodyConfig
from artiskill.learning.commands import GRIP_PHASES, CommandSpace
from artiskill.learning.displacement import Displacement
from artiskill.learning.observation import ObservationArrays
from artiskill.robots.arm_config import load_arm
from artiskill.robots.config import load_robot
from artiskill.robots.kinematics import RobotKinematics, RobotPose

B, N, STEP_S = 32, 20, 0.05
ARM = np.array([0.0, 0, 0, -1.5, 0, 2.5, np.pi / 4, 0.02, 0.02])


def space(arms: int) -> CommandSpace:
    robot = load_robot("one_arm" if arms == 1 else "two_arms")
    return CommandSpace(robot, STEP_S, GRIP_PHASES, arms, WholeBodyConfig(), (0.0,) * 7 * arms, 0.1, arms == 1)


def agents(arms: int) -> np.ndarray:
    """Return the proprioception (B, S) of robots near a usual posture, fingertips and all."""
    rng, tips, joints = np.random.default_rng(0), 12 * arms, 1 + 9 * arms
    found = np.zeros((B, tips + 6 + 2 * joints))
    found[:, tips : tips + 6 + joints] = rng.normal(0, 0.2, (B, 6 + joints))
    found[:, tips + 6 : tips + 6 + joints] += [0.5, *np.tile(ARM, arms)]
    found[:, tips + 7 : tips + 6 + joints].reshape(B, arms, 9)[:, :, 7:] = rng.uniform(0, 0.04, (B, arms, 2))
    found[:, : 6 * arms] = tips_of(found, arms).reshape(B, -1)
    return found


def tips_of(agent: np.ndarray, arms: int) -> np.ndarray:
    """Return fingertips (B, A, 2, 3) of proprioception (B, S), 2 cm beyond each tool, as far apart as fingers."""
    kinematics = RobotKinematics(space(arms).robot)
    pose, qpos = kinematics.pose(agent, STEP_S), kinematics.joints(agent)[0]
    fingers = qpos[:, 4:].reshape(B, arms, 9)[:, :, 7:] * [1, -1]
    ends = pose.tool_position_w + 0.02 * pose.tool_rotation_w[..., 2]
    return ends[:, :, None] + fingers[..., None] * pose.tool_rotation_w[:, :, None, :, 1]


def steps(
    arms: int, gap_m: float, grip: Grip = Grip.OPEN, lift_m: float | None = None
) -> tuple[ObservationArrays, np.ndarray]:
    """Return steps whose points, in the world's frame, are all so far from the first hand, and commands.

    The last two points are of the robot.
    """
    rng, agent = np.random.default_rng(1), agents(arms).astype(np.float32)
    if lift_m is not None:
        agent[:, 12 * arms + 6] = lift_m
    pose = RobotKinematics(space(arms).robot).pose(agent.astype(np.float64), STEP_S)
    away = rng.normal(0, 1, (B, N, 3))
    points = pose.tool_position_w[:, :1] + gap_m * away / np.linalg.norm(away, axis=2, keepdims=True)
    masks = np.zeros((B, N, 3 if arms == 1 else 1), np.float32)  # of chairs and buckets there is the robot's alone
    masks[:, -2:, -1] = 1.0
    seen = ObservationArrays(
        points.astype(np.float32), np.zeros((B, N, 3), np.float32), masks, np.ones((B, N), bool), agent
    )
    command = Command(
        phase=int(grip),
        twists=rng.uniform(-0.3, 0.3, (arms, 6)),
        trunk_qvel=rng.uniform(-0.2, 0.2, 4),
        arm_gain_s=1.0,
        grip=np.full(arms, grip),
        width_m=np.full(arms, 0.03),
    )
    return seen, np.tile(space(arms).encode(command), (B, 1))


def displaced(arms: int, gap_m: float, grip: Grip = Grip.OPEN) -> tuple[ObservationArrays, ...]:
    """Return steps before and after, then their commands likewise, then where robots were and are."""
    seen, labels = steps(arms, gap_m, grip)
    found, others = Displacement(space(arms), "world", 0.03, 0.06)(seen, labels, np.random.default_rng(2))
    kinematics = RobotKinematics(space(arms).robot)
    poses = [kinematics.pose(one.agent.astype(np.float64), STEP_S) for one in (seen, found)]
    return seen, found, labels, others, *poses


def way_m(before: RobotPose, after: RobotPose) -> np.ndarray:
    return np.linalg.norm(after.tool_position_w - before.tool_position_w, axis=2)


def turn(before: RobotPose, after: RobotPose) -> np.ndarray:
    """Return rotation vectors (B, A, 3), world."""
    matrices = after.tool_rotation_w @ before.tool_rotation_w.swapaxes(2, 3)
    return Rotation.from_matrix(matrices.reshape(-1, 3, 3)).as_rotvec().reshape(*matrices.shape[:2], 3)


def turn_rad(before: RobotPose, after: RobotPose) -> np.ndarray:
    return np.linalg.norm(turn(before, after), axis=2)


def in_world(pose: RobotPose, arms: int, commands: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what commands ask of hands (B, A, 2, 3) and trunk (B, 4), along the world's axes."""
    twists, trunk = space(arms).motions(commands)
    cos, sin = np.cos(pose.robot_qpos[:, 2]), np.sin(pose.robot_qpos[:, 2])
    x, y = cos * trunk[:, 0] - sin * trunk[:, 1], sin * trunk[:, 0] + cos * trunk[:, 1]
    twists = np.einsum("baij,bakj->baki", pose.tool_rotation_w, twists.reshape(B, arms, 2, 3))
    return twists, np.stack((x, y, trunk[:, 2], trunk[:, 3]), axis=1)


@pytest.mark.parametrize("arms", [1, 2])
def test_hands_move_by_centimetres_where_there_is_room_and_fingertips_with_them(arms: int) -> None:
    seen, found, *_, before, after = displaced(arms, gap_m=1.0)
    assert 0.02 < np.median(way_m(before, after)) < 0.2
    assert 0.02 < np.median(turn_rad(before, after)) < 0.5
    tips = found.agent[:, : 6 * arms].reshape(B, arms, 2, 3)
    np.testing.assert_allclose(tips, tips_of(found.agent.astype(np.float64), arms), atol=1e-5)
    np.testing.assert_array_equal(found.points, seen.points)


def test_a_hand_stays_where_it_works_and_the_base_moves_all_the_same() -> None:
    *_, before, after = displaced(1, gap_m=0.005, grip=Grip.CLOSING)
    assert way_m(before, after).max() < 0.01
    assert turn_rad(before, after).max() < 0.03
    assert np.abs(after.robot_qpos - before.robot_qpos)[:, :2].std() > 0.01


def test_an_open_hand_turns_even_near_a_handle() -> None:
    *_, before, after = displaced(1, gap_m=0.005)
    assert way_m(before, after).max() < 0.01
    assert np.median(turn_rad(before, after)) > 0.02


def test_fingers_of_some_open_hands_stand_elsewhere_and_closed_ones_hold_what_they_hold() -> None:
    *_, before, after = displaced(1, gap_m=0.1)
    moved = (after.robot_qpos != before.robot_qpos)[:, -2:].all(axis=1)
    assert 0.1 < moved.mean() < 0.6
    assert (after.robot_qpos[moved, -2:] >= 0).all()
    *_, before, after = displaced(1, gap_m=0.1, grip=Grip.CLOSING)
    np.testing.assert_array_equal(after.robot_qpos[:, -2:], before.robot_qpos[:, -2:])


@pytest.mark.parametrize("arms", [1, 2])
def test_the_command_is_the_same_motion_and_one_that_leads_back(arms: int) -> None:
    *_, labels, others, before, after = displaced(arms, gap_m=0.1)
    (hands, trunk), (new_hands, new_trunk) = in_world(before, arms, labels), in_world(after, arms, others)
    moved = after.tool_position_w - before.tool_position_w
    np.testing.assert_allclose(new_hands[:, :, 0] - hands[:, :, 0], -3.0 * moved, atol=2e-3)
    np.testing.assert_allclose(new_hands[:, :, 1] - hands[:, :, 1], -3.0 * turn(before, after), atol=0.02)
    assert np.abs(new_hands - hands).max() > 0.2
    way = after.robot_qpos[:, :4] - before.robot_qpos[:, :4]
    np.testing.assert_allclose(new_trunk - trunk, -1.0 * way, atol=2e-3)
    assert np.abs(way).max(axis=0).min() > 0.02
    np.testing.assert_array_equal(others[:, space(arms).motion_size : -1], labels[:, space(arms).motion_size : -1])


def test_the_kind_is_that_of_the_new_motion() -> None:
    seen, labels = steps(1, gap_m=1.0)
    _, others = Displacement(space(1), "world", 0.03, 0.3)(seen, labels, np.random.default_rng(2))
    again = np.stack([space(1).encode(space(1).decode(one)) for one in others])
    np.testing.assert_array_equal(again[:, -1], others[:, -1])
    assert len(np.unique(others[:, -1])) > 1
    alone = replace(space(1), one_kind=True)
    assert alone.with_motions(labels, *alone.motions(others))[:, -1].max() == 0


def test_points_in_the_frame_of_the_base_stay_where_they_are_in_the_world() -> None:
    seen, labels = steps(1, gap_m=0.3)
    to_base = RobotKinematics(space(1).robot)

    def moved_to(points: np.ndarray, agent: np.ndarray, sign: int) -> np.ndarray:
        qpos = to_base.joints(agent.astype(np.float64))[0]
        turn = np.zeros((B, 3, 3))
        turn[:, 0, 0] = turn[:, 1, 1] = np.cos(qpos[:, 2])
        turn[:, 1, 0], turn[:, 2, 2] = np.sin(qpos[:, 2]), 1.0
        turn[:, 0, 1] = -turn[:, 1, 0]
        place = np.concatenate((qpos[:, :2], np.zeros((B, 1))), axis=1)[:, None]
        return points @ turn.swapaxes(1, 2) + place if sign > 0 else (points - place) @ turn

    own = seen._replace(points=moved_to(seen.points, seen.agent, -1).astype(np.float32))
    found, _ = Displacement(space(1), "robot", 0.03, 0.06)(own, labels, np.random.default_rng(2))
    np.testing.assert_allclose(moved_to(found.points, found.agent, 1), seen.points, atol=1e-5)
    assert np.abs(found.points - own.points).max() > 0.01


@pytest.mark.parametrize("arms", [1, 2])
def test_the_robots_own_points_are_missing_and_keep_no_hand_in_its_place(arms: int) -> None:
    seen, labels = steps(arms, gap_m=1.0)
    kinematics = RobotKinematics(space(arms).robot)
    before = kinematics.pose(seen.agent.astype(np.float64), STEP_S)
    seen.points[:, -1] = before.tool_position_w[:, 0]
    found, _ = Displacement(space(arms), "world", 0.03, 0.06)(seen, labels, np.random.default_rng(2))
    assert not found.valid[:, -2:].any()
    assert found.valid[:, :-2].all()
    after = kinematics.pose(found.agent.astype(np.float64), STEP_S)
    assert np.median(way_m(before, after)) > 0.02


def test_joints_keep_their_ranges_and_hands_come_where_they_shall_or_nothing_moves() -> None:
    """The lift is at its end: where it would go beyond, the arm does its part."""
    seen, labels = steps(1, gap_m=1.0, lift_m=0.0)
    found, _ = Displacement(space(1), "world", 0.03, 0.2)(seen, labels, np.random.default_rng(2))
    kinematics = RobotKinematics(space(1).robot)
    before, after = (kinematics.joints(one.agent)[0] for one in (seen, found))
    limits = np.array([joint.range_rad for joint in load_arm(space(1).robot.arm).joints])
    moved = (before != after).any(axis=1)
    assert 0.5 < moved.mean() <= 1.0
    assert (after[:, 3] >= 0.0).all()
    assert 0.2 < (after[moved, 3] == 0.0).mean() < 0.8
    assert (after[moved, 4:11] >= limits[:, 0] - 1e-6).all()
    assert (after[moved, 4:11] <= limits[:, 1] + 1e-6).all()
    poses = [kinematics.pose(one.agent.astype(np.float64), STEP_S) for one in (seen, found)]
    assert way_m(*poses).max() < 0.2
    assert turn_rad(*poses).max() < 1.0


def test_commands_that_leave_an_arm_alone() -> None:
    with pytest.raises(ConfigError, match="all 2 arms, not of 1"):
        Displacement(replace(space(2), arms=1, arm_qpos_rad=space(2).arm_qpos_rad[:7]), "world", 0.03, 0.06)


def test_the_same_generator_moves_robots_alike() -> None:
    seen, labels = steps(1, gap_m=0.2)
    one, other = (
        Displacement(space(1), "world", 0.03, 0.06)(seen, labels, np.random.default_rng(4)) for _ in range(2)
    )
    np.testing.assert_array_equal(one[0].agent, other[0].agent)
    np.testing.assert_array_equal(one[1], other[1])

"""Variations of steps: mirror images that are true, and what stays as it is in the others."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.errors import ConfigError
from artiskill.experts.whole_body import Command, Grip, WholeBodyConfig
from artiskill.learning.augmentation import Augmentation, AugmentationConfig, mirrored_agent
from artiskill.learning.commands import GRIP_PHASES, CommandActor, CommandSpace
from artiskill.learning.observation import ObservationArrays
from artiskill.robots.config import load_robot
from artiskill.robots.kinematics import RobotKinematics

NONE = AugmentationConfig(mirror=0, stretch=0, jitter_m=0, drop=0, unmask=0)
MIRROR = np.diag([1.0, -1.0, 1.0])
B, N = 6, 40


def space(arms: int) -> CommandSpace:
    robot = load_robot("one_arm" if arms == 1 else "two_arms")
    posture = (0.0, 0.0, 0.0, -1.5, 0.0, 3.0, np.pi / 4) * arms
    return CommandSpace(robot, 0.05, ("reach", "push"), arms, WholeBodyConfig(), posture, 0.1, False)


def agents(arms: int = 2) -> np.ndarray:
    """Return the proprioception (B, S) of robots in any posture near the usual one; fingertips are left out."""
    rng, tips, joints = np.random.default_rng(0), 12 * arms, 1 + 9 * arms
    found = np.zeros((B, tips + 6 + 2 * joints))
    found[:, tips:] = rng.normal(0, 0.3, found[:, tips:].shape)
    start = tips + 6
    found[:, start] = 0.5
    found[:, start + 1 : start + joints] += np.array([0, 0, 0, -1.5, 0, 2.5, np.pi / 4, 0.02, 0.02] * arms)
    return found


def seen(arms: int = 2) -> ObservationArrays:
    rng = np.random.default_rng(1)
    masks = np.eye(4, dtype=np.float32)[rng.integers(0, 4, (B, N))][..., :3]
    points = rng.normal(0, 1, (B, N, 3)).astype(np.float32)
    valid = np.arange(N) < rng.integers(N // 2, N, (B, 1))
    return ObservationArrays(points, np.zeros_like(points), masks, valid, agents(arms).astype(np.float32))


def command(seed: int, arms: int = 2) -> Command:
    rng = np.random.default_rng(seed)
    return Command(
        phase=1,
        twists=rng.uniform(-0.3, 0.3, (arms, 6)),
        trunk_qvel=rng.uniform(-0.2, 0.2, 4),
        arm_gain_s=0.5,
        grip=np.array([Grip.OPEN, Grip.SHUT][:arms]),
        width_m=np.array([0.01, 0.03][:arms]),
        press_n=20.0 if arms > 1 else 0.0,
    )


def vary(arms: int = 2, **values: float) -> tuple[ObservationArrays, ObservationArrays, np.ndarray, np.ndarray]:
    """Return steps and commands, before and after."""
    given = seen(arms)
    labels = np.stack([space(arms).encode(command(k, arms)) for k in range(B)])
    found, others = Augmentation(replace(NONE, **values), space(arms), frame="robot", masks=3)(
        given, labels, np.random.default_rng(2)
    )
    return given, found, labels, others


def test_a_mirrored_robot_has_its_hands_where_the_mirror_shows_them() -> None:
    kinematics, agent = RobotKinematics(space(2).robot), agents()
    pose, other = (kinematics.pose(one, 0.05) for one in (agent, mirrored_agent(agent, 2)))
    np.testing.assert_allclose(other.tool_position_w, pose.tool_position_w[:, ::-1] @ MIRROR, atol=1e-12)
    axes = MIRROR @ pose.tool_rotation_w[:, ::-1] @ MIRROR
    np.testing.assert_allclose(other.tool_rotation_w, axes, atol=1e-12)


def test_points_have_right_and_left_exchanged() -> None:
    given = seen()
    found = Augmentation(replace(NONE, mirror=1), space(2), "robot", 3).mirrored(given, vary()[2])[0]
    np.testing.assert_array_equal(found.points, given.points @ MIRROR.astype(np.float32))
    np.testing.assert_array_equal(found.masks, given.masks)


def test_a_mirrored_robot_has_its_fingertips_where_its_hands_are() -> None:
    """Of robots as an environment shows them: fingertips in the frames of hands that kinematics finds."""
    env = ManipulationVectorEnv(B, "MoveBucket", obs_mode="pointcloud", num_threads=1)
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(3):
        agent = np.asarray(env.step(env.action_space.sample())[0]["agent"], dtype=np.float64)
    env.close()
    kinematics, places = RobotKinematics(space(2).robot), []
    for one in (agent, mirrored_agent(agent, 2)):
        tips, pose = one[:, :12].reshape(B, 2, 2, 3), kinematics.pose(one, 0.05)
        places.append((tips - pose.tool_position_w[:, :, None]) @ pose.tool_rotation_w)
    assert (np.abs(places[0]).max(axis=3) < 0.06).all()
    assert (np.ptp(places[0][..., 1], axis=2) > 0.01).all()  # fingers stand apart
    np.testing.assert_allclose(places[1], places[0][:, ::-1, ::-1] @ MIRROR, atol=1e-5)


def test_a_mirrored_velocity_is_that_of_mirrored_positions() -> None:
    """Fingertips, base, joints: positions are followed by velocities of as many numbers."""
    rng, places, rates = np.random.default_rng(3), [], []
    for start, size in ((0, 12), (24, 3), (30, 19)):
        places += range(start, start + size)
        rates += range(start + size, start + 2 * size)
    before = rng.normal(0, 1, (B, 68))
    after = before.copy()
    after[:, places] += 0.1 * before[:, rates]
    found, later = (mirrored_agent(one, 2) for one in (before, after))
    np.testing.assert_allclose((later - found)[:, places] / 0.1, found[:, rates], atol=1e-9)
    assert np.abs(found - before)[:, rates].max() > 0.1


def test_a_mirrored_command_is_carried_out_as_the_mirror_shows_it() -> None:
    """Twists, widths, grips and trunk: the action is the mirror image of the action."""
    actor, agent = CommandActor(space(2)), agents()
    labels = np.stack([actor.space.encode(command(k)) for k in range(B)])
    others = Augmentation(replace(NONE, mirror=1), space(2), "robot", 3).mirrored(seen(), labels)[1]
    for row in range(B):
        action = actor.action(agent[row], labels[row])
        other = actor.action(mirrored_agent(agent, 2)[row], others[row])
        trunk = action[:4] * [1, -1, -1, 1]
        arms = action[4:].reshape(2, -1)[::-1].copy()
        arms[:, :7] *= [-1, 1, -1, 1, -1, 1, -1]
        np.testing.assert_allclose(other, np.concatenate((trunk, arms.reshape(-1))), atol=1e-5)


def test_a_mirror_image_of_a_mirror_image_is_the_step_itself() -> None:
    augmentation, labels = Augmentation(replace(NONE, mirror=1), space(2), "robot", 3), vary()[2]
    there = augmentation.mirrored(seen(), labels)
    back, same = augmentation.mirrored(*there)
    assert np.abs(there[1] - labels).max() > 0.1
    np.testing.assert_array_equal(same, labels)
    for one, other in zip(back, seen(), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-6)


def test_where_kinds_are_grips_the_kind_is_that_of_the_hand_that_is_first_now() -> None:
    own = replace(space(2), phases=GRIP_PHASES)
    labels = own.encode(replace(command(0), phase=int(Grip.OPEN)))[None]  # its grips: open, shut
    other = Augmentation(replace(NONE, mirror=1), own, "robot", 3).mirrored(seen(), labels)[1]
    assert (labels[0, -1], other[0, -1]) == (Grip.OPEN, Grip.SHUT)
    assert own.decode(other[0]).grip.tolist() == [Grip.SHUT, Grip.OPEN]


def test_about_the_share_asked_for_is_mirrored() -> None:
    given, found, labels, others = vary(mirror=0.5)
    changed = (found.points != given.points).any(axis=(1, 2))
    assert 0 < changed.sum() < B
    np.testing.assert_array_equal(changed, (others != labels).any(axis=1))


def test_handle_and_robot_stay_where_they_are_when_the_object_is_stretched() -> None:
    given, found, _, _ = vary(arms=1, stretch=0.2)
    stays = (given.masks[..., 0] > 0) | (given.masks[..., 2] > 0)
    np.testing.assert_array_equal(found.points[stays], given.points[stays])
    for row in range(B):
        middle = given.points[row, given.masks[row, :, 0] > 0].mean(axis=0)
        ratios = ((found.points[row] - middle) / (given.points[row] - middle))[~stays[row]]
        np.testing.assert_allclose(ratios, np.broadcast_to(ratios[0], ratios.shape), rtol=1e-3)
        assert (ratios[0] >= 1 / 1.2 - 1e-3).all()
        assert (ratios[0] <= 1.2 + 1e-3).all()
        assert np.ptp(ratios[0]) > 0.001


def test_points_tremble_are_lost_and_leave_their_masks() -> None:
    given, found, labels, others = vary(arms=1, jitter_m=0.01, drop=0.5, unmask=0.5)
    assert 0.005 < (found.points - given.points).std() < 0.015
    assert (found.valid <= given.valid).all()
    assert 0.5 < found.valid.sum() / given.valid.sum() < 0.95
    assert (found.masks <= given.masks).all()
    assert 0.5 < found.masks.sum() / given.masks.sum() < 0.95
    np.testing.assert_array_equal(others, labels)
    assert {array.dtype for array in found[:3]} == {np.dtype(np.float32)}


def test_points_below_some_height_are_cut_off_but_the_robots() -> None:
    given, found, labels, others = vary(cut=1.0, cut_m=0.5)
    lost, height, robot = given.valid & ~found.valid, given.points[..., 2], given.masks[..., 2] > 0
    assert (found.valid <= given.valid).all()
    assert lost.any()
    assert not (lost & robot).any()
    highest = [height[row, lost[row]].max(initial=-np.inf) for row in range(B)]
    lowest = [height[row, found.valid[row] & ~robot[row]].min() for row in range(B)]
    assert (np.array(highest) < np.array(lowest)).all()
    assert max(highest) < 0.5
    assert len(set(highest)) > 1
    for one, other in zip((*found._replace(valid=given.valid), others), (*given, labels), strict=True):
        np.testing.assert_array_equal(one, other)


def test_about_the_share_asked_for_is_cut() -> None:
    given, found, *_ = vary(cut=0.5, cut_m=0.5)
    assert 0 < (found.valid != given.valid).any(axis=1).sum() < B


def test_nothing_changes_where_nothing_is_asked_for() -> None:
    given, found, labels, others = vary()
    for one, other in zip((*found, others), (*given, labels), strict=True):
        np.testing.assert_array_equal(one, other)
        assert one.dtype == other.dtype


@pytest.mark.parametrize(
    "values",
    [
        {"mirror": 1.5},
        {"stretch": -0.1},
        {"drop": 2},
        {"cut": -1},
        {"cut_m": -0.1},
        {"displace": 2},
        {"displace_rad": 0.5},
    ],
)
def test_values_that_make_no_sense(values: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=next(iter(values))):
        replace(NONE, **values)


def test_a_robot_with_one_arm_has_no_mirror_image() -> None:
    with pytest.raises(ConfigError, match="two arms"):
        Augmentation(replace(NONE, mirror=0.5), space(1), "robot", 3)


def test_where_there_is_no_handle_nothing_is_stretched() -> None:
    with pytest.raises(ConfigError, match="first mask is a handle's"):
        Augmentation(replace(NONE, stretch=0.2), space(2), "robot", 1)

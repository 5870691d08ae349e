"""Hands that come out of where they should not be, and hands that are left alone."""

import dataclasses

import numpy as np
import pytest

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.experts.clearances import Cylinder, base_too_near, clear_of_object, clear_of_robot
from artiskill.experts.move_bucket import MoveBucketExpert, MoveBucketExpertConfig
from artiskill.sim.snapshot import Snapshot

BUCKET = Cylinder(np.array((1.0, 2.0, 0.0)), 0.2, 0.3)
STILL = np.zeros((2, 6))
UP = (0.0, 0.0, 1.0)


@pytest.fixture(scope="module")
def start() -> Snapshot:
    """The start of an episode."""
    env = ManipulationEnv("MoveBucket", objects="bucket-0024")
    env.reset(seed=0)
    return env.snapshot


def with_right_hand(start: Snapshot, ahead_m: float, left_m: float, height_m: float) -> Snapshot:
    """Return the same with the right hand somewhere else, from the base's middle, pointing down."""
    x, y, yaw = start.robot_qpos[0, :3]
    tools, turns = start.tool_position_w.copy(), start.tool_rotation_w.copy()
    tools[0, 0, 0] = x + np.cos(yaw) * ahead_m - np.sin(yaw) * left_m
    tools[0, 0, 1] = y + np.sin(yaw) * ahead_m + np.cos(yaw) * left_m
    tools[0, 0, 2] = height_m
    turns[0, 0] = np.diag((1.0, -1.0, -1.0))
    return dataclasses.replace(start, tool_position_w=tools, tool_rotation_w=turns)


@pytest.mark.parametrize(
    ("point", "way", "distance"),
    [
        ((1.5, 2.0, 0.1), (1.0, 0.0, 0.0), 0.3),  # beside it
        ((1.0, 1.5, 0.1), (0.0, -1.0, 0.0), 0.3),
        ((1.1, 2.0, 0.5), UP, 0.2),  # above
        ((1.0, 2.0, 0.1), UP, 0.0),  # inside: out by its mouth
        ((1.5, 2.0, 0.7), (0.6, 0.0, 0.8), 0.5),  # off its rim
    ],
)
def test_the_way_out_of_a_cylinder(point: tuple[float, ...], way: tuple[float, ...], distance: float) -> None:
    found, far = BUCKET.way_out(np.array(point))
    np.testing.assert_allclose(found, way, atol=1e-9)
    assert far == pytest.approx(distance)


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), (0.5, 0.0, -0.5)])
def test_a_hand_in_the_object_leaves_it_upwards(start: Snapshot, velocity: tuple[float, ...]) -> None:
    """Its palm, which is outside, does not change that."""
    around = Cylinder(start.tool_position_w[0, 0] - (0.0, 0.0, 0.1), 0.2, 0.3)
    velocities = np.array((velocity, (0.0, 0.0, 0.0)))
    found = clear_of_object(start, velocities, around)
    np.testing.assert_allclose(found[0], (0.6 * velocity[0], 0.0, 0.3), atol=1e-12)
    np.testing.assert_array_equal(found[1], velocities[1], "the other hand is not near")


def test_a_hand_that_leaves_fast_enough_is_left_alone(start: Snapshot) -> None:
    around = Cylinder(start.tool_position_w[0, 0] - (0.0, 0.0, 0.1), 0.2, 0.3)
    velocities = np.array(((0.0, 0.0, 0.5), (0.0, 0.0, 0.0)))
    np.testing.assert_allclose(clear_of_object(start, velocities, around), velocities, atol=1e-12)


def test_a_hand_behind_the_column_comes_out_on_its_own_side(start: Snapshot) -> None:
    """While the robot drives and turns: on the robot, it does nothing else."""
    yaw, drive = start.robot_qpos[0, 2], np.array((0.3, -0.2, 0.1, 0.0, 0.0, 0.5))
    wanted = np.arange(12.0).reshape(2, 6)
    found = clear_of_robot(with_right_hand(start, -0.2, 0.05, 0.8), wanted, lambda: np.stack((drive, drive)))
    right = np.array((np.sin(yaw), -np.cos(yaw), 0.0))
    np.testing.assert_allclose(found[0, :3] - drive[:3], 0.6 * right, atol=1e-9)
    np.testing.assert_array_equal(found[0, 3:], wanted[0, 3:])
    np.testing.assert_array_equal(found[1], wanted[1])


def test_a_hand_on_the_base_rises(start: Snapshot) -> None:
    found = clear_of_robot(with_right_hand(start, 0.3, -0.1, 0.15), STILL, lambda: STILL)
    assert found[0, 2] == pytest.approx(0.4)
    assert not found[0, :2].any()


@pytest.mark.parametrize(
    "place",
    [(0.6, -0.2, 0.1), (0.3, -0.1, 0.5), (-0.2, -0.6, 0.8)],
    ids=["ahead", "high above the base", "beside the column"],
)
def test_other_hands_are_left_alone(start: Snapshot, place: tuple[float, float, float]) -> None:
    assert not clear_of_robot(with_right_hand(start, *place), STILL, lambda: STILL).any()


@pytest.mark.parametrize(("distance_m", "share"), [(0.65, 0.0), (0.45, 0.5), (0.3, 1.0)])
def test_a_base_may_be_too_near(start: Snapshot, distance_m: float, share: float) -> None:
    x, y = start.robot_qpos[0, :2]
    middle = np.array((x + distance_m, y, 0.2))
    assert base_too_near(start, middle, 0.65) == pytest.approx(share)
    assert base_too_near(start, middle, 0.5) <= share


def without_clearances(expert: MoveBucketExpert) -> MoveBucketExpertConfig:
    """Return the expert's configuration without what this chapter is about."""
    press = dataclasses.replace(expert.config.press, palm_m=0.0)
    return dataclasses.replace(expert.config, keeps_clear=False, press=press)


@pytest.mark.parametrize(("name", "level"), [("bucket-0024", 0), ("bucket-0031", 3), ("bucket-0007", 1)])
def test_a_robot_in_order_acts_as_without(name: str, level: int) -> None:
    """To the bit, through an episode that nobody disturbs."""
    env = ManipulationEnv("MoveBucket", objects=name)
    env.reset(options={"level": level})
    expert = MoveBucketExpert(env.task.robot)
    without, done = MoveBucketExpert(env.task.robot, without_clearances(expert)), False
    while not done:
        action = expert.act(env.snapshot, env.goal)
        np.testing.assert_array_equal(action, without.act(env.snapshot, env.goal))
        _, _, terminated, truncated, info = env.step(action)
        done = terminated or truncated
    assert info["success"]


@pytest.mark.parametrize("where", ["behind", "in the bucket", "base"])
def test_a_robot_out_of_order_does_not(where: str) -> None:
    """Each of the three reaches what the expert asks of its hands."""
    env = ManipulationEnv("MoveBucket", objects="bucket-0024")
    env.reset(seed=0)
    expert = MoveBucketExpert(env.task.robot)
    without = MoveBucketExpert(env.task.robot, without_clearances(expert))
    snapshot, bucket = env.snapshot, env.snapshot.link_position_w[0, 0]
    if where == "behind":
        snapshot = with_right_hand(snapshot, -0.2, 0.05, 0.8)
    elif where == "in the bucket":
        tools, robot = snapshot.tool_position_w.copy(), snapshot.robot_qpos.copy()
        tools[0, 0] = bucket + np.array((0.0, 0.0, 0.1))
        robot[0, 2] += 1.5  # it faces elsewhere, so arms and base go home
        snapshot = dataclasses.replace(snapshot, robot_qpos=robot, tool_position_w=tools)
    else:
        robot = snapshot.robot_qpos.copy()
        way = robot[0, :2] - bucket[:2]
        robot[0, :2] = bucket[:2] + 0.35 * way / np.hypot(*way)
        tools = snapshot.tool_position_w + np.array((*(robot[0, :2] - snapshot.robot_qpos[0, :2]), 0.0))
        snapshot = dataclasses.replace(snapshot, robot_qpos=robot, tool_position_w=tools)
    commands = [one.command(snapshot, env.goal) for one in (expert, without)]
    assert np.abs(commands[0].twists - commands[1].twists).max() > 0.05

"""Forward kinematics from proprioception, held against the engine."""

from itertools import product

import numpy as np
import pytest

from artiskill.assets.catalog import load_object
from artiskill.experts.whole_body import Command, CommandController, Grip, WholeBodyConfig, WholeBodyController
from artiskill.robots.arm_config import load_arm
from artiskill.robots.config import RobotConfig, load_robot
from artiskill.robots.kinematics import RobotKinematics
from artiskill.scene.scene import build_scene
from artiskill.sim.simulation import Simulation
from artiskill.sim.snapshot import Snapshot
from artiskill.sim.states import InitialState
from artiskill.tasks.registry import make_task
from artiskill.tasks.state_vector import observe_robot

ROBOTS = ("one_arm", "two_arms")
COUNT = 40
FIELDS = ("robot_joint_anchor_w", "robot_joint_axis_w", "tool_position_w", "tool_rotation_w")


def random_states(robot: RobotConfig) -> Snapshot:
    """Snapshots of a robot anywhere, turned anyhow, moving."""
    rng, arm, cabinet = np.random.default_rng(3), load_arm(robot.arm), load_object("cabinet-0001")
    ranges = np.array([joint.range_rad for joint in arm.joints] + [arm.finger.range_m] * 2)
    arms = rng.uniform(ranges[:, 0], ranges[:, 1], (COUNT, len(robot.mounts), len(ranges))).reshape(COUNT, -1)
    trunk = rng.uniform((-4, -4, -3, 0), (4, 4, 3, 1.5), (COUNT, 4))
    zeros = np.zeros(sum(link.joint is not None for link in cabinet.links))
    simulation = Simulation(build_scene(robot, cabinet, make_task("OpenCabinetDrawer").physics), num_envs=COUNT)
    simulation.reset([InitialState(q, zeros, zeros, zeros) for q in np.concatenate((trunk, arms), axis=1)])
    simulation.step(rng.normal(size=(COUNT, trunk.shape[1] + arms.shape[1])))
    return simulation.snapshot()


@pytest.fixture(scope="module", params=ROBOTS)
def seen(request: pytest.FixtureRequest) -> tuple[RobotConfig, Snapshot, np.ndarray]:
    """A robot, its states, and what it knows of itself."""
    robot = load_robot(request.param)
    snapshot = random_states(robot)
    agent = np.concatenate([observe_robot(snapshot, row) for row in range(COUNT)])
    return robot, snapshot, agent.astype(np.float64)


def test_joints_are_those_of_the_snapshot(seen: tuple[RobotConfig, Snapshot, np.ndarray]) -> None:
    robot, snapshot, agent = seen
    qpos, qvel = RobotKinematics(robot).joints(agent)
    np.testing.assert_allclose(qpos, snapshot.robot_qpos, atol=1e-6)
    np.testing.assert_allclose(qvel, snapshot.robot_qvel, atol=1e-5, rtol=1e-6)


def test_joints_at_other_positions_are_read_back(seen: tuple[RobotConfig, Snapshot, np.ndarray]) -> None:
    robot, _, agent = seen
    kinematics = RobotKinematics(robot)
    qpos, qvel = kinematics.joints(agent)
    other = kinematics.with_joints(agent, qpos + 1.0)
    np.testing.assert_array_equal(kinematics.joints(other)[0], qpos + 1.0)
    np.testing.assert_array_equal(kinematics.joints(other)[1], qvel)
    np.testing.assert_array_equal(kinematics.with_joints(other, qpos), agent)


def test_jacobians_of_several_robots_are_those_of_each(seen: tuple[RobotConfig, Snapshot, np.ndarray]) -> None:
    robot, _, agent = seen
    kinematics, body = RobotKinematics(robot), WholeBodyController(robot, WholeBodyConfig(), len(robot.mounts))
    together = body.jacobians(kinematics.pose(agent, 0.05))
    alone = [body.jacobian(kinematics.pose(one[None], 0.05)) for one in agent]
    assert together.shape == (COUNT, 6 * len(robot.mounts), body.num_joints)
    np.testing.assert_array_equal(together, alone)


def test_pose_is_that_of_the_engine(seen: tuple[RobotConfig, Snapshot, np.ndarray]) -> None:
    robot, snapshot, agent = seen
    pose = RobotKinematics(robot).pose(agent, snapshot.step_s)
    for name in FIELDS:
        np.testing.assert_allclose(getattr(pose, name), getattr(snapshot, name), atol=2e-6, err_msg=name)


def test_float64_joints_give_the_engines_pose_exactly(seen: tuple[RobotConfig, Snapshot, np.ndarray]) -> None:
    """What is missing above is the rounding of the observation."""
    robot, snapshot, agent = seen
    exact = agent.copy()
    tips = 12 * len(robot.mounts)
    exact[:, tips : tips + 3] = snapshot.robot_qpos[:, :3]
    exact[:, tips + 6 : tips + 3 + snapshot.robot_qpos.shape[1]] = snapshot.robot_qpos[:, 3:]
    pose = RobotKinematics(robot).pose(exact, snapshot.step_s)
    for name in FIELDS:
        np.testing.assert_allclose(getattr(pose, name), getattr(snapshot, name), atol=1e-12, err_msg=name)


def test_tools_do_not_depend_on_where_the_base_is(seen: tuple[RobotConfig, Snapshot, np.ndarray]) -> None:
    robot, snapshot, _ = seen
    position, rotation = RobotKinematics(robot).tools(snapshot.robot_qpos)
    yaw, place = snapshot.robot_qpos[:, 2], snapshot.robot_qpos[:, :2]
    cos, sin, zero = np.cos(yaw), np.sin(yaw), np.zeros(COUNT)
    turn = np.array(((cos, -sin, zero), (sin, cos, zero), (zero, zero, zero + 1))).transpose(2, 0, 1)
    world = np.einsum("bij,baj->bai", turn, position)
    world[..., :2] += place[:, None]
    np.testing.assert_allclose(world, snapshot.tool_position_w, atol=1e-12)
    np.testing.assert_allclose(turn[:, None] @ rotation, snapshot.tool_rotation_w, atol=1e-12)


def test_a_command_gives_the_snapshots_action(seen: tuple[RobotConfig, Snapshot, np.ndarray]) -> None:
    robot, snapshot, agent = seen
    arms = len(robot.mounts)
    body = WholeBodyController(robot, WholeBodyConfig(), arms)
    controller = CommandController(body, np.tile(robot.initial.arm_qpos_rad, arms), close_speed_m_s=0.1)
    kinematics, rng = RobotKinematics(robot), np.random.default_rng(5)
    for row, grip in product(range(COUNT), Grip):
        command = Command(
            phase=0,
            twists=rng.normal(size=(arms, 6)),
            trunk_qvel=rng.normal(size=4),
            arm_gain_s=2.0,
            grip=np.full(arms, grip),
            width_m=np.full(arms, 0.03),
            press_n=20.0 * (arms == 2),
        )
        wanted = controller.action(snapshot.row(row), command)
        found = controller.action(kinematics.pose(agent[row : row + 1], snapshot.step_s), command)
        np.testing.assert_allclose(found, wanted, atol=5e-6)

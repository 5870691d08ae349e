"""What actions mean, and which are refused.

Operational space: exact away from singular poses, tame at them, and what it says is what the hand does.
"""

import numpy as np
import pytest

from artiskill.assets.catalog import load_object
from artiskill.envs.control import OPERATIONAL, Control, action_scale, check_action, check_actions, jacobians
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ActionError
from artiskill.robots.config import load_robot
from artiskill.robots.operational_space import (
    LEAST_MANIPULABILITY,
    OperationalSpace,
    damp,
    determinant,
    null_motion,
)
from artiskill.scene.scene import build_scene
from artiskill.sim.simulation import Simulation
from artiskill.sim.snapshot import Snapshot
from artiskill.sim.states import InitialState
from artiskill.tasks.registry import make_task

ROBOTS = ("one_arm", "two_arms")
START = np.array((0, 0, 0, -1.5, 0, 3, 0.78))


def posed(robot_name: str, arm_qpos: np.ndarray) -> Snapshot:
    """Snapshots of a robot with its arms in B given poses, (B, A, 7)."""
    robot, cabinet = load_robot(robot_name), load_object("cabinet-0001")
    count = len([link for link in cabinet.links if link.joint is not None])
    physics = make_task("OpenCabinetDrawer").physics
    simulation = Simulation(build_scene(robot, cabinet, physics), num_envs=len(arm_qpos))
    fingers = np.full((*arm_qpos.shape[:2], 2), 0.02)
    arms = np.concatenate((arm_qpos, fingers), axis=-1).reshape(len(arm_qpos), -1)
    trunk = np.tile((-2.0, 0.3, 0.4, 0.5), (len(arm_qpos), 1))
    zeros = np.zeros(count)
    simulation.reset([InitialState(q, zeros, zeros, zeros) for q in np.concatenate((trunk, arms), axis=1)])
    return simulation.snapshot()


def poses(robot_name: str, count: int, spread: float, seed: int = 0) -> np.ndarray:
    arms = len(load_robot(robot_name).mounts)
    return START + np.random.default_rng(seed).uniform(-spread, spread, (count, arms, 7))


def regular(snapshot: Snapshot) -> np.ndarray:
    """Which environments have all arms far from singular poses, (B,) bool."""
    jacobian = jacobians(snapshot)
    return (np.sqrt(np.linalg.det(jacobian @ jacobian.swapaxes(-1, -2))) > LEAST_MANIPULABILITY).all(axis=1)


@pytest.mark.parametrize("robot_name", ROBOTS)
def test_there_and_back_loses_nothing(robot_name: str) -> None:
    snapshot = posed(robot_name, poses(robot_name, 200, 0.4))
    keep = regular(snapshot)
    assert keep.mean() > 0.9
    space, jacobian = OperationalSpace(load_robot(robot_name)), jacobians(snapshot)[keep]
    targets = np.random.default_rng(1).uniform(-3, 3, (len(jacobian), snapshot.robot_qpos.shape[1]))
    values = space.to_operational(targets, jacobian)
    np.testing.assert_allclose(space.to_joint(values, jacobian), targets, atol=1e-6)
    again = space.to_operational(space.to_joint(targets, jacobian), jacobian)
    np.testing.assert_allclose(again, targets, atol=1e-6)
    assert (values[:, :4] == targets[:, :4]).all(), "the trunk means the same in both"
    assert (values[:, 11:13] == targets[:, 11:13]).all(), "and so do fingers"


@pytest.mark.parametrize("robot_name", ROBOTS)
def test_the_jacobian_is_that_of_the_engine(robot_name: str) -> None:
    """Joint velocities move the hand as the Jacobian says, seen over a short time."""
    start, rates = poses(robot_name, 4, 0.3), np.random.default_rng(2).uniform(-1, 1, (4, 7))
    dt = 1e-6
    before, after = posed(robot_name, start), posed(robot_name, start + dt * rates[:, None])
    jacobian = jacobians(before)
    for arm in range(start.shape[1]):
        turn = before.tool_rotation_w[:, arm]
        moved = (after.tool_position_w - before.tool_position_w)[:, arm] / dt
        twist = np.einsum("bij,bj->bi", jacobian[:, arm], rates)
        np.testing.assert_allclose(twist[:, :3], np.einsum("bji,bj->bi", turn, moved), atol=1e-4)
        spin = turn.swapaxes(-1, -2) @ (after.tool_rotation_w[:, arm] - turn) / dt  # skew matrix, hand's frame
        np.testing.assert_allclose(twist[:, 3:], spin[:, (2, 0, 1), (1, 2, 0)], atol=1e-4)


def test_the_null_motion_leaves_the_hand_in_place_and_never_flips() -> None:
    path = START + np.linspace(0, 1, 200)[:, None, None] * np.array((0.5, 0.6, -0.4, 0.5, 0.7, -0.5, 0.3))
    jacobian = jacobians(posed("one_arm", path))[:, 0]
    found = np.zeros((len(path), 7))
    for matrix, null in zip(jacobian, found, strict=True):
        null_motion(np.ascontiguousarray(matrix), null)
    np.testing.assert_allclose(np.einsum("bij,bj->bi", jacobian, found), 0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1)
    assert np.abs(np.diff(found, axis=0)).max() < 0.05


def test_singular_poses_ask_for_no_wild_velocities() -> None:
    """The elbow stretched: the hand cannot go further out; plain inversion would ask for thousands of rad/s."""
    stretched = np.array((0.0, 0.0, 0.0, -0.07, 0.0, 0.07, 0.0))
    snapshot = posed("one_arm", np.stack([stretched, stretched + 0.01])[:, None])
    space, jacobian = OperationalSpace(load_robot("one_arm")), jacobians(snapshot)
    for axis in range(6):
        values = np.zeros((2, 13))
        values[:, 4 + axis] = 1.0
        found = space.to_joint(values, jacobian)
        assert np.isfinite(found).all()
        assert np.abs(found).max() < 10.0


def test_linear_algebra_of_the_kernels() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        matrix = rng.normal(size=(6, 6))
        assert determinant(matrix.copy()) == pytest.approx(np.linalg.det(matrix))
        gram = matrix @ matrix.T + np.eye(6)
        damped = gram.copy()
        damp(damped)
        np.testing.assert_array_equal(damped, gram)  # far from singular: untouched
    assert determinant(np.zeros((6, 6))) == 0


def test_the_hand_does_what_an_action_says() -> None:
    """Along the hand's own z at 0.2 m/s, the rest of the robot at rest."""
    env = ManipulationEnv(objects="cabinet-0001", control_mode=OPERATIONAL)
    env.reset(seed=0)
    action = np.zeros(13)
    action[6] = 0.2
    for _ in range(4):  # the drives need some 60 ms to get there
        env.step(action)
    start = env.snapshot
    forward = start.tool_rotation_w[0, 0, :, 2]
    for _ in range(4):
        env.step(action)
    moved = env.snapshot.tool_position_w[0, 0] - start.tool_position_w[0, 0]
    assert moved @ forward == pytest.approx(0.2 * 0.2, rel=0.1)
    assert np.linalg.norm(moved - (moved @ forward) * forward) < 0.004
    assert np.abs(env.snapshot.tool_rotation_w - start.tool_rotation_w).max() < 0.02


def test_joint_actions_can_be_given_in_operational_space() -> None:
    """An episode of slow joint actions, converted step by step, ends in the same place."""
    actions = np.random.default_rng(4).uniform(-0.1, 0.1, (20, 13))
    actions[:, 9] -= 0.05  # away from the limit of joint 6
    joint = ManipulationEnv(objects="cabinet-0001")
    other = ManipulationEnv(objects="cabinet-0001", control_mode=OPERATIONAL)
    joint.reset(seed=3)
    other.reset(seed=3)
    for action in actions:
        assert regular(joint.snapshot).all()
        targets = joint.control.to_targets(action[None], joint.snapshot)
        converted = other.control.to_actions(targets, other.snapshot)[0]
        assert np.abs(converted).max() < 1
        joint.step(action)
        other.step(converted)
    np.testing.assert_allclose(other.snapshot.robot_qpos, joint.snapshot.robot_qpos, atol=1e-6)


def test_full_joint_actions_survive_where_the_hand_has_room() -> None:
    """An action of the hand ends at 1 m/s, which random joints exceed; with room enough nothing is lost."""
    snapshot = posed("one_arm", poses("one_arm", 200, 0.4))
    keep = regular(snapshot)
    wide = {"hand_velocity_m_s": 20, "hand_rate_rad_s": 40, "null_rate_rad_s": 40}
    plain, roomy = load_robot("one_arm"), load_robot({"like": "one_arm", "actions": wide})
    targets = Control(plain, "joint").to_targets(np.random.default_rng(6).uniform(-1, 1, (200, 13)), snapshot)
    errors = {}
    for name, robot in (("plain", plain), ("roomy", roomy)):
        control = Control(robot, OPERATIONAL)
        actions = control.to_actions(targets, snapshot)
        errors[name] = np.abs(control.to_targets(actions, snapshot) - targets)[keep].max(axis=1)
        whole = (np.abs(actions) < 1)[keep][:, 4:11].all(axis=1)
        assert errors[name][whole].max(initial=0) < 1e-6, "what is not clipped is exact"
    assert np.median(errors["plain"]) > 0.1
    assert errors["roomy"].max() < 1e-6


@pytest.mark.parametrize("mode", ["joint", OPERATIONAL])
@pytest.mark.parametrize("robot_name", ROBOTS)
def test_actions_and_targets_turn_into_one_another(robot_name: str, mode: str) -> None:
    snapshot = posed(robot_name, poses(robot_name, 5, 0.3))
    control = Control(load_robot(robot_name), mode)
    actions = np.random.default_rng(5).uniform(-0.1, 0.1, (5, control.size))
    again = control.to_actions(control.to_targets(actions, snapshot), snapshot)
    np.testing.assert_allclose(again[regular(snapshot)], actions[regular(snapshot)], atol=1e-6)
    assert control.space.shape == (control.size,)


@pytest.fixture(scope="module")
def scale():
    return action_scale(load_robot("one_arm"))


def test_full_actions_mean_what_the_specification_says(scale):
    full = [0.5, 0.5, 3.14, 0.5, *[3.14] * 7, 0.04, 0.04]
    assert scale.to_targets(np.ones(13)) == pytest.approx(full)
    assert scale.to_targets(-np.ones(13)) == pytest.approx([*(-x for x in full[:11]), 0, 0])
    assert scale.to_targets(np.zeros(13)) == pytest.approx([*[0] * 11, 0.02, 0.02])


def test_actions_beyond_one_are_clipped(scale):
    assert np.array_equal(scale.to_targets(np.full(13, 7.0)), scale.to_targets(np.ones(13)))
    assert np.array_equal(scale.to_targets(np.full(13, -7.0)), scale.to_targets(-np.ones(13)))


def test_targets_and_actions_are_each_others_inverse(scale, rng):
    actions = rng.uniform(-1, 1, (4, 5, 13))
    assert scale.to_actions(scale.to_targets(actions)) == pytest.approx(actions, abs=1e-12)


def test_targets_out_of_reach_become_the_nearest_action(scale):
    targets = scale.to_targets(np.zeros(13))
    targets[0], targets[11] = 9.0, -0.5
    actions = scale.to_actions(targets)
    assert actions[0] == 1.0
    assert actions[11] == -1.0
    assert np.all(actions[[*range(1, 11), 12]] == 0)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (np.zeros(3) + 1j, r"an action is 3 real numbers, not complex ones"),
        ([0, 1j, 0], "not complex ones"),
        (np.array([0, 1j, 0], dtype=object), "an action is 3 real numbers, not"),
        ([[0, 0], 0, 0], "an action is 3 real numbers, not"),
        ("abc", "an action is 3 real numbers, not 'abc'"),
    ],
)
def test_what_is_no_real_numbers_is_refused(given, says):
    with pytest.raises(ActionError, match=says):
        check_action(given, 3)
    with pytest.raises(ActionError, match="real numbers of shape"):
        check_actions(given, 1, 3)

"""The expert and its inverse kinematics: it follows twists, keeps limits, holds what it grips, opens doors."""

import dataclasses
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from artiskill.assets.catalog import list_objects
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.experts import door_opening
from artiskill.experts.door_opening import door_of
from artiskill.experts.frames import rotation_error, yaw_rotation
from artiskill.experts.handle_grasp import CabinetPhase, rest_posture
from artiskill.experts.open_cabinet import OpenCabinetExpert
from artiskill.experts.whole_body import Grip, WholeBodyConfig, WholeBodyController, bounded_least_squares
from artiskill.robots.arm_config import load_arm
from artiskill.sim.snapshot import Snapshot


@pytest.fixture
def env() -> ManipulationEnv:
    env = ManipulationEnv(objects="cabinet-0010")
    env.reset(seed=0)
    return env


def test_the_hand_follows_a_twist(env: ManipulationEnv) -> None:
    controller = WholeBodyController(env.task.robot, WholeBodyConfig())
    before = env.snapshot.tool_position_w[0, 0]
    twist = np.array((0.1, -0.05, 0.08, 0, 0, 0))
    for _ in range(20):
        qvel = controller.joint_velocities(env.snapshot, twist[None], np.zeros(controller.num_joints))
        env.step(controller.to_action(env.snapshot, qvel, np.full((1, 2), 0.02)))
    moved = env.snapshot.tool_position_w[0, 0] - before
    np.testing.assert_allclose(moved, twist[:3] * 1.0, atol=0.02)


def test_jacobian_is_the_derivative(env: ManipulationEnv) -> None:
    """Against finite differences of the engine's own kinematics."""
    controller = WholeBodyController(env.task.robot, WholeBodyConfig())
    simulation = env.simulation
    assert simulation is not None
    jacobian, h = controller.jacobian(env.snapshot), 1e-6
    saved = simulation.save()
    for joint in range(controller.num_joints):
        ends = []
        for sign in (1, -1):
            rows = saved.rows.copy()
            simulation.restore(dataclasses.replace(saved, rows=rows))
            simulation._qpos[0, joint] += sign * h
            simulation._batch.forward()
            ends.append(simulation.snapshot().tool_position_w[0, 0])
        np.testing.assert_allclose(jacobian[:3, joint], (ends[0] - ends[1]) / (2 * h), atol=1e-6)


def test_least_squares_stays_in_its_box() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        matrix, target = rng.normal(size=(17, 11)), rng.normal(size=17) * 3
        lower, upper = -rng.uniform(0, 0.5, 11), rng.uniform(0, 0.5, 11)
        x = bounded_least_squares(matrix, target, lower, upper)
        assert (x >= lower - 1e-12).all()
        assert (x <= upper + 1e-12).all()
        slope = matrix.T @ (matrix @ x - target)  # nothing is gained by going on, or back from a bound
        assert (slope[x > lower + 1e-9] < 1e-6).all()
        assert (slope[x < upper - 1e-9] > -1e-6).all()
        unbounded = np.linalg.lstsq(matrix, target, rcond=None)[0]
        wide = bounded_least_squares(matrix, target, np.full(11, -1e3), np.full(11, 1e3))
        np.testing.assert_allclose(wide, unbounded, atol=1e-9)


def test_least_squares_of_what_is_not_finite_is_seen() -> None:
    target = np.ones(17)
    target[3] = np.nan
    x = bounded_least_squares(np.random.default_rng(0).normal(size=(17, 11)), target, -np.ones(11), np.ones(11))
    assert np.isnan(x).all()


Episode = list[tuple[Snapshot, Any, CabinetPhase]]  # snapshot, goal, phase of every step


def play(
    env: ManipulationEnv,
    level: int,
    disturb: Callable[[CabinetPhase, np.ndarray], None] = lambda phase, action: None,
) -> tuple[Episode, bool]:
    """Play an episode, and say whether it ended well."""
    env.reset(seed=level)
    expert, episode, done = OpenCabinetExpert(env.task.robot), [], False
    while not done:
        snapshot = env.snapshot
        command = expert.command(snapshot, env.goal)
        action = expert.controller.action(snapshot, command)
        assert np.abs(action).max() <= 1
        episode.append((snapshot, env.goal, CabinetPhase(command.phase)))
        disturb(CabinetPhase(command.phase), action)
        _, _, terminated, truncated, info = env.step(action)
        done = terminated or truncated
    return episode, info["success"]


def in_order(episode: Episode) -> list[CabinetPhase]:
    """Return the phases without repetitions."""
    phases = [phase for _, _, phase in episode]
    return [phases[0], *(after for before, after in pairwise(phases) if after is not before)]


TO_PULL = [CabinetPhase.APPROACH, CabinetPhase.GRIP, CabinetPhase.PULL]


def test_it_grips_and_pulls_without_slipping(env: ManipulationEnv) -> None:
    expert = OpenCabinetExpert(env.task.robot)
    episode, success = play(env, 0)
    assert success
    assert in_order(episode) == [*TO_PULL, CabinetPhase.HOLD]
    pulling = [(snapshot, goal) for snapshot, goal, phase in episode if phase is CabinetPhase.PULL]
    errors = np.array([expert._look(snapshot, goal).hand.error_m for snapshot, goal in pulling])
    assert np.abs(errors - errors[0]).max() < 0.005, "the handle stays between the fingers"


def test_it_takes_a_lost_grip_again(env: ManipulationEnv) -> None:
    """Pushed off the handle in mid-pull, it approaches anew and still opens the drawer."""
    disturbed = []

    def push_off(phase: CabinetPhase, action: np.ndarray) -> None:
        if len(disturbed) < 8 and (disturbed or phase is CabinetPhase.PULL):
            action[11:], action[0] = 1.0, -1.0  # open the hand and back away
            disturbed.append(phase)

    episode, success = play(env, 0, push_off)
    assert success
    assert in_order(episode).count(CabinetPhase.PULL) >= 2


@pytest.mark.parametrize("task", ["OpenCabinetDrawer", "OpenCabinetDoor"])
def test_it_remembers_nothing(task: str, rng: np.random.Generator) -> None:
    """Asked about the states of an episode in any order, any expert answers the same bits."""
    env = ManipulationEnv(task, objects="train")
    episode, success = play(env, 5)
    assert success
    expert = OpenCabinetExpert(env.task.robot)
    expected = [expert.act(snapshot, goal) for snapshot, goal, _ in episode]
    other = OpenCabinetExpert(env.task.robot)
    for number in rng.permutation(len(episode)):
        snapshot, goal, _ = episode[number]
        np.testing.assert_array_equal(other.act(snapshot, goal), expected[number])


@pytest.mark.parametrize("task", ["OpenCabinetDrawer", "OpenCabinetDoor"])
def test_it_asks_for_nearly_the_same_in_nearly_the_same_states(task: str, rng: np.random.Generator) -> None:
    """Students learn an average over states that they cannot tell apart."""
    env = ManipulationEnv(task, objects="train")
    expert = OpenCabinetExpert(env.task.robot)
    episode, _ = play(env, 7)
    changes = []
    for snapshot, goal, _ in episode:
        here = expert.command(snapshot, goal)
        shaken = dataclasses.replace(
            snapshot, tool_position_w=snapshot.tool_position_w + rng.uniform(-0.001, 0.001, size=3)
        )
        there = expert.command(shaken, goal)
        if there.phase == here.phase:
            changes.append(np.abs(there.twists - here.twists)[0, :3].max())
    assert len(changes) > 0.95 * len(episode), "phases do not hang by a hair"
    assert max(changes) < 0.2, "m/s"


LET_GO = [CabinetPhase.RELEASE, CabinetPhase.AROUND, CabinetPhase.PUSH, CabinetPhase.HOLD]


@pytest.mark.parametrize("object_id", ["cabinet-0006", "cabinet-0009"])  # 153 and 141 degrees
@pytest.mark.parametrize("target", ["link_0", "link_1"])  # hinges on the left and on the right
def test_it_pulls_a_door_ajar_and_pushes_it_on_from_inside(object_id: str, target: str) -> None:
    env = ManipulationEnv("OpenCabinetDoor", objects=object_id, target=target)
    episode, success = play(env, level=1)
    assert success
    assert in_order(episode) == [*TO_PULL, *LET_GO]


def test_it_holds_a_flap_that_would_fall_shut() -> None:
    env = ManipulationEnv("OpenCabinetDoor", objects=hanging_flap())
    episode, success = play(env, level=0)
    assert success
    assert not set(in_order(episode)) & {CabinetPhase.RELEASE, CabinetPhase.AROUND, CabinetPhase.PUSH}


def hanging_flap() -> str:
    """A held-out object whose flap hangs from a level hinge."""
    for object_id in list_objects(split="ood", task="OpenCabinetDoor"):
        env = ManipulationEnv("OpenCabinetDoor", objects=object_id)
        env.reset(seed=0)
        if door_of(env.snapshot, env.goal).hangs:
            return object_id
    pytest.skip("the catalogue has no hanging flap")


def test_it_takes_a_door_again_that_falls_shut() -> None:
    """The door is closed while the hand is on its way around: it begins anew."""
    env = ManipulationEnv("OpenCabinetDoor", objects="cabinet-0005", target="link_2")
    shut = []

    def shut_it(phase: CabinetPhase, action: np.ndarray) -> None:
        if phase is CabinetPhase.AROUND and not shut:
            shut.append(True)
            env.simulation._qpos[0, env.simulation.scene.index.object_qpos] = 0.0

    episode, success = play(env, 0, shut_it)
    assert shut
    phases = in_order(episode)
    assert phases.count(CabinetPhase.GRIP) >= 2
    assert success or phases[-1] is CabinetPhase.PUSH, "there may not be time enough left"


def test_the_rest_posture_is_where_episodes_begin(env: ManipulationEnv) -> None:
    """Against the engine's own kinematics."""
    qpos, tool = env.snapshot.robot_qpos[0], env.snapshot.tool_position_w[0, 0]
    posture = rest_posture(env.task.robot)
    np.testing.assert_allclose(yaw_rotation(qpos[2]) @ posture.tool_offset + (*qpos[:2], qpos[3]), tool, atol=1e-6)
    np.testing.assert_array_equal(posture.arm, qpos[4:11])


def test_narrow_fingers_back_off_until_they_are_wide(env: ManipulationEnv) -> None:
    """Shut just before the handle, they would only press on it."""
    expert = OpenCabinetExpert(env.task.robot)
    episode, _ = play(env, 0)
    first = next(number for number, (_, _, phase) in enumerate(episode) if phase is CabinetPhase.GRIP)
    snapshot, goal, _ = episode[first - 4]  # on its way in, aligned
    assert expert.command(snapshot, goal).twists[0, 2] > 0.05
    qpos = snapshot.robot_qpos.copy()
    qpos[0, 11:] = 0.0
    shut = dataclasses.replace(snapshot, robot_qpos=qpos)
    command = expert.command(shut, goal)
    assert command.twists[0, 2] < -0.05
    assert command.grip[0] == Grip.OPEN


def test_a_folded_arm_unfolds_before_it_reaches(env: ManipulationEnv) -> None:
    """Its hand would only get to where a joint is at its limit."""
    simulation = env.simulation
    simulation._qpos[0, 4:11] = (1.9, 1.2, 0.3, -2.9, -1.2, 1.7, 1.7)
    simulation._batch.forward()
    snapshot, before = simulation.snapshot(), env.snapshot
    expert = OpenCabinetExpert(env.task.robot)
    rest = np.array(env.task.robot.initial.arm_qpos_rad)
    body = expert.controller.whole_body
    qvel = body.scale.to_targets(expert.act(snapshot, env.goal))[body.columns]
    off = rest[:-1] - snapshot.robot_qpos[0, 4:10]
    far = np.abs(off) > 0.5
    assert (qvel[4:10][far] * off[far] > 0).all()
    assert far.sum() >= 4
    command = expert.command(before, env.goal)  # at rest it heads for the handle
    assert command.twists[0, 2] > 0.3


def test_a_hand_that_goes_around_is_turned_about_where_that_spares_its_last_joint() -> None:
    env = ManipulationEnv("OpenCabinetDoor", objects="cabinet-0006")
    env.reset(seed=0)
    simulation, last = env.simulation, 10
    expert, flipped = OpenCabinetExpert(env.task.robot), set()
    for angle in (-2.4, -1.6, -0.8, 0.0, 0.8, 1.6, 2.4):
        simulation._qpos[0, last] = angle
        simulation._batch.forward()
        now = expert._look(simulation.snapshot(), env.goal)
        hand = expert._pushing_hand(now, now.door)
        relative = now.tool.rotation.T @ hand
        roll = np.arctan2(relative[1, 0] - relative[0, 1], relative[0, 0] + relative[1, 1])
        assert abs(angle + roll) < 2.6, "far from its limits"
        flipped.add(bool(hand[:, 1] @ door_opening.pushing_hand(now.door, expert.config.door)[:, 1] < 0))
    assert flipped == {False, True}


def opened(env: ManipulationEnv, value: float) -> Snapshot:
    """As it is when the target's joint is there."""
    simulation = env.simulation
    simulation._qpos[0, simulation.scene.index.object_qpos][int(env.goal.joint[0])] = value
    simulation._batch.forward()
    return simulation.snapshot()


def test_a_grip_turns_against_the_door_only_for_what_it_turned_since() -> None:
    """A door that was gripped half open: at first the hand is not turned in its grip at all."""
    env = ManipulationEnv("OpenCabinetDoor", objects="cabinet-0006")
    env.reset(seed=0)
    expert = OpenCabinetExpert(env.task.robot)
    look = expert._look(opened(env, 0.3), env.goal)
    now = dataclasses.replace(look, tool=look.grasp)
    wanted = expert._motion(CabinetPhase.PULL, now).wanted
    assert np.linalg.norm(rotation_error(now.grasp.rotation, wanted.rotation)) == pytest.approx(0.0, abs=1e-6)


def test_what_is_open_is_held_by_a_robot_that_stands_still(env: ManipulationEnv) -> None:
    expert = OpenCabinetExpert(env.task.robot)
    snapshot = opened(env, float(env.goal.upper[0]))
    assert expert.command(snapshot, env.goal).phase == CabinetPhase.HOLD
    np.testing.assert_allclose(expert.act(snapshot, env.goal)[:11], 0.0, atol=1e-9)


def test_commands_name_their_phase(env: ManipulationEnv) -> None:
    assert OpenCabinetExpert.phases[CabinetPhase.PULL] == "pull"
    assert len(OpenCabinetExpert.phases) == len(CabinetPhase)


@pytest.mark.parametrize(("task", "arms"), [("OpenCabinetDrawer", 1), ("PushChair", 2)])
@pytest.mark.parametrize("side", [0, 1])
def test_joints_stop_at_their_limits(task: str, arms: int, side: int) -> None:
    env = ManipulationEnv(task)
    env.reset(seed=0)
    controller = WholeBodyController(env.task.robot, WholeBodyConfig(), arms)
    limits = np.array([joint.range_rad for joint in load_arm(env.task.robot.arm).joints] * arms)
    qpos = env.snapshot.robot_qpos.copy()
    qpos[0, controller.columns[4:]] = limits[:, side] + (0.05, -0.05)[side]
    snapshot, rng = dataclasses.replace(env.snapshot, robot_qpos=qpos), np.random.default_rng(0)
    moved = np.zeros(len(limits), dtype=bool)
    for _ in range(20):
        qvel = controller.joint_velocities(
            snapshot, rng.normal(size=(arms, 6)) * 3, np.zeros(controller.num_joints)
        )
        after = controller.qpos(snapshot)[4:] + qvel[4:] * snapshot.step_s
        assert (after >= limits[:, 0]).all()
        assert (after <= limits[:, 1]).all()
        moved |= np.abs(qvel[4:]) > 0.1
    assert moved.all()


def test_what_is_free_makes_up_for_what_is_at_its_bound() -> None:
    matrix, target = np.array(((1.0, 1.0), (0.1, 0.0), (0.0, 0.1))), np.array((2.0, 0.0, 0.0))
    x = bounded_least_squares(matrix, target, np.array((-1.0, -5.0)), np.array((0.2, 5.0)))
    np.testing.assert_allclose(x, (0.2, 1.8 / 1.01), atol=1e-9)

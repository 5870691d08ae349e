"""The expert and its inverse kinematics: it follows twists, keeps limits, holds what it grips, opens doors."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from artiskill.assets.catalog import list_objects
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.experts.door_opening import door_of
from artiskill.experts.frames import Frame, rotation_error
from artiskill.experts.handle_grasp import CabinetPhase, default_grasp
from artiskill.experts.open_cabinet import OpenCabinetExpert
from artiskill.experts.whole_body import WholeBodyConfig, WholeBodyController, bounded_least_squares
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
        unbounded = np.linalg.lstsq(matrix, target, rcond=None)[0]
        wide = bounded_least_squares(matrix, target, np.full(11, -1e3), np.full(11, 1e3))
        np.testing.assert_allclose(wide, unbounded, atol=1e-9)


def test_it_grips_and_pulls_without_slipping(env: ManipulationEnv) -> None:
    expert = OpenCabinetExpert(env.task.robot)
    expert.reset(env.snapshot, env.goal)
    gripped, phases, done = [], [], False
    while not done:
        action = expert.act(env.snapshot, env.goal)
        assert np.abs(action).max() <= 1
        phases.append(expert.phase)
        if expert.phase is CabinetPhase.PULL:
            grasp = default_grasp().frame(env.snapshot, env.goal, 10)
            gripped.append(grasp.position - env.snapshot.tool_position_w[0, 0])
        _, _, terminated, truncated, info = env.step(action)
        done = terminated or truncated
    assert info["success"]
    order = [p for i, p in enumerate(phases) if i == 0 or p is not phases[i - 1]]
    assert order == [
        CabinetPhase.APPROACH,
        CabinetPhase.REACH,
        CabinetPhase.GRIP,
        CabinetPhase.PULL,
        CabinetPhase.HOLD,
    ]
    assert np.abs(np.array(gripped) - gripped[0]).max() < 0.005, "the handle stays between the fingers"


def test_it_takes_a_lost_grip_again(env: ManipulationEnv) -> None:
    """Pushed off the handle in mid-pull, it approaches anew and still opens the drawer."""
    expert = OpenCabinetExpert(env.task.robot)
    expert.reset(env.snapshot, env.goal)
    disturbed = 0
    for _ in range(200):
        action = expert.act(env.snapshot, env.goal)
        if expert.phase is CabinetPhase.PULL and disturbed < 8:
            action[11:], action[0] = 1.0, -1.0  # open the hand and back away
            disturbed += 1
        _, _, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            break
    assert disturbed == 8
    assert info["success"]


def test_the_same_episode_gives_the_same_actions(env: ManipulationEnv) -> None:
    def actions() -> np.ndarray:
        env.reset(seed=3)
        expert = OpenCabinetExpert(env.task.robot)
        expert.reset(env.snapshot, env.goal)
        taken = []
        for _ in range(30):
            taken.append(expert.act(env.snapshot, env.goal))
            env.step(taken[-1])
        return np.array(taken)

    np.testing.assert_array_equal(actions(), actions())


def in_order(phases: list[CabinetPhase]) -> list[CabinetPhase]:
    """Without repetitions."""
    return [p for i, p in enumerate(phases) if i == 0 or p is not phases[i - 1]]


def play(env: ManipulationEnv, level: int, disturb: Callable[[OpenCabinetExpert], None] | None = None) -> tuple:
    """Phases of an episode, and whether it ended well."""
    env.reset(seed=level)
    expert = OpenCabinetExpert(env.task.robot)
    expert.reset(env.snapshot, env.goal)
    phases, done = [], False
    while not done:
        action = expert.act(env.snapshot, env.goal)
        phases.append(expert.phase)
        if disturb is not None:
            disturb(expert)
        _, _, terminated, truncated, info = env.step(action)
        done = terminated or truncated
    return phases, info["success"]


LET_GO = [CabinetPhase.RELEASE, CabinetPhase.AROUND, CabinetPhase.PUSH, CabinetPhase.HOLD]


@pytest.mark.parametrize("object_id", ["cabinet-0006", "cabinet-0009"])  # 153 and 141 degrees
@pytest.mark.parametrize("target", ["link_0", "link_1"])  # hinges on the left and on the right
def test_it_pulls_a_door_ajar_and_pushes_it_on_from_inside(object_id: str, target: str) -> None:
    env = ManipulationEnv("OpenCabinetDoor", objects=object_id, target=target)
    phases, success = play(env, level=1)
    assert success
    assert in_order(phases) == [
        CabinetPhase.APPROACH,
        CabinetPhase.REACH,
        CabinetPhase.GRIP,
        CabinetPhase.PULL,
        *LET_GO,
    ]


def test_it_holds_a_flap_that_would_fall_shut() -> None:
    env = ManipulationEnv("OpenCabinetDoor", objects=hanging_flap())
    phases, success = play(env, level=0)
    assert success
    assert not set(phases) & {CabinetPhase.RELEASE, CabinetPhase.AROUND, CabinetPhase.PUSH}


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

    def shut_it(expert: OpenCabinetExpert) -> None:
        if expert.phase is CabinetPhase.AROUND and not shut:
            shut.append(True)
            env.simulation._qpos[0, env.simulation.scene.index.object_qpos] = 0.0

    phases, success = play(env, 0, shut_it)
    assert shut
    assert phases.count(CabinetPhase.GRIP) > 8, "it gripped twice"
    assert success or phases[-1] is CabinetPhase.PUSH, "there may not be time enough left"


def test_a_hand_that_cannot_reach_in_tries_again_nearer_to_level(env: ManipulationEnv) -> None:
    expert = OpenCabinetExpert(env.task.robot)
    expert.reset(env.snapshot, env.goal)
    low = Frame(np.array((0.0, 0.0, 0.1)), np.array(((0.0, 0, 1), (-1, 0, 0), (0, -1, 0))))
    steep = expert._tilted(low).forward[2]
    assert steep < -0.3, "the hand comes down on what is low"
    expert.phase, expert._steps_in_phase = CabinetPhase.REACH, expert.config.grip.patience_steps
    expert.act(env.snapshot, env.goal)
    assert expert.phase is CabinetPhase.APPROACH
    assert expert._tilted(low).forward[2] == pytest.approx(steep / 2)
    expert.reset(env.snapshot, env.goal)
    assert expert._tilted(low).forward[2] == steep


def test_another_try_is_the_usual_one(env: ManipulationEnv) -> None:
    """What failed in a manner of its own is done again in the usual one, before the hand comes nearer to level."""
    usual = OpenCabinetExpert(env.task.robot).config
    manner = dataclasses.replace(usual.grasp, lean_along_rad=0.1, roll_rad=1.0)
    stance = dataclasses.replace(usual.stance, bearing_rad=0.3)
    expert = OpenCabinetExpert(env.task.robot, dataclasses.replace(usual, grasp=manner, stance=stance))
    expert.reset(env.snapshot, env.goal)
    before = expert._look(env.snapshot, env.goal).grasp
    tilts = []
    for _ in range(2):
        expert.phase, expert._steps_in_phase = CabinetPhase.REACH, expert.config.grip.patience_steps
        expert.act(env.snapshot, env.goal)
        tilts.append(expert._tilt)
    assert tilts == [1.0, 0.5]
    assert expert._stance.bearing_rad == 0
    plain = OpenCabinetExpert(env.task.robot)
    plain.reset(env.snapshot, env.goal)
    plain._tilt = 0.5
    after, wanted = expert._look(env.snapshot, env.goal).grasp, plain._look(env.snapshot, env.goal).grasp
    np.testing.assert_array_equal(after.position, wanted.position)
    np.testing.assert_array_equal(after.rotation, wanted.rotation)
    assert np.abs(before.rotation - after.rotation).max() > 0.1
    expert.reset(env.snapshot, env.goal)
    np.testing.assert_array_equal(expert._look(env.snapshot, env.goal).grasp.rotation, before.rotation)


def test_a_hand_that_goes_around_is_turned_about_where_that_spares_its_last_joint() -> None:
    env = ManipulationEnv("OpenCabinetDoor", objects="cabinet-0006")
    env.reset(seed=0)
    simulation, last = env.simulation, 10
    flipped = set()
    for angle in (-2.4, -1.6, -0.8, 0.0, 0.8, 1.6, 2.4):
        simulation._qpos[0, last] = angle
        simulation._batch.forward()
        snapshot = simulation.snapshot()
        expert = OpenCabinetExpert(env.task.robot)
        expert.reset(snapshot, env.goal)
        now = expert._look(snapshot, env.goal)
        expert._enter(CabinetPhase.AROUND, now)
        relative = now.tool.rotation.T @ expert._pushing_hand(now.door)
        roll = np.arctan2(relative[1, 0], relative[0, 0])
        assert abs(angle + roll) <= abs(angle + roll - np.copysign(np.pi, roll)) + 1e-9
        assert abs(angle + roll) < 2.6, "far from its limits"
        flipped.add(expert._flipped)
    assert flipped == {False, True}


def opened(env: ManipulationEnv, value: float) -> Snapshot:
    """As it is when the target's joint is there."""
    simulation = env.simulation
    simulation._qpos[0, simulation.scene.index.object_qpos][int(env.goal.joint[0])] = value
    simulation._batch.forward()
    return simulation.snapshot()


def test_a_grip_turns_against_the_door_only_for_what_it_turned_since() -> None:
    """A door that was gripped half open: at first the hand does not turn in its grip at all."""
    env = ManipulationEnv("OpenCabinetDoor", objects="cabinet-0006")
    env.reset(seed=0)
    expert = OpenCabinetExpert(env.task.robot)
    expert.reset(env.snapshot, env.goal)

    def turned_rad(angle: float) -> float:
        look = expert._look(opened(env, angle), env.goal)
        now = dataclasses.replace(look, tool=look.grasp)
        if expert.phase is not CabinetPhase.PULL:
            expert._enter(CabinetPhase.GRIP, now)
            expert.phase = CabinetPhase.PULL
        return float(np.linalg.norm(rotation_error(now.grasp.rotation, expert._motion(now).wanted.rotation)))

    assert turned_rad(0.3) == pytest.approx(0.0, abs=1e-6)
    assert turned_rad(0.35) == pytest.approx(0.05 * (1 - expert.config.door.follow), abs=1e-3)


def test_what_is_open_is_held_by_a_robot_that_stands_still(env: ManipulationEnv) -> None:
    expert = OpenCabinetExpert(env.task.robot)
    expert.reset(env.snapshot, env.goal)
    snapshot = opened(env, float(env.goal.upper[0]))
    expert._enter(CabinetPhase.HOLD, expert._look(snapshot, env.goal))
    action = expert.act(snapshot, env.goal)
    assert expert.phase is CabinetPhase.HOLD
    np.testing.assert_allclose(action[:11], 0.0, atol=1e-9)


def test_a_quick_hand_still_waits_until_it_may_close_where_it_is(env: ManipulationEnv) -> None:
    usual = OpenCabinetExpert(env.task.robot).config
    manner = dataclasses.replace(usual.grasp, lean_along_rad=0.1)
    expert = OpenCabinetExpert(env.task.robot, dataclasses.replace(usual, grasp=manner, reach_speed_m_s=2.0))
    expert.reset(env.snapshot, env.goal)
    assert expert._patience(expert._look(env.snapshot, env.goal)) > usual.grip.blocked_steps


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

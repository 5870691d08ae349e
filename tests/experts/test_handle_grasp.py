"""How handles are taken hold of: grasp, stance, and when the fingers close."""

import numpy as np
import pytest

from artiskill.assets.catalog import list_objects
from artiskill.config import CONFIG_DIR, load_config
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError
from artiskill.experts.frames import Frame, axis_rotation, rotation_error, tool_frame, yaw_rotation
from artiskill.experts.handle_grasp import (
    CabinetPhase,
    GraspConfig,
    Posture,
    StanceConfig,
    after_reach,
    approach_point,
    choose_grasp,
    default_grasp,
)
from artiskill.experts.open_cabinet import OpenCabinetExpertConfig

LAST = 10
DEFAULT = GraspConfig(0.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def env() -> ManipulationEnv:
    env = ManipulationEnv(objects="cabinet-0026")
    env.reset(seed=0)
    return env


def along_of(env: ManipulationEnv, share: float) -> float:
    """How far from the middle, along the handle."""
    chosen = choose_grasp(GraspConfig(share, 0.0, 0.0, 0.0), env.snapshot, env.goal, LAST)
    axes = env.goal.grasp_rotations[0, 0]
    along, across, forward = axes.T @ chosen.shift
    assert abs(across) < 1e-9
    assert abs(forward) < 1e-9
    return float(along)


def test_the_default_grasp(env: ManipulationEnv) -> None:
    chosen = choose_grasp(DEFAULT, env.snapshot, env.goal, LAST)
    assert chosen.is_default
    assert chosen.on(env.goal) is env.goal
    frame = chosen.frame(env.snapshot, env.goal, LAST)
    assert chosen.leaning(frame) is frame
    same = default_grasp().frame(env.snapshot, env.goal, LAST)
    np.testing.assert_array_equal(frame.position, same.position)
    tool = env.snapshot.tool_rotation_w[0, 0]
    assert np.linalg.norm(rotation_error(tool, frame.rotation)) < np.pi / 2 + 0.2, "the nearest way round"


def test_it_stays_on_the_handle(env: ManipulationEnv) -> None:
    axes, goal = env.goal.grasp_rotations[0, 0], env.goal
    along = axes[:, 0] @ (goal.handle_points[0] - goal.grasp_positions[0, 0][:, None])
    ends = along_of(env, -1.0), along_of(env, 1.0)
    assert along.min() + 0.03 <= ends[0] + 1e-9 < -0.01
    assert along.max() - 0.03 >= ends[1] - 1e-9 > 0.01
    assert along_of(env, 0.5) == pytest.approx(ends[1] / 2)
    chosen = choose_grasp(GraspConfig(1.0, 0.0, 0.0, 0.0), env.snapshot, goal, LAST)
    moved = chosen.on(goal)
    np.testing.assert_allclose(
        moved.grasp_positions - goal.grasp_positions, np.broadcast_to(chosen.shift, (1, 2, 3)), atol=1e-12
    )
    assert not chosen.is_default


def test_a_knob_has_one_place() -> None:
    env = ManipulationEnv("OpenCabinetDrawer", "train")
    for object_id in list_objects(split="train", task="OpenCabinetDrawer"):
        env.reset(options={"object": object_id, "level": 0})
        handle = env.scene.object.handles_of(env.save_state().target)[0]
        if handle.kind == "knob":
            assert along_of(env, 1.0) == 0.0
            return
    pytest.fail("the training objects have no knob")


@pytest.mark.parametrize("roll", [-2.5, -1.5, 1.5])
def test_it_rolls_as_the_last_joint_allows(env: ManipulationEnv, roll: float) -> None:
    chosen = choose_grasp(GraspConfig(0.0, roll, 0.0, 0.0), env.snapshot, env.goal, LAST)
    assert chosen.number is not None
    assert abs(chosen.last_joint_rad) <= 2.6
    left = chosen.last_joint_rad - float(env.snapshot.robot_qpos[0, LAST])
    candidates = env.goal.grasp_rotations[0]
    relative = env.snapshot.tool_rotation_w[0, 0].T @ chosen.frame(env.snapshot, env.goal, LAST).rotation
    asked = float(np.arctan2(relative[1, 0], relative[0, 0]))
    assert asked == pytest.approx(np.clip(left, -1.2, 1.2) if abs(left) > 1.99 else left, abs=0.02)
    assert len(candidates) > chosen.number


def test_it_leans(env: ManipulationEnv) -> None:
    chosen = choose_grasp(GraspConfig(0.0, 0.0, 0.1, -0.2), env.snapshot, env.goal, LAST)
    frame = chosen.leaning(Frame(np.zeros(3), np.eye(3)))
    sine = np.sin(0.1), np.sin(-0.2)
    np.testing.assert_allclose(frame.forward, (sine[1], -sine[0] * np.cos(0.2), np.cos(0.1) * np.cos(0.2)))
    assert not chosen.is_default


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((1.5, 0, 0, 0), r"along must lie in \[-1, 1\], not 1.5"),
        ((0, 4, 0, 0), "roll_rad must lie in"),
        ((0, 0, 1, 0), "lean_along_rad must lie in"),
    ],
)
def test_illegal_values_of_a_grasp(values: tuple, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        GraspConfig(*values)


HEAD_ON = np.array(((0.0, 0, 1), (-1, 0, 0), (0, -1, 0)))  # a hand that points along +x


@pytest.mark.parametrize("bearing", [-0.5, 0.0, 0.3])
def test_a_turned_base_holds_the_hand_where_it_was(bearing: float) -> None:
    """Against the engine's own kinematics."""
    env = ManipulationEnv(objects="cabinet-0010")
    env.reset(seed=3)
    before, qpos = tool_frame(env.snapshot), env.snapshot.robot_qpos[0]
    offset = yaw_rotation(-qpos[2]) @ (before.position - (qpos[0], qpos[1], qpos[3]))
    shoulder = np.asarray(env.task.robot.mounts[0].position_m)
    posture = Posture(qpos[4:11].copy(), offset).turned(bearing, shoulder)
    simulation = env.simulation
    assert simulation is not None
    simulation._qpos[0, :11] = posture.joints(before)
    simulation._batch.forward()
    after = tool_frame(simulation.snapshot())
    np.testing.assert_allclose(after.position, before.position, atol=1e-6)
    np.testing.assert_allclose(after.rotation, before.rotation, atol=0.08)  # so much aside the rest posture points
    turned = simulation.snapshot().robot_qpos[0, 2] - np.arctan2(before.forward[1], before.forward[0])
    assert turned == pytest.approx(bearing)


def test_the_default_posture_is_the_rest() -> None:
    arm, offset = np.arange(7.0), np.array((0.7, -0.3, 0.4))
    same = Posture(arm, offset).turned(0.0, np.array((0.1, -0.3, 0.2)))
    np.testing.assert_array_equal(same.arm, arm)
    np.testing.assert_array_equal(same.tool_offset, offset)


def test_a_detour_fades() -> None:
    goal, config = Frame(np.array((1.0, 0.0, 0.8)), HEAD_ON), StanceConfig(0.0, 0.3, 0.2)
    far = approach_point(config, goal, np.array((0.0, 0.0, 0.8)))
    np.testing.assert_allclose(far, (1.0, 0.3, 1.0))
    half = approach_point(config, goal, np.array((1.0 - 0.375, 0.0, 0.8)))
    np.testing.assert_allclose(half, (1.0, 0.15, 0.9))
    np.testing.assert_allclose(approach_point(config, goal, np.array((0.9, 0.0, 0.8))), goal.position)


def test_no_detour_through_the_floor() -> None:
    config, far = StanceConfig(0.0, 0.0, -0.5), np.zeros(3)
    assert approach_point(config, Frame(np.array((1.0, 0, 0.6)), HEAD_ON), far)[2] == pytest.approx(0.3)
    assert approach_point(config, Frame(np.array((1.0, 0, 0.2)), HEAD_ON), far)[2] == pytest.approx(0.2)


def test_the_straight_way_is_the_goal_itself() -> None:
    goal = Frame(np.array((1.0, 0.0, 0.8)), HEAD_ON)
    assert approach_point(StanceConfig(0.0, 0.0, 0.0), goal, np.zeros(3)) is goal.position


def test_illegal_values_of_a_stance() -> None:
    with pytest.raises(ConfigError, match=r"bearing_rad must lie in \[-1.0, 1.0\], not 2"):
        StanceConfig(2.0, 0.0, 0.0)


CONFIG = load_config(OpenCabinetExpertConfig, CONFIG_DIR / "experts" / "open_cabinet.yaml").grip
GRASP = Frame(np.array((0.5, 0.2, 0.4)), np.eye(3))
PATIENCE = 30


def off(along: float = 0.0, across: float = 0.0, forward: float = 0.0, turned_rad: float = 0.0) -> Frame:
    """A hand that is so far from the grasp, m, and turned about the way forward."""
    rotation = axis_rotation(np.array((0.0, 0.0, 1.0)), turned_rad) if turned_rad else np.eye(3)
    return Frame(GRASP.position - rotation @ (along, across, forward), rotation)


@pytest.mark.parametrize(
    ("tool", "steps", "phase"),
    [
        (off(), 3, CabinetPhase.GRIP),
        (off(forward=0.05), 3, CabinetPhase.REACH),
        (off(across=0.01), 3, CabinetPhase.REACH),
        (off(along=0.012), 3, CabinetPhase.GRIP),  # along the handle it matters less
        (off(forward=0.012), CONFIG.blocked_steps - 1, CabinetPhase.REACH),
        (
            off(forward=0.012),
            CONFIG.blocked_steps,
            CabinetPhase.GRIP,
        ),  # something behind the handle is in its way
        (off(forward=0.02), CONFIG.blocked_steps, CabinetPhase.REACH),
        (off(forward=0.05, across=0.03), 3, CabinetPhase.APPROACH),  # lost, long before its patience ends
        (off(forward=0.05, turned_rad=0.4), 3, CabinetPhase.APPROACH),
        (off(forward=0.05), PATIENCE, CabinetPhase.APPROACH),
    ],
)
def test_what_follows_on_reaching_in(tool: Frame, steps: int, phase: CabinetPhase) -> None:
    assert after_reach(tool, GRASP, steps, PATIENCE, CONFIG) is phase

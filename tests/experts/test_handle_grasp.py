"""How handles are taken hold of: grasp, stance, and when the fingers close."""

import numpy as np
import pytest

from artiskill.assets.catalog import list_objects
from artiskill.config import CONFIG_DIR, load_config
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError
from artiskill.experts.frames import Frame, axis_rotation, rotation_error, tool_frame, yaw_rotation
from artiskill.experts.handle_grasp import (
    GraspConfig,
    HandAtHandle,
    Posture,
    StanceConfig,
    approach_point,
    grasp_pose,
    leaning,
    nearest_roll,
    tilt_of,
    tilted,
)
from artiskill.experts.open_cabinet import OpenCabinetExpertConfig

LAST, REST_RAD = 10, 0.78
CONFIG = load_config(OpenCabinetExpertConfig, CONFIG_DIR / "experts" / "open_cabinet.yaml").grip
DEFAULT = GraspConfig(0.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def env() -> ManipulationEnv:
    env = ManipulationEnv(objects="cabinet-0026")
    env.reset(seed=0)
    return env


def pose(env: ManipulationEnv, config: GraspConfig) -> Frame:
    return grasp_pose(config, env.snapshot, env.goal, LAST, REST_RAD)


def along_of(env: ManipulationEnv, share: float) -> float:
    """How far from the middle, along the handle."""
    axes = env.snapshot.link_rotation_w[0, int(env.goal.link[0])] @ env.goal.grasp_rotations[0, 0]
    shift = pose(env, GraspConfig(share, 0.0, 0.0, 0.0)).position - pose(env, DEFAULT).position
    along, across, forward = axes.T @ shift
    assert abs(across) < 1e-9
    assert abs(forward) < 1e-9
    return float(along)


def test_the_default_grasp_is_the_middle_and_the_nearest_way_round(env: ManipulationEnv) -> None:
    snapshot, goal = env.snapshot, env.goal
    link = int(goal.link[0])
    middle = snapshot.link_position_w[0, link] + snapshot.link_rotation_w[0, link] @ goal.grasp_positions[0, 0]
    found = pose(env, DEFAULT)
    np.testing.assert_allclose(found.position, middle, atol=1e-12)
    assert np.linalg.norm(rotation_error(snapshot.tool_rotation_w[0, 0], found.rotation)) < np.pi / 2 + 0.2


def test_it_stays_on_the_handle(env: ManipulationEnv) -> None:
    axes, goal = env.goal.grasp_rotations[0, 0], env.goal
    along = axes[:, 0] @ (goal.handle_points[0] - goal.grasp_positions[0, 0][:, None])
    ends = along_of(env, -1.0), along_of(env, 1.0)
    assert along.min() + 0.03 <= ends[0] + 1e-9 < -0.01
    assert along.max() - 0.03 >= ends[1] - 1e-9 > 0.01
    assert along_of(env, 0.5) == pytest.approx(ends[1] / 2)


def test_a_knob_has_one_place() -> None:
    env = ManipulationEnv("OpenCabinetDrawer", "train")
    for object_id in list_objects(split="train", task="OpenCabinetDrawer"):
        env.reset(options={"object": object_id, "level": 0})
        handle = env.scene.object.handles_of(env.save_state().target)[0]
        if handle.kind == "knob":
            assert along_of(env, 1.0) == 0.0
            return
    pytest.fail("the training objects have no knob")


def rolled(angle_rad: float) -> np.ndarray:
    return axis_rotation(np.array((0.0, 0, 1)), angle_rad)


@pytest.mark.parametrize(
    ("now", "wanted", "turn"),
    [
        (0.78, 0.78, -0.9),  # the nearer of the two
        (2.2, 0.78, -0.9),  # not the nearest one, -0.9 + pi, which lies beyond the joint's range
        (0.2, 2.5, 1.2),  # another one is asked for, and half of the way is shown
        (0.0, -2.6, -0.9),
    ],
)
def test_a_hand_rolls_to_the_best_of_its_grasps(now: float, wanted: float, turn: float) -> None:
    tool = axis_rotation(np.array((1.0, 2, 3)), 0.7)
    candidates = np.stack([tool @ rolled(-0.9), tool @ rolled(-0.9 + np.pi)])
    np.testing.assert_allclose(nearest_roll(candidates, tool, now, wanted), tool @ rolled(turn), atol=2e-3)


def test_with_less_weight_the_nearest_grasp_is_taken() -> None:
    """A round knob: the hand has been rolled far from what is asked for."""
    candidates = np.stack([rolled(angle) for angle in np.linspace(-np.pi, np.pi, 8, endpoint=False)])
    far = nearest_roll(candidates, rolled(-0.3), -0.3, 2.3)
    near = nearest_roll(candidates, rolled(-0.3), -0.3, 2.3, weight=0.3)
    np.testing.assert_allclose(near, rolled(0.0), atol=1e-9)
    assert not np.allclose(far, near)


def test_a_hand_that_has_begun_to_roll_goes_on() -> None:
    """Between two grasps that are equally far, the first step decides."""
    candidates = np.stack([rolled(0.0), rolled(np.pi)])
    for start in np.linspace(1.3, 1.9, 13):
        chosen = nearest_roll(candidates, rolled(start), 0.78, 0.78)
        step = 0.1 if chosen[0, 0] < 0 else -0.1
        again = nearest_roll(candidates, rolled(start + step), 0.78 + step, 0.78)
        np.testing.assert_allclose(again, chosen)


def test_a_long_roll_is_asked_for_in_parts(env: ManipulationEnv) -> None:
    tool = env.snapshot.tool_rotation_w[0, 0]
    for roll in (-2.5, 2.5):
        relative = tool.T @ pose(env, GraspConfig(0.0, roll, 0.0, 0.0)).rotation
        assert abs(np.arctan2(relative[1, 0], relative[0, 0])) < 2.0


def test_it_leans() -> None:
    upright, config = Frame(np.zeros(3), np.eye(3)), GraspConfig(0.0, 0.0, 0.1, -0.2)
    sine = np.sin(0.1), np.sin(-0.2)
    np.testing.assert_allclose(
        leaning(upright, config, 0.0).forward,
        (sine[1], -sine[0] * np.cos(0.2), np.cos(0.1) * np.cos(0.2)),
        atol=1e-12,
    )
    assert leaning(upright, DEFAULT, 0.0) is upright
    assert leaning(upright, config, 0.5) is upright, "low things leave no room"


def test_a_low_hand_comes_from_above() -> None:
    assert tilt_of(0.5, 0.42, CONFIG) == 0.0
    tilt = tilt_of(0.1, 0.42, CONFIG)
    assert np.sin(tilt) == pytest.approx(0.32 / CONFIG.arm_reach_m)
    hand = tilted(Frame(np.zeros(3), HEAD_ON), tilt)
    assert hand.forward[2] == pytest.approx(-np.sin(tilt))
    np.testing.assert_allclose(hand.rotation.T @ hand.rotation, np.eye(3), atol=1e-12)


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


WIDTH_M, WIDE_M = 0.01, 0.036


def hand(
    off_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    turned_rad: float = 0.0,
    speed_m_s: float = 0.2,
    opening_m: float = WIDE_M,
) -> HandAtHandle:
    return HandAtHandle(CONFIG, np.array(off_m), turned_rad, speed_m_s, opening_m, WIDTH_M, WIDE_M)


@pytest.mark.parametrize(
    ("seen", "closes"),
    [
        (hand(), True),
        (hand((0.0, 0.0, 0.05)), False),
        (hand((0.0, 0.012, 0.0)), False),
        (hand((0.012, 0.0, 0.0)), True),  # along the handle it matters less
        (hand((0.0, 0.0, 0.012)), False),
        (hand((0.0, 0.0, 0.012), speed_m_s=0.0), True),  # something behind the handle is in its way
        (hand(turned_rad=0.4), False),
        (hand(opening_m=0.0), False),  # there is nothing between them: they have to open first
    ],
)
def test_when_fingers_close(seen: HandAtHandle, closes: bool) -> None:
    assert seen.may_close is closes


@pytest.mark.parametrize(
    ("seen", "holds"),
    [
        (hand(opening_m=WIDTH_M), True),
        (hand((0.0, 0.012, 0.0), opening_m=0.025), True),  # what has begun goes on
        (hand(opening_m=0.0005), False),  # empty
        (hand((0.0, 0.0, 0.04), opening_m=WIDTH_M), False),  # slipped
        (hand(), False),  # open
    ],
)
def test_when_a_handle_is_held(seen: HandAtHandle, holds: bool) -> None:
    assert seen.holds is holds


def test_a_grip_firms_as_fingers_close() -> None:
    firm = [hand(opening_m=opening).firmness for opening in np.linspace(WIDTH_M, WIDE_M, 100)]
    assert firm[0] == 1.0
    assert firm[-1] > 0.0
    assert (np.diff(firm) <= 0).all()


def test_a_funnel_leads_in() -> None:
    """Smoothly, for students learn an average over states that they cannot tell apart."""
    across = np.linspace(0.0, 0.04, 200)
    shares = np.array([hand((0.0, off, 0.1)).standoff for off in across])
    assert shares[0] == 0.0
    assert shares[-1] == 1.0
    assert (np.diff(shares) >= 0).all()
    assert np.diff(shares).max() < 0.02
    assert hand((0.0, 0.0, 0.1), turned_rad=0.3).standoff == pytest.approx(0.5)
    assert hand((0.0, 0.0, 0.05), opening_m=0.01).standoff == 1.0, "too narrow"
    assert hand((0.0, 0.0, 0.09), opening_m=0.01).standoff == 0.0, "with time to open on the way"

"""Stances: the base may stand turned and the hand come by a detour, and the hand is where it should be."""

import numpy as np
import pytest

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError
from artiskill.experts.frames import Frame, tool_frame, yaw_rotation
from artiskill.experts.stance import Posture, StanceConfig, approach_point

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


def test_the_usual_posture_is_the_rest() -> None:
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


def test_illegal_values() -> None:
    with pytest.raises(ConfigError, match=r"bearing_rad must lie in \[-1.0, 1.0\], not 2"):
        StanceConfig(2.0, 0.0, 0.0)

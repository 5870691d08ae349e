"""Grasps: along the handle and no further, rolled where the last joint allows it, leaning as asked."""

import numpy as np
import pytest

from artiskill.assets.catalog import list_objects
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError
from artiskill.experts.frames import Frame, rotation_error
from artiskill.experts.grasp import GraspConfig, choose_grasp, usual_grasp

LAST = 10
USUAL = GraspConfig(0.0, 0.0, 0.0, 0.0)


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


def test_the_usual_grasp(env: ManipulationEnv) -> None:
    chosen = choose_grasp(USUAL, env.snapshot, env.goal, LAST)
    assert chosen.is_usual
    assert chosen.on(env.goal) is env.goal
    frame = chosen.frame(env.snapshot, env.goal, LAST)
    assert chosen.leaning(frame) is frame
    same = usual_grasp().frame(env.snapshot, env.goal, LAST)
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
    assert not chosen.is_usual


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
    assert not chosen.is_usual


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((1.5, 0, 0, 0), r"along must lie in \[-1, 1\], not 1.5"),
        ((0, 4, 0, 0), "roll_rad must lie in"),
        ((0, 0, 1, 0), "lean_along_rad must lie in"),
    ],
)
def test_illegal_values(values: tuple, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        GraspConfig(*values)

"""States of which only positions and velocities are known; tests/demos/test_replay.py has whole trajectories."""

from dataclasses import replace

import numpy as np
import pytest

from artiskill.assets.catalog import load_object
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.scene.scene import cached_scene
from artiskill.sim.snapshot import Snapshot
from artiskill.sim.states import with_values

NAMES = ("robot_qpos", "robot_qvel", "object_qpos", "object_qvel", "root_velocity_w", "prop_position_w")


def values_of(snapshot: Snapshot, joints: int) -> dict[str, np.ndarray]:
    found = {name: getattr(snapshot, name)[0] for name in (*NAMES, "prop_velocity_w")}
    found["root_position_w"] = snapshot.link_position_w[0, 0]
    found["root_quaternion_w"] = snapshot.link_quaternion_w[0, 0]
    return found | {name: found[name][:joints] for name in ("object_qpos", "object_qvel")}


@pytest.mark.parametrize(
    ("task", "object_id"),
    [("OpenCabinetDoor", "cabinet-0006"), ("PushChair", "chair-0004"), ("MoveBucket", "bucket-0001")],
)
def test_everything_is_where_it_was(task: str, object_id: str) -> None:
    env = ManipulationEnv(task, object_id)
    env.reset(seed=0)
    start, rng = env.save_state(), np.random.default_rng(0)
    before = env.snapshot
    for _ in range(20):
        before = env.snapshot
        env.step(rng.uniform(-1, 1, env.action_space.shape))
    wanted = env.snapshot
    obj = load_object(object_id)
    scene = cached_scene(env.task.robot, obj, env.task.physics, env.task.props)
    state = with_values(start.simulation, scene, values_of(wanted, len(obj.joints)), before)
    env.restore_state(replace(start, simulation=state))
    found = env.snapshot
    for name in (*NAMES, "prop_velocity_w", "link_position_w", "link_quaternion_w", "previous_link_position_w"):
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), atol=1e-9, err_msg=name)
    for name in ("tool_position_w", "finger_line_w", "fingertip_velocity_w"):
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), atol=1e-9, err_msg=name)
    assert np.abs(found.robot_qpos - start.simulation.rows[0, 1 : 1 + found.robot_qpos.shape[1]]).max() > 0.1

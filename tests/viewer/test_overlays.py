"""What the robot's cameras see and what touches what, against observations and the laws of mechanics."""

from typing import Any

import numpy as np
import pytest

from artiskill.envs.core import ObservationContext
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.geometry.rotations import quat_to_matrix
from artiskill.sim.simulation import Contacts
from artiskill.viewer.overlays import ContactView, SensorView


@pytest.fixture(scope="module")
def env() -> ManipulationEnv:
    made = ManipulationEnv("OpenCabinetDrawer", objects=["cabinet-0002"], obs_mode="pointcloud")
    made.reset(seed=3)
    return made


def node(server: Any, name: str) -> Any:
    found = server.scene.get_handle_by_name(name)
    assert found is not None, name
    return found


def test_the_cloud_is_what_the_observation_has(server: Any, env: ManipulationEnv) -> None:
    observation, info = env.reset(seed=3)
    sensors = SensorView(server, env.task, env.scene, info["target"])
    sensors.observe(ObservationContext(env.snapshot, env.goal, 0, 3, 0))
    cloud, cameras = observation["pointcloud"], env.task.cameras
    seen = cloud["xyz"].any(axis=1)
    xyz, rgb = sensors.cloud()
    both = np.column_stack((cloud["xyz"][seen], cloud["rgb"][seen]))
    assert 30_000 < len(xyz) <= 40_000
    assert {tuple(row) for row in np.column_stack((xyz, rgb))} <= {tuple(row) for row in both}
    picture = sensors.picture("colour")
    first = cloud["rgb"].reshape(cameras.number, cameras.height, cameras.width, 3)[0]
    np.testing.assert_array_equal(picture[: cameras.height], first)
    assert (sensors.picture("masks") != picture).any()
    assert sensors.picture("depth")[: cameras.height].std() > 5
    for matrix, (position, quaternion) in zip(
        info["cameras"]["world_to_camera"], sensors.camera_poses(), strict=True
    ):
        np.testing.assert_allclose(matrix[:3, :3] @ position + matrix[:3, 3], 0.0, atol=1e-9)
        np.testing.assert_allclose(quat_to_matrix(quaternion), matrix[:3, :3].T, atol=1e-9)
    sensors.show_cloud(True)
    np.testing.assert_array_equal(node(server, "/sensors/points").points, xyz)
    sensors.show_cloud(False)
    assert server.scene.get_handle_by_name("/sensors/points") is None


def test_contacts_are_points_and_arrows(server: Any) -> None:
    view = ContactView(server)
    places, forces = np.eye(3), np.array(((0.0, 0.0, 10.0), (0.1, 0.0, 0.0), (-5.0, 0.0, 0.0)))
    view.show(Contacts(places, forces, np.zeros((3, 2), dtype=int)))
    np.testing.assert_array_equal(node(server, "/contacts/points").points, places)
    arrows = node(server, "/contacts/forces").points  # the second force is too weak for one
    np.testing.assert_allclose(arrows[:, 1] - arrows[:, 0], 0.004 * forces[[0, 2]], atol=1e-6)
    view.show(Contacts(places[:0], forces[:0], np.zeros((0, 2), dtype=int)))
    assert server.scene.get_handle_by_name("/contacts/points") is None
    assert server.scene.get_handle_by_name("/contacts/forces") is None

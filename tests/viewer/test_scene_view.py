"""What is sent to the browser, against the scene and its snapshots."""

import io
import socket
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from artiskill.assets.catalog import load_object
from artiskill.assets.kinematics import shape_volume_m3
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError, UnknownNameError
from artiskill.exports.glb import body_glb
from artiskill.geometry.rotations import quat_angle, quat_to_matrix
from artiskill.sensors.render_config import load_render_config
from artiskill.viewer import check_address, serving
from artiskill.viewer.scene_view import (
    AXES,
    GRASPS,
    LAYERS,
    SHAPES,
    TARGET,
    SceneView,
    add_stage,
    blended_poses,
    narrow_view,
    object_bodies,
    place_camera,
    scene_bodies,
)


@pytest.fixture(scope="module")
def env() -> ManipulationEnv:
    made = ManipulationEnv("OpenCabinetDrawer", objects=["cabinet-0002"], obs_mode="pointcloud")
    made.reset(seed=3)
    return made


def view_of(server: Any, env: ManipulationEnv) -> SceneView:
    scene = env.scene
    return SceneView(
        server, scene_bodies(scene), scene.object, scene.index.object_bodies.start, env.save_state().target
    )


def node(server: Any, name: str) -> Any:
    found = server.scene.get_handle_by_name(name)
    assert found is not None, name
    return found


@pytest.mark.parametrize(
    ("task", "obj"),
    [("OpenCabinetDoor", "cabinet-0041"), ("PushChair", "chair-0004"), ("MoveBucket", "bucket-0001")],
)
def test_bodies_have_all_that_is_drawn_and_all_that_collides(task: str, obj: str) -> None:
    env = ManipulationEnv(task, objects=[obj])
    env.reset(seed=0)
    scene, bodies = env.scene, scene_bodies(env.scene)
    assert {(k, id(v)) for k, body in bodies.items() for v in body.visuals} == {
        (k, id(v)) for k, v in scene.visuals
    }
    first = scene.index.object_bodies.start
    for i, link in enumerate(scene.object.links):
        shapes = bodies[first + i].collisions if first + i in bodies else ()
        assert len(shapes) == len(link.collisions)
        volumes = [sum(map(shape_volume_m3, given)) for given in (shapes, link.collisions)]
        assert volumes[0] == pytest.approx(volumes[1], rel=1e-4)
    robot = [body for body in bodies.values() if body.name.startswith("robot/")]
    assert sum(bool(body.collisions) for body in robot) > 10
    assert len({body.name for body in bodies.values()}) == len(bodies)


def test_surfaces_keep_shape_colour_and_texture(env: ManipulationEnv) -> None:
    trimesh = pytest.importorskip("trimesh")
    seen_textures = 0
    for body in scene_bodies(env.scene).values():
        if not body.visuals:
            continue
        found = trimesh.load(io.BytesIO(body_glb(body.visuals)), file_type="glb", process=False)
        meshes = list(found.geometry.values())
        assert sum(len(mesh.faces) for mesh in meshes) == sum(len(v.mesh.faces) for v in body.visuals)
        bounds = np.array([v.mesh.bounds for v in body.visuals])
        wanted = np.stack((bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)))
        np.testing.assert_allclose(found.bounds, wanted, atol=1e-6)
        colours = {tuple(mesh.visual.material.baseColorFactor[:3]) for mesh in meshes}
        given = {tuple(np.round(255 * np.array(v.material.rgba[:3])).astype(int)) for v in body.visuals}
        assert all(min(np.abs(np.array(c, int) - g).max() for g in given) <= 1 for c in colours)
        seen_textures += sum(mesh.visual.material.baseColorTexture is not None for mesh in meshes)
    assert seen_textures


def test_poses_are_the_snapshots(server: Any, env: ManipulationEnv) -> None:
    view, bodies = view_of(server, env), scene_bodies(env.scene)
    for _ in range(3):
        snapshot = env.snapshot
        view.set_poses(snapshot.body_position_w[0], snapshot.body_quaternion_w[0])
        for index, body in bodies.items():
            handle = node(server, f"/scene/{body.name}")
            np.testing.assert_allclose(handle.position, snapshot.body_position_w[0, index], atol=2e-6)
            np.testing.assert_allclose(
                quat_to_matrix(handle.wxyz), quat_to_matrix(snapshot.body_quaternion_w[0, index]), atol=5e-6
            )
        env.step(env.action_space.sample())


def test_poses_between_two_snapshots(env: ManipulationEnv) -> None:
    before = env.snapshot
    for _ in range(3):
        env.step(env.action_space.sample())
    after = env.snapshot
    flipped = replace(after, body_quaternion_w=-after.body_quaternion_w)  # the same orientations
    for share in (0.0, 0.3, 1.0):
        positions, quaternions = blended_poses(before, flipped, share)
        way = after.body_position_w[0] - before.body_position_w[0]
        np.testing.assert_allclose(positions - before.body_position_w[0], share * way, atol=1e-12)
        first, last = before.body_quaternion_w[0], after.body_quaternion_w[0]
        whole, part = quat_angle(first, last), quat_angle(first, quaternions)
        np.testing.assert_allclose(part, share * whole, atol=2e-3)


def test_layers_are_switched_on_and_off(server: Any, env: ManipulationEnv) -> None:
    view = view_of(server, env)
    handle = env.scene.object.handles_of(env.save_state().target)[0]
    names = {
        TARGET: f"/scene/object/{handle.link}/target-0",
        SHAPES: f"/scene/object/{handle.link}/shapes",
        AXES: f"/scene/object/{handle.link}/axis",
        GRASPS: f"/scene/object/{env.scene.object.handles[0].link}/grasps-0",
    }
    for layer in LAYERS:
        assert server.scene.get_handle_by_name(names[layer]) is None
        view.show_layer(layer, True)
        assert node(server, names[layer]).visible
        assert view.shown == {layer}
        view.show_layer(layer, False)
        assert not node(server, names[layer]).visible
        assert not view.shown
    box = node(server, names[TARGET]).points.reshape(-1, 3)
    assert (box.min(axis=0) < handle.points.min(axis=0)).all()
    assert (box.max(axis=0) > handle.points.max(axis=0)).all()
    with pytest.raises(UnknownNameError, match="unknown layer 'axes'"):
        view.show_layer("axes", True)


def test_nothing_is_left_of_a_scene_that_is_removed(server: Any, env: ManipulationEnv) -> None:
    view = view_of(server, env)
    for layer in LAYERS:
        view.show_layer(layer, True)
    view.remove()
    assert server.scene.get_handle_by_name("/scene") is None
    assert server.scene.get_handle_by_name("/scene/object/base/surface") is None
    again = view_of(server, env)
    again.set_poses(env.snapshot.body_position_w[0], env.snapshot.body_quaternion_w[0])
    assert node(server, "/scene/robot/mobile_base/surface").visible


def test_links_are_marked(server: Any) -> None:
    obj = load_object("cabinet-0005")
    view = SceneView(server, object_bodies(obj), obj)
    marks = view.mark("link_0", "fault", "too heavy")
    assert node(server, "/scene/object/link_0/fault-text").text == "too heavy"
    for mark in marks:
        mark.remove()
    assert server.scene.get_handle_by_name("/scene/object/link_0/fault") is None


def test_light_and_ground_are_the_pictures(server: Any) -> None:
    config = load_render_config()
    add_stage(server, config)
    place_camera(server, (-3.0, 0.0, 1.0), (0.0, 0.0, 0.5), has_panel=False)
    sun = np.asarray(node(server, "/light/sun").position)
    np.testing.assert_allclose(sun / np.linalg.norm(sun), config.sun.direction_w, atol=1e-6)
    np.testing.assert_allclose(server.initial_camera.look_at, (0.0, 0.0, 0.5))
    assert server.initial_camera.position[0] < -3.0
    assert node(server, "/ground").visible


def test_only_this_machine_is_listened_to_by_default(server: Any) -> None:
    assert server.get_host() == "127.0.0.1"
    with socket.create_connection(("127.0.0.1", server.get_port()), timeout=60):
        pass


def test_addresses_that_cannot_be_listened_to(server: Any) -> None:
    with pytest.raises(ConfigError, match=r"cannot listen to 127\.0\.0\.1, port \d+: .*--port 0"):
        check_address("127.0.0.1", server.get_port())
    with pytest.raises(ConfigError, match=r"cannot listen to nowhere\.invalid"):
        check_address("nowhere.invalid", 0)
    with pytest.raises(ConfigError, match=r"\[0, 65535\], not 70000"):
        check_address("127.0.0.1", 70000)


def test_a_connection_without_a_request_is_no_error(server: Any, caplog: pytest.LogCaptureFixture) -> None:
    with socket.create_connection(("127.0.0.1", server.get_port()), timeout=60) as browser:
        browser.shutdown(socket.SHUT_WR)
        browser.settimeout(60)
        while browser.recv(1024):
            pass
    time.sleep(0.3)
    assert not caplog.records


def test_no_page_can_open_a_tunnel_and_nothing_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("viser")
    with serving(port=0) as server:
        port = server.get_port()
        assert server.request_share_url() is None
    assert capsys.readouterr().out == ""
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", port), timeout=60)


def test_a_narrow_page_sees_the_scene_above_the_panel(server: Any) -> None:
    """The middle of what is shown lies in the upper part of the picture, in the middle from left to right."""
    eye, middle = np.array((-3.0, -2.0, 1.5)), np.array((0.2, 0.1, 0.5))
    place_camera(server, eye, middle)
    first = server.initial_camera
    eye_w, look_at_w = narrow_view(first.position, first.look_at, 390 / 844)
    ahead = (look_at_w - eye_w) / np.linalg.norm(look_at_w - eye_w)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    to_middle = middle - eye_w
    half = np.tan(first.fov / 2) * (to_middle @ ahead)
    assert to_middle @ right == pytest.approx(0.0, abs=1e-6)
    assert 0.4 < to_middle @ np.cross(right, ahead) / half < 0.7  # 1 is the upper edge
    assert np.linalg.norm(to_middle) > 1.5 * np.linalg.norm(middle - eye)

"""Ids and depth of real scenes against the engine's own ray caster, on meshes of the same triangles."""

import math

import mujoco
import numpy as np
import pytest

from artiskill.assets.catalog import load_object
from artiskill.robots.config import load_robot
from artiskill.scene.physics import PhysicsConfig
from artiskill.scene.scene import build_scene
from artiskill.sensors.camera import Camera
from artiskill.sensors.drawing.backdrop import FLOOR, NOTHING
from artiskill.sensors.render_config import load_render_config
from artiskill.sensors.renderer import BodyVisual, Renderer

RAYS = 2000
GROUND = "ground"


def ray_model(visuals, body_count):
    """A model whose geom k is visual k, on bodies that are put where one likes, and the ground."""
    spec = mujoco.MjSpec()
    bodies = [spec.worldbody.add_body(mocap=True) for _ in range(body_count)]
    for i, item in enumerate(visuals):
        mesh = spec.add_mesh(name=f"mesh{i}", inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        mesh.uservert = item.visual.mesh.vertices.astype(np.float32).reshape(-1)
        mesh.userface = item.visual.mesh.faces.astype(np.int32).reshape(-1)
        bodies[item.body].add_geom(name=f"visual{i}", type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"mesh{i}")
    spec.worldbody.add_geom(name=GROUND, type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1))
    return spec.compile()


def random_scene(seed, object_id):
    """Robot and cabinet in a random state: visuals, poses, three cameras."""
    rng = np.random.default_rng(seed)
    scene = build_scene(load_robot("one_arm"), load_object(object_id), PhysicsConfig())
    model, data = scene.model, mujoco.MjData(scene.model)
    low, high = np.clip(model.jnt_range.T, -2.0, 2.0)
    data.qpos[:] = rng.uniform(low, high)
    data.qpos[:4] = rng.uniform((-1.9, -0.6, -0.5, 0.1), (-1.4, 0.6, 0.5, 0.7))
    mujoco.mj_kinematics(model, data)
    x, y, yaw = data.qpos[:3]
    turns = yaw + 2 * math.pi * np.arange(3) / 3
    on_robot = [((x, y, 1.5), (x + math.cos(a), y + math.sin(a), 0.5)) for a in turns]
    # out of the arm's reach: a camera within a body sees through it, a ray does not
    close = ((-0.9, rng.choice((-1.9, 1.9)), 1.2), (0, 0, 0.4))
    cameras = [Camera.look_at(eye, target, width=400, height=160) for eye, target in (*on_robot, close)]
    visuals = [BodyVisual(body, visual) for body, visual in scene.visuals]
    return visuals, data.xpos.copy(), data.xquat.copy(), cameras


def cast(visuals, positions, quaternions, camera, rows, columns):
    """Ids (R,) and depths (R,) along the optical axis by `mj_ray`; -1 and 0 where nothing is within reach."""
    model = ray_model(visuals, len(positions))
    data = mujoco.MjData(model)
    data.mocap_pos[:], data.mocap_quat[:] = positions, quaternions
    mujoco.mj_kinematics(model, data)
    ground = model.geom(GROUND).id
    numbers = {model.geom(f"visual{i}").id: i for i in range(len(visuals))} | {ground: FLOOR}
    rays = np.stack((columns + 0.5, rows + 0.5, np.ones(len(rows))), axis=1) @ np.linalg.inv(camera.intrinsics).T
    rays = rays @ camera.extrinsics[:3, :3]  # length 1 along the optical axis
    ids, depths = np.full(len(rows), NOTHING), np.zeros(len(rows))
    hit = np.zeros(1, dtype=np.int32)
    for i, ray in enumerate(rays):
        begin = camera.position_w + camera.near_m * ray
        length = np.linalg.norm(ray)
        away = mujoco.mj_ray(model, data, begin, ray / length, None, 1, -1, hit, None)
        depth = camera.near_m + away / length
        if away >= 0 and depth < camera.far_m:
            ids[i], depths[i] = numbers[int(hit[0])], depth
    return ids, depths


def calm_pixels(ids):
    """Away from silhouettes: all eight neighbours show the same."""
    calm = np.zeros(ids.shape, dtype=bool)
    height, width = ids.shape
    shifted = [ids[i : height - 2 + i, j : width - 2 + j] for i in range(3) for j in range(3)]
    calm[1:-1, 1:-1] = np.all([s == ids[1:-1, 1:-1] for s in shifted], axis=0)
    return calm


def compare(seed, object_id):
    visuals, positions, quaternions, cameras = random_scene(seed, object_id)
    renderer = Renderer(visuals, load_render_config("fast"))
    images = renderer.render(positions, quaternions, cameras, ("geom", "depth"))
    rng = np.random.default_rng(seed)
    equal, errors, surfaces = [], [], 0
    for c, camera in enumerate(cameras):
        ids, depth = images.geom[c], images.depth[c]
        calm = np.argwhere(calm_pixels(ids))
        on_mesh = np.argwhere(calm_pixels(ids) & (ids >= 0))
        chosen = [rng.choice(pixels, RAYS // 8) for pixels in (calm, on_mesh) if len(pixels)]
        rows, columns = np.concatenate(chosen).T
        expected, expected_depth = cast(visuals, positions, quaternions, camera, rows, columns)
        equal.append(ids[rows, columns] == expected)
        errors.append(np.abs(depth[rows, columns] - expected_depth)[equal[-1]])
        surfaces += len(np.unique(expected))
    equal, errors = np.concatenate(equal), np.concatenate(errors)
    assert len(equal) > RAYS / 2
    assert surfaces > 15
    assert equal.mean() >= 0.999
    assert np.quantile(errors, 0.99) < 1e-4


@pytest.mark.parametrize("object_id", ["cabinet-0003", "cabinet-0006"])
def test_ids_and_depth_are_the_engines(object_id):
    compare(1, object_id)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_ids_and_depth_are_the_engines_in_many_scenes(seed):
    compare(100 + seed, f"cabinet-{2 * seed + 1:04d}")

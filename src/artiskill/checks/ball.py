"""Balls dropped into a bucket from its rim stay in."""

from typing import Any

import mujoco
import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.checks.config import BallConfig, ChecksConfig
from artiskill.checks.result import CheckResult, at_least
from artiskill.checks.specimen import FREE, Specimen
from artiskill.geometry.rotations import quat_conjugate, quat_rotate
from artiskill.scene.object_scene import ObjectScene, object_spec, resolve_object_scene
from artiskill.scene.options import Group, set_contact

NAME = "ball"
_BALL = "ball"
# one ball in the middle, and one off it on each of four sides, which moves on towards the wall
_SIDES = ((0, 0), (1, 0), (0, 1), (-1, 0), (0, -1))


def check_ball(specimen: Specimen, config: ChecksConfig) -> list[CheckResult]:
    """How many of the balls, dropped one at a time, are inside the root's bounds after a while."""
    scene = _scene_with_ball(specimen, config.ball)
    bounds = body_bounds(specimen.object)
    outside = []
    for side in _SIDES:
        place = _drop(specimen, scene, config.ball, bounds, np.array(side, dtype=float))
        if not ((place >= bounds[0]) & (place <= bounds[1])).all():
            outside.append(f"the one dropped {_where(side)} lies at {np.round(place, 2).tolist()}")
    note = f"outside of the body {np.round(bounds, 2).tolist()}: {'; '.join(outside)}" if outside else ""
    inside = len(_SIDES) - len(outside)
    return [at_least(NAME, "object", inside, len(_SIDES), "", note)]


def body_bounds(obj: ArticulatedObject) -> np.ndarray:
    """Smallest and largest corner of what is drawn of the root link, (2, 3), in its frame."""
    corners = np.concatenate([visual.mesh.bounds for visual in obj.links[0].visuals])
    return np.stack((corners.min(axis=0), corners.max(axis=0)))


def _scene_with_ball(specimen: Specimen, ball: BallConfig) -> ObjectScene:
    """The object on the ground, its root first in qpos, and a free ball, last."""
    spec, part = object_spec(specimen.object, specimen.physics)
    body = spec.worldbody.add_body(name=_BALL)
    body.add_freejoint(name=_BALL)
    geom = body.add_geom(name=_BALL, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(ball.radius_m, 0, 0))
    geom.density = ball.density_kg_m3
    physics = specimen.physics
    set_contact(geom, Group.LOOSE, Group.OBJECT | Group.GROUND, physics.contact.object_friction, physics)
    return resolve_object_scene(spec.compile(), specimen.object, part)


def _drop(
    specimen: Specimen, scene: ObjectScene, ball: BallConfig, bounds: np.ndarray, side: np.ndarray
) -> np.ndarray:
    """Where in the root's frame a ball is that was dropped on that side of the middle, (3,)."""
    model: Any = specimen.with_dynamics(scene, specimen.limits.joints, FREE)
    data = scene.rest_data()
    middle, half = bounds.mean(axis=0), np.diff(bounds, axis=0)[0] / 2
    room = np.maximum(half[:2] - ball.radius_m, 0.0)
    root = data.qpos[:3].copy()
    data.qpos[-7:-5] = root[:2] + middle[:2] + ball.offset * room * side
    data.qpos[-5] = root[2] + bounds[1, 2] + ball.drop_m
    data.qvel[-6:-4] = ball.speed_m_s * side
    mujoco.mj_step(model, data, round(ball.time_s / model.opt.timestep))
    back = quat_conjugate(data.qpos[3:7])
    return quat_rotate(back, data.qpos[-7:-4] - data.qpos[:3])


def _where(side: tuple[int, int]) -> str:
    names = {(0, 0): "in the middle", (1, 0): "towards +x", (-1, 0): "towards -x", (0, 1): "towards +y"}
    return names.get(side, "towards -y")

"""Scenes and cameras for the sensor's benchmark."""

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from artiskill.assets.articulated_object import Material, VisualMesh
from artiskill.assets.catalog import load_object
from artiskill.geometry.primitives import box, sphere
from artiskill.robots.config import load_robot
from artiskill.scene.physics import PhysicsConfig
from artiskill.scene.scene import build_scene
from artiskill.sensors.camera import Camera
from artiskill.sensors.renderer import BodyVisual

_BODIES = 24
_EYE_HEIGHT_M = 1.5


@dataclass(frozen=True, eq=False)
class BenchmarkScene:
    """Surfaces, poses (N, 3) and (N, 4) of their bodies, and three cameras."""

    name: str
    visuals: list[BodyVisual]
    positions: np.ndarray
    quaternions: np.ndarray
    cameras: list[Camera]


def panorama(x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> list[Camera]:
    """Three cameras of 400 x 160, 120 degrees apart, 1.5 m high, 45 degrees down, as on the robot."""
    turns = [yaw + 2 * math.pi * k / 3 for k in range(3)]
    eye = (x, y, _EYE_HEIGHT_M)
    return [
        Camera.look_at(eye, (x + math.cos(a), y + math.sin(a), _EYE_HEIGHT_M - 1), width=400, height=160)
        for a in turns
    ]


def ring(triangles: int) -> BenchmarkScene:
    """Balls and boxes in a ring around the robot's place, about so many triangles in all."""
    # a ball of so many rings per hemisphere has about 8 rings^2 triangles; a rounded block has 44, a plain one 12
    block = box((0.2, 0.2, 0.4), 0.01) if triangles > 2000 else box((0.2, 0.2, 0.4))
    rings = max(2, round(math.sqrt(max(0, triangles / _BODIES - len(block.faces)) / 8)))
    ball = sphere(0.25, 2 * rings, rings)
    grey = Material("grey", (0.6, 0.6, 0.6, 1.0))
    visuals, positions = [], []
    for i in range(_BODIES):
        angle, reach = 2 * math.pi * i / _BODIES, 1.0 + 0.5 * (i % 3)
        visuals += [BodyVisual(i, VisualMesh(ball.transformed((0, 0, 0.65)), grey, "ball"))]
        visuals += [BodyVisual(i, VisualMesh(block, grey, "block"))]
        positions.append((reach * math.cos(angle), reach * math.sin(angle), 0.4))
    upright = np.tile((1.0, 0.0, 0.0, 0.0), (_BODIES, 1))
    return BenchmarkScene("ring", visuals, np.array(positions), upright, panorama())


def robot_and_cabinet(object_id: str) -> BenchmarkScene:
    """What the robot sees at the start of an episode with a cabinet 1.6 m in front of it."""
    robot = load_robot("one_arm")
    scene = build_scene(robot, load_object(object_id), PhysicsConfig())
    data = mujoco.MjData(scene.model)
    x, y, lift_m = -1.6, 0.8, 0.5
    arm = robot.initial.arm_qpos_rad
    data.qpos[: 4 + len(arm)] = (x, y, 0.0, lift_m, *arm)
    mujoco.mj_kinematics(scene.model, data)
    visuals = [BodyVisual(body, visual) for body, visual in scene.visuals]
    return BenchmarkScene(object_id, visuals, data.xpos.copy(), data.xquat.copy(), panorama(x, y, -0.3))

"""A plausible push rolls a chair without tipping it, and a torque on its seat turns the seat.

Wheels turn freely for the push: whether the chair can roll is a question of its shape and mass. How hard a level
makes it is drawn by the task. For the swivel they are as stiff as they get, so that the base stays.
"""

import math
from typing import Any

import mujoco
import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.checks.config import ChecksConfig, PushConfig
from artiskill.checks.result import CheckResult, at_least, at_most, fine
from artiskill.checks.specimen import Specimen
from artiskill.checks.standing import Course, free_model, watch

ROLL, SWIVEL = "roll", "swivel"
_UPRIGHT = 0.9  # a seat's swivel axis is this nearly vertical: the cosine of 26 degrees


def check_roll(specimen: Specimen, config: ChecksConfig) -> list[CheckResult]:
    """The shortest way and the greatest lean over pushes from all sides."""
    push = config.push
    courses = [_pushed(specimen, push, 2 * math.pi * k / push.directions) for k in range(push.directions)]
    ways, leans = [c.moved_xy_m for c in courses], [math.degrees(c.tilt_rad) for c in courses]
    short, lean = int(np.argmin(ways)), int(np.argmax(leans))
    height = push_height(specimen.object, push)
    how = f"{push_force(specimen):.0f} N for {push.time_s:g} s at {height:.2f} m, towards"
    return [
        at_least(ROLL, "way", ways[short], push.distance_m, "m", f"{how} {360 * short // push.directions} deg"),
        at_most(ROLL, "lean", leans[lean], push.tilt_deg, "deg", f"{how} {360 * lean // push.directions} deg"),
    ]


def check_swivel(specimen: Specimen, config: ChecksConfig) -> list[CheckResult]:
    """How far a torque about the vertical turns the seat against the base, at the highest friction and damping."""
    push, joint = config.push, swivel_joint(specimen)
    if joint is None:
        return [fine(SWIVEL, "object", "its seat has no swivel")]
    scene = specimen.scene
    limits = specimen.limits
    model = free_model(specimen, limits.joints, limits.wheels)
    data = scene.rest_data()
    address, body = scene.qpos[joint], int(scene.model.jnt_bodyid[scene.joints[joint]])
    first = float(data.qpos[address])
    data.xfrc_applied[body, 5] = push.torque_nm
    mujoco.mj_step(model, data, math.ceil(push.time_s / model.opt.timestep))
    turned = math.degrees(abs(float(data.qpos[address]) - first))
    note = f"{push.torque_nm:g} N m for {push.time_s:g} s"
    return [at_least(SWIVEL, specimen.joints[joint].name, turned, push.swivel_deg, "deg", note)]


def push_force(specimen: Specimen) -> float:
    """What people push with, and less on a light chair."""
    scene, push = specimen.scene, specimen.config.push
    weight = float(scene.model.body_subtreemass[scene.bodies[0]]) * abs(float(scene.model.opt.gravity[2]))
    return min(push.force_n, push.weight_share * weight)


def push_height(obj: ArticulatedObject, push: PushConfig) -> float:
    """Height of the seat, as far as it is known."""
    height = obj.metadata.get("seat_height_m")
    bottom, top = (float(z) for z in np.asarray(obj.bounds)[:, 2])
    return float(height) if height is not None else bottom + push.height_share * (top - bottom)


def swivel_joint(specimen: Specimen) -> int | None:
    """The joint that turns about the vertical and carries most, casters left out; None if there is none."""
    found: tuple[float, int] | None = None
    scene = specimen.scene
    for k, joint in enumerate(specimen.joints):
        upright = joint.kind == "revolute" and abs(float(joint.axis[2])) > _UPRIGHT
        if upright and not specimen.rolling[k]:
            mass = float(scene.model.body_subtreemass[scene.model.jnt_bodyid[scene.joints[k]]])
            found = max(found or (0.0, k), (mass, k))
    return None if found is None else found[1]


def _pushed(specimen: Specimen, push: PushConfig, angle_rad: float) -> Course:
    model = free_model(specimen)
    data = specimen.scene.rest_data()
    root = int(specimen.scene.bodies[0])
    force = push_force(specimen) * np.array((math.cos(angle_rad), math.sin(angle_rad), 0.0))
    _apply(data, root, force, push_height(specimen.object, push))
    during = watch(model, data, push.time_s)
    data.xfrc_applied[:] = 0
    after = watch(model, data, push.coast_s)
    moved = max(during.moved_xy_m, float(np.linalg.norm((during.moved + after.moved)[:2])))
    return Course(during.moved + after.moved, moved, max(during.tilt_rad, after.tilt_rad))


def _apply(data: Any, body: int, force: np.ndarray, height_m: float) -> None:
    """A force on a body at a height above the ground, over its centre of mass."""
    arm = np.array((0.0, 0.0, height_m - float(data.xipos[body, 2])))
    data.xfrc_applied[body, :3] = force
    data.xfrc_applied[body, 3:] = np.cross(arm, force)

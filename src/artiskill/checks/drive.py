"""In the simulation, a limited force takes every joint from one limit to the other and back.

Friction and damping are the highest that the category's tasks draw. The root is held; gravity and springs are
balanced, for how hard they make it is the object's character. A joint that is too heavy, or has limits or an axis
with which the engine cannot do anything, does not get there. Links do not meet one another here, as they do not in
the benchmark: `sweep` looks at that.
"""

import math
from typing import Any

import mujoco
import numpy as np

from artiskill.assets.articulated_object import Joint
from artiskill.checks.config import ChecksConfig, DriveConfig
from artiskill.checks.result import CheckResult, at_least
from artiskill.checks.specimen import Specimen
from artiskill.scene.object_scene import ObjectScene, build_object_scene

NAME = "drive"
_STEPS_BETWEEN_LOOKS = 20
_TURN_RAD = 2 * math.pi


def check_drive(specimen: Specimen, config: ChecksConfig) -> list[CheckResult]:
    """One result per joint: the share of its range, or of a turn, that it covered, the worse of both ways."""
    joints, drive = specimen.joints, config.drive
    if not joints:
        return []
    scene = build_object_scene(specimen.object, specimen.physics, ground=False, hold=True)
    model = specimen.with_dynamics(scene, specimen.limits.joints, specimen.limits.wheels)
    model.opt.gravity[:] = 0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_SPRING)
    forces = _forces(specimen, drive)
    data = scene.rest_data()
    start = data.qpos[scene.qpos].copy()
    low = np.array([j.limits[0] if math.isfinite(j.limits[0]) else q for j, q in zip(joints, start, strict=True)])
    spans = np.array([j.limits[1] - j.limits[0] if _is_limited(j) else _TURN_RAD for j in joints])
    top = _drive(model, data, scene, drive, forces, low, spans)
    high = np.where([_is_limited(j) for j in joints], low + spans, top)
    bottom = _drive(model, data, scene, drive, forces, high, -spans)
    shares = np.minimum((top - low) / spans, (high - bottom) / spans)
    notes = [
        "" if share >= drive.reach else _note(joint, force, a, b, drive)
        for joint, share, force, a, b in zip(joints, shares, forces, bottom, top, strict=True)
    ]
    return [
        at_least(NAME, joint.name, 100 * min(share, 1.0), 100 * drive.reach, "%", note)
        for joint, share, note in zip(joints, shares.tolist(), notes, strict=True)
    ]


def _is_limited(joint: Joint) -> bool:
    return all(map(math.isfinite, joint.limits))


def _forces(specimen: Specimen, drive: DriveConfig) -> np.ndarray:
    """On each joint, N or N m."""
    slides = np.array([joint.kind == "prismatic" for joint in specimen.joints])
    return np.where(specimen.rolling, drive.wheel_torque_nm, np.where(slides, drive.force_n, drive.torque_nm))


def _drive(
    model: Any,
    data: Any,
    scene: ObjectScene,
    drive: DriveConfig,
    forces: np.ndarray,
    begin: np.ndarray,
    way: np.ndarray,
) -> np.ndarray:
    """Move all joints by `way` from `begin`, until all are there or time is up; the furthest values, (J,)."""
    data.qfrc_applied[scene.dofs] = np.sign(way) * forces
    reached = np.zeros(len(way))
    for _ in range(math.ceil(drive.time_s / (model.opt.timestep * _STEPS_BETWEEN_LOOKS))):
        mujoco.mj_step(model, data, _STEPS_BETWEEN_LOOKS)
        reached = np.maximum(reached, (data.qpos[scene.qpos] - begin) / way)
        if (reached >= 0.5 * (1 + drive.reach)).all() or not np.isfinite(reached).all():
            break
    return begin + reached * way


def _note(joint: Joint, force: float, bottom: float, top: float, drive: DriveConfig) -> str:
    force_unit, unit = ("N", "m") if joint.kind == "prismatic" else ("N m", "rad")
    low, high = joint.limits
    return (
        f"{force:g} {force_unit} moved it between {bottom:.3f} and {top:.3f} {unit} only "
        f"(range {low:.3f} to {high:.3f}) in {drive.time_s:g} s each way"
    )

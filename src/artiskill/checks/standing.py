"""Watching a free object in the simulation: where its root goes, how far it leans."""

import math
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from artiskill.checks.config import DynamicsConfig
from artiskill.checks.specimen import FREE, Specimen

_STEPS_BETWEEN_LOOKS = 10
_FALLEN_RAD = math.radians(45)


@dataclass(frozen=True, eq=False)
class Course:
    """What a free root did.

    Attributes:
        moved: (3,) m, from its first place to where it was at the end.
        moved_xy_m: likewise in the plane, at most.
        tilt_rad: how far its z axis leaned at most.
    """

    moved: np.ndarray
    moved_xy_m: float
    tilt_rad: float


def free_model(specimen: Specimen, joints: DynamicsConfig = FREE, wheels: DynamicsConfig = FREE) -> Any:
    """The model of a specimen on the ground, with friction and damping in its joints; by default none."""
    return specimen.with_dynamics(specimen.scene, joints, wheels)


def watch(model: Any, data: Any, time_s: float) -> Course:
    """Step on for so long and see what the free root, which stands first in qpos, does.

    What falls over is not watched any further; a simulation that runs away counts as fallen over.
    """
    first = data.qpos[:3].copy()
    furthest_m = tilt_rad = 0.0
    for _ in range(math.ceil(time_s / (model.opt.timestep * _STEPS_BETWEEN_LOOKS))):
        mujoco.mj_step(model, data, _STEPS_BETWEEN_LOOKS)
        furthest_m = max(furthest_m, float(np.linalg.norm(data.qpos[:2] - first[:2])))
        tilt_rad = max(tilt_rad, math.pi if ran_away(data) else tilt_of(data.qpos[3:7]))
        if tilt_rad > _FALLEN_RAD:
            break
    return Course(data.qpos[:3] - first, furthest_m, tilt_rad)


def ran_away(data: Any) -> bool:
    """Whether the engine met numbers with which it cannot go on, and began anew."""
    kinds = mujoco.mjtWarning
    bad = (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC)
    return any(data.warning[int(kind)].number for kind in bad)


def tilt_of(quaternion: np.ndarray) -> float:
    """Angle between a body's z axis and the vertical."""
    _, x, y, _ = quaternion.tolist()
    return math.acos(max(-1.0, min(1.0, 1 - 2 * (x * x + y * y))))

"""`Pull`, a built handle, and the few shapes that all kinds are made of.

Builders work in one frame: the origin on the front's outer face behind the handle's middle, the room towards -x,
the handle's long side along z. `build.build_pull` brings the result to its place.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.handles import HandleGrasp, grasp_depth
from artiskill.assets.parts import IDENTITY
from artiskill.geometry.arrays import norm
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.rotations import quat_from_axis_angle

PART = "handle"
ROUND_SIDES = 12  # of drawn bars
# How far behind the face the surface lies under the lower (right) foot, the middle and the upper (left) foot.
Sinks = tuple[float, float, float]
# Fingers hook where this much room is left between the front and what they hook.
_HOOK_GAP_M = 0.012

# Turns a shape's z axis onto x.
TO_X = quat_from_axis_angle((0, 1, 0), np.pi / 2)
# Turns a shape's z axis onto -x, towards the room.
TO_ROOM = quat_from_axis_angle((0, 1, 0), -np.pi / 2)
_Y = np.array((0.0, 1.0, 0.0))


@dataclass(frozen=True, eq=False)
class Pull:
    """A built handle.

    Attributes:
        mesh: its drawn surface.
        collisions: what is touched.
        grasp: where a hand takes hold.
        hookable: whether a finger fits behind it.
        recess: the lining of the hollow that it lies in, or None.
    """

    mesh: TriMesh
    collisions: tuple[CollisionShape, ...]
    grasp: HandleGrasp
    hookable: bool
    recess: TriMesh | None = None


def capsule_between(start: Any, end: Any, radius: float) -> CollisionShape:
    """A capsule whose caps are centred on two points."""
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    length = float(norm(b - a))
    return CollisionShape("capsule", (radius, length / 2), (a + b) / 2, turn_onto((b - a) / length), part=PART)


def block(low: Any, high: Any) -> CollisionShape:
    """A box between two corners."""
    a, b = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    return CollisionShape("box", tuple(((b - a) / 2).tolist()), (a + b) / 2, IDENTITY, part=PART)


def turn_onto(direction: np.ndarray) -> np.ndarray:
    """The least rotation, (4,), of the z axis onto a unit vector."""
    axis = np.cross((0.0, 0.0, 1.0), direction)
    sine = float(norm(axis))
    if sine < 1e-9:
        return IDENTITY
    return quat_from_axis_angle(axis, math.atan2(sine, direction[2]))


def bar_grasp(projection_m: float, thickness_m: float, width_m: float) -> HandleGrasp:
    """Across the middle of something that stands so far out and is so thick (x) and so wide (y)."""
    centre = np.array((-projection_m + grasp_depth(thickness_m), 0.0, 0.0))
    return HandleGrasp(centre, _Y[None], width_m)


def is_hookable(projection_m: float, thickness_m: float) -> bool:
    """Whether a finger fits behind a part of this outermost face and thickness."""
    return projection_m - thickness_m >= _HOOK_GAP_M

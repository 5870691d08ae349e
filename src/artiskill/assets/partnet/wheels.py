"""Wheels as round shapes about their axles: a polygon of a hull would bump along instead of rolling.

A real tread is crowned: it touches the ground in a spot. A cylinder as wide as the drawn wheel would touch it
along a line and resist, with its friction, every turn of the caster; the data set's casters trail too little, 9 mm
in one that was measured, to overcome that. So the cylinder is narrow, in the middle of the drawn wheel.
"""

import numpy as np

from artiskill.assets.articulated_object import CollisionShape, Joint
from artiskill.geometry.meshes import TriMesh, convex_hull
from artiskill.geometry.rotations import quat_from_matrix

# Beyond these the drawn wheel rolls visibly out of round, and a warning says so.
ROUND_TOLERANCE_M = 0.002
TREAD_HALF_WIDTH_M = 0.003
# A ball fills pi / 6 of the box about it and a disc pi / 4: halfway, a ball as long as wide is one.
_BALL_SHARE = (np.pi / 6 + np.pi / 4) / 2
_BALL_LENGTHS = (0.85, 1.15)  # of a ball's extent along the axle, in diameters


def wheel_shape(mesh: TriMesh, joint: Joint | None, part: str) -> tuple[CollisionShape, list[str]]:
    """A cylinder or, for a ball, a sphere that a wheel rolls on; and what to warn of.

    Args:
        mesh: the wheel's drawn surface, in the link's frame.
        joint: of its link. A wheel turns about this joint's axis if it lies round about it; one that does not, on
            a link that only swivels, say, is given the axle that its shape suggests.
        part: name of the shape's part.
    """
    centre, axis, radius_m, wobble_m = _about_joint(mesh, joint) or _about_own_axle(mesh)
    warnings = []
    if wobble_m > ROUND_TOLERANCE_M:
        warnings.append(f"a wheel is out of round by {1e3 * wobble_m:.0f} mm: it rolls on its greatest radius")
    along = (mesh.vertices - centre) @ axis
    middle = centre + axis * (along.min() + along.max()) / 2
    half = float(np.ptp(along)) / 2
    box = 2 * half * (2 * radius_m) ** 2
    lengths = half / radius_m
    if (
        _BALL_LENGTHS[0] <= lengths <= _BALL_LENGTHS[1]
        and convex_hull(mesh.vertices).volume_m3 < _BALL_SHARE * box
    ):
        still = np.array((1.0, 0.0, 0.0, 0.0))
        return CollisionShape("sphere", (radius_m,), middle, still, None, part), warnings
    size = (radius_m, min(half, TREAD_HALF_WIDTH_M))
    return CollisionShape("cylinder", size, middle, _turn_z_to(axis), None, part), warnings


def _about_joint(mesh: TriMesh, joint: Joint | None) -> tuple[np.ndarray, np.ndarray, float, float] | None:
    """Centre, axle, radius and out-of-roundness about the link's joint; None where it is no axle."""
    if joint is None or joint.kind != "revolute":
        return None
    axis = np.asarray(joint.axis, dtype=float)
    radius_m, wobble_m = _roundness(mesh.vertices - joint.origin, axis)
    if wobble_m > 0.25 * radius_m:  # a swivel's axis, say, or far beside the wheel
        return None
    return np.asarray(joint.origin, dtype=float), axis, radius_m, wobble_m


def _about_own_axle(mesh: TriMesh) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Likewise from the shape alone: of its own principal axes, the one about which it is roundest."""
    hull = convex_hull(mesh.vertices).mesh.vertices
    middle = (hull.min(axis=0) + hull.max(axis=0)) / 2
    _, _, axes = np.linalg.svd(hull - hull.mean(axis=0), full_matrices=False)
    found = []
    for axis in (*axes, *np.eye(3)):
        radius_m, wobble_m = _roundness(hull - middle, axis)
        found.append((wobble_m / radius_m, radius_m, axis, wobble_m))
    _, radius_m, axis, wobble_m = min(found, key=lambda entry: round(entry[0], 3))
    return middle, axis, radius_m, wobble_m


def _roundness(points: np.ndarray, axis: np.ndarray) -> tuple[float, float]:
    """The largest distance of points from an axis, and how much less it is in the worst direction about it."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    u = np.cross(axis, helper)
    u /= np.linalg.norm(u)
    flat = np.stack((points @ u, points @ np.cross(axis, u)), axis=1)
    angles = np.linspace(0, 2 * np.pi, 72, endpoint=False)
    reach = (flat @ np.stack((np.cos(angles), np.sin(angles)))).max(axis=0)
    radius = float(np.linalg.norm(flat, axis=1).max())
    return radius, radius - float(reach.min())


def _turn_z_to(axis: np.ndarray) -> np.ndarray:
    """A quaternion (4,) that turns z to a unit vector."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x)
    return quat_from_matrix(np.stack((x, np.cross(axis, x), axis), axis=1))

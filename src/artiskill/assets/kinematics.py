"""Forward kinematics and masses of an `ArticulatedObject`, without an engine."""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape, Joint
from artiskill.errors import ConfigError
from artiskill.geometry.arrays import total
from artiskill.geometry.meshes import convex_hull
from artiskill.geometry.rotations import quat_from_axis_angle, quat_multiply, quat_rotate, transform_points


def link_poses(obj: ArticulatedObject, qpos: Sequence[float] | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the poses of all links in the object frame.

    Args:
        obj: the object.
        qpos: (J,) metres or radians, one per joint in the order of `obj.jointed_links`; limits are not enforced.

    Returns:
        Positions (L, 3) in metres and quaternions (L, 4), in the order of `obj.links`.

    Raises:
        ConfigError: another number of joint values, or one that is not finite.
    """
    jointed = obj.jointed_links
    values = np.asarray(qpos, dtype=np.float64)
    if values.shape != (len(jointed),):
        raise ConfigError(
            f"object {obj.id!r} has {len(jointed)} joints; joint values must have shape ({len(jointed)},), "
            f"not {values.shape}"
        )
    if not np.isfinite(values).all():
        raise ConfigError(f"joint values must be finite, not {values.tolist()}")
    value_of = dict(zip(jointed, values.tolist(), strict=True))
    positions, quaternions = np.zeros((len(obj.links), 3)), np.zeros((len(obj.links), 4))
    for i, link in enumerate(obj.links):
        position, quaternion = np.asarray(link.position, float), np.asarray(link.quaternion, float)
        if link.parent >= 0:
            parent_position, parent_quaternion = positions[link.parent], quaternions[link.parent]
            position = parent_position + quat_rotate(parent_quaternion, position)
            quaternion = quat_multiply(parent_quaternion, quaternion)
        if link.joint is not None:
            shift, turn = _joint_motion(link.joint, value_of[i])
            position = position + quat_rotate(quaternion, shift)
            quaternion = quat_multiply(quaternion, turn)
        positions[i], quaternions[i] = position, quaternion
    return positions, quaternions


def joint_values(obj: ArticulatedObject, fractions: float | Sequence[float] | np.ndarray) -> np.ndarray:
    """Return joint values at fractions of the joints' ranges.

    Args:
        obj: the object.
        fractions: 0 is the lower limit (closed), 1 the upper; one number for all joints, or one per joint. A joint
            that turns without end turns once from 0 to 1.

    Returns:
        (J,) metres or radians.

    Raises:
        ConfigError: another number of fractions, or one outside [0, 1].
    """
    joints = obj.joints
    shares = np.asarray(fractions, dtype=np.float64)
    if shares.ndim == 0:
        shares = np.full(len(joints), float(shares))
    if shares.shape != (len(joints),):
        raise ConfigError(
            f"object {obj.id!r} has {len(joints)} joints: give one share for all of them or {len(joints)}, "
            f"not {shares.size}"
        )
    if not ((shares >= 0) & (shares <= 1)).all():
        raise ConfigError(f"shares of the joints' ranges must lie in [0, 1], not {shares.tolist()}")
    return np.array([_at_share(joint, share) for joint, share in zip(joints, shares.tolist(), strict=True)])


def drawn_points(obj: ArticulatedObject, qpos: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the vertices of all visual meshes in the object frame, (V, 3), or its bounds' corners if it has none.

    A wall that the object hangs on is left out.
    """
    positions, quaternions = link_poses(obj, qpos)
    points = [
        transform_points(positions[i], quaternions[i], visual.mesh.vertices)
        for i in obj.own_links
        for visual in obj.links[i].visuals
        if len(visual.mesh.vertices)
    ]
    if points:
        return np.concatenate(points)
    lower, upper = np.asarray(obj.bounds, float)
    return np.array([np.where(mask, upper, lower) for mask in np.ndindex(2, 2, 2)])


def shape_volume_m3(shape: CollisionShape) -> float:
    """Return the volume of a convex shape."""
    if shape.kind == "hull":
        return convex_hull(shape.vertices).volume_m3
    if shape.kind == "box":
        return 8.0 * math.prod(shape.size)
    radius = shape.size[0]
    ball = 4.0 / 3.0 * math.pi * math.pow(radius, 3)
    if shape.kind == "sphere":
        return ball
    barrel = 2.0 * math.pi * radius**2 * shape.size[1]
    return barrel if shape.kind == "cylinder" else barrel + ball


def shapes_volume_m3(shapes: Iterable[CollisionShape]) -> float:
    """Return the sum of volumes, as the engine counts it: where shapes overlap, twice."""
    return total(shape_volume_m3(shape) for shape in shapes)


def first_moment_m4(shapes: Iterable[CollisionShape]) -> np.ndarray:
    """Return the sum of volume times centre, (3,), in the link's frame: times density, mass times centre of mass.

    A hull's centre is taken to be the mean of its corners.
    """
    moment = np.zeros(3)
    for shape in shapes:
        centre = np.asarray(shape.position, dtype=float)
        if shape.vertices is not None:
            centre = centre + quat_rotate(shape.quaternion, shape.vertices.mean(axis=0))
        moment += shape_volume_m3(shape) * centre
    return moment


def density_for_mass(mass_kg: float, shapes: Iterable[CollisionShape]) -> float:
    """Return the density at which the shapes have this mass, kg/m3, to a tenth."""
    return round(mass_kg / shapes_volume_m3(shapes), 1)


def _joint_motion(joint: Joint, value: float) -> tuple[np.ndarray, np.ndarray]:
    """Return what a joint adds to its link's pose, in the link's frame at joint value 0: shift (3,), turn (4,)."""
    axis = np.asarray(joint.axis, dtype=np.float64)
    if joint.kind == "prismatic":
        return axis * value, np.array((1.0, 0.0, 0.0, 0.0))
    turn = quat_from_axis_angle(axis, value)
    origin = np.asarray(joint.origin, dtype=np.float64)
    return origin - quat_rotate(turn, origin), turn


def _at_share(joint: Joint | None, share: float) -> float:
    assert joint is not None, "asked of jointed links only"
    lower, upper = joint.limits
    if math.isinf(lower) or math.isinf(upper):
        return 2 * math.pi * share
    return lower + share * (upper - lower)

"""Which end of a joint's range is closed, and the joint rewritten so that closed is its lower limit, 0.

The data set draws its objects closed, and most joints start at 0. Where one does not, the closed end is decided by
these rules, and a warning says so:

1. The drawn pose (0) is at one end of the range: that end is closed.
2. It is inside the range, or outside: closed is the end at which the link stands out less towards the front (-x).

Chairs and buckets do not close. What slides up and down in a chair sinks: its lowest end becomes the lower limit,
since the data set knows no gas springs. All else keeps the limits that the file gives, with the drawn pose at 0.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from artiskill.assets.articulated_object import JointKind
from artiskill.assets.partnet.bodies import Body, body_poses, transform
from artiskill.assets.partnet.urdf import UrdfJoint
from artiskill.errors import AssetError

RestRule = Literal["close", "settle", "keep"]

_UPRIGHT = 0.9  # cosine between a joint's axis and the vertical, at least, for it to slide up and down
_SMALL = 1e-6  # radians or file units: joint values that are equal
_NEARLY_RAD = 0.01  # a hinge that lacks less of a full turn has no end
_FULL_TURN_RAD = 2 * np.pi + 1e-3  # the data set rounds


@dataclass(frozen=True)
class RestJoint:
    """A joint relative to its rest pose.

    Attributes:
        kind: as in `Joint`.
        value: the file's joint value at rest.
        sign: -1 where the axis is turned round, else 1.
        limits: relative to rest, along the possibly turned axis, in file units or radians.
    """

    kind: JointKind
    value: float
    sign: int
    limits: tuple[float, float]

    @property
    def standing(self) -> float:
        """The file's joint value at `Joint.rest`: the lower limit, where there is one."""
        return self.value + (self.sign * self.limits[0] if np.isfinite(self.limits[0]) else 0.0)


def rest_joints(
    bodies: tuple[Body, ...], points: list[np.ndarray], rule: RestRule, where: str
) -> tuple[list[RestJoint | None], list[str]]:
    """The rest pose of each body's joint, None for the root, and warnings.

    Args:
        bodies: of the object.
        points: (N, 3) per body, its vertices in its frame; N may be 0.
        rule: whether joints have a closed end, let things down, or stay as they are drawn.
        where: the object, for messages.

    Raises:
        AssetError: a joint's limits are degenerate, or wider than a turn or the object's size.
    """
    size = _drawn_size(bodies, points)
    drawn_poses = body_poses(bodies, [0.0] * len(bodies))
    rest: list[RestJoint | None] = []
    warnings: list[str] = []
    for index, body in enumerate(bodies):
        if body.joint is None:
            rest.append(None)
            continue
        kind: JointKind = "prismatic" if body.joint.kind == "prismatic" else "revolute"
        lower, upper = check_limits(body.joint, size, where)
        joint = RestJoint(kind, 0.0, 1, (lower, upper))
        said: list[str] = []
        if rule == "close" and np.isinf(lower):
            warnings.append(f"joint {body.joint.name!r} of {body.name!r} turns without end: it has no closed pose")
        elif rule == "close":
            joint, said = _close(kind, lower, upper, partial(_front, bodies, points, index))
        elif rule == "settle":
            axis = drawn_poses[index][:3, :3] @ body.joint.axis
            joint, said = _settle(kind, lower, upper, float(axis[2]))
        warnings += [f"joint {body.joint.name!r} of {body.name!r}: {text}" for text in said]
        rest.append(joint)
    return rest, warnings


def check_limits(joint: UrdfJoint, size: float, where: str) -> tuple[float, float]:
    """Lower and upper limit as written; infinite for joints that turn without end.

    Args:
        joint: whose.
        size: of the object, file units; nothing slides further. The scale multiplies both sides alike.
        where: the object, for messages.

    Raises:
        AssetError: the limits are missing, equal, in the wrong order, too wide, or infinite where that is illegal.
    """
    if joint.kind == "continuous":
        return -np.inf, np.inf
    name = f"{where}: joint {joint.name!r} ({joint.kind}, moves {joint.child!r})"
    if joint.limits is None:
        raise AssetError(f"{name} has no <limit>; it must have lower < upper")
    lower, upper = joint.limits
    if joint.kind == "revolute" and lower == -np.inf and upper == np.inf:
        return lower, upper
    if not (np.isfinite(lower) and np.isfinite(upper)):
        raise AssetError(f"{name} has infinite limits ({lower:g}, {upper:g}); they must be finite")
    if upper - lower < _SMALL:
        raise AssetError(f"{name} has degenerate limits ({lower:g}, {upper:g}); lower must be less than upper")
    if joint.kind == "revolute" and upper - lower > _FULL_TURN_RAD:
        raise AssetError(
            f"{name} has limits ({lower:g}, {upper:g}), a range of {upper - lower:g} rad; at most one turn, 2 pi, "
            "is legal, and a joint without end is of type continuous"
        )
    travel = max(abs(lower), abs(upper), upper - lower)
    if joint.kind == "prismatic" and travel > size:
        raise AssetError(
            f"{name} has limits ({lower:g}, {upper:g}), a travel of {travel:g}; at most the object's own size, "
            f"its diagonal of {size:.3g}, is legal (both in the file's units, which the scale multiplies alike)"
        )
    return lower, upper


def _drawn_size(bodies: tuple[Body, ...], points: list[np.ndarray]) -> float:
    """Diagonal of the object's bounds as drawn, in file units."""
    poses = body_poses(bodies, [0.0] * len(bodies))
    world = np.concatenate([transform(pose, p) for pose, p in zip(poses, points, strict=True)])
    return float(np.linalg.norm(np.ptp(world, axis=0)))


def _close(
    kind: JointKind, lower: float, upper: float, front: Callable[[float], float]
) -> tuple[RestJoint, list[str]]:
    """The joint that rests at its closed end; `front(value)` is how far the link stands out at a joint value."""
    span = upper - lower
    limits = (0.0, span)
    if abs(lower) < _SMALL:
        return RestJoint(kind, 0.0, 1, limits), []
    given = f"limits ({lower:g}, {upper:g})"
    if abs(upper) < _SMALL:
        said = f"{given} put the drawn pose at the upper limit: it is taken as closed, the axis turned round"
        return RestJoint(kind, 0.0, -1, limits), [said]
    outside = "inside" if lower < 0 < upper else "outside"
    if front(upper) < front(lower) - _SMALL:
        said = f"{given}, drawn pose {outside} them: the upper limit, which stands out less, is taken as closed"
        return RestJoint(kind, upper, -1, limits), [said]
    said = f"{given}, drawn pose {outside} them: the lower limit, which stands out less, is taken as closed"
    return RestJoint(kind, lower, 1, limits), [said]


def _settle(kind: JointKind, lower: float, upper: float, axis_up: float) -> tuple[RestJoint, list[str]]:
    """The joint of something that only its limits hold up; `axis_up` is the vertical part of its axis."""
    as_drawn = RestJoint(kind, 0.0, 1, (lower, upper))
    given = f"limits ({lower:g}, {upper:g})"
    if np.isinf(lower):
        return as_drawn, []
    if kind == "revolute":
        if upper - lower > 2 * np.pi - _NEARLY_RAD:
            return RestJoint(kind, 0.0, 1, (-np.inf, np.inf)), [f"{given} are a full turn: it turns without end"]
        away = abs(lower) > _SMALL
        return as_drawn, [f"{given}: it rests at the lower one, not as drawn"] if away else []
    if abs(axis_up) < _UPRIGHT:
        return as_drawn, []
    lowest, sign = (lower, 1) if axis_up > 0 else (upper, -1)
    said = f"{given}: nothing holds it up, it rests at its lowest end, {abs(lowest):g} (file units) from drawn"
    return RestJoint(kind, lowest, sign, (0.0, upper - lower)), [said] if abs(lowest) > _SMALL else []


def _front(bodies: tuple[Body, ...], points: list[np.ndarray], index: int, value: float) -> float:
    """How far (file units) a body stands out towards -x with its joint at a value, all others at 0."""
    if not len(points[index]):
        return 0.0
    values = [value if i == index else 0.0 for i in range(len(bodies))]
    return float(-transform(body_poses(bodies, values)[index], points[index])[:, 0].min())

"""How an object stands: its joints at rest, its scale, and where its origin lies.

The data set draws its objects closed, and most joints start at 0. Where one does not, the closed end is decided by
these rules, and a warning says so:

1. The drawn pose (0) is at one end of the range: that end is closed.
2. It is inside the range, or outside: closed is the end at which the link stands out less towards the front (-x).

Chairs and buckets do not close. What slides up and down in a chair sinks: its lowest end becomes the lower limit,
since the data set knows no gas springs. All else keeps the limits that the file gives, with the drawn pose at 0.

Folders that are in metres already say so in `meta.json`, and are neither scaled nor moved.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from artiskill.assets.articulated_object import Category, JointKind
from artiskill.assets.partnet.part_names import read_meta
from artiskill.assets.partnet.urdf import Body, UrdfJoint, body_poses, transform
from artiskill.errors import AssetError, shown

RestRule = Literal["close", "settle", "keep"]

_UPRIGHT = 0.9  # cosine between a joint's axis and the vertical, at least, for it to slide up and down
_SMALL = 1e-6  # radians or file units: joint values that are equal
_NEARLY_RAD = 0.01  # a hinge that lacks less of a full turn has no end
_FULL_TURN_RAD = 2 * np.pi + 1e-3  # the data set rounds

KEY = "artiskill"  # of meta.json
# Scales of the first release for chairs and buckets; its cabinets lie in this range.
_FIXED_SCALE: dict[Category, float] = {"chair": 0.8, "bucket": 0.3}
_LEAST_HEIGHT = 1e-9  # of the file: something flat gets the largest scale
CABINET_SCALES = (0.28, 0.81)
# Bedside tables and sideboards stand about 0.65 m high, chests of drawers and tall cabinets 0.9 m and more.
WIDE_CABINET_HEIGHT_M, TALL_CABINET_HEIGHT_M = 0.65, 0.9
# Cabinets, chairs and buckets, in metres: what is smaller or larger has been given a wrong scale.
SMALLEST_M, LARGEST_M = 0.05, 5.0
_FOOT_SHARE = 0.08  # of the height: what lies lower is the footprint
_CIRCLE_STEPS, _CIRCLE_DIRECTIONS = 1000, 96


@dataclass(frozen=True)
class RestJoint:
    """A joint relative to its rest pose."""

    kind: JointKind  # as in `Joint`
    value: float  # the file's joint value at rest
    sign: int  # -1 where the axis is turned round, else 1
    limits: tuple[float, float]  # relative to rest, along the possibly turned axis, in file units or radians

    @property
    def rest_value(self) -> float:
        """The file's joint value at `Joint.rest`: the lower limit, if there is one."""
        return self.value + (self.sign * self.limits[0] if np.isfinite(self.limits[0]) else 0.0)


def rest_joints(
    bodies: tuple[Body, ...], points: list[np.ndarray], rule: RestRule, where: str
) -> tuple[list[RestJoint | None], list[str]]:
    """Return the rest pose of each body's joint, None for the root, and warnings.

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
    """Return lower and upper limit as written; infinite for joints that turn without end.

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
    """Return the diagonal of the object's bounds as drawn, in file units."""
    poses = body_poses(bodies, [0.0] * len(bodies))
    world = np.concatenate([transform(pose, p) for pose, p in zip(poses, points, strict=True)])
    return float(np.linalg.norm(np.ptp(world, axis=0)))


def _close(
    kind: JointKind, lower: float, upper: float, front: Callable[[float], float]
) -> tuple[RestJoint, list[str]]:
    """Return the joint at rest at its closed end; `front(value)` is how far the link stands out there."""
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
    """Return the joint of something that only its limits hold up; `axis_up` is the vertical part of its axis."""
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
    """Return how far (file units) a body stands out towards -x with its joint at a value, all others at 0."""
    if not len(points[index]):
        return 0.0
    values = [value if i == index else 0.0 for i in range(len(bodies))]
    return float(-transform(body_poses(bodies, values)[index], points[index])[:, 0].min())


@dataclass(frozen=True, eq=False)
class OwnFrame:
    """How a folder's root frame, z up, becomes the object frame: x to `scale * (x - origin)`."""

    scale: float  # metres per unit of the file
    origin: np.ndarray  # (3,) in the file's units


def read_own_frame(folder: Path) -> OwnFrame | None:
    """Read what `meta.json` has under `artiskill`: `{"scale": 1.0, "origin": [0, 0, 0]}`; None if it has nothing.

    Raises:
        AssetError: it has something else.
    """
    given = read_meta(folder).get(KEY)
    if given is None:
        return None
    found: dict[str, Any] = {"scale": 1.0, "origin": [0.0, 0.0, 0.0], **given} if isinstance(given, dict) else {}
    scale: Any = found.get("scale")
    origin: Any = found.get("origin")
    legal = len(found) == 2 and _is_number(scale) and scale > 0  # nothing but these two
    if not legal or not isinstance(origin, list) or len(origin) != 3 or not all(map(_is_number, origin)):
        raise AssetError(
            f"{folder.name}/meta.json: {KEY!r} must be a mapping with a positive number 'scale' and three numbers "
            f"'origin', not {shown(given)}"
        )
    return OwnFrame(float(scale), np.array(origin, dtype=float))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


@dataclass(frozen=True, eq=False)
class Placement:
    """x in the file's root frame becomes `scale * x + shift` in the object frame."""

    scale: float
    shift: np.ndarray

    def apply(self, point: np.ndarray) -> np.ndarray:
        """Transform a point (3,), or points (N, 3), to the object frame."""
        return point * self.scale + self.shift


def find_placement(
    category: Category, points: np.ndarray, own_frame: OwnFrame | None, scale: float | None
) -> Placement:
    """Return scale and shift of an object whose vertices (N, 3), z up and at rest, are in the file's root frame.

    The ground is its lowest point. The origin is the middle of a cabinet's bounds, and of the smallest circle
    about the footprint of a chair or bucket: the same wherever its casters or its bail point.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    if own_frame is not None:
        foot, usual = own_frame.origin, own_frame.scale
    else:
        usual = default_scale(category, high - low)
        middle = (low[:2] + high[:2]) / 2
        if category != "cabinet":
            middle = _circle_centre(points[points[:, 2] <= low[2] + _FOOT_SHARE * (high[2] - low[2]), :2])
        foot = np.append(middle, low[2])
    used = usual if scale is None else float(scale)
    return Placement(used, -used * foot)


def check_size(size_m: np.ndarray, scale: float, name: str) -> None:
    """Refuse an object whose largest extent (of x, y, z) is none that a cabinet, chair or bucket has.

    Raises:
        AssetError: with the size, the scale and where that is set.
    """
    largest_m = float(size_m.max())
    if not SMALLEST_M <= largest_m <= LARGEST_M:
        raise AssetError(
            f"{name}: at a scale of {scale:g} metres per unit of the file it measures {largest_m:.3g} m; legal: "
            f"{SMALLEST_M:g} to {LARGEST_M:g} m. The scale stands in meta.json (under {KEY!r}), or is an argument"
        )


def default_scale(category: Category, size: np.ndarray) -> float:
    """Return metres per unit of the file for an object of such size (x, y, z in file units, z up).

    Chairs 0.8 and buckets 0.3, as in the first release. A cabinet that is at least as wide (y) as high becomes
    0.65 m high, a taller one 0.9 m, but the scale stays within the first release's range, 0.28..0.81.
    """
    if category in _FIXED_SCALE:
        return _FIXED_SCALE[category]
    height_m = WIDE_CABINET_HEIGHT_M if size[1] >= size[2] else TALL_CABINET_HEIGHT_M
    return float(np.clip(height_m / max(float(size[2]), _LEAST_HEIGHT), *CABINET_SCALES))


def _circle_centre(points: np.ndarray) -> np.ndarray:
    """Return the centre (2,) of the smallest circle about points (N, 2), to a thousandth of its radius.

    By the core-set iteration of Badoiu and Clarkson (2003): ever smaller steps towards the furthest point.
    """
    angles = np.arange(_CIRCLE_DIRECTIONS) * (2 * np.pi / _CIRCLE_DIRECTIONS)
    outmost = np.argmax(points @ np.stack((np.cos(angles), np.sin(angles))), axis=0)
    points = points[np.unique(outmost)]  # inner points do not count
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    for step in range(1, _CIRCLE_STEPS):
        away = points[int(np.argmax(((points - centre) ** 2).sum(axis=1)))] - centre
        centre = centre + away / (step + 1)
    return centre

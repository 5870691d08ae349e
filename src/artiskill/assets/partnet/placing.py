"""From the file's root frame to the object frame: how large an object is, and where it stands."""

from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import Category
from artiskill.assets.partnet.own_frame import KEY, OwnFrame
from artiskill.errors import AssetError

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


@dataclass(frozen=True, eq=False)
class Placement:
    """x in the file's root frame becomes `scale * x + shift` in the object frame."""

    scale: float
    shift: np.ndarray

    def apply(self, point: np.ndarray) -> np.ndarray:
        """A point (3,), or points (N, 3), in the object frame."""
        return point * self.scale + self.shift


def find_placement(
    category: Category, points: np.ndarray, own_frame: OwnFrame | None, scale: float | None
) -> Placement:
    """Where an object goes whose vertices (N, 3), z up and at rest, are given in the file's root frame.

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
    """Metres per unit of the file for an object of such size (x, y, z in file units, z up).

    Chairs 0.8 and buckets 0.3, as in the first release. A cabinet that is at least as wide (y) as high becomes
    0.65 m high, a taller one 0.9 m, but the scale stays within the first release's range, 0.28..0.81.
    """
    if category in _FIXED_SCALE:
        return _FIXED_SCALE[category]
    height_m = WIDE_CABINET_HEIGHT_M if size[1] >= size[2] else TALL_CABINET_HEIGHT_M
    return float(np.clip(height_m / max(float(size[2]), _LEAST_HEIGHT), *CABINET_SCALES))


def _circle_centre(points: np.ndarray) -> np.ndarray:
    """Centre (2,) of the smallest circle about points (N, 2), to a thousandth of its radius.

    By the core-set iteration of Badoiu and Clarkson (2003): ever smaller steps towards the furthest point.
    """
    angles = np.arange(_CIRCLE_DIRECTIONS) * (2 * np.pi / _CIRCLE_DIRECTIONS)
    outmost = np.argmax(points @ np.stack((np.cos(angles), np.sin(angles))), axis=0)
    points = points[np.unique(outmost)]  # inner points have no say
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    for step in range(1, _CIRCLE_STEPS):
        away = points[int(np.argmax(((points - centre) ** 2).sum(axis=1)))] - centre
        centre = centre + away / (step + 1)
    return centre

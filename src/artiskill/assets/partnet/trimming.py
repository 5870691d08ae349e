"""Fronts that are drawn into the frame, set free: where collision shapes of two links overlap at rest, one is cut.

Links of one object do not collide with each other in the simulation, but a front that stands in its frame is no
object that could be built, and what grips its edge meets two links at once. Where the overlap is no deeper than a
few millimetres, the shape is cut off by the plane of the other's face that it enters least.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.partnet.collisions import hull_shape
from artiskill.assets.partnet.overlaps import moved_hull, shape_hull
from artiskill.assets.partnet.slicing import cut
from artiskill.geometry.meshes import ConvexHull, convex_hull

# What is less deep is legal to the checks; what is deeper than this would show, and is meant: a pin, a runner.
_LEGAL_M, _MOST_M = 0.0005, 0.008
_GAP_M = 0.0002  # between what was cut and what it was cut from
_LEAST_SHARE = 0.3  # of a shape's volume that must be left
_BEARINGS = ("hinge", "pin", "axle", "stem", "column", "bearing")  # as `bearing_parts` of the checks


def trim_overlaps(
    surfaces: Sequence[tuple[str, np.ndarray]], shapes: Sequence[Sequence[CollisionShape]]
) -> tuple[list[tuple[CollisionShape, ...]], list[str]]:
    """The shapes of each link, free of those of other links at rest, and what to say of it.

    Args:
        surfaces: name of each link and its frame's position (3,) in the object frame at rest; all are parallel.
        shapes: of each link, in its frame.
    """
    solids = [
        [_Solid.of(shape, position) for shape in of] for (_, position), of in zip(surfaces, shapes, strict=True)
    ]
    cuts: dict[tuple[int, int], float] = {}
    for second in range(len(solids)):
        for first in range(second):
            for i in range(len(solids[first])):
                for j in range(len(solids[second])):
                    depth = _separate(solids[first], i, solids[second], j)
                    cuts[first, second] = max(cuts.get((first, second), 0.0), depth)
    said = [
        f"collision shapes of {surfaces[second][0]!r} and {surfaces[first][0]!r} overlapped at rest: "
        f"trimmed by up to {1e3 * depth:.1f} mm"
        for (first, second), depth in cuts.items()
        if depth > 0
    ]
    return [tuple(solid.shape for solid in of) for of in solids], said


@dataclass(frozen=True, eq=False)
class _Solid:
    """A shape and its hull in the object frame."""

    shape: CollisionShape
    hull: ConvexHull
    position: np.ndarray

    @classmethod
    def of(cls, shape: CollisionShape, position: np.ndarray) -> "_Solid":
        return cls(shape, moved_hull(shape_hull(shape), position), position)

    def beyond(self, plane: np.ndarray) -> "_Solid | None":
        """What is left of it outside a plane (4,) of another hull; None where that is too little."""
        rest = cut(self.hull.mesh, plane[:3], _GAP_M - float(plane[3]))
        if rest is None:
            return None
        try:
            left = convex_hull(rest.vertices)
        except ValueError:
            return None
        if left.volume_m3 < _LEAST_SHARE * self.hull.volume_m3:
            return None
        return _Solid.of(hull_shape(left.mesh.vertices - self.position, self.shape.part), self.position)


def _separate(ones: list[_Solid], i: int, others: list[_Solid], j: int) -> float:
    """Cut one of two shapes so that they are apart, the second's rather; by how much, 0 where nothing was cut."""
    one, other = ones[i], others[j]
    if any(word in solid.shape.part.lower() for solid in (one, other) for word in _BEARINGS):
        return 0.0
    (low, high), (other_low, other_high) = one.hull.mesh.bounds, other.hull.mesh.bounds
    if (np.maximum(low, other_low) >= np.minimum(high, other_high) - _LEGAL_M).any():
        return 0.0
    of_one, of_other = _least_entered(one.hull, other.hull), _least_entered(other.hull, one.hull)
    depth = min(of_one[0], of_other[0])
    if not _LEGAL_M < depth <= _MOST_M:
        return 0.0
    if of_one[0] <= of_other[0] and (left := other.beyond(of_one[1])) is not None:
        others[j] = left
        return depth
    if of_other[0] <= _MOST_M and (left := one.beyond(of_other[1])) is not None:
        ones[i] = left
        return of_other[0]
    return 0.0


def _least_entered(hull: ConvexHull, other: ConvexHull) -> tuple[float, np.ndarray]:
    """How deep another hull lies behind that face of this one which it enters least, and the face's plane (4,)."""
    heights = hull.planes[:, :3] @ other.mesh.vertices.T + hull.planes[:, 3:]
    depths = -heights.min(axis=1)
    best = int(np.argmin(depths))
    return float(depths[best]), hull.planes[best]

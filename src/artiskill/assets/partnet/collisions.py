"""The collision shapes of an imported object: round wheels, open vessels, convex hulls of everything else.

Shapes of two links may overlap at rest, where a front is drawn into its frame. Links of one object do not collide
with each other in the simulation, but such an object could not be built, and what grips the front's edge meets two
links at once. An overlap of a few millimetres is cut off by the plane of the other shape's face that it enters
least.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from artiskill.assets.articulated_object import Category, CollisionShape, Joint, Link
from artiskill.assets.partnet.decompose import DecompositionConfig, DecompositionPart
from artiskill.assets.partnet.drawn import DrawnMesh, group_by_part
from artiskill.assets.partnet.meshes import cut
from artiskill.assets.partnet.part_names import HANDLE, WALL, WHEEL
from artiskill.assets.partnet.round_parts import wheel_shape
from artiskill.geometry.arrays import total
from artiskill.geometry.meshes import ConvexHull, TriMesh, convex_hull, depth_inside, merge, sample_surface
from artiskill.geometry.primitives import box, cylinder, sphere
from artiskill.geometry.rotations import quat_from_axis_angle, quat_to_matrix, transform_points

Decompose = Callable[[Sequence[DecompositionPart], int | None], list[list[np.ndarray]]]

# Shapes of an object at most: every one costs time in every step.
MOST_SHAPES: dict[Category, int] = {"cabinet": 80, "chair": 50, "bucket": 60}
# Times as many hulls as may stay: from where on parts get only their share, and how many these are together.
_GENEROUS, _SHARED_OUT = 4.0, 2.0
_BOX_SHARE = 0.995  # a hull that fills so much of its bounds is a box

# 4 mm where the body is concerned is less than a finger's thickness; a handle decides whether a grasp holds.
BODY_CONFIG = DecompositionConfig()
HANDLE_CONFIG = DecompositionConfig(tolerance_m=0.0015, thickness_m=0.002, max_hulls=10, resolution=50)
# A bail is a bent wire: slices follow it.
BAIL_CONFIG = DecompositionConfig(
    tolerance_m=0.003, thickness_m=0.004, max_hulls=10, resolution=50, pieces=6, slices=8
)
_VESSEL = DecompositionConfig(vessel=True, max_hulls=60)
# Chairs are pushed and pulled at their large parts: these are followed to a centimetre, within which the drawn and
# the touched surface shall agree. Nothing is gripped between two legs: there, few slices do.
_CHAIR_CONFIG = DecompositionConfig(
    tolerance_m=0.010, thickness_m=0.006, max_hulls=3, pieces=6, slices=3, slack_m=np.inf
)
_CHAIR_CONFIGS: dict[str, DecompositionConfig] = {
    "seat": replace(_CHAIR_CONFIG, max_hulls=4, slices=4),
    "back": replace(_CHAIR_CONFIG, max_hulls=6, slices=6, slack_m=0.018),
    "arm": replace(_CHAIR_CONFIG, tolerance_m=0.008, max_hulls=4, slices=4, slack_m=0.015),
    "caster": replace(_CHAIR_CONFIG, tolerance_m=0.020, thickness_m=0.004, max_hulls=1, slices=1),
    "column": replace(_CHAIR_CONFIG, tolerance_m=0.015, max_hulls=2, slices=2),
}
# Overlaps that are cut off. What is less deep is legal to the checks; what is deeper is meant: a pin, a runner.
_LEGAL_M, _MOST_M = 0.0005, 0.008
_GAP_M = 0.0002  # between what was cut and what it was cut from
_LEAST_SHARE = 0.3  # of a shape's volume that must be left
_BEARINGS = ("hinge", "pin", "axle", "stem", "column", "bearing")  # as `bearing_parts` of the checks
# Overlaps that are warned of. Sheets are made 3 mm thick: neighbours that touch in the drawing overlap by less.
DEPTH_M = 0.0035
_PROBES = 150
_FRACTIONS = (0.0, 0.1, 0.3, 0.6, 1.0)  # of the joint's range


@dataclass(frozen=True, eq=False)
class LinkSurface:
    """What the shapes of a link are made from: its drawn meshes in its frame (metres), its joint or None."""

    name: str
    drawn: Sequence[DrawnMesh]
    joint: Joint | None


def collision_shapes(
    links: Sequence[LinkSurface], category: Category, decompose: Decompose, warnings: list[str]
) -> list[tuple[CollisionShape, ...]]:
    """Return the shapes of each link, the root's first, in the link's frame; what is odd is added to `warnings`.

    `decompose` finds the hulls of all parts, of which there may be so many: `hull_cache.decompose_cached`.

    Raises:
        AssetError: a worker died.
        MissingExtraError: coacd is needed and not installed.
    """
    shapes: list[list[CollisionShape]] = [[] for _ in links]
    is_vessel = category == "bucket" and _fill_vessel(shapes, links[0], decompose, warnings)
    owners: list[tuple[int, str]] = []
    parts: list[DecompositionPart] = []
    for index, link in enumerate(links):
        for label, meshes in group_by_part(link.drawn).items():
            surfaces = tuple(mesh.mesh for mesh in meshes)
            if category == "chair" and label.part == WHEEL:
                shape, said = wheel_shape(merge(surfaces), link.joint, WHEEL)
                shapes[index].append(shape)
                warnings += [f"{link.name!r}: {text}" for text in said]
            elif not (is_vessel and index == 0):
                owner = (index, label.part)
                group = owners.index(owner) if owner in owners else len(owners)
                owners.append(owner)
                parts.append(DecompositionPart(surfaces, _config(category, label.part, label.is_handle), group))
    most = MOST_SHAPES[category] - sum(map(len, shapes))
    found = decompose(_limited(parts, most), most) if parts else []
    for (index, part), hulls in zip(owners, found, strict=True):
        shapes[index] += [hull_shape(hull, part) for hull in hulls]
    count = sum(map(len, shapes))
    if count > MOST_SHAPES[category]:
        warnings.append(f"it has {count} collision shapes, more than the {MOST_SHAPES[category]} that are quick")
    return [tuple(of) for of in shapes]


def hull_shape(points: np.ndarray, part: str) -> CollisionShape:
    """Return a hull as a shape about the middle of its bounds; a box where it fills them: the cheapest contact."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, still = (low + high) / 2, np.array((1.0, 0.0, 0.0, 0.0))
    if convex_hull(points).volume_m3 >= _BOX_SHARE * float(np.prod(high - low)):
        x, y, z = (float(v) for v in (high - low) / 2)
        return CollisionShape("box", (x, y, z), middle, still, None, part)
    return CollisionShape("hull", (), middle, still, points - middle, part)


def _fill_vessel(
    shapes: list[list[CollisionShape]], root: LinkSurface, decompose: Decompose, warnings: list[str]
) -> bool:
    """Add an open vessel's wall and floor to the root; return False, and warn, where it is none."""
    surfaces: tuple[TriMesh, ...] = tuple(mesh.mesh for mesh in root.drawn)
    (hulls,) = decompose([DecompositionPart(surfaces, _VESSEL)], None) if surfaces else ([],)
    if not hulls:
        warnings.append(
            f"the body {root.name!r} is no open vessel (no floor, a hole in its wall, or closed at the top): its "
            "collision shapes may fill the hollow or leave gaps"
        )
        return False
    shapes[0] += [hull_shape(hull, WALL) for hull in hulls[:-1]]
    shapes[0].append(hull_shape(hulls[-1], "floor"))
    return True


def _limited(parts: Sequence[DecompositionPart], most: int) -> list[DecompositionPart]:
    """Limit the hulls of each part to what it takes up of the object, where parts are very many.

    Hundreds of parts, cut into eight hulls each, would only be joined again. What is gripped keeps its own.
    """
    if sum(part.config.max_hulls for part in parts) <= _GENEROUS * most:
        return list(parts)
    sizes = [float(np.linalg.norm(np.ptp(np.concatenate([m.vertices for m in p.meshes]), axis=0))) for p in parts]
    limited = []
    for part, size in zip(parts, sizes, strict=True):
        share = math.ceil(_SHARED_OUT * most * size / max(total(sizes), 1e-9))
        config = replace(part.config, max_hulls=min(share, part.config.max_hulls))
        limited.append(part if part.config == HANDLE_CONFIG else replace(part, config=config))
    return limited


def _config(category: Category, part: str, is_handle: bool) -> DecompositionConfig:
    if category == "chair":
        return _CHAIR_CONFIGS.get(part, _CHAIR_CONFIG)
    if is_handle or part == HANDLE:
        return BAIL_CONFIG if category == "bucket" else HANDLE_CONFIG
    return BODY_CONFIG


def trim_overlaps(
    surfaces: Sequence[tuple[str, np.ndarray]], shapes: Sequence[Sequence[CollisionShape]]
) -> tuple[list[tuple[CollisionShape, ...]], list[str]]:
    """Return the shapes of each link, free of those of other links at rest, and warnings.

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
        """Return what is left of it outside a plane (4,) of another hull; None where that is too little."""
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
    """Cut one of two shapes, the second's rather, so that they are apart; return by how much, 0 for not at all."""
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
    """Return how deep another hull is behind the face of this one that it enters least, and its plane (4,)."""
    heights = hull.planes[:, :3] @ other.mesh.vertices.T + hull.planes[:, 3:]
    depths = -heights.min(axis=1)
    best = int(np.argmin(depths))
    return float(depths[best]), hull.planes[best]


def find_overlaps(links: tuple[Link, ...]) -> list[str]:
    """Return a warning for each moving link whose shapes enter its parent's by more than `DEPTH_M` somewhere."""
    found = []
    for link in links:
        if link.joint is None or not np.isfinite(link.joint.limits).all() or not link.collisions:
            continue
        parent = links[link.parent]
        others = [shape_hull(shape) for shape in parent.collisions]
        points = _probe_points(link)
        depths = [
            _deepest(others, _moved(points, link.joint, value) + link.position)
            for value in (link.joint.limits[0] + f * np.diff(link.joint.limits)[0] for f in _FRACTIONS)
        ]
        if max(depths) > DEPTH_M:
            worst = int(np.argmax(depths))
            when = "closed" if worst == 0 else f"{100 * _FRACTIONS[worst]:g} % open"
            found.append(
                f"collision shapes of {link.name!r} overlap those of {parent.name!r}: "
                f"{1e3 * depths[0]:.0f} mm closed, at most {1e3 * depths[worst]:.0f} mm ({when})"
            )
    return found


def shape_hull(shape: CollisionShape) -> ConvexHull:
    """Return the hull, in the link's frame, of a shape that this importer makes."""
    if shape.vertices is not None:
        points = shape.vertices
    elif shape.kind == "cylinder":
        points = cylinder(shape.size[0], shape.size[1]).vertices
    else:
        points = sphere(shape.size[0]).vertices if shape.kind == "sphere" else box(shape.size).vertices
    return convex_hull(transform_points(shape.position, shape.quaternion, points))


def moved_hull(hull: ConvexHull, shift: np.ndarray) -> ConvexHull:
    """Return a hull moved by a vector (3,)."""
    offsets = hull.planes[:, 3] - hull.planes[:, :3] @ shift
    planes = np.column_stack((hull.planes[:, :3], offsets))
    return ConvexHull(hull.mesh.transformed(shift), planes, hull.volume_m3)


def _probe_points(link: Link) -> np.ndarray:
    rng = np.random.default_rng(0)
    meshes = [shape_hull(shape).mesh for shape in link.collisions]
    return np.concatenate([np.concatenate((m.vertices, sample_surface([m], _PROBES, rng))) for m in meshes])


def _moved(points: np.ndarray, joint: Joint, value: float) -> np.ndarray:
    """Return points of the link's frame when the joint has moved, relative to the link's rest position."""
    if joint.kind == "prismatic":
        return points + joint.axis * value
    rotation = quat_to_matrix(quat_from_axis_angle(joint.axis, value))
    return (points - joint.origin) @ rotation.T + joint.origin


def _deepest(hulls: list[ConvexHull], points: np.ndarray) -> float:
    return max((float(depth_inside(hull.planes, points).max()) for hull in hulls), default=0.0)

"""The collision shapes of an imported object: round wheels, hollow vessels, convex hulls of everything else."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from artiskill.assets.articulated_object import Category, CollisionShape, Joint
from artiskill.assets.partnet.decompose import DecompositionConfig, DecompositionPart
from artiskill.assets.partnet.drawn import DrawnMesh, group_by_part
from artiskill.assets.partnet.part_names import HANDLE, WALL, WHEEL
from artiskill.assets.partnet.wheels import wheel_shape
from artiskill.geometry.arrays import total
from artiskill.geometry.meshes import TriMesh, convex_hull, merge

Decompose = Callable[[Sequence[DecompositionPart], int | None], list[list[np.ndarray]]]

# Shapes of an object at most: every one costs time in every step.
MOST_SHAPES: dict[Category, int] = {"cabinet": 80, "chair": 50, "bucket": 60}
# Times as many hulls as may stay: from where on parts get only their share, and how many these are together.
_GENEROUS, _SHARED_OUT = 4.0, 2.0
_BOX_SHARE = 0.995  # a hull that fills so much of its bounds is a box

# 4 mm where the body is concerned is less than a finger's thickness; a handle decides whether a grip holds.
BODY = DecompositionConfig()
GRIP = DecompositionConfig(tolerance_m=0.0015, thickness_m=0.002, max_hulls=10, resolution=50)
# A bail is a bent wire: slices follow it.
BAIL = DecompositionConfig(tolerance_m=0.003, thickness_m=0.004, max_hulls=10, resolution=50, pieces=6, slices=8)
_VESSEL = DecompositionConfig(vessel=True, max_hulls=60)
# Chairs are pushed and pulled at their large parts: these are followed to a centimetre, within which the drawn and
# the touched surface shall agree. Nothing is gripped between two legs: there, few slices do.
_CHAIR_DEFAULT = DecompositionConfig(
    tolerance_m=0.010, thickness_m=0.006, max_hulls=3, pieces=6, slices=3, slack_m=np.inf
)
_CHAIR: dict[str, DecompositionConfig] = {
    "seat": replace(_CHAIR_DEFAULT, max_hulls=4, slices=4),
    "back": replace(_CHAIR_DEFAULT, max_hulls=6, slices=6, slack_m=0.018),
    "arm": replace(_CHAIR_DEFAULT, tolerance_m=0.008, max_hulls=4, slices=4, slack_m=0.015),
    "caster": replace(_CHAIR_DEFAULT, tolerance_m=0.020, thickness_m=0.004, max_hulls=1, slices=1),
    "column": replace(_CHAIR_DEFAULT, tolerance_m=0.015, max_hulls=2, slices=2),
}


@dataclass(frozen=True, eq=False)
class LinkSurface:
    """What the shapes of a link are made from: its drawn meshes in its frame (metres), its joint or None."""

    name: str
    drawn: Sequence[DrawnMesh]
    joint: Joint | None


def collision_shapes(
    links: Sequence[LinkSurface],
    category: Category,
    decompose: Decompose,
    warnings: list[str],
) -> list[tuple[CollisionShape, ...]]:
    """The shapes of each link, in its frame.

    Args:
        links: of the object, the root first.
        category: of the object.
        decompose: finds the hulls of all parts, of which there may be so many: `hull_cache.decompose_cached`.
        warnings: added to, where shapes are not what one would expect.

    Raises:
        AssetError: a worker ended by itself.
        MissingExtraError: coacd is needed and not installed.
    """
    shapes: list[list[CollisionShape]] = [[] for _ in links]
    hollow = _fill_vessel(shapes, links[0], decompose, warnings) if category == "bucket" else False
    owners: list[tuple[int, str]] = []
    parts: list[DecompositionPart] = []
    for index, link in enumerate(links):
        for label, meshes in group_by_part(list(link.drawn)).items():
            surfaces = tuple(mesh.mesh for mesh in meshes)
            if category == "chair" and label.part == WHEEL:
                shape, said = wheel_shape(merge(surfaces), link.joint, WHEEL)
                shapes[index].append(shape)
                warnings += [f"{link.name!r}: {text}" for text in said]
            elif not (hollow and index == 0):
                owner = (index, label.part)
                group = owners.index(owner) if owner in owners else len(owners)
                owners.append(owner)
                parts.append(DecompositionPart(surfaces, _config(category, label.part, label.is_handle), group))
    room = MOST_SHAPES[category] - sum(map(len, shapes))
    found = decompose(_shared_out(parts, room), room) if parts else []
    for (index, part), hulls in zip(owners, found, strict=True):
        shapes[index] += [hull_shape(hull, part) for hull in hulls]
    count = sum(map(len, shapes))
    if count > MOST_SHAPES[category]:
        warnings.append(f"it has {count} collision shapes, more than the {MOST_SHAPES[category]} that are quick")
    return [tuple(of) for of in shapes]


def hull_shape(points: np.ndarray, part: str) -> CollisionShape:
    """A hull as a shape about the middle of its bounds; a box where it fills them: MuJoCo's cheapest contact."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, still = (low + high) / 2, np.array((1.0, 0.0, 0.0, 0.0))
    if convex_hull(points).volume_m3 >= _BOX_SHARE * float(np.prod(high - low)):
        x, y, z = (float(v) for v in (high - low) / 2)
        return CollisionShape("box", (x, y, z), middle, still, None, part)
    return CollisionShape("hull", (), middle, still, points - middle, part)


def _fill_vessel(
    shapes: list[list[CollisionShape]], root: LinkSurface, decompose: Decompose, warnings: list[str]
) -> bool:
    """Give the root a hollow body; False where it is no open vessel, which is warned of."""
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


def _shared_out(parts: Sequence[DecompositionPart], room: int) -> list[DecompositionPart]:
    """Parts of which each may have only so many hulls as it takes up of the object, where they are very many.

    Hundreds of parts, cut into eight hulls each, would only be joined again. What is gripped keeps its own.
    """
    if sum(part.config.max_hulls for part in parts) <= _GENEROUS * room:
        return list(parts)
    sizes = [float(np.linalg.norm(np.ptp(np.concatenate([m.vertices for m in p.meshes]), axis=0))) for p in parts]
    most = [math.ceil(_SHARED_OUT * room * size / max(total(sizes), 1e-9)) for size in sizes]
    return [
        part if part.config == GRIP else replace(part, config=_with_most(part.config, number))
        for part, number in zip(parts, most, strict=True)
    ]


def _with_most(config: DecompositionConfig, hulls: int) -> DecompositionConfig:
    return replace(config, max_hulls=min(hulls, config.max_hulls))


def _config(category: Category, part: str, is_handle: bool) -> DecompositionConfig:
    if category == "chair":
        return _CHAIR.get(part, _CHAIR_DEFAULT)
    if is_handle or part == HANDLE:
        return BAIL if category == "bucket" else GRIP
    return BODY

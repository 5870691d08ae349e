"""How similar two objects are: the mean distance between their surfaces, closed and half open.

Shape alone counts, not colour, and no wall that an object hangs on. Both objects are put with the middle of their
footprint at the origin, standing on the ground. A few hundred points, spread by area over each object's visual
meshes, are measured to the nearest point of the other's. The distance of the two objects is the mean over all
these points, at rest and with every joint half open. Duplicates are less than 1 mm apart, not 0, as the search is
not quite exact.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Category
from artiskill.assets.kinematics import joint_values, link_poses
from artiskill.config import check_positive
from artiskill.geometry.arrays import total
from artiskill.geometry.meshes import TriMesh, merge
from artiskill.geometry.surfaces import Surface, make_surface

# Two objects of a category that are nearer than this are near duplicates: some 2 % of a typical size.
NEAR_DUPLICATE_M: dict[Category, float] = {"cabinet": 0.015, "chair": 0.01, "bucket": 0.005}
# the half-open copy stands this far aside, so that one search serves both states
_ASIDE_M = 100.0
_OPEN = 0.5
# near samples whose triangles are looked at: at first, and properly
_COARSE_CANDIDATES, _CANDIDATES = 1, 6
# The search for the nearest neighbour: so many points of each object at first, both ways; then properly those
# whose coarse distance is below so many times the best proper one. Over all pairs of the catalogue the coarse
# distance of near objects is 0.7 to 1.4 times the proper one, so that none is missed.
_COARSE_POINTS = 60
_LOOKED_AT = 1.4

_Measure = Callable[["Descriptor", "Descriptor"], float]


@dataclass(frozen=True)
class DescriptorConfig:
    """How finely surfaces are compared."""

    points: int = 200  # per object and state, measured to the other object
    dense: int = 8000  # per object and state, to find the triangles that are near

    def __post_init__(self) -> None:
        check_positive(self, "points", "dense")


@dataclass(frozen=True, eq=False)
class Descriptor:
    """What is kept of an object to compare it with others."""

    id: str  # the object's
    category: Category  # the object's
    joints: tuple[str, ...]  # kinds of its joints, in their order
    points: np.ndarray  # (2 * points, 3) on both states' surfaces
    surface: Surface  # both states' drawn surfaces, searchable


@dataclass(frozen=True)
class Neighbour:
    """The most similar one of several other objects."""

    id: str  # of the object
    nearest: str  # id of its nearest neighbour
    distance_m: float  # of their surfaces
    same_joints: bool  # whether both have the same kinds of joints in the same order


def describe(obj: ArticulatedObject, config: DescriptorConfig | None = None) -> Descriptor:
    """Return the descriptor of an object; the same object always gives the same one."""
    config = config or DescriptorConfig()
    rng = np.random.default_rng(0)  # fixed: the points are a property of the object
    centre = np.append(np.asarray(obj.bounds)[:, :2].mean(axis=0), 0.0)
    states = [_visual_mesh(obj, obj.rest_qpos), _visual_mesh(obj, joint_values(obj, _OPEN))]
    states = [state.transformed(-centre + (k * _ASIDE_M, 0, 0)) for k, state in enumerate(states)]
    points = np.concatenate([make_surface(state, config.points, rng).samples for state in states])
    whole = make_surface(merge(states), 2 * config.dense, rng)
    kinds = tuple(joint.kind for joint in obj.joints)
    return Descriptor(obj.id, obj.category, kinds, points, whole)


def distance(first: Descriptor, second: Descriptor) -> float:
    """Return the mean distance of two surfaces in metres, both ways and over both states; symmetric."""
    return (_one_way(first.points, second) + _one_way(second.points, first)) / 2


def nearest_neighbour(one: Descriptor, others: Iterable[Descriptor]) -> Neighbour | None:
    """Return the most similar of several objects of the same category, None if there is none.

    All are compared coarsely, and those that may be the nearest properly. Of equally near objects, one with the
    same joints counts as nearer.
    """
    group = [o for o in others if o.category == one.category and o.id != one.id]
    return _nearest(one, group, _rough, distance) if group else None


def nearest_neighbours(descriptors: Sequence[Descriptor]) -> tuple[Neighbour, ...]:
    """Return each object's nearest neighbour, in order; objects alone in their category are left out."""
    rough, proper = _memoised(_rough), _memoised(distance)
    groups = [[o for o in descriptors if o.category == one.category and o is not one] for one in descriptors]
    return tuple(_nearest(one, g, rough, proper) for one, g in zip(descriptors, groups, strict=True) if g)


def _memoised(measure: _Measure) -> _Measure:
    """Return a symmetric measure that is computed once for each pair."""
    known: dict[frozenset[str], float] = {}

    def memoised(first: Descriptor, second: Descriptor) -> float:
        pair = frozenset((first.id, second.id))
        if pair not in known:
            known[pair] = measure(first, second)
        return known[pair]

    return memoised


def _nearest(one: Descriptor, group: Sequence[Descriptor], rough: _Measure, proper: _Measure) -> Neighbour:
    coarse = [rough(one, other) for other in group]
    best: tuple[float, bool, int] | None = None
    for k in sorted(range(len(group)), key=coarse.__getitem__):
        if best is not None and coarse[k] > _LOOKED_AT * best[0]:
            break
        found = (proper(one, group[k]), one.joints != group[k].joints, k)
        best = found if best is None else min(best, found)
    assert best is not None, "only asked with a group"
    length, other_joints, k = best
    return Neighbour(one.id, group[k].id, length, not other_joints)


def _rough(first: Descriptor, second: Descriptor) -> float:
    """Estimate the distance cheaply."""
    ways = ((first, second), (second, first))
    return (
        total(_one_way(a.points[:: len(a.points) // _COARSE_POINTS or 1], b, _COARSE_CANDIDATES) for a, b in ways)
        / 2
    )


def _one_way(points: np.ndarray, target: Descriptor, candidates: int = _CANDIDATES) -> float:
    return float(target.surface.distances(points, candidates).mean())


def _visual_mesh(obj: ArticulatedObject, qpos: np.ndarray) -> TriMesh:
    """Merge all visual meshes of the object, without a wall that it hangs on, in its frame."""
    positions, quaternions = link_poses(obj, qpos)
    return merge(
        visual.mesh.transformed(positions[i], quaternions[i])
        for i in obj.own_links
        for visual in obj.links[i].visuals
    )

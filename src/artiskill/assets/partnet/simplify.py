"""Fewer triangles for the same surface: fast-simplification, its result checked against the surface itself.

The library collapses edges where that moves the surface least (Garland and Heckbert, SIGGRAPH 1997), but never
touches needles, so that it stops early at boards and mouldings, which consist of them. For these the mesh is
stretched to a cube, and where that is not enough, near vertices are made one first.
"""

from typing import Any

import numpy as np

from artiskill.assets.partnet.meshes import distance_to_surface, weld
from artiskill.errors import MissingExtraError
from artiskill.geometry.meshes import TriMesh, sample_surface

_PROBES = 400
_NEAR_SHARE = 0.98
_LIGHT_FACES = (600, 1_200, 2_400, 4_800, 9_600)  # tried one after the other
_WORTH_IT = 1.5  # times as many faces: fewer cost less than it takes to try
_CELL_SHARE = 0.5  # of the tolerance, within which vertices become one
NEARLY = 1.05  # times as many faces as wanted are few enough
_ROUGHLY = 6.0  # times as many, at most, are collapsed; more become fewer cell by cell first
_LEAST_SHARE = 0.02  # of a mesh's largest extent: no direction is stretched more than this makes it
_FINEST, _COARSER = 2.0**-10, 1.5  # of a mesh's size: the first cells in which vertices become one, and the next


def lighten(mesh: TriMesh, tolerance_m: float) -> TriMesh:
    """The lightest of some simplified meshes that lies within a tolerance of a welded mesh, or that mesh itself.

    Args:
        mesh: its vertices welded.
        tolerance_m: of 98 % of either surface to the other.
    """
    if len(mesh.faces) <= _LIGHT_FACES[0] * _WORTH_IT:
        return mesh
    start = cluster(mesh, _CELL_SHARE * tolerance_m)
    for count in _LIGHT_FACES:
        if len(mesh.faces) <= count * _WORTH_IT:
            break
        light = weld(_collapse(start, count))
        if 0 < len(light.faces) < len(mesh.faces) / _WORTH_IT and _agree(mesh, light, tolerance_m):
            return light
    return mesh


def collapse(mesh: TriMesh, faces: int) -> TriMesh:
    """A mesh of about so many faces; it has no uvs.

    Raises:
        MissingExtraError: fast-simplification is not installed.
    """
    found, cell = mesh, _FINEST * float(np.ptp(mesh.bounds, axis=0).max())
    while len(found.faces) > NEARLY * faces and cell > 0:
        if len(mesh.faces) <= _ROUGHLY * faces:  # of more, the library takes seconds
            found = _collapse(mesh, faces)
        mesh = cluster(mesh, cell)
        cell *= _COARSER
    return found


def cluster(mesh: TriMesh, cell_m: float) -> TriMesh:
    """All vertices of a cubic cell made one, that which is nearest to their middle; flat faces are gone."""
    cells = np.round((mesh.vertices - mesh.bounds[0]) / cell_m).astype(np.int64)
    _, index, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    index = index.reshape(-1)
    middles = np.stack([np.bincount(index, mesh.vertices[:, k]) for k in range(3)], axis=1) / counts[:, None]
    away = np.sum((mesh.vertices - middles[index]) ** 2, axis=1)
    order = np.lexsort((away, index))
    first = order[np.searchsorted(index[order], np.arange(len(counts)))]
    faces = index[mesh.faces]
    solid = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    _, once = np.unique(np.sort(faces[solid], axis=1), axis=0, return_index=True)
    return TriMesh(mesh.vertices[first], faces[solid][np.sort(once)])


def _collapse(mesh: TriMesh, faces: int) -> TriMesh:
    """What the library makes of a mesh as it is, and, where that is too much, of it stretched to a cube."""
    if len(mesh.faces) <= faces:
        return TriMesh(mesh.vertices, mesh.faces)
    low, high = mesh.bounds
    middle, largest = (low + high) / 2, float((high - low).max())
    # single precision inside: about the mesh's own middle and size, a speck is as good as a house
    for sizes in (np.full(3, largest), np.maximum(high - low, _LEAST_SHARE * largest)):
        share = max(1 - faces / len(mesh.faces), 0.0)
        points, left = _library().simplify((mesh.vertices - middle) / sizes, mesh.faces, target_reduction=share)
        mesh = TriMesh(np.asarray(points, dtype=np.float64) * sizes + middle, left)
        if len(mesh.faces) <= NEARLY * faces:
            break
    return mesh


def _agree(mesh: TriMesh, light: TriMesh, tolerance_m: float) -> bool:
    """Whether nearly all of either surface lies near the other."""
    for one, other in ((mesh, light), (light, mesh)):
        probes = sample_surface([one], _PROBES, np.random.default_rng(0))
        if np.mean(distance_to_surface(probes, other) <= tolerance_m) < _NEAR_SHARE:
            return False
    return True


def _library() -> Any:
    try:
        import fast_simplification
    except ImportError as error:
        raise MissingExtraError("the PartNet-Mobility importer", "import") from error
    return fast_simplification

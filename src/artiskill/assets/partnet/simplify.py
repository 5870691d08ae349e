"""Fewer triangles for the same surface: fast-simplification, its result checked against the surface itself."""

from typing import Any

import numpy as np

from artiskill.assets.partnet.meshes import distance_to_surface, weld
from artiskill.errors import MissingExtraError
from artiskill.geometry.meshes import TriMesh, sample_surface

_PROBES = 400
_NEAR_SHARE = 0.98
_LIGHT_FACES = (600, 1_200, 2_400, 4_800, 9_600)  # tried one after the other
_WORTH_IT = 1.5  # times as many faces: fewer cost less than it takes to try
_COLLAPSE_AT_MOST = 0.9999  # the library wants a share below 1


def lighten(mesh: TriMesh, tolerance_m: float) -> TriMesh:
    """The lightest of some simplified meshes that lies within a tolerance of a welded mesh, or that mesh itself.

    Args:
        mesh: its vertices welded.
        tolerance_m: of 98 % of either surface to the other.
    """
    for count in _LIGHT_FACES:
        if len(mesh.faces) <= count * _WORTH_IT:
            return mesh
        light = weld(collapse(mesh, count))
        if len(light.faces) and _near(mesh, light, tolerance_m) and _near(light, mesh, tolerance_m):
            return light
    return mesh


def collapse(mesh: TriMesh, faces: int) -> TriMesh:
    """A mesh of about so many faces, edges collapsed where that moves the surface least; it has no uvs.

    Raises:
        MissingExtraError: fast-simplification is not installed.
    """
    if len(mesh.faces) <= faces:
        return TriMesh(mesh.vertices, mesh.faces)
    share = min(1 - faces / len(mesh.faces), _COLLAPSE_AT_MOST)
    # single precision inside: about the mesh's own middle and size, a speck is as good as a house
    low, high = mesh.bounds
    middle, size = (low + high) / 2, float(np.ptp(mesh.bounds, axis=0).max()) or 1.0
    points, triangles = _library().simplify((mesh.vertices - middle) / size, mesh.faces, target_reduction=share)
    return TriMesh(np.asarray(points, dtype=np.float64) * size + middle, triangles)


def _near(mesh: TriMesh, other: TriMesh, tolerance_m: float) -> bool:
    """Whether nearly all of a mesh's surface lies near another's."""
    probes = sample_surface([mesh], _PROBES, np.random.default_rng(0))
    return float(np.mean(distance_to_surface(probes, other) <= tolerance_m)) >= _NEAR_SHARE


def _library() -> Any:
    try:
        import fast_simplification
    except ImportError as error:
        raise MissingExtraError("the PartNet-Mobility importer", "import") from error
    return fast_simplification

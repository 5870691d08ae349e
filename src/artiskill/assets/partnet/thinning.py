"""Drawn surfaces of very many triangles made lighter: a renderer's time goes with their number.

Each drawn mesh gets a share of the object's triangles that goes with the root of how many it has, so that boards of
a dozen keep theirs and carvings give theirs up. Edges are collapsed where that moves the surface least; texture
coordinates are read anew off the nearest triangle of the surface as it was.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from artiskill.assets.articulated_object import Category, Link, VisualMesh
from artiskill.assets.partnet.meshes import weld
from artiskill.assets.partnet.simplify import NEARLY, collapse
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.surfaces import make_surface

MOST_TRIANGLES: dict[Category, int] = {"cabinet": 15_000, "chair": 15_000, "bucket": 6_000}
_LEAST_TRIANGLES = 12  # of a mesh: a box
_SAMPLES_PER_FACE, _CANDIDATES = 4, 6
_WELD_SHARE = 1e-6  # of a mesh's size: vertices so near are one


def thin_out(links: tuple[Link, ...], category: Category) -> tuple[tuple[Link, ...], list[str]]:
    """The links with at most so many drawn triangles as their category is quick with, and what to say of it."""
    counts = [len(visual.mesh.faces) for link in links for visual in link.visuals]
    most = MOST_TRIANGLES[category]
    if sum(counts) <= most:
        return links, []
    shares = iter(share_out(counts, int(most / NEARLY)))
    thinned = tuple(
        replace(link, visuals=tuple(_thinned(v, next(shares)) for v in link.visuals)) for link in links
    )
    left = sum(len(visual.mesh.faces) for link in thinned for visual in link.visuals)
    return thinned, [f"drawn with {left:,} triangles of {sum(counts):,}: more than {most:,} are slow to draw"]


def share_out(counts: Sequence[int], most: int) -> list[int]:
    """How many triangles each mesh keeps, of so many together; a mesh that needs less than its share keeps all."""
    kept = np.array(counts)
    weights = np.sqrt(kept)
    free, room = np.ones(len(kept), dtype=bool), most
    while free.any():
        share = np.maximum(room * weights / weights[free].sum(), _LEAST_TRIANGLES)
        small = free & (kept <= share)
        if not small.any():
            kept[free] = share[free]
            break
        free &= ~small
        room = max(most - int(kept[~free].sum()), 0)
    return [int(count) for count in kept]


def _thinned(visual: VisualMesh, faces: int) -> VisualMesh:
    mesh = visual.mesh
    if len(mesh.faces) <= faces:
        return visual
    size = float(np.ptp(mesh.bounds, axis=0).max())
    light = collapse(weld(TriMesh(mesh.vertices, mesh.faces), _WELD_SHARE * size), faces)
    if not len(light.faces):
        return visual
    return replace(visual, mesh=light if mesh.uvs is None else _with_uvs(light, mesh))


def _with_uvs(light: TriMesh, drawn: TriMesh) -> TriMesh:
    """The light mesh with texture coordinates: each face has those of the plane of the drawn face that is nearest."""
    assert drawn.uvs is not None
    surface = make_surface(drawn, _SAMPLES_PER_FACE * len(drawn.faces), np.random.default_rng(0))
    corners = light.vertices[light.faces]  # (F, 3, 3)
    near = cKDTree(surface.samples).query(corners.mean(axis=1), k=_CANDIDATES)[1]
    candidates = surface.faces[near]  # (F, k)
    facing = np.einsum("fi,fki->fk", _normals(corners), _normals(surface.corners)[candidates])
    chosen = candidates[np.arange(len(candidates)), np.argmax(np.round(facing, 3), axis=1)]
    a, b, c = (surface.corners[chosen, k][:, None] for k in range(3))
    u, v = b - a, c - a
    uu, uv, vv = (np.sum(x * y, axis=2) for x, y in ((u, u), (u, v), (v, v)))
    off = corners - a
    ou, ov = np.sum(off * u, axis=2), np.sum(off * v, axis=2)
    area = np.maximum(uu * vv - uv * uv, 1e-30)
    second, third = (vv * ou - uv * ov) / area, (uu * ov - uv * ou) / area  # (F, 3) weights of b and c
    of_face = drawn.uvs.astype(np.float64)[drawn.faces[chosen]]  # (F, 3, 2)
    first = 1 - second - third
    found = np.einsum("fck,fki->fci", np.stack((first, second, third), axis=2), of_face).reshape(-1, 2)
    keys = np.column_stack((light.faces.reshape(-1), np.round(found, 5)))
    _, at, index = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    vertices = light.vertices[light.faces.reshape(-1)[at]]
    return TriMesh(vertices, index.reshape(-1, 3), found[at].astype(np.float32))


def _normals(corners: np.ndarray) -> np.ndarray:
    """Unit normals of triangles (F, 3, 3)."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)

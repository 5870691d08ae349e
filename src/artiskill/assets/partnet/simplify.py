"""Fewer triangles for the same surface: for decomposition, and for drawing, whose time goes with their number.

fast-simplification collapses edges where that moves the surface least (Garland and Heckbert, SIGGRAPH 1997), but
never touches needles, so that it stops early at boards and mouldings, which consist of them. For these the mesh is
stretched to a cube, and where that is not enough, near vertices are made one first.

Of what is drawn, each mesh gets a share of the object's triangles that goes with the root of how many it has:
boards of a dozen keep theirs, carvings give theirs up. Then each face that is left looks for the nearest face of
the original surface that shows the same way, and takes its material and its texture coordinates. The data set
draws many surfaces twice, one material for either side: such meshes are simplified together and stay opposite
sides.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from artiskill.assets.articulated_object import Category, Link, VisualMesh
from artiskill.assets.partnet.meshes import connected_labels, distance_to_surface, weld
from artiskill.errors import MissingExtraError
from artiskill.geometry.meshes import TriMesh, merge, sample_surface
from artiskill.geometry.normals import face_normals
from artiskill.geometry.surfaces import make_surface, point_triangle_distance

_PROBES = 400
_NEAR_SHARE = 0.98
_LIGHT_FACES = (600, 1_200, 2_400, 4_800, 9_600)  # tried one after the other
_WORTH_IT = 1.5  # times as many faces: fewer cost less than it takes to try
_CELL_SHARE = 0.5  # of the tolerance, within which vertices become one
NEARLY = 1.05  # times as many faces as wanted are few enough
_ROUGHLY = 6.0  # times as many, at most, are collapsed; more become fewer cell by cell first
_LEAST_SHARE = 0.02  # of a mesh's largest extent: no direction is stretched more than this makes it
_FINEST, _COARSER = 2.0**-10, 1.5  # of a mesh's size: the first cells in which vertices become one, and the next


MOST_TRIANGLES: dict[Category, int] = {"cabinet": 15_000, "chair": 15_000, "bucket": 6_000}
_LEAST_TRIANGLES = 12  # of a mesh: a box
_SAMPLES_PER_FACE = 4
_WELD_SHARE = 1e-6  # of a mesh's size: vertices so near are one
_TURN_SHARE = 0.05  # of a mesh's size: a face that shows another way is taken for so much further off
_UV_STEP = 1e-5  # texture coordinates so near are one


def lighten(mesh: TriMesh, tolerance_m: float) -> TriMesh:
    """Return the lightest of some simplified meshes within a tolerance of a welded mesh, or that mesh itself.

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
    """Return a mesh of about so many faces; it has no uvs.

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
    """Make all vertices of a cubic cell one, that which is nearest to their middle; drop faces without area."""
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
    """Collapse edges of a mesh as it is, and, where that leaves too many faces, of it stretched to a cube."""
    if len(mesh.faces) <= faces:
        return TriMesh(mesh.vertices, mesh.faces)
    try:
        from fast_simplification import simplify
    except ImportError as error:
        raise MissingExtraError("the PartNet-Mobility importer", "import") from error
    low, high = mesh.bounds
    middle, largest = (low + high) / 2, float((high - low).max())
    # single precision inside: about the mesh's own middle and size, a tiny mesh is as exact as a large one
    for sizes in (np.full(3, largest), np.maximum(high - low, _LEAST_SHARE * largest)):
        share = max(1 - faces / len(mesh.faces), 0.0)
        points, left = simplify((mesh.vertices - middle) / sizes, mesh.faces, target_reduction=share)
        mesh = TriMesh(np.asarray(points, dtype=np.float64) * sizes + middle, left)
        if len(mesh.faces) <= NEARLY * faces:
            break
    return mesh


def _agree(mesh: TriMesh, light: TriMesh, tolerance_m: float) -> bool:
    """Return whether nearly all of either surface lies near the other."""
    for one, other in ((mesh, light), (light, mesh)):
        probes = sample_surface([one], _PROBES, np.random.default_rng(0))
        if np.mean(distance_to_surface(probes, other) <= tolerance_m) < _NEAR_SHARE:
            return False
    return True


def thin_out(links: tuple[Link, ...], category: Category) -> tuple[tuple[Link, ...], list[str]]:
    """Return the links with at most so many drawn triangles as their category is quick with, and warnings."""
    counts = [len(visual.mesh.faces) for link in links for visual in link.visuals]
    most = MOST_TRIANGLES[category]
    if sum(counts) <= most:
        return links, []
    shares = iter(share_out(counts, int(most / NEARLY)))
    thinned = tuple(
        replace(link, visuals=_thinned(link.visuals, [next(shares) for _ in link.visuals])) for link in links
    )
    left = sum(len(visual.mesh.faces) for link in thinned for visual in link.visuals)
    return thinned, [f"drawn with {left:,} triangles of {sum(counts):,}: more than {most:,} are slow to draw"]


def share_out(counts: Sequence[int], most: int) -> list[int]:
    """Return how many of so many triangles each mesh keeps; a mesh that needs less than its share keeps all."""
    kept = np.array(counts)
    weights = np.sqrt(kept)
    free, left = np.ones(len(kept), dtype=bool), most
    while free.any():
        share = np.maximum(left * weights / weights[free].sum(), _LEAST_TRIANGLES)
        small = free & (kept <= share)
        if not small.any():
            kept[free] = share[free]
            break
        free &= ~small
        left = max(most - int(kept[~free].sum()), 0)
    return [int(count) for count in kept]


def _thinned(visuals: tuple[VisualMesh, ...], shares: Sequence[int]) -> tuple[VisualMesh, ...]:
    """Return the drawn meshes of a link, in their order, each with about so many faces as its share."""
    found: dict[int, VisualMesh] = {}
    for group in _groups(visuals):
        kept = sum(shares[k] for k in group)
        if sum(len(visuals[k].mesh.faces) for k in group) <= kept:
            found.update({k: visuals[k] for k in group})
        else:
            found.update(_lighter([(k, visuals[k]) for k in group], kept))
    return tuple(found[k] for k in sorted(found))


def _groups(visuals: Sequence[VisualMesh]) -> list[list[int]]:
    """Group the numbers of meshes that have faces in common."""
    if not visuals:
        return []
    whole = merge(TriMesh(v.mesh.vertices, v.mesh.faces) for v in visuals)
    owner = np.repeat(np.arange(len(visuals)), [len(v.mesh.faces) for v in visuals])
    first, second = (owner[faces] for faces in _same_faces(whole))
    labels = connected_labels(np.stack((first, second), axis=1), len(visuals))
    return [np.flatnonzero(labels == label).tolist() for label in np.unique(labels)]


def _same_faces(mesh: TriMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of faces with the same corners, whichever way round."""
    cells = np.round(mesh.vertices / _weld_m(mesh)).astype(np.int64)
    places = np.unique(cells, axis=0, return_inverse=True)[1].reshape(-1)
    number = np.unique(np.sort(places[mesh.faces], axis=1), axis=0, return_inverse=True)[1].reshape(-1)
    order = np.argsort(number, kind="stable")
    same = number[order][1:] == number[order][:-1]
    return order[:-1][same], order[1:][same]


def _weld_m(mesh: TriMesh) -> float:
    return _WELD_SHARE * float(np.ptp(mesh.bounds, axis=0).max()) or _WELD_SHARE


def _lighter(group: Sequence[tuple[int, VisualMesh]], faces: int) -> Iterator[tuple[int, VisualMesh]]:
    """Yield the meshes of a group, numbered, with so many faces together, without those of which none is left."""
    drawn = merge(TriMesh(v.mesh.vertices, v.mesh.faces) for _, v in group)
    welded = weld(drawn, _weld_m(drawn))
    light = collapse(welded, int(faces * len(welded.faces) / len(drawn.faces)))
    if not len(light.faces):
        yield from group
        return
    source = _Source.of(group, drawn)
    sides = source.sides(light)
    for k, (number, visual) in enumerate(group):
        parts = [TriMesh(light.vertices, turned[source.owner[at] == k]) for turned, at in sides]
        at = np.concatenate([at[source.owner[at] == k] for _, at in sides])
        mesh = merge(parts)
        if len(mesh.faces):
            yield number, replace(visual, mesh=source.with_uvs(mesh, at) if visual.mesh.uvs is not None else mesh)


@dataclass(frozen=True, eq=False)
class _Source:
    """A surface before it is simplified."""

    mesh: TriMesh  # its triangles
    normals: np.ndarray  # (F, 3) of them
    owner: np.ndarray  # (F,) which mesh of the group each is from
    uvs: np.ndarray  # (V, 2) texture coordinates; 0 where there are none
    other_side: np.ndarray  # (F,) the face that lies back to back with each; -1 where there is none

    @classmethod
    def of(cls, group: Sequence[tuple[int, VisualMesh]], drawn: TriMesh) -> "_Source":
        meshes = [visual.mesh for _, visual in group]
        uvs = [np.zeros((len(m.vertices), 2)) if m.uvs is None else m.uvs.astype(float) for m in meshes]
        owner = np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes])
        normals, other_side = face_normals(drawn), np.full(len(drawn.faces), -1)
        first, second = _same_faces(drawn)
        opposite = np.sum(normals[first] * normals[second], axis=1) < 0
        first, second = first[opposite], second[opposite]
        other_side[first], other_side[second] = second, first
        return cls(drawn, normals, owner, np.concatenate(uvs), other_side)

    def sides(self, light: TriMesh) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return faces (K, 3) that are drawn, and the face of the source (K,) that each is like."""
        surface = make_surface(self.mesh, _SAMPLES_PER_FACE * len(self.mesh.faces), np.random.default_rng(0))
        size = float(np.ptp(self.mesh.bounds, axis=0).max())
        turn_m = _TURN_SHARE * size
        tree = cKDTree(np.column_stack((surface.samples, turn_m * self.normals[surface.faces])))
        middles, normals = light.vertices[light.faces].mean(axis=1), face_normals(light)
        like, off = [], []  # of a face as it is and turned over: the source's face, how far off it is
        for side in (1.0, -1.0):
            like.append(surface.faces[tree.query(np.column_stack((middles, side * turn_m * normals)))[1]])
            away = point_triangle_distance(middles, surface.corners[like[-1]])
            turned = side * np.sum(normals * self.normals[like[-1]], axis=1) <= 0
            off.append(np.where(turned, away + size, away))
        is_front = off[0] <= off[1]
        chosen = np.where(is_front, *like)
        faces = np.where(is_front[:, None], light.faces, light.faces[:, ::-1])
        others = self.other_side[chosen]
        return [(faces, chosen), (faces[others >= 0][:, ::-1], others[others >= 0])]

    def with_uvs(self, mesh: TriMesh, at: np.ndarray) -> TriMesh:
        """Add texture coordinates to a mesh: those of the plane of source face `at` (F,) for each of its faces."""
        a, b, c = (self.mesh.vertices[self.mesh.faces[at, k]][:, None] for k in range(3))
        u, v, off = b - a, c - a, mesh.vertices[mesh.faces] - a
        uu, uv, vv, ou, ov = (np.sum(x * y, axis=2) for x, y in ((u, u), (u, v), (v, v), (off, u), (off, v)))
        area = np.maximum(uu * vv - uv * uv, 1e-30)
        second, third = (vv * ou - uv * ov) / area, (uu * ov - uv * ou) / area  # (F, 3) weights of b and c
        weights = np.stack((1 - second - third, second, third), axis=2)
        found = np.einsum("fck,fki->fci", weights, self.uvs[self.mesh.faces[at]]).reshape(-1, 2)
        keys = np.column_stack((mesh.faces.reshape(-1), np.round(found / _UV_STEP)))
        _, first, index = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        vertices = mesh.vertices[mesh.faces.reshape(-1)[first]]
        return TriMesh(vertices, index.reshape(-1, 3), found[first].astype(np.float32))

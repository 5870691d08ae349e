"""Triangle meshes and convex hulls: the values, areas, samples of surfaces, depths inside a hull."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from artiskill.geometry.arrays import Array, amax, dot, matmul, namespace, norm
from artiskill.geometry.rotations import quat_to_matrix


@dataclass(frozen=True, eq=False)
class TriMesh:
    """A triangle mesh; counter-clockwise faces look outwards.

    Attributes:
        vertices: (V, 3) float64, metres.
        faces: (F, 3) int32 indices into the vertices.
        uvs: (V, 2) float32 texture coordinates, or None.
    """

    vertices: np.ndarray
    faces: np.ndarray
    uvs: np.ndarray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", np.ascontiguousarray(self.vertices, dtype=np.float64))
        object.__setattr__(self, "faces", np.ascontiguousarray(self.faces, dtype=np.int32))
        assert self.vertices.ndim == 2
        assert self.vertices.shape[1] == 3
        assert self.faces.ndim == 2
        assert self.faces.shape[1] == 3
        assert self.uvs is None or self.uvs.shape == (len(self.vertices), 2)

    @property
    def bounds(self) -> np.ndarray:
        """Smallest and largest corner, (2, 3)."""
        return np.stack((self.vertices.min(axis=0), self.vertices.max(axis=0)))

    def transformed(self, position: Any = (0, 0, 0), quaternion: Any = (1, 0, 0, 0)) -> "TriMesh":
        """The mesh rotated, then moved."""
        rotation = quat_to_matrix(np.asarray(quaternion, dtype=float))
        return TriMesh(matmul(self.vertices, rotation.T) + np.asarray(position, dtype=float), self.faces, self.uvs)

    def scaled(self, factor: Any) -> "TriMesh":
        """The mesh scaled about its origin by a number or three; mirrored faces are turned back outwards."""
        factors = np.broadcast_to(np.asarray(factor, dtype=float), (3,))
        faces = self.faces[:, ::-1] if np.prod(factors) < 0 else self.faces
        return TriMesh(self.vertices * factors, faces, self.uvs)


def merge(meshes: Iterable[TriMesh]) -> TriMesh:
    """One mesh of all; texture coordinates are kept only where every part has them."""
    parts = list(meshes)
    assert parts, "nothing to merge"
    offsets = np.cumsum([0] + [len(m.vertices) for m in parts[:-1]])
    uvs = [m.uvs for m in parts if m.uvs is not None]
    return TriMesh(
        np.concatenate([m.vertices for m in parts]),
        np.concatenate([m.faces + o for m, o in zip(parts, offsets, strict=True)]),
        np.concatenate(uvs) if len(uvs) == len(parts) else None,
    )


def triangle_areas(mesh: TriMesh) -> np.ndarray:
    """Area of each face, (F,)."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return 0.5 * norm(np.cross(b - a, c - a))


def sample_surface(meshes: Sequence[TriMesh], count: int, rng: np.random.Generator) -> np.ndarray:
    """Points spread uniformly by area over the surfaces of several meshes. -> (count, 3)."""
    mesh = meshes[0] if len(meshes) == 1 else merge(meshes)
    areas = triangle_areas(mesh)
    chosen = rng.choice(len(areas), size=count, p=areas / areas.sum())
    u, v = rng.random((2, count))
    flip = u + v > 1
    u, v = np.where(flip, 1 - u, u), np.where(flip, 1 - v, v)
    a, b, c = (mesh.vertices[mesh.faces[chosen, i]] for i in range(3))
    return a + u[:, None] * (b - a) + v[:, None] * (c - a)


@dataclass(frozen=True, eq=False)
class ConvexHull:
    """A convex hull as a mesh and as the planes that bound it.

    Attributes:
        mesh: the hull's surface, faces outwards.
        planes: (P, 4) outward unit normal and offset: inside where normal . x + offset <= 0.
        volume_m3: enclosed volume.
    """

    mesh: TriMesh
    planes: np.ndarray
    volume_m3: float


def convex_hull(points: Any) -> ConvexHull:
    """The convex hull of a point cloud (N, 3) that spans a volume.

    Raises:
        ValueError: fewer than four points, or all (nearly) in one plane.
    """
    from scipy.spatial import ConvexHull as Qhull
    from scipy.spatial import QhullError

    points = np.asarray(points, dtype=float)
    try:
        hull = Qhull(points)
    except (QhullError, ValueError) as error:
        raise ValueError(f"no convex hull: {len(points)} points that do not span a volume") from error
    used, faces = np.unique(hull.simplices, return_inverse=True)
    vertices, faces = points[used], faces.reshape(-1, 3)
    normals = np.cross(
        vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]]
    )
    inward = dot(normals, hull.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    # triangles of one flat face share their plane: keep it once
    planes = np.unique(np.round(hull.equations, 9), axis=0)
    return ConvexHull(TriMesh(vertices, faces), planes, float(hull.volume))


def depth_inside(planes: Array, points: Array) -> Array:
    """Signed distance to a convex hull's nearest bounding plane, positive inside.

    Exact inside; outside it is a lower bound of the distance (exact where the nearest point lies on a face).

    Args:
        planes: (..., P, 4) as in `ConvexHull.planes`.
        points: (..., N, 3) in the same frame.

    Returns:
        (..., N) metres.
    """
    xp = namespace(planes, points)
    heights = matmul(points, xp.matrix_transpose(planes[..., :3])) + planes[..., None, :, 3]
    return -amax(heights)

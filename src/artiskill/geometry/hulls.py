"""Convex hulls: faces for drawing, planes for signed distances."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from artiskill.geometry.arrays import Array, amax, dot, namespace
from artiskill.geometry.exact import matmul
from artiskill.geometry.meshes import TriMesh


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

"""Kernels that draw a scene as a light at infinity sees it: no perspective, no near plane, no culling."""

from artiskill.geometry.kernel import Array, kernel
from artiskill.sensors.scan_conversion import point, scan_convert


@kernel
def transform_vertices(
    vertices: Array, vertex_pose: Array, rotations: Array, positions: Array, world: Array
) -> None:
    """Body-frame vertices to the world."""
    for i in range(vertices.shape[0]):
        p = vertex_pose[i]
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        for k in range(3):
            world[i, k] = (
                rotations[p, k, 0] * x + rotations[p, k, 1] * y + rotations[p, k, 2] * z + positions[p, k]
            )


@kernel
def project_affine(world: Array, matrix: Array, projected: Array) -> None:
    """World vertices through a (3, 4) matrix to screen x, y and a positive height."""
    for i in range(world.shape[0]):
        for k in range(3):
            projected[i, k] = (
                matrix[k, 0] * world[i, 0] + matrix[k, 1] * world[i, 1] + matrix[k, 2] * world[i, 2] + matrix[k, 3]
            )


@kernel
def draw_heights(projected: Array, faces: Array, heights: Array, triangle: Array) -> None:
    """Draw all triangles, whichever side they show, keeping the greatest height (S, S) and its triangle."""
    for t in range(faces.shape[0]):
        a, b, c = point(projected, faces[t, 0]), point(projected, faces[t, 1]), point(projected, faces[t, 2])
        scan_convert(a, b, c, t, True, heights, triangle)

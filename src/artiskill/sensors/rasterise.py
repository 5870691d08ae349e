"""Kernels from body poses to a buffer of inverse depths and a buffer of triangle ids.

Conventions: screen x to the right, y down, in pixels, pixel (row, column) centred at (column + 0.5, row + 0.5).
`w` is what the depth test compares, greater is nearer: the inverse depth of a perspective camera, the height
towards the sun of a shadow map. Both are linear over the screen. Geometry is float64, buffers are float32.
"""

import numpy as np

from artiskill.geometry.kernel import Array, Point, kernel

NOTHING = -1
FLOOR = -2
# square pixels: a sliver this thin covers no pixel centre worth having, and its depth gradient is noise
_MIN_AREA_PX = 1e-6
# beyond this a vertex is so far off the screen that differences of coordinates lose all digits
_MAX_AREA_PX = 1e18


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
def project_perspective(world: Array, position: Array, rotation: Array, lens: Array, projected: Array) -> None:
    """World vertices to screen x, y and inverse depth; w = 0 marks a vertex before the near plane."""
    focal, centre_x, centre_y, near = lens[0], lens[1], lens[2], lens[3]
    for i in range(world.shape[0]):
        x, y, z = world[i, 0] - position[0], world[i, 1] - position[1], world[i, 2] - position[2]
        depth = -(rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z)
        if depth >= near:
            w = 1.0 / depth
            projected[i, 0] = centre_x + focal * w * (rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z)
            projected[i, 1] = centre_y - focal * w * (rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z)
            projected[i, 2] = w
        else:
            projected[i, 0] = 0.0
            projected[i, 1] = 0.0
            projected[i, 2] = 0.0


@kernel
def project_affine(world: Array, matrix: Array, projected: Array) -> None:
    """World vertices through a (3, 4) matrix to screen x, y and a positive height: an orthographic view."""
    for i in range(world.shape[0]):
        for k in range(3):
            projected[i, k] = (
                matrix[k, 0] * world[i, 0] + matrix[k, 1] * world[i, 1] + matrix[k, 2] * world[i, 2] + matrix[k, 3]
            )


@kernel
def fill_background(
    position: Array, rotation: Array, lens: Array, has_floor: bool, inverse_depth: Array, triangle: Array
) -> None:
    """Clear both buffers, with the floor z = 0 drawn analytically: its inverse depth is linear over the screen."""
    focal, centre_x, centre_y, near, far = lens[0], lens[1], lens[2], lens[3], lens[4]
    farthest, nearest = np.float32(1.0 / far), np.float32(1.0 / near)
    scale = 0.0  # from below the floor is not seen
    if has_floor and position[2] > 0.0:
        scale = 1.0 / (position[2] * focal)
    dw_dx, dw_dy = -rotation[2, 0] * scale, rotation[2, 1] * scale
    w_corner = (0.5 - centre_x) * dw_dx + (0.5 - centre_y) * dw_dy + rotation[2, 2] * focal * scale
    for row in range(inverse_depth.shape[0]):
        w_row = w_corner + row * dw_dy
        for column in range(inverse_depth.shape[1]):
            w = np.float32(w_row + column * dw_dx)
            on_floor = farthest < w <= nearest
            inverse_depth[row, column] = w if on_floor else farthest
            triangle[row, column] = FLOOR if on_floor else NOTHING


@kernel
def rasterise(
    world: Array,
    projected: Array,
    faces: Array,
    two_sided: Array,
    cull: bool,
    position: Array,
    rotation: Array,
    lens: Array,
    inverse_depth: Array,
    triangle: Array,
) -> None:
    """Draw all triangles into the buffers: near clipping, back-face culling, scan conversion with depth test.

    Args:
        world: (V, 3) vertices.
        projected: (V, 3) their screen x, y and w; w = 0 where a vertex lies before the near plane.
        faces: (F, 3).
        two_sided: (F,) faces that are drawn from behind too.
        cull: whether back faces of the others are left out.
        position: (3,) of the camera; like the next two read for clipping only, never where all w are positive.
        rotation: (3, 3) of the camera.
        lens: (5,) as from `Camera.lens`.
        inverse_depth: (H, W) float32 buffer.
        triangle: (H, W) int32 buffer.
    """
    for t in range(faces.shape[0]):
        a, b, c = point(projected, faces[t, 0]), point(projected, faces[t, 1]), point(projected, faces[t, 2])
        ahead = int(a[2] > 0.0) + int(b[2] > 0.0) + int(c[2] > 0.0)
        both = two_sided[t] or not cull
        if ahead == 3:
            scan_convert(a, b, c, t, both, inverse_depth, triangle)
        elif ahead > 0:
            clipped = clip_near(world, faces[t], position, rotation, lens)
            for k in range(2, clipped.shape[0]):
                a, b, c = point(clipped, 0), point(clipped, k - 1), point(clipped, k)
                scan_convert(a, b, c, t, both, inverse_depth, triangle)


@kernel
def point(table: Array, i: int) -> Point:
    """Row i of an (N, 3) table as a tuple: registers, no reference counts."""
    return table[i, 0], table[i, 1], table[i, 2]


@kernel
def clip_near(world: Array, face: Array, position: Array, rotation: Array, lens: Array) -> Array:
    """The part of a triangle beyond the near plane (Sutherland and Hodgman 1974), projected. -> (3 or 4, 3)."""
    near = lens[3]
    camera = np.empty((3, 3))
    for i in range(3):
        for k in range(3):
            camera[i, k] = 0.0
            for j in range(3):
                camera[i, k] += rotation[j, k] * (world[face[i], j] - position[j])
        camera[i, 2] = -camera[i, 2]
    clipped = np.empty((4, 3))
    count = 0
    for i in range(3):
        j = (i + 1) % 3
        if camera[i, 2] >= near:
            clipped[count] = camera[i]
            count += 1
        if (camera[i, 2] >= near) != (camera[j, 2] >= near):
            # always from the same end, so that two triangles cut their common edge at the same point
            low, high = (i, j) if camera[i, 2] < camera[j, 2] else (j, i)
            s = (near - camera[low, 2]) / (camera[high, 2] - camera[low, 2])
            for k in range(3):
                clipped[count, k] = camera[low, k] + s * (camera[high, k] - camera[low, k])
            count += 1
    for i in range(count):
        w = 1.0 / max(clipped[i, 2], near)
        clipped[i, 0] = lens[1] + lens[0] * w * clipped[i, 0]
        clipped[i, 1] = lens[2] - lens[0] * w * clipped[i, 1]
        clipped[i, 2] = w
    return clipped[:count]


@kernel
def scan_convert(
    a: Point, b: Point, c: Point, t: int, two_sided: bool, inverse_depth: Array, triangle: Array
) -> None:
    """Draw one projected triangle, unless it shows its back, has no area or misses the screen."""
    area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])  # y points down: negative in front
    if not (_MIN_AREA_PX < abs(area) < _MAX_AREA_PX) or (area > 0.0 and not two_sided):
        return  # written so that NaN ends here too
    if max(a[0], b[0], c[0]) < 0.0 or min(a[0], b[0], c[0]) > inverse_depth.shape[1]:
        return
    dw_dx = ((b[2] - a[2]) * (c[1] - a[1]) - (c[2] - a[2]) * (b[1] - a[1])) / area
    dw_dy = ((c[2] - a[2]) * (b[0] - a[0]) - (b[2] - a[2]) * (c[0] - a[0])) / area
    w_corner = a[2] + (0.5 - a[0]) * dw_dx + (0.5 - a[1]) * dw_dy
    if b[1] < a[1]:
        a, b = b, a
    if c[1] < a[1]:
        a, c = c, a
    if c[1] < b[1]:
        b, c = c, b
    fill_rows(a, b, c, (w_corner, dw_dx, dw_dy), t, inverse_depth, triangle)


@kernel
def fill_rows(
    top: Point, middle: Point, bottom: Point, plane: Point, t: int, inverse_depth: Array, triangle: Array
) -> None:
    """The pixels whose centres lie in a triangle or on its edges, with depth test.

    Each edge is evaluated from its upper end by one formula, so that triangles with a common edge leave no pixel
    between them. `plane` is w at the centre of the first pixel and its growth per column and per row.
    """
    height, width = inverse_depth.shape
    first_row = clamp_index(np.ceil(top[1] - 0.5), 0, height)
    last_row = clamp_index(np.floor(bottom[1] - 0.5), -1, height - 1)
    long_slope, upper_slope, lower_slope = slope(top, bottom), slope(top, middle), slope(middle, bottom)
    for row in range(first_row, last_row + 1):
        y = row + 0.5
        x_long = top[0] + (y - top[1]) * long_slope
        if y < middle[1]:
            x_short = top[0] + (y - top[1]) * upper_slope
        else:
            x_short = middle[0] + (y - middle[1]) * lower_slope
        first = clamp_index(np.ceil(min(x_long, x_short) - 0.5), 0, width)
        last = clamp_index(np.floor(max(x_long, x_short) - 0.5), -1, width - 1)
        w = plane[0] + first * plane[1] + row * plane[2]
        for column in range(first, last + 1):
            w32 = np.float32(w)
            if w32 > inverse_depth[row, column]:
                inverse_depth[row, column] = w32
                triangle[row, column] = t
            w += plane[1]


@kernel
def slope(upper: Point, lower: Point) -> float:
    """Change of x per row along an edge; 0 for a level edge, which is never followed."""
    drop = lower[1] - upper[1]
    return (lower[0] - upper[0]) / drop if drop > 0.0 else 0.0


@kernel
def clamp_index(value: float, low: int, high: int) -> int:
    """A float to an integer in [low, high]: compared as a float, since out of range, or NaN, it has no integer."""
    if not value > low:
        return low
    return high if value >= high else int(value)

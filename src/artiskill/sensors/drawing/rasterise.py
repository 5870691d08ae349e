"""Kernels from body poses and a camera to a buffer of inverse depths and a buffer of triangle ids.

Conventions: screen x to the right, y down, in pixels, pixel (row, column) centred at (column + 0.5, row + 0.5).
`w` is what the depth test compares, greater is nearer: the inverse depth of a perspective camera, the height
towards the sun of a shadow map. Both are linear over the screen. Geometry is float64, buffers are float32.
"""

import math

import numpy as np

from artiskill.geometry.kernel import Array, Point, kernel
from artiskill.sensors.camera import View
from artiskill.sensors.drawing.backdrop import Box, fill_box, find_backdrop
from artiskill.sensors.drawing.buffers import Scratch, ViewBuffers
from artiskill.sensors.drawing.scene_tables import Poses, SceneTables
from artiskill.sensors.drawing.simd import LANES, clamp_index, draw_simd, fill

# of the distances involved: a face counts as seen from behind only where float32 leaves no doubt
_BEHIND = 1e-5
# square pixels: a sliver this thin covers no pixel centre worth having, and its depth gradient is noise
_MIN_AREA_PX = 1e-6
# beyond this a vertex is so far off the screen that differences of coordinates lose all digits
_MAX_AREA_PX = 1e18
# pixels: what lies this close to a pixel's centre may by rounding count as on it
_EDGE_PX = 1e-6

# x and y on the screen
Pixel = tuple[float, float]
# rows of the affine map from a body's frame to a camera's: factors of x, y, z and the constant
Row = tuple[float, float, float, float]


@kernel
def draw_view(
    scene: SceneTables, pose: Poses, view: View, has_floor: bool, buffers: ViewBuffers, scratch: Scratch
) -> None:
    """Draw all visuals into the buffers of a view, which hold values only where something may be drawn.

    Visuals out of view and faces seen from behind are left out. `buffers.camera` keeps the vertices of the others.
    """
    inverse_depth, triangle, drawn, camera = buffers.inverse_depth, buffers.triangle, buffers.drawn, buffers.camera
    positions, rotations = pose.positions, pose.rotations
    projected, candidates, clipped = scratch.projected, scratch.candidates, scratch.clipped
    height, width = inverse_depth.shape
    whole = (0.0, float(width), 0.0, float(height))
    backdrop = find_backdrop(view, has_floor, buffers)
    fill(drawn.reshape(-1), 0)
    for g in range(scene.geom_body.shape[0]):
        k = scene.geom_body[g] + 1
        rows = body_to_camera(positions, rotations, k, view)
        if out_of_view(scene.geom_spheres, g, rows, view.lens):
            continue
        first, last = scene.geom_vertices[g], scene.geom_vertices[g + 1]
        box, farthest, nearest = place_vertices(
            scene.vertices[first:last], rows, view.lens, camera[first:last], projected[first:last]
        )
        if nearest == 0.0:
            continue
        first, last, sphere = scene.geom_faces[g], scene.geom_faces[g + 1], scene.geom_spheres[g]
        count = list_front_faces(scene.planes, first, last, sphere, pose, k, view.position, candidates)
        if count > 0:
            fill_box(backdrop, box if farthest > 0.0 else whole, inverse_depth, triangle, drawn)
        for i in range(count):
            t = candidates[i]
            face = (scene.faces[t, 0], scene.faces[t, 1], scene.faces[t, 2])
            a, b, c = point(projected, face[0]), point(projected, face[1]), point(projected, face[2])
            if a[2] > 0.0 and b[2] > 0.0 and c[2] > 0.0:
                if covers_centres(a, b, c, scene.two_sided[t], height, width):
                    fill_rows(downwards(a, b, c), depth_plane(a, b, c), t, inverse_depth, triangle)
            elif a[2] > 0.0 or b[2] > 0.0 or c[2] > 0.0:
                for n in range(2, clip_near(camera, face, view.lens, clipped)):
                    a, b, c = point(clipped, 0), point(clipped, n - 1), point(clipped, n)
                    scan_convert(a, b, c, t, scene.two_sided[t], inverse_depth, triangle)


@kernel
def body_to_camera(positions: Array, rotations: Array, pose: int, view: View) -> tuple[Row, Row, Row]:
    """Return the map from a body's frame to right, up and depth of a camera."""
    eye, axes = view.position, view.rotation
    d = (positions[pose, 0] - eye[0], positions[pose, 1] - eye[1], positions[pose, 2] - eye[2])
    return (
        _row((axes[0, 0], axes[1, 0], axes[2, 0]), rotations, pose, d),
        _row((axes[0, 1], axes[1, 1], axes[2, 1]), rotations, pose, d),
        _row((-axes[0, 2], -axes[1, 2], -axes[2, 2]), rotations, pose, d),
    )


@kernel
def _row(axis: Point, r: Array, pose: int, d: Point) -> Row:
    x, y, z = axis
    return (
        x * r[pose, 0, 0] + y * r[pose, 1, 0] + z * r[pose, 2, 0],
        x * r[pose, 0, 1] + y * r[pose, 1, 1] + z * r[pose, 2, 1],
        x * r[pose, 0, 2] + y * r[pose, 1, 2] + z * r[pose, 2, 2],
        x * d[0] + y * d[1] + z * d[2],
    )


@kernel
def mapped(row: Row, x: float, y: float, z: float) -> float:
    """Return one coordinate of an affine map."""
    return row[0] * x + row[1] * y + row[2] * z + row[3]


@kernel
def out_of_view(spheres: Array, g: int, rows: tuple[Row, Row, Row], lens: Array) -> bool:
    """Return whether sphere g lies wholly outside one of the six planes that bound what a camera sees."""
    centre, radius = point(spheres, g), spheres[g, 3]
    x = mapped(rows[0], centre[0], centre[1], centre[2])
    y = mapped(rows[1], centre[0], centre[1], centre[2])
    depth = mapped(rows[2], centre[0], centre[1], centre[2])
    if depth + radius < lens[3] or depth - radius > lens[4]:
        return True
    # the tangent of half the angle of view; the image's centre is its middle
    across, along = lens[1] / lens[0], lens[2] / lens[0]
    return (
        abs(x) - across * depth > radius * math.sqrt(1.0 + across * across)
        or abs(y) - along * depth > radius * math.sqrt(1.0 + along * along)
    )  # fmt: skip


@kernel
def place_vertices(
    vertices: Array, rows: tuple[Row, Row, Row], lens: Array, camera: Array, projected: Array
) -> tuple[Box, float, float]:
    """Map body-frame vertices to right, up, depth (camera) and to screen x, y, inverse depth (projected).

    An inverse depth of 0 marks a vertex before the near plane.

    Returns:
        The box on the screen that holds all vertices, and their least and greatest inverse depth.
    """
    focal, centre_x, centre_y, near = lens[0], lens[1], lens[2], lens[3]
    left, right_most, top, bottom = np.inf, -np.inf, np.inf, -np.inf
    farthest, nearest = np.inf, 0.0
    for i in range(vertices.shape[0]):
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        right, up, depth = mapped(rows[0], x, y, z), mapped(rows[1], x, y, z), mapped(rows[2], x, y, z)
        w = 1.0 / depth if depth >= near else 0.0
        camera[i, 0], camera[i, 1], camera[i, 2] = right, up, depth
        column, row = centre_x + focal * w * right, centre_y - focal * w * up
        projected[i, 0], projected[i, 1], projected[i, 2] = column, row, w
        left, right_most = lesser(column, left), greater(column, right_most)
        top, bottom = lesser(row, top), greater(row, bottom)
        farthest, nearest = lesser(w, farthest), greater(w, nearest)
    return (left, right_most, top, bottom), farthest, nearest


@kernel
def lesser(value: float, bound: float) -> float:
    """Return the lesser of both; the bound where the value is no number."""
    return value if value < bound else bound


@kernel
def greater(value: float, bound: float) -> float:
    """Return the greater of both; the bound where the value is no number."""
    return value if value > bound else bound


@kernel
def list_front_faces(
    planes: Array, first: int, last: int, sphere: Array, pose: Poses, k: int, eye: Array, candidates: Array
) -> int:
    """List the faces first .. last - 1 that may show their front; return how many.

    Asked in the frame of body k, before anything is projected, and in single precision with a margin: what is left
    is decided on the screen.
    """
    position, rotation = pose.positions[k], pose.rotations[k]
    d = (eye[0] - position[0], eye[1] - position[1], eye[2] - position[2])
    x = rotation[0, 0] * d[0] + rotation[1, 0] * d[1] + rotation[2, 0] * d[2]
    y = rotation[0, 1] * d[0] + rotation[1, 1] * d[1] + rotation[2, 1] * d[2]
    z = rotation[0, 2] * d[0] + rotation[1, 2] * d[1] + rotation[2, 2] * d[2]
    reach = abs(x) + abs(y) + abs(z) + abs(sphere[0]) + abs(sphere[1]) + abs(sphere[2]) + sphere[3]
    margin = np.float32(-_BEHIND * reach)
    eye_x, eye_y, eye_z = np.float32(x), np.float32(y), np.float32(z)
    count = 0
    for t in range(first, last):
        ahead = planes[0, t] * eye_x + planes[1, t] * eye_y + planes[2, t] * eye_z - planes[3, t]
        candidates[count] = t
        count += 0 if ahead < margin else 1  # no branch: which way it goes cannot be foreseen
    return count


@kernel
def clip_near(camera: Array, face: tuple[int, int, int], lens: Array, clipped: Array) -> int:
    """Clip a triangle at the near plane (Sutherland and Hodgman 1974) and project it; return how many corners."""
    near = lens[3]
    count = 0
    for i in range(3):
        start, end = face[i], face[(i + 1) % 3]
        if camera[start, 2] >= near:
            # numbers only: to assign a row, Numba would compile half a second of error messages
            for k in range(3):
                clipped[count, k] = camera[start, k]
            count += 1
        if (camera[start, 2] >= near) != (camera[end, 2] >= near):
            # always from the same end, so that two triangles cut their common edge at the same point
            low, high = (start, end) if camera[start, 2] < camera[end, 2] else (end, start)
            s = (near - camera[low, 2]) / (camera[high, 2] - camera[low, 2])
            for k in range(3):
                clipped[count, k] = camera[low, k] + s * (camera[high, k] - camera[low, k])
            count += 1
    for i in range(count):
        w = 1.0 / max(clipped[i, 2], near)
        clipped[i, 0] = lens[1] + lens[0] * w * clipped[i, 0]
        clipped[i, 1] = lens[2] - lens[0] * w * clipped[i, 1]
        clipped[i, 2] = w
    return count


@kernel
def point(table: Array, i: int) -> Point:
    """Return row i of an (N, 3) table as a tuple: registers, no reference counts."""
    return table[i, 0], table[i, 1], table[i, 2]


@kernel
def scan_convert(
    a: Point, b: Point, c: Point, t: int, two_sided: bool, inverse_depth: Array, triangle: Array
) -> None:
    """Draw one projected triangle, unless it shows its back, has no area or covers no pixel's centre."""
    height, width = inverse_depth.shape
    if covers_centres(a, b, c, two_sided, height, width):
        fill_rows(downwards(a, b, c), depth_plane(a, b, c), t, inverse_depth, triangle)


@kernel
def depth_plane(a: Point, b: Point, c: Point) -> Point:
    """Return a triangle's w at the centre of the first pixel, and its growth per column and per row."""
    inverse = 1.0 / screen_area(a, b, c)
    dw_dx = ((b[2] - a[2]) * (c[1] - a[1]) - (c[2] - a[2]) * (b[1] - a[1])) * inverse
    dw_dy = ((c[2] - a[2]) * (b[0] - a[0]) - (b[2] - a[2]) * (c[0] - a[0])) * inverse
    return a[2] + (0.5 - a[0]) * dw_dx + (0.5 - a[1]) * dw_dy, dw_dx, dw_dy


@kernel
def screen_area(a: Point, b: Point, c: Point) -> float:
    """Return twice a triangle's area on the screen; as y points down, it is negative where the front is seen."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])


@kernel
def covers_centres(a: Point, b: Point, c: Point, two_sided: bool, height: int, width: int) -> bool:
    """Return whether a triangle may show: it faces us, has an area, and a pixel's centre lies in its box."""
    area = screen_area(a, b, c)
    if not (_MIN_AREA_PX < abs(area) < _MAX_AREA_PX) or (area > 0.0 and not two_sided):
        return False  # written so that NaN ends here too
    if misses_centres(min(a[0], b[0], c[0]), max(a[0], b[0], c[0]), width):
        return False
    return not misses_centres(min(a[1], b[1], c[1]), max(a[1], b[1], c[1]), height)


@kernel
def downwards(a: Point, b: Point, c: Point) -> tuple[Pixel, Pixel, Pixel]:
    """Sort three places on the screen by their y; those with the same y stay in their order.

    Which way a comparison goes cannot be foreseen, so these are choices between numbers instead of jumps.
    """
    first, second = in_order((a[0], a[1]), (b[0], b[1]))
    first, third = in_order(first, (c[0], c[1]))
    second, third = in_order(second, third)
    return first, second, third


@kernel
def in_order(a: Pixel, b: Pixel) -> tuple[Pixel, Pixel]:
    """Return two places on the screen, the upper one first."""
    swap = b[1] < a[1]
    return (
        (b[0] if swap else a[0], b[1] if swap else a[1]),
        (a[0] if swap else b[0], a[1] if swap else b[1]),
    )  # fmt: skip


@kernel
def misses_centres(low: float, high: float, size: int) -> bool:
    """Return whether no pixel's centre lies between two coordinates: most triangles of a fine mesh end here."""
    return (
        high < 0.5 - _EDGE_PX
        or low > size - 0.5 + _EDGE_PX
        or np.ceil(low - (0.5 + _EDGE_PX)) > np.floor(high - (0.5 - _EDGE_PX))
    )


@kernel
def fill_rows(
    corners: tuple[Pixel, Pixel, Pixel], plane: Point, t: int, inverse_depth: Array, triangle: Array
) -> None:
    """Draw the pixels whose centres lie in a triangle or on its edges, with depth test.

    Each edge is evaluated from its upper end by one formula, so that triangles with a common edge leave no pixel
    between them. `plane` is w at the centre of the first pixel and its growth per column and per row.
    """
    height, width = inverse_depth.shape
    top, middle, bottom = corners
    first_row = clamp_index(np.ceil(top[1] - 0.5), 0, height)
    last_row = clamp_index(np.floor(bottom[1] - 0.5), -1, height - 1)
    long_slope, upper_slope, lower_slope = slope(top, bottom), slope(top, middle), slope(middle, bottom)
    for row in range(first_row, last_row + 1):
        y = row + 0.5
        x_long = top[0] + (y - top[1]) * long_slope
        upper, lower = top[0] + (y - top[1]) * upper_slope, middle[0] + (y - middle[1]) * lower_slope
        x_short = upper if y < middle[1] else lower
        first = clamp_index(np.ceil(min(x_long, x_short) - 0.5), 0, width)
        last = clamp_index(np.floor(max(x_long, x_short) - 0.5), -1, width - 1)
        fill_span(row, first, last, plane, t, inverse_depth, triangle)


@kernel
def fill_span(
    row: int, first: int, last: int, plane: Point, t: int, inverse_depth: Array, triangle: Array
) -> None:
    """Draw columns first .. last of a row, with depth test."""
    w_row = plane[0] + row * plane[2]
    start = row * inverse_depth.shape[1]
    column = first
    # `LANES` at once while there are so many before the image's end; if none is left, no lane is inside
    while start + column + LANES <= inverse_depth.size:
        draw_simd(inverse_depth, triangle, start + column, column, last + 1 - column, (w_row, plane[1]), t)
        column += LANES
        if column > last:
            return
    for i in range(column, last + 1):
        w = np.float32(w_row + i * plane[1])
        if w > inverse_depth[row, i]:
            inverse_depth[row, i] = w
            triangle[row, i] = t


@kernel
def slope(upper: Pixel, lower: Pixel) -> float:
    """Return the change of x per row along an edge; 0 for a level edge, which is never followed."""
    drop = lower[1] - upper[1]
    return (lower[0] - upper[0]) / drop if drop > 0.0 else 0.0

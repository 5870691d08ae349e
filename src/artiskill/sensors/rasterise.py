"""Kernels from body poses and a camera to a buffer of inverse depths and a buffer of triangle ids."""

import math

import numpy as np

from artiskill.geometry.kernel import Array, Point, kernel
from artiskill.sensors.backdrop import Backdrop, Box, fill_box
from artiskill.sensors.lighting import View
from artiskill.sensors.scan_conversion import (
    covers_centres,
    depth_plane,
    downwards,
    fill_rows,
    point,
    scan_convert,
)
from artiskill.sensors.scene_tables import SceneTables

# of the distances involved: a face counts as seen from behind only where float32 leaves no doubt
_BEHIND = 1e-5

# rows of the affine map from a body's frame to a camera's: factors of x, y, z and the constant
Row = tuple[float, float, float, float]


@kernel
def draw_geoms(
    scene: SceneTables,
    positions: Array,
    rotations: Array,
    view: View,
    backdrop: Backdrop,
    camera: Array,
    projected: Array,
    candidates: Array,
    inverse_depth: Array,
    triangle: Array,
    drawn: Array,
) -> None:
    """Draw all visuals: culling of whole visuals and of back faces, projection, near clipping, scan conversion.

    Args:
        scene: what is drawn.
        positions: (N + 1, 3) of the world and all bodies.
        rotations: (N + 1, 3, 3) likewise.
        view: the camera.
        backdrop: of the view.
        camera: (V, 3) scratch, see `place_vertices`; rows of visuals out of view are left as they were.
        projected: (V, 3) scratch, likewise.
        candidates: (F,) int32 scratch.
        inverse_depth: (H, W) float32 buffer.
        triangle: (H, W) int32 buffer.
        drawn: (H, 2) int64 columns of each row where both buffers have values, see `fill_box`.
    """
    height, width = inverse_depth.shape
    whole = (0.0, float(width), 0.0, float(height))
    for g in range(scene.geom_body.shape[0]):
        pose = scene.geom_body[g] + 1
        rows = body_to_camera(positions, rotations, pose, view)
        if out_of_view(scene.geom_spheres, g, rows, view.lens):
            continue
        first, last = scene.geom_vertices[g], scene.geom_vertices[g + 1]
        box, farthest, nearest = place_vertices(
            scene.vertices[first:last], rows, view.lens, camera[first:last], projected[first:last]
        )
        if nearest == 0.0:
            continue
        count = list_front_faces(scene, g, positions[pose], rotations[pose], view.position, candidates)
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
                clipped = clip_near(camera, face, view.lens)
                for k in range(2, clipped.shape[0]):
                    a, b, c = point(clipped, 0), point(clipped, k - 1), point(clipped, k)
                    scan_convert(a, b, c, t, scene.two_sided[t], inverse_depth, triangle)


@kernel
def body_to_camera(positions: Array, rotations: Array, pose: int, view: View) -> tuple[Row, Row, Row]:
    """The map from a body's frame to right, up and depth of a camera."""
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
    """One coordinate of an affine map."""
    return row[0] * x + row[1] * y + row[2] * z + row[3]


@kernel
def out_of_view(spheres: Array, g: int, rows: tuple[Row, Row, Row], lens: Array) -> bool:
    """Whether sphere g lies wholly outside one of the six planes that bound what a camera sees."""
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
    """Body-frame vertices to right, up, depth (camera) and to screen x, y, inverse depth (projected).

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
    """The lesser of both; the bound where the value is no number."""
    return value if value < bound else bound


@kernel
def greater(value: float, bound: float) -> float:
    """The greater of both; the bound where the value is no number."""
    return value if value > bound else bound


@kernel
def list_front_faces(
    scene: SceneTables, g: int, position: Array, rotation: Array, eye: Array, candidates: Array
) -> int:
    """List the faces of a visual that may show their front; returns how many.

    Asked in the body's frame, before anything is projected, and in single precision with a margin: what is left
    is decided on the screen.
    """
    d = (eye[0] - position[0], eye[1] - position[1], eye[2] - position[2])
    x = rotation[0, 0] * d[0] + rotation[1, 0] * d[1] + rotation[2, 0] * d[2]
    y = rotation[0, 1] * d[0] + rotation[1, 1] * d[1] + rotation[2, 1] * d[2]
    z = rotation[0, 2] * d[0] + rotation[1, 2] * d[1] + rotation[2, 2] * d[2]
    sphere = scene.geom_spheres[g]
    reach = abs(x) + abs(y) + abs(z) + abs(sphere[0]) + abs(sphere[1]) + abs(sphere[2]) + sphere[3]
    margin = np.float32(-_BEHIND * reach)
    eye_x, eye_y, eye_z = np.float32(x), np.float32(y), np.float32(z)
    count = 0
    for t in range(scene.geom_faces[g], scene.geom_faces[g + 1]):
        planes = scene.planes
        ahead = planes[0, t] * eye_x + planes[1, t] * eye_y + planes[2, t] * eye_z - planes[3, t]
        candidates[count] = t
        count += 0 if ahead < margin else 1  # no branch: which way it goes cannot be foreseen
    return count


@kernel
def clip_near(camera: Array, face: tuple[int, int, int], lens: Array) -> Array:
    """The part of a triangle beyond the near plane (Sutherland and Hodgman 1974), projected. -> (3 or 4, 3)."""
    near = lens[3]
    clipped = np.empty((4, 3))
    count = 0
    for i in range(3):
        start, end = face[i], face[(i + 1) % 3]
        if camera[start, 2] >= near:
            for k in range(
                3
            ):  # numbers only: to assign a row, Numba would compile half a second of error messages
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
    return clipped[:count]

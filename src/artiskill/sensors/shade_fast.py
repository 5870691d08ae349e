"""Fast shading for observations: light at the corners (Gouraud 1971), one sample per pixel, no shadows.

Three steps per view: list runs of pixels and the faces that are seen (`runs`), set each face up (here), colour the
pixels (`paint`). The arrays of a scene are taken out of their tuples once per step: Numba counts references each
time, which inside a loop would cost more than the work.
"""

import numpy as np

from artiskill.geometry.kernel import Array, Point, inlined_kernel, kernel
from artiskill.sensors.lighting import Lights, View, cross3, dot3, encoded, irradiance, tone_mapped, unit3
from artiskill.sensors.paint import CONSTANT, LINEAR, TEXTURED
from artiskill.sensors.point_lights import point_irradiance
from artiskill.sensors.scan_conversion import point
from artiskill.sensors.scene_tables import SceneTables
from artiskill.sensors.scratch import Drawing, LitPoints
from artiskill.sensors.texture import mip_level

# a face that covers less than this many pixels gets one corner's colour; in a fine mesh the others' hardly differ
_SMALL_PX = 4.0

Corners = tuple[int, int, int]


@kernel
def set_up_faces(
    count: int,
    scene: SceneTables,
    rotations: Array,
    view: View,
    light: Lights,
    drawing: Drawing,
    lit: LitPoints,
) -> None:
    """Write the seen faces' display colour and texture coordinates as functions of the screen, and their states.

    With the corners as columns of M, in the camera's frame, the point seen through the ray (x, y, 1) has the
    barycentric coordinates depth * M^-1 (x, y, 1) (Olano and Greer 1997), so that colours and texture coordinates
    over depth are linear. Where one colour will do, it is written as it is, in the place of the constants.
    """
    seen, state, planes, camera = drawing.seen, drawing.face_state, drawing.face_planes, drawing.camera
    point_view, colours, views = lit.point_view, lit.point_colours, lit.views
    face_rows, uvs, normals, bodies = scene.face_rows, scene.corner_uvs, scene.point_normals, scene.geom_body
    materials, textures = scene.materials, scene.textures
    views[0] += 1
    square_px, has_lamps = 0.5 * view.lens[0] * view.lens[0], light.lamps.shape[0] > 0
    for j in range(count):
        t = seen[j]
        corners, geom = (face_rows[t, 3], face_rows[t, 4], face_rows[t, 5]), face_rows[t, 6]
        p0 = point(camera, face_rows[t, 0])
        p1, p2 = point(camera, face_rows[t, 1]), point(camera, face_rows[t, 2])
        rows = (cross3(p1, p2), cross3(p2, p0), cross3(p0, p1))
        det = dot3(p0, rows[0])  # six times the volume between eye and face; negative from behind
        back = 1 if det < 0.0 else 0
        textured = textures[geom, 0, 1] > 0
        # its area on the screen: |det| shrinks with the third power of the distance
        area_px, cube = abs(det) * square_px, abs(p0[2] * p1[2] * p2[2])
        plain = (face_rows[t, 7] != 0 and not has_lamps) or area_px < _SMALL_PX * cube
        needed = 1 if plain and not textured else 3
        for i in range(needed):
            s = face_rows[t, 3 + i]
            if point_view[back, s] != views[0]:
                point_view[back, s] = views[0]
                place = in_world(point(camera, face_rows[t, i]), view) if has_lamps else (0.0, 0.0, 0.0)
                light_point(s, back, geom, bodies[geom] + 1, place, normals, rotations, materials, light, colours)
        if needed == 1:
            state[t] = CONSTANT
            for i in range(3):
                planes[t, i, 0], planes[t, i, 1] = 0.0, 0.0
                planes[t, i, 2] = colours[back, corners[0], i]
        else:
            state[t] = TEXTURED + mip_level(textures[geom], uvs[t], area_px, cube) if textured else LINEAR
            write_planes(t, back, corners, rows, det, colours, planes)
            if textured:
                write_texture_planes(t, rows, det, uvs, planes)


@inlined_kernel
def light_point(
    s: int,
    back: int,
    geom: int,
    pose: int,
    place: Point,
    normals: Array,
    rotations: Array,
    materials: Array,
    light: Lights,
    colours: Array,
) -> None:
    """Write the display colour of lit point s without its texture; arrays as in `SceneTables`, `LitPoints`.

    `place` in the world matters to lamps only.
    """
    normal = (np.float64(normals[s, 0]), np.float64(normals[s, 1]), np.float64(normals[s, 2]))
    turned = turned_normal(rotations, pose, normal, 1.0 - 2.0 * back)
    received = irradiance(turned, 1.0, 1.0, light)
    if light.lamps.shape[0] > 0:
        added = point_irradiance(place, turned, light)
        received = (received[0] + added[0], received[1] + added[1], received[2] + added[2])
    for k in range(3):
        value = encoded(tone_mapped(received[k] * materials[geom, k]), light.encode)
        colours[back, s, k] = np.float32(value)


@inlined_kernel
def in_world(p: Point, view: View) -> Point:
    """Right, up and depth in the camera's frame to the world."""
    e, r = view.position, view.rotation
    return (
        e[0] + r[0, 0] * p[0] + r[0, 1] * p[1] - r[0, 2] * p[2],
        e[1] + r[1, 0] * p[0] + r[1, 1] * p[1] - r[1, 2] * p[2],
        e[2] + r[2, 0] * p[0] + r[2, 1] * p[1] - r[2, 2] * p[2],
    )


@inlined_kernel
def write_planes(
    t: int,
    back: int,
    used: Corners,
    rows: tuple[Point, Point, Point],
    det: float,
    colours: Array,
    planes: Array,
) -> None:
    """Colours of face t; `rows` / `det` is the matrix from rays to corners' shares."""
    inverse = 1.0 / det if abs(det) > 1e-300 else 0.0
    for k in range(3):
        f0, f1, f2 = inverse * rows[0][k], inverse * rows[1][k], inverse * rows[2][k]
        for i in range(3):
            a, b, c = colours[back, used[0], i], colours[back, used[1], i], colours[back, used[2], i]
            planes[t, i, k] = np.float32(f0 * a + f1 * b + f2 * c)


@inlined_kernel
def write_texture_planes(t: int, rows: tuple[Point, Point, Point], det: float, uvs: Array, planes: Array) -> None:
    """Texture coordinates of face t, as `write_planes`."""
    inverse = 1.0 / det if abs(det) > 1e-300 else 0.0
    for k in range(3):
        f0, f1, f2 = inverse * rows[0][k], inverse * rows[1][k], inverse * rows[2][k]
        for i in range(2):
            planes[t, 3 + i, k] = np.float32(f0 * uvs[t, 0, i] + f1 * uvs[t, 1, i] + f2 * uvs[t, 2, i])


@kernel
def turned_normal(rotations: Array, pose: int, n: Point, side: float) -> Point:
    """A body-frame normal rotated to the world, unit length, turned to the side that is seen."""
    r = rotations
    return unit3(
        (
            side * (r[pose, 0, 0] * n[0] + r[pose, 0, 1] * n[1] + r[pose, 0, 2] * n[2]),
            side * (r[pose, 1, 0] * n[0] + r[pose, 1, 1] * n[1] + r[pose, 1, 2] * n[2]),
            side * (r[pose, 2, 0] * n[0] + r[pose, 2, 1] * n[1] + r[pose, 2, 2] * n[2]),
        )
    )

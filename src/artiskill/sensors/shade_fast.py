"""Fast shading for observations: light at the corners (Gouraud 1971), one sample per pixel, no shadows."""

import numpy as np

from artiskill.geometry.kernel import Array, Point, kernel
from artiskill.sensors.lighting import (
    Lights,
    Surfaces,
    View,
    cross3,
    dot3,
    encoded,
    irradiance,
    tone_mapped,
    unit3,
)
from artiskill.sensors.rasterise import FLOOR
from artiskill.sensors.texture import texel_row


@kernel
def shade_fast(
    surface: Surfaces,
    view: View,
    light: Lights,
    plain: Array,
    inverse_depth: Array,
    triangle: Array,
    planes: Array,
    rgb: Array,
) -> None:
    """Colour every pixel.

    Args:
        surface: what is drawn.
        view: the camera.
        light: lights and the display table.
        plain: (2, 3) uint8 colours of background and floor.
        inverse_depth: (H, W) float32.
        triangle: (H, W) int32.
        planes: (F, 5, 3) float32 scratch, see `set_up_face`.
        rgb: (H, W, 3) uint8, written.
    """
    state = np.zeros(planes.shape[0], dtype=np.uint8)  # 0: not set up, 1: plain, 2: textured
    per_px = np.float32(1.0 / view.lens[0])
    centre_x, centre_y = np.float32(view.lens[1] - 0.5), np.float32(view.lens[2] - 0.5)
    for row in range(triangle.shape[0]):
        y = (np.float32(row) - centre_y) * per_px
        for column in range(triangle.shape[1]):
            t = triangle[row, column]
            if t < 0:
                kind = 1 if t == FLOOR else 0
                for k in range(3):
                    rgb[row, column, k] = plain[kind, k]
                continue
            if state[t] == 0:
                set_up_face(surface, view, light, t, planes[t])
                state[t] = 2 if surface.textures[surface.face_geom[t], 1] > 0 else 1
            x = (np.float32(column) - centre_x) * per_px
            z = np.float32(1.0) / inverse_depth[row, column]
            texel = -1
            if state[t] == 2:
                u, v = z * linear(planes, t, 3, x, y), z * linear(planes, t, 4, x, y)
                texel = texel_row(surface.textures[surface.face_geom[t]], u, v)
            for k in range(3):
                value = z * linear(planes, t, k, x, y)
                if texel >= 0:
                    value *= np.float32(surface.texels[texel, k]) * np.float32(1.0 / 255.0)
                rgb[row, column, k] = np.uint8(min(max(value, np.float32(0.0)), np.float32(255.0)))


@kernel
def linear(planes: Array, t: int, k: int, x: np.floating, y: np.floating) -> np.floating:
    """Function k of face t, linear over the screen."""
    return planes[t, k, 0] * x + planes[t, k, 1] * y + planes[t, k, 2]


@kernel
def set_up_face(surface: Surfaces, view: View, light: Lights, t: int, planes: Array) -> None:
    """Display colour and texture coordinates of a face, divided by depth, as linear functions of the screen.

    With the corners as columns of M, in the camera's frame (x right, y down, z forward), the point seen through
    the ray (x, y, 1) has the barycentric coordinates depth * M^-1 (x, y, 1) (Olano and Greer 1997).

    Args:
        surface: what is drawn.
        view: the camera.
        light: lights and the display table.
        t: the face.
        planes: (5, 3) red, green, blue, u, v: factors of x, y and 1.
    """
    p0, p1, p2 = (
        to_camera(surface.world, surface.faces[t, 0], view),
        to_camera(surface.world, surface.faces[t, 1], view),
        to_camera(surface.world, surface.faces[t, 2], view),
    )
    rows = (cross3(p1, p2), cross3(p2, p0), cross3(p0, p1))
    det = dot3(p0, rows[0])
    side = -1.0 if det > 0.0 else 1.0  # seen from behind: light the back
    inverse = 1.0 / det if abs(det) > 1e-300 else 0.0
    planes[:] = np.float32(0.0)
    for i in range(3):
        colour = corner_colour(surface, light, t, i, side)
        for k in range(3):
            factor = inverse * rows[i][k]
            planes[0, k] += np.float32(factor * colour[0])
            planes[1, k] += np.float32(factor * colour[1])
            planes[2, k] += np.float32(factor * colour[2])
            planes[3, k] += np.float32(factor * surface.corner_uvs[t, i, 0])
            planes[4, k] += np.float32(factor * surface.corner_uvs[t, i, 1])


@kernel
def to_camera(world: Array, vertex: int, view: View) -> Point:
    """A vertex in the camera's frame, x right, y down, z forward."""
    d = (
        world[vertex, 0] - view.position[0],
        world[vertex, 1] - view.position[1],
        world[vertex, 2] - view.position[2],
    )
    r = view.rotation
    return (
        r[0, 0] * d[0] + r[1, 0] * d[1] + r[2, 0] * d[2],
        -(r[0, 1] * d[0] + r[1, 1] * d[1] + r[2, 1] * d[2]),
        -(r[0, 2] * d[0] + r[1, 2] * d[1] + r[2, 2] * d[2]),
    )


@kernel
def world_normal(r: Array, n: Point, side: float) -> Point:
    """A body-frame normal rotated by r to the world, unit length, turned to the side that is seen."""
    return unit3(
        (
            side * (r[0, 0] * n[0] + r[0, 1] * n[1] + r[0, 2] * n[2]),
            side * (r[1, 0] * n[0] + r[1, 1] * n[1] + r[1, 2] * n[2]),
            side * (r[2, 0] * n[0] + r[2, 1] * n[1] + r[2, 2] * n[2]),
        )
    )


@kernel
def corner_colour(surface: Surfaces, light: Lights, t: int, i: int, side: float) -> Point:
    """Display colour [0, 255] of an untextured corner."""
    n = surface.corner_normals[t, i]
    rotation = surface.rotations[surface.face_body[t] + 1]
    received = irradiance(world_normal(rotation, (n[0], n[1], n[2]), side), 1.0, 1.0, light)
    g = surface.face_geom[t]
    return (
        encoded(tone_mapped(received[0] * surface.materials[g, 0]), light.encode),
        encoded(tone_mapped(received[1] * surface.materials[g, 1]), light.encode),
        encoded(tone_mapped(received[2] * surface.materials[g, 2]), light.encode),
    )

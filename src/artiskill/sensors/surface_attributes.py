"""Kernel from shading samples on triangles to place, normal, albedo and shininess."""

import numpy as np

from artiskill.geometry.kernel import Array, Point, kernel
from artiskill.sensors.lighting import Surfaces, View, cross3, dot3
from artiskill.sensors.shade_fast import turned_normal
from artiskill.sensors.texture import texel_area, trilinear


@kernel
def surface_attributes(
    count: int,
    surface: Surfaces,
    view: View,
    decode: Array,
    triangle: Array,
    screen: Array,
    place_w: Array,
    normal_w: Array,
    colour: Array,
    shininess: Array,
    haze: Array,
) -> None:
    """Fill the samples that show a triangle; the others are left alone.

    Args:
        count: samples in use.
        surface: what is drawn.
        view: the camera, its lens in units of samples.
        decode: (256,) sRGB bytes to linear.
        triangle: (S,) see `Samples`, as all that follow.
        screen: (S, 2).
        place_w: (S, 3) written.
        normal_w: (S, 3) written.
        colour: (S, 3) written.
        shininess: (S,) written.
        haze: (S,) written.
    """
    for i in range(count):
        t = triangle[i]
        if t < 0:
            continue
        ray = view_ray(screen[i, 0], screen[i, 1], view.rotation, view.lens)
        face = surface.faces[t]
        p0 = from_camera(surface.world, face[0], view.position)
        p1 = from_camera(surface.world, face[1], view.position)
        p2 = from_camera(surface.world, face[2], view.position)
        b0, b1, b2, det = barycentric(p0, p1, p2, ray)
        n = surface.corner_normals[t]
        uv = surface.corner_uvs[t]
        mixed = (
            b0 * n[0, 0] + b1 * n[1, 0] + b2 * n[2, 0],
            b0 * n[0, 1] + b1 * n[1, 1] + b2 * n[2, 1],
            b0 * n[0, 2] + b1 * n[1, 2] + b2 * n[2, 2],
        )
        side = -1.0 if det > 0.0 else 1.0  # seen from behind: light the back
        normal = turned_normal(surface.rotations, surface.face_body[t] + 1, mixed, side)
        geom = surface.face_geom[t]
        u, v = b0 * uv[0, 0] + b1 * uv[1, 0] + b2 * uv[2, 0], b0 * uv[0, 1] + b1 * uv[1, 1] + b2 * uv[2, 1]
        p = (
            b0 * p0[0] + b1 * p1[0] + b2 * p2[0],
            b0 * p0[1] + b1 * p1[1] + b2 * p2[1],
            b0 * p0[2] + b1 * p1[2] + b2 * p2[2],
        )
        images = surface.textures[geom]
        # a face's area on the screen shrinks with the third power of the distance, see `set_up_faces`
        depth = -(view.rotation[0, 2] * p[0] + view.rotation[1, 2] * p[1] + view.rotation[2, 2] * p[2])
        area_px = 0.5 * view.lens[0] * view.lens[0] * abs(det)
        texels_per_px = texel_area(images, uv) * depth * depth * depth / area_px
        texel = trilinear(images, surface.texels, u, v, texels_per_px, decode)
        for k in range(3):
            place_w[i, k] = np.float32(p[k] + view.position[k])
            normal_w[i, k] = np.float32(normal[k])
            colour[i, k] = np.float32(surface.materials[geom, k] * texel[k])
        shininess[i] = np.float32(surface.materials[geom, 3])
        haze[i] = np.float32(0.0)


@kernel
def view_ray(x: float, y: float, rotation: Array, lens: Array) -> Point:
    """Direction in the world of what the screen shows at (x, y), of length 1 along the optical axis."""
    right, up = (x - lens[1]) / lens[0], (lens[2] - y) / lens[0]
    return (
        rotation[0, 0] * right + rotation[0, 1] * up - rotation[0, 2],
        rotation[1, 0] * right + rotation[1, 1] * up - rotation[1, 2],
        rotation[2, 0] * right + rotation[2, 1] * up - rotation[2, 2],
    )


@kernel
def from_camera(world: Array, vertex: int, position: Array) -> Point:
    """A vertex relative to the camera's place, along world axes."""
    return world[vertex, 0] - position[0], world[vertex, 1] - position[1], world[vertex, 2] - position[2]


@kernel
def barycentric(p0: Point, p1: Point, p2: Point, ray: Point) -> tuple[float, float, float, float]:
    """Where a ray from the origin meets a triangle, clamped into it, and the determinant, positive from behind."""
    c0, c1, c2 = cross3(p1, p2), cross3(p2, p0), cross3(p0, p1)
    det = dot3(p0, c0)
    side = 1.0 if det > 0.0 else -1.0
    b0, b1, b2 = max(0.0, side * dot3(c0, ray)), max(0.0, side * dot3(c1, ray)), max(0.0, side * dot3(c2, ray))
    total = b0 + b1 + b2
    if not total > 0.0:
        return 1.0, 0.0, 0.0, det
    return b0 / total, b1 / total, b2 / total, det

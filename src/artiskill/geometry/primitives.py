"""Closed surfaces that objects are made of: boxes, lathed and lofted bodies, bars along a path, rings, shells."""

from typing import Any

import numpy as np

from artiskill.geometry.arrays import dot, norm, power
from artiskill.geometry.meshes import TriMesh, convex_hull


def box(half_extents: Any, bevel_m: float = 0.0) -> TriMesh:
    """An axis-aligned box about the origin, its edges optionally cut by a flat bevel."""
    half = np.asarray(half_extents, dtype=float)
    bevel = min(bevel_m, 0.45 * float(half.min()))
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    if bevel <= 0:
        corners = signs * half
    else:  # each corner becomes three, one on each of its faces
        corners = np.concatenate([signs * (half - bevel * (1 - np.eye(3)[axis])) for axis in range(3)])
    return convex_hull(corners).mesh


def lathe(profile: Any, segments: int = 24) -> TriMesh:
    """Turn a profile about the z axis.

    Args:
        profile: (P, 2) radius and height, from bottom to top; points with radius 0 close the ends.
        segments: number of sides.
    """
    points = np.asarray(profile, dtype=float)
    angles = np.arange(segments) * (2 * np.pi / segments)
    ring = np.stack((np.cos(angles), np.sin(angles)), axis=-1)  # (S, 2)
    xy = points[:, None, :1] * ring[None]  # (P, S, 2)
    z = np.broadcast_to(points[:, None, 1:], (len(points), segments, 1))
    vertices = np.concatenate((xy, z), axis=-1).reshape(-1, 3)
    index = np.arange(len(vertices)).reshape(len(points), segments)
    index[points[:, 0] <= 0] = index[points[:, 0] <= 0, :1]  # one vertex at each pole: the surface is closed
    faces = []
    for p in range(len(points) - 1):
        for s in range(segments):
            t = (s + 1) % segments
            if points[p, 0] > 0:
                faces.append((index[p, s], index[p, t], index[p + 1, t]))
            if points[p + 1, 0] > 0:
                faces.append((index[p, s], index[p + 1, t], index[p + 1, s]))
    return _drop_unused(TriMesh(vertices, np.array(faces)))


def cylinder(radius: float, half_length: float, segments: int = 24, bevel_m: float = 0.0) -> TriMesh:
    """A closed cylinder about the origin, along z, its rims optionally bevelled."""
    b = min(bevel_m, 0.45 * radius, 0.45 * half_length)
    profile = [(0.0, -half_length), (radius - b, -half_length)]
    if b > 0:
        profile += [(radius, -half_length + b), (radius, half_length - b)]
    else:
        profile += [(radius, half_length)]
    profile += [(radius - b, half_length), (0.0, half_length)] if b > 0 else [(0.0, half_length)]
    return lathe(profile, segments)


def capsule(radius: float, half_length: float, segments: int = 24, rings: int = 6) -> TriMesh:
    """A capsule about the origin, along z; `half_length` is that of its cylinder."""
    arc = np.linspace(-np.pi / 2, 0, rings)
    lower = [(radius * np.cos(a), radius * np.sin(a) - half_length) for a in arc]
    lower[0] = (0.0, -radius - half_length)
    upper = [(r, -z) for r, z in reversed(lower)]
    profile = lower + upper if half_length > 0 else lower + upper[1:]
    return lathe(profile, segments)


def sphere(radius: float, segments: int = 24, rings: int = 7) -> TriMesh:
    """A sphere about the origin."""
    return capsule(radius, 0.0, segments, rings)


def extrude(outline: Any, half_height: float) -> TriMesh:
    """A prism along z over a convex outline (P, 2), counter-clockwise seen from +z."""
    xy = np.asarray(outline, dtype=float)
    n = len(xy)
    bottom = np.column_stack((xy, np.full(n, -half_height)))
    top = np.column_stack((xy, np.full(n, half_height)))
    faces = [(0, i + 1, i) for i in range(1, n - 1)]
    faces += [(n, n + i, n + i + 1) for i in range(1, n - 1)]
    for i in range(n):
        j = (i + 1) % n
        faces += [(i, j, n + j), (i, n + j, n + i)]
    return TriMesh(np.concatenate((bottom, top)), np.array(faces))


def tube(path: Any, radius: float, segments: int = 12) -> TriMesh:
    """A round tube with closed ends along an open path (P, 3), its frames carried without twist."""
    points = np.asarray(path, dtype=float)
    tangents = np.gradient(points, axis=0)
    tangents /= norm(tangents)[:, None]
    helper = np.eye(3)[np.argmin(np.abs(tangents[0]))]
    normal = np.cross(tangents[0], helper)
    angles = np.arange(segments) * (2 * np.pi / segments)
    rings = []
    for point, tangent in zip(points, tangents, strict=True):
        normal = normal - tangent * dot(normal, tangent)
        normal /= norm(normal)
        binormal = np.cross(tangent, normal)
        rings.append(point + radius * (np.outer(np.cos(angles), normal) + np.outer(np.sin(angles), binormal)))
    vertices = np.concatenate((*rings, points[:1], points[-1:]))
    start, end = len(vertices) - 2, len(vertices) - 1
    last = (len(points) - 1) * segments
    faces = []
    for s in range(segments):
        t = (s + 1) % segments
        faces += [(start, t, s), (end, last + s, last + t)]
        for p in range(len(points) - 1):
            a, b = p * segments + s, p * segments + t
            faces += [(a, b, b + segments), (a, b + segments, a + segments)]
    return TriMesh(vertices, np.array(faces))


def loft(rings: Any) -> TriMesh:
    """A closed skin through rings of equally many points, its ends flat.

    Args:
        rings: (R, N, 3), R >= 2, each ring convex, counter-clockwise seen against the direction of travel.
    """
    points = np.asarray(rings, dtype=float)
    count, sides = points.shape[:2]
    s = np.arange(sides)
    t = (s + 1) % sides
    first = (np.arange(count - 1) * sides)[:, None]
    a, b, c, d = first + s, first + t, first + t + sides, first + s + sides
    # each quad is cut along its shorter diagonal, which follows a twisting or leaning skin better
    flat = points.reshape(-1, 3)
    short = norm(flat[a] - flat[c]) <= norm(flat[b] - flat[d]) + 1e-12
    lower = np.where(short[..., None], np.stack((a, b, c), axis=-1), np.stack((a, b, d), axis=-1))
    upper = np.where(short[..., None], np.stack((a, c, d), axis=-1), np.stack((b, c, d), axis=-1))
    cap = _zigzag(sides)
    end = cap + (count - 1) * sides
    faces = np.concatenate((cap[:, ::-1], lower.reshape(-1, 3), upper.reshape(-1, 3), end))
    return TriMesh(flat, faces)


def superellipse(half_x: float, half_y: float, exponent: float, count: int = 16) -> np.ndarray:
    """Outline |x / half_x|^n + |y / half_y|^n = 1, counter-clockwise: n = 2 an ellipse, 4 and more a rounded box.

    Returns:
        (count, 2) points.
    """
    angles = np.arange(count) * (2 * np.pi / count)
    unit = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    unit[np.abs(unit) < 1e-12] = 0.0
    return np.sign(unit) * power(np.abs(unit), 2.0 / exponent) * (half_x, half_y)


def superellipse_loft(sections: Any, count: int = 16) -> TriMesh:
    """A closed, rounded body along z through superelliptic sections.

    Args:
        sections: (R, 6) from bottom to top: height z, centre x and y, half extents x and y, exponent.
        count: points of each section; a multiple of 4 keeps it symmetric.
    """
    rings = []
    for z, x, y, half_x, half_y, exponent in np.asarray(sections, dtype=float):
        outline = superellipse(half_x, half_y, exponent, count) + np.array((x, y))
        rings.append(np.column_stack((outline, np.full(count, z))))
    return loft(rings)


def rounded_rectangle(half_x: float, half_y: float, radius_m: float, arc: int = 3) -> np.ndarray:
    """Outline of a rectangle whose corners are arcs of `arc` >= 2 points, counter-clockwise. -> (4 arc, 2)."""
    radius = min(radius_m, 0.98 * half_x, 0.98 * half_y)
    angles = np.arange(4)[:, None] * (np.pi / 2) + np.linspace(0, np.pi / 2, arc)
    direction = np.stack((np.cos(angles), np.sin(angles)), axis=-1).reshape(-1, 2)
    signs = np.repeat([(1, 1), (-1, 1), (-1, -1), (1, -1)], arc, axis=0)
    return signs * (half_x - radius, half_y - radius) + radius * direction


def rounded_box(half_extents: Any, radius_m: float, arc: int = 3, bevel_m: float = 0.005) -> TriMesh:
    """An axis-aligned box about the origin with round vertical edges and a bevel around top and bottom.

    Args:
        half_extents: three numbers.
        radius_m: of the vertical edges.
        arc: points on each round edge, at least 2.
        bevel_m: width of the bevel, less than the radius.
    """
    hx, hy, hz = (float(h) for h in half_extents)
    bevel = min(bevel_m, 0.45 * hz, 0.9 * radius_m, 0.45 * hx, 0.45 * hy)
    rings = []
    for z, inset in ((-hz, bevel), (-hz + bevel, 0.0), (hz - bevel, 0.0), (hz, bevel)):
        outline = rounded_rectangle(hx - inset, hy - inset, radius_m - inset, arc)
        rings.append(np.column_stack((outline, np.full(len(outline), z))))
    return loft(rings)


def strip(path: Any, across: Any, half_width: float, half_thickness: float, sides: int = 4) -> TriMesh:
    """A bar along a path in a plane: round (elliptic) for many sides, flat for four.

    Args:
        path: (P, 3) points in a plane.
        across: (3,) unit normal of that plane; the width runs along it.
        half_width: of the section, along `across`.
        half_thickness: of the section, in the plane.
        sides: corners of the section, at least 3.
    """
    points, normal = np.asarray(path, dtype=float), np.asarray(across, dtype=float)
    steps = np.diff(points, axis=0)
    steps /= norm(steps)[:, None]
    ends = np.concatenate((steps[:1], steps, steps[-1:]))
    tangents = ends[:-1] + ends[1:]  # halfway between the two pieces that meet
    tangents /= norm(tangents)[:, None]
    stretch = 1.0 / dot(tangents, ends[1:])  # mitred: pieces keep their thickness
    inwards = np.cross(tangents, normal)
    angles = (np.arange(sides) + 0.5) * (2 * np.pi / sides)
    scale = np.sqrt(2.0) if sides == 4 else 1.0
    width, thickness = scale * half_width * np.cos(angles), scale * half_thickness * np.sin(angles)
    # (P, S, 3)
    rings = (
        points[:, None]
        + width[None, :, None] * normal
        + (stretch[:, None] * thickness)[..., None] * inwards[:, None]
    )
    return loft(rings)


def torus(radius: float, wire_radius: float, segments: int = 24, sides: int = 8) -> TriMesh:
    """A ring about the z axis, centred on the origin; `radius` is that of the wire's middle."""
    angles = np.linspace(0.0, 2 * np.pi, sides + 1)
    profile = np.stack((radius + wire_radius * np.cos(angles), wire_radius * np.sin(angles)), axis=-1)
    profile[-1] = profile[0]
    return lathe(profile, segments)


def upright_prism(outline: Any, z0: float, z1: float) -> TriMesh:
    """A prism between two heights over a convex outline (P, 2) in x and y, counter-clockwise, edges sharp."""
    xy = np.asarray(outline, dtype=float)
    return loft([np.column_stack((xy, np.full(len(xy), z))) for z in (z0, z1)])


def frustum(low: Any, high: Any, depth: float, height: float) -> TriMesh:
    """A field that rises towards the viewer: a rectangle at `depth` that narrows to another, `height` before it.

    Args:
        low: (2, 2) smallest and largest y, z of the rectangle behind.
        high: likewise, of the one in front.
        depth: x of the rectangle behind.
        height: how far the one in front stands before it, towards -x.
    """
    rings = []
    for (y0, z0), (y1, z1), x in ((*low, depth), (*high, depth - height)):
        rings.append([(x, y0, z0), (x, y0, z1), (x, y1, z1), (x, y1, z0)])
    return loft(rings)


def ring_sweep(outline: Any, loop: Any, tile_m: float = 0.0) -> TriMesh:
    """A closed skin made by carrying a closed loop around a closed outline, as a lathe does around a circle.

    Args:
        outline: (N, 2) counter-clockwise seen from +z, about the z axis; it is scaled for each point of the loop.
        loop: (P, 2) scale of the outline and height, counter-clockwise in the plane (scale, z): outside going up,
            inside going down. It may be (N, P, 2) to differ around the outline.
        tile_m: side of the square that a texture covers; then there are texture coordinates, u around the outline,
            v along the loop. A whole number of squares goes around.
    """
    around = np.asarray(outline, dtype=float)
    loops = np.asarray(loop, dtype=float)
    if loops.ndim == 2:
        loops = np.broadcast_to(loops, (len(around), *loops.shape))
    if tile_m > 0:
        return _textured_ring(around, loops, tile_m)
    count, points = loops.shape[:2]
    xy = around[:, None, :] * loops[:, :, :1]  # (N, P, 2)
    vertices = np.concatenate((xy, loops[:, :, 1:]), axis=-1).reshape(-1, 3)
    i, p = (index.ravel() for index in np.mgrid[0:count, 0:points])
    j, q = (i + 1) % count, (p + 1) % points
    a, b, c, d = i * points + p, j * points + p, j * points + q, i * points + q
    return TriMesh(vertices, np.concatenate((np.stack((a, b, c), axis=1), np.stack((a, c, d), axis=1))))


def _textured_ring(around: np.ndarray, loops: np.ndarray, tile_m: float) -> TriMesh:
    """As `ring_sweep`, its vertices doubled along the two seams."""
    around, loops = np.concatenate((around, around[:1])), np.concatenate((loops, loops[:1]))
    loops = np.concatenate((loops, loops[:, :1]), axis=1)
    count, points = loops.shape[:2]
    xy = around[:, None, :] * loops[:, :, :1]
    vertices = np.concatenate((xy, loops[:, :, 1:]), axis=-1)
    along = norm(np.diff(around, axis=0))
    turns = max(1, round(float(along.sum() * loops[:, :, 0].max()) / tile_m))
    u = np.concatenate(([0.0], np.cumsum(along))) / along.sum() * turns
    v = np.concatenate(([0.0], np.cumsum(norm(np.diff(loops[0], axis=0))))) / tile_m
    uvs = np.stack(np.broadcast_arrays(u[:, None], v[None, :]), axis=-1).reshape(-1, 2)
    i, p = (index.ravel() for index in np.mgrid[0 : count - 1, 0 : points - 1])
    a = i * points + p
    b, c, d = a + points, a + points + 1, a + 1
    faces = np.concatenate((np.stack((a, b, c), axis=1), np.stack((a, c, d), axis=1)))
    return TriMesh(vertices.reshape(-1, 3), faces, uvs.astype(np.float32))


def path_sweep(path: Any, section: Any, side: Any) -> TriMesh:
    """A closed skin made by carrying a convex section along an open path that lies in a plane.

    Args:
        path: (P, 3) points.
        section: (N, 2) convex outline, counter-clockwise: its first coordinate runs along `side`, its second in
            the plane, along tangent x side.
        side: (3,) unit normal of the plane.
    """
    points, around = np.asarray(path, dtype=float), np.asarray(section, dtype=float)
    normal = np.asarray(side, dtype=float)
    tangents = np.gradient(points, axis=0)
    tangents /= norm(tangents)[:, None]
    across = np.cross(tangents, normal)  # (P, 3)
    rings = points[:, None] + around[None, :, :1] * normal + around[None, :, 1:] * across[:, None]
    return loft(rings)


def _drop_unused(mesh: TriMesh) -> TriMesh:
    used, faces = np.unique(mesh.faces, return_inverse=True)
    return TriMesh(mesh.vertices[used], faces.reshape(-1, 3))


def _zigzag(count: int) -> np.ndarray:
    """Triangles of a convex polygon, in zigzag: fewer needles than in a fan. -> (count - 2, 3)."""
    faces, low, high = [], 0, count - 1
    while high - low >= 2:
        faces.append((low, low + 1, high))
        low += 1
        if high - low >= 2:
            faces.append((low, high - 1, high))
            high -= 1
    return np.array(faces)

"""Triangle meshes: the value, the primitives it is built from, and surface samples."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from artiskill.geometry.arrays import dot, norm
from artiskill.geometry.exact import matmul, power
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


def box(half_extents: Any, bevel_m: float = 0.0) -> TriMesh:
    """An axis-aligned box about the origin, its edges optionally cut by a flat bevel."""
    half = np.asarray(half_extents, dtype=float)
    bevel = min(bevel_m, 0.45 * float(half.min()))
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    if bevel <= 0:
        corners = signs * half
    else:  # each corner becomes three, one on each of its faces
        corners = np.concatenate([signs * (half - bevel * (1 - np.eye(3)[axis])) for axis in range(3)])
    from artiskill.geometry.hulls import convex_hull

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
    cap = _strip(sides)
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


def _drop_unused(mesh: TriMesh) -> TriMesh:
    used, faces = np.unique(mesh.faces, return_inverse=True)
    return TriMesh(mesh.vertices[used], faces.reshape(-1, 3))


def _strip(count: int) -> np.ndarray:
    """Triangles of a convex polygon, in zigzag: fewer needles than in a fan. -> (count - 2, 3)."""
    faces, low, high = [], 0, count - 1
    while high - low >= 2:
        faces.append((low, low + 1, high))
        low += 1
        if high - low >= 2:
            faces.append((low, high - 1, high))
            high -= 1
    return np.array(faces)

"""`LinkBuilder` adds visuals and collision shapes to a link: meshes, pads, and bars and tubes along paths."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import CollisionShape, Material
from artiskill.assets.chairs.pads import Faces, Pad, hull_shape, pad_hulls, pad_mesh
from artiskill.assets.chairs.spec import ChairAppearance
from artiskill.assets.finishes import GRAIN_TILE_M, make_materials
from artiskill.assets.parts import IDENTITY, LinkParts
from artiskill.geometry.arrays import dot, matmul, norm
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import loft, superellipse, tube
from artiskill.geometry.rotations import quat_from_matrix, quat_multiply, quat_rotate

# Upholstery of chairs is woven finely: threads of 5 mm, as coarse as a picture from 1 m needs them to be seen.
_TILES_M = {"fabric": 0.08}
# Texture coordinates of a mesh without its own: a plane that no face of a chair stands square to.
_PLANE = np.array(((0.94, 0.1), (0.1, 0.94), (0.3, 0.3)))
_TEXTURE_PLACE = (0.37, 0.61)  # of a pad's middle
_SQUARE = np.array(((-1, -1), (-1, 1), (1, 1), (1, -1)))
_OCTAGON = 1.04 * np.stack((np.cos(np.arange(8) * np.pi / 4), np.sin(np.arange(8) * np.pi / 4)), axis=1)
_NOSE_SHARE = 0.62  # size of a rounded end's last section
_SAME_M = 0.001  # sections that differ less are one box or capsule


@dataclass(frozen=True, eq=False)
class TiledMaterial:
    """A material, and the side of the square that its texture covers."""

    material: Material
    tile_m: float


def make_tiled_materials(appearance: ChairAppearance) -> dict[str, TiledMaterial]:
    """Build one material per field of an appearance, textures included; equal surfaces share one."""
    return {
        name: TiledMaterial(material, _TILES_M.get(getattr(appearance, name).finish, GRAIN_TILE_M))
        for name, material in make_materials(appearance).items()
    }


class LinkBuilder:
    """Adds to one link. Parts are given in the object frame, or in one of their own.

    Surfaces are fields of `ChairAppearance`.
    """

    def __init__(self, parts: LinkParts, materials: dict[str, TiledMaterial]) -> None:
        """Begin in the object frame."""
        self._parts = parts
        self.materials = materials
        self._origin, self._rotation = parts.local((0.0, 0.0, 0.0)), IDENTITY

    def in_frame(self, origin: np.ndarray, rotation: np.ndarray) -> "LinkBuilder":
        """Return a builder whose parts are given in a frame with such origin and rotation in the object frame."""
        moved = LinkBuilder(self._parts, self.materials)
        moved._origin, moved._rotation = self._parts.local(origin), rotation
        return moved

    def add_visual(self, mesh: TriMesh, surface: str, part: str) -> None:
        """Add a mesh; texture coordinates are made for it where its material needs them."""
        tiled, uvs = self.materials[surface], mesh.uvs
        if tiled.material.texture is None:
            uvs = None
        elif uvs is None:
            uvs = (matmul(mesh.vertices, _PLANE) / tiled.tile_m).astype(np.float32)
        moved = TriMesh(mesh.vertices, mesh.faces, uvs).transformed(self._origin, self._rotation)
        self._parts.add_visual(moved, tiled.material, part)

    def add_collision(self, *shapes: CollisionShape) -> None:
        """Add collision shapes."""
        for s in shapes:
            position = self._origin + quat_rotate(self._rotation, np.asarray(s.position, dtype=float))
            rotation = quat_multiply(self._rotation, s.quaternion)
            self._parts.add_collision(CollisionShape(s.kind, s.size, position, rotation, s.vertices, s.part))

    def add_bar_visual(
        self, bar: "Beam | Tube", surface: str, part: str, fillet_m: float = 0.0, count: int = 8
    ) -> None:
        """Add a bar or a tube without collision shapes; its texture coordinates are in metres."""
        mesh = bar.mesh(count, fillet_m)
        if mesh.uvs is not None:
            mesh = TriMesh(mesh.vertices, mesh.faces, mesh.uvs / np.float32(self.materials[surface].tile_m))
        self.add_visual(mesh, surface, part)

    def add_bar(self, bar: "Beam | Tube", surface: str, part: str, fillet_m: float = 0.0, count: int = 8) -> None:
        """Add a bar or a tube with its collision shapes."""
        self.add_bar_visual(bar, surface, part, fillet_m, count)
        self.add_collision(*bar.shapes(part))

    def add_pad_visual(self, pad: Pad, surface: str, part: str, count: int = 28, seen: Faces = "both") -> None:
        """Add a pad without collision shapes; a face that is not seen is meshed coarsely."""
        mesh = pad_mesh(pad, self.materials[surface].tile_m, _TEXTURE_PLACE, count, seen)
        self.add_visual(mesh, surface, part)

    def add_pad_collision(self, pad: Pad, part: str, pieces: int = 1, along: int = 1) -> None:
        """Add the collision shapes of a pad."""
        self.add_collision(*(hull_shape(points, part) for points in pad_hulls(pad, pieces, along)))


class Beam:
    """A bar along an open path whose section may change from point to point.

    Sections stand across the path: their width along `lateral`, their height across both.
    """

    def __init__(
        self, path: Any, width: Any, height: Any, lateral: Any, round_: bool = False, nose_m: float = 0.0
    ) -> None:
        """Describe the bar.

        Args:
            path: (P, 3) points, its corners sharp.
            width: one number or P.
            height: one number or P.
            lateral: (3,) direction, nowhere along the path.
            round_: whether the section is an ellipse instead of a rounded rectangle.
            nose_m: how far the mesh reaches beyond the path, rounded.
        """
        self.path = np.asarray(path, dtype=float)
        self.width = np.broadcast_to(np.asarray(width, dtype=float), len(self.path))
        self.height = np.broadcast_to(np.asarray(height, dtype=float), len(self.path))
        self.lateral = np.asarray(lateral, dtype=float)
        self.round = round_
        self.nose_m = nose_m

    def mesh(self, count: int = 8, fillet_m: float = 0.0, steps: int = 3) -> TriMesh:
        """Return the visual surface, corners of the path rounded with such a radius, nearly."""
        path, width, height = _rounded(self.path, self.width, self.height, fillet_m, steps)
        if self.nose_m > 0:
            end = path[-1] + self.nose_m * (path[-1] - path[-2]) / norm(path[-1] - path[-2])
            path = np.concatenate((path, end[None]))
            width, height = (np.append(sizes, _NOSE_SHARE * sizes[-1]) for sizes in (width, height))
        section = superellipse(0.5, 0.5, 2.0 if self.round else 6.0, count)
        lengths = np.concatenate(((0.0,), np.cumsum(norm(np.diff(path, axis=0)))))
        rings, uvs = [], []
        for i, point in enumerate(path):
            side, across, stretch = _frame(path, i, self.lateral)
            offsets = section * (width[i], height[i] * stretch)
            rings.append(point + matmul(offsets, np.stack((side, across))))
            uvs.append(np.column_stack((np.full(count, lengths[i]), offsets.sum(axis=1))))
        mesh = loft(np.stack(rings))
        return TriMesh(mesh.vertices, mesh.faces, np.concatenate(uvs).astype(np.float32))  # in metres

    def shapes(self, part: str) -> list[CollisionShape]:
        """Return one convex shape for each straight piece."""
        return [self._shape(i, part) for i in range(len(self.path) - 1)]

    def _shape(self, i: int, part: str) -> CollisionShape:
        start, end = self.path[i], self.path[i + 1]
        along = end - start
        length = float(norm(along))
        axes = _axes(along, self.lateral)
        width, height = self.width[i : i + 2], self.height[i : i + 2]
        turn = quat_from_matrix(axes.T)
        middle = (start + end) / 2
        if max(np.ptp(width), np.ptp(height)) > _SAME_M:
            corners = [
                point + 0.5 * (su * w * axes[0] + sv * h * axes[1])
                for point, w, h in ((start, width[0], height[0]), (end, width[1], height[1]))
                for su, sv in (_OCTAGON if self.round else _SQUARE)
            ]
            return hull_shape(np.round(np.array(corners), 6), part)
        w, h = float(width.mean()), float(height.mean())
        if self.round and abs(w - h) < _SAME_M:
            return CollisionShape("capsule", ((w + h) / 4, length / 2), middle, turn, part=part)
        return CollisionShape("box", (w / 2, h / 2, length / 2), middle, turn, part=part)


class Tube:
    """A round tube along an open path that may turn any way."""

    def __init__(self, path: Any, radius_m: float) -> None:
        """Describe the tube; `path` is (P, 3) with sharp corners."""
        self.path = np.asarray(path, dtype=float)
        self.radius_m = radius_m

    def mesh(self, count: int = 8, fillet_m: float = 0.0, steps: int = 4) -> TriMesh:
        """Return the visual surface, corners of the path rounded with such a radius, nearly."""
        nothing = np.zeros(len(self.path))
        return tube(_rounded(self.path, nothing, nothing, fillet_m, steps)[0], self.radius_m, count)

    def shapes(self, part: str, chamfer_m: float = 0.0) -> list[CollisionShape]:
        """Return a capsule for each straight piece, and for each corner that is cut off so far from its tip."""
        found = []
        nothing = np.zeros(len(self.path))
        path = _rounded(self.path, nothing, nothing, chamfer_m, 1)[0]
        for start, end in pairwise(path):
            along = end - start
            helper = np.eye(3)[np.argmin(np.abs(along))]
            turn = quat_from_matrix(_axes(along, helper).T)
            half = max(float(norm(along)) / 2, 1e-4)
            found.append(CollisionShape("capsule", (self.radius_m, half), (start + end) / 2, turn, part=part))
        return found


def loop_mesh(path: np.ndarray, radius_m: float, count: int = 8) -> TriMesh:
    """Return a round tube along a closed path (P, 3), counter-clockwise about the direction of its own normal."""
    after, before = np.roll(path, -1, axis=0), np.roll(path, 1, axis=0)
    tangents = after - before
    tangents /= norm(tangents)[:, None]
    normal = np.cross(path, after).sum(axis=0)
    normal /= norm(normal)
    outward = np.cross(tangents, normal)
    outward /= norm(outward)[:, None]
    upward = np.cross(outward, tangents)
    angles = np.arange(count) * (2 * np.pi / count)
    rings = path[:, None] + radius_m * (
        np.cos(angles)[:, None] * outward[:, None] + np.sin(angles)[:, None] * upward[:, None]
    )
    points = len(path)
    i, s = (index.ravel() for index in np.mgrid[0:points, 0:count])
    j, t = (i + 1) % points, (s + 1) % count
    a, b, c, d = i * count + s, j * count + s, j * count + t, i * count + t
    faces = np.concatenate((np.stack((a, b, c), axis=1), np.stack((a, c, d), axis=1)))
    return TriMesh(rings.reshape(-1, 3), faces)


def _axes(along: np.ndarray, lateral: np.ndarray) -> np.ndarray:
    """Return rows: lateral made square to the path, across both, along."""
    tangent = along / norm(along)
    side = lateral - tangent * dot(lateral, tangent)
    side = side / norm(side)
    return np.stack((side, np.cross(tangent, side), tangent))


def _frame(path: np.ndarray, i: int, lateral: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the directions of width and height at a point of a path, and how much longer the mitred height is."""
    before = path[i] - path[max(i - 1, 0)]
    after = path[min(i + 1, len(path) - 1)] - path[i]
    before = before if i > 0 else after
    after = after if i < len(path) - 1 else before
    before, after = before / norm(before), after / norm(after)
    side, across, tangent = _axes(before + after, lateral)
    return side, across, 1.0 / max(float(dot(tangent, after)), 0.5)


def _rounded(
    path: np.ndarray, width: np.ndarray, height: np.ndarray, radius_m: float, steps: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a path whose inner corners are quadratic curves that begin and end at most `radius_m` from them."""
    if radius_m <= 0 or len(path) < 3:
        return path, width, height
    rows = np.column_stack((path, width, height))
    out = [rows[0]]
    for before, corner, after in zip(rows[:-2], rows[1:-1], rows[2:], strict=True):
        reach = [min(radius_m / norm((p - corner)[:3]), 0.48) for p in (before, after)]
        start, end = corner + reach[0] * (before - corner), corner + reach[1] * (after - corner)
        shares = np.linspace(0.0, 1.0, steps + 1)
        out += [(1 - t) ** 2 * start + 2 * t * (1 - t) * corner + t**2 * end for t in shares]
    out.append(rows[-1])
    table = np.array(out)
    return table[:, :3], table[:, 3], table[:, 4]

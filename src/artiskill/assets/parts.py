"""Collects the drawn and the touched parts of one link: panels, posts and bars, with their materials."""

import numpy as np
from numpy.typing import ArrayLike

from artiskill.assets.articulated_object import CollisionShape, Material, VisualMesh
from artiskill.assets.finishes import GRAIN_TILE_M
from artiskill.geometry.arrays import norm
from artiskill.geometry.meshes import TriMesh, merge, sample_surface
from artiskill.geometry.primitives import box

IDENTITY = np.array((1.0, 0.0, 0.0, 0.0))
BEVEL_M = 0.0012
SURFACE_POINTS = 200
_DISC_SIDES = 24

# A bevelled box's 24 corners: corner k % 8 on the face across axis k // 8 (geometry.meshes.box).
_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
_CORNER_SIGNS = np.tile(_SIGNS, (3, 1))
_CORNER_FACE = np.repeat(np.arange(3), 8)


def _panel_faces() -> np.ndarray:
    """Triangles of a bevelled box over the corner order above; the same for all sizes, so found only once."""
    unit = box((1.0, 1.0, 1.0), 0.2)
    corners = _CORNER_SIGNS * (1.0 - 0.2 * (1 - np.eye(3)[_CORNER_FACE]))
    order = np.argmin(norm(unit.vertices[:, None] - corners[None]), axis=1)
    return order[unit.faces].astype(np.int32)


_FACES = _panel_faces()


class LinkParts:
    """What a link is made of, in the link's frame."""

    def __init__(self, origin: ArrayLike, rng: np.random.Generator) -> None:
        """Parts are given in the object frame and kept relative to `origin`."""
        self._origin = np.asarray(origin, dtype=float)
        self._rng = rng
        self._drawn: dict[tuple[str, int], tuple[Material, list[TriMesh]]] = {}
        self.collisions: list[CollisionShape] = []

    def panel(
        self,
        low: ArrayLike,
        high: ArrayLike,
        material: Material,
        part: str,
        grain: int | None = None,
        collide: bool = True,
    ) -> None:
        """A bevelled board between two corners, given in the object frame.

        Args:
            low: smallest x, y, z.
            high: largest x, y, z.
            material: of all its faces.
            part: semantic name.
            grain: axis along which the grain runs, by default the longest.
            collide: whether the board is touched too.
        """
        corners = np.array((low, high), dtype=float) - self._origin
        centre, half = corners.mean(axis=0), (corners[1] - corners[0]) / 2
        assert (half > 0).all(), f"panel {part} has no volume: half extents {half}"
        self.add_visual(
            panel_mesh(centre, half, int(np.argmax(half)) if grain is None else grain, self._rng), material, part
        )
        if collide:
            self.add_collision(CollisionShape("box", tuple(half.tolist()), centre, IDENTITY, part=part))

    def add_visual(self, mesh: TriMesh, material: Material, part: str) -> None:
        """Add a mesh in the link's frame; meshes of one material and part become one."""
        self._drawn.setdefault((part, id(material)), (material, []))[1].append(mesh)

    def add_collision(self, shape: CollisionShape) -> None:
        """Add a shape in the link's frame."""
        self.collisions.append(shape)

    def local(self, point: ArrayLike) -> np.ndarray:
        """A point of the object frame in the link's frame."""
        return np.asarray(point, dtype=float) - self._origin

    def visuals(self) -> tuple[VisualMesh, ...]:
        """One mesh per part and material."""
        return tuple(
            VisualMesh(merge(meshes), material, part) for (part, _), (material, meshes) in self._drawn.items()
        )

    def surface_points(self) -> np.ndarray:
        """Samples of everything drawn, (SURFACE_POINTS, 3)."""
        meshes = [mesh for _, meshes in self._drawn.values() for mesh in meshes]
        return sample_surface(meshes, SURFACE_POINTS, self._rng)


def standing_disc(radius_m: float, low_m: float, high_m: float, part: str) -> CollisionShape:
    """A round foot or floor about the z axis that stands on the ground, as a prism of 24 sides.

    No cylinder: MuJoCo 4.0.1 takes one for up to 22 mm deep in a plane when its axis is off the plane's normal
    by some 1e-15, and kicks it up. Settled objects are just so.
    """
    around = np.arange(_DISC_SIDES) * (2 * np.pi / _DISC_SIDES)
    ring = np.round(radius_m * np.stack((np.cos(around), np.sin(around)), axis=1), 6)
    half = (high_m - low_m) / 2
    corners = np.concatenate([np.column_stack((ring, np.full(_DISC_SIDES, z))) for z in (-half, half)])
    return CollisionShape("hull", (), np.array((0.0, 0.0, low_m + half)), IDENTITY, corners, part)


def panel_mesh(centre: np.ndarray, half: np.ndarray, grain: int, rng: np.random.Generator) -> TriMesh:
    """A bevelled box with texture coordinates: u along the grain, v across it, at a random place of the texture.

    Every corner of a bevelled box belongs to one face, so that each face has its own planar map.
    """
    bevel = min(BEVEL_M, 0.45 * float(half.min()))
    vertices = _CORNER_SIGNS * (half - bevel * (1 - np.eye(3)[_CORNER_FACE]))
    across = np.array([next(a for a in (2, 1, 0) if a not in (face, grain)) for face in range(3)])
    along = np.array([grain if face != grain else (grain + 1) % 3 for face in range(3)])
    across = np.where(across == along, 3 - along - np.arange(3), across)
    rows = np.arange(len(vertices))
    uv = np.stack((vertices[rows, along[_CORNER_FACE]], vertices[rows, across[_CORNER_FACE]]), axis=1)
    uv = (uv - uv.min(axis=0)) / GRAIN_TILE_M
    uv += rng.random(2) * np.maximum(1.0 - uv.max(axis=0), 0.0)
    return TriMesh(vertices + centre, _FACES, uv.astype(np.float32))

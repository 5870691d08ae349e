"""`LinkParts` collects the visual meshes and collision shapes of one link: boards, prisms and ready-made parts."""

import numpy as np
from numpy.typing import ArrayLike

from artiskill.assets.articulated_object import CollisionShape, Joint, Link, Material, VisualMesh
from artiskill.assets.finishes import GRAIN_TILE_M
from artiskill.geometry.arrays import norm
from artiskill.geometry.meshes import TriMesh, merge, sample_surface
from artiskill.geometry.primitives import box, upright_prism
from artiskill.geometry.rotations import quat_from_axis_angle

IDENTITY = np.array((1.0, 0.0, 0.0, 0.0))
# Quaternions that turn z onto x and z onto -y.
TO_X = quat_from_axis_angle((0, 1, 0), np.pi / 2)
TO_Y = quat_from_axis_angle((1, 0, 0), np.pi / 2)
_BEVEL_M = 0.0012
_SURFACE_POINTS = 200
_DISC_SIDES = 24

# A bevelled box's 24 corners: corner k % 8 on the face across axis k // 8 (geometry.primitives.box).
_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
_CORNER_SIGNS = np.tile(_SIGNS, (3, 1))
_CORNER_FACE = np.repeat(np.arange(3), 8)


def _panel_faces() -> np.ndarray:
    """Return the triangles of a bevelled box over the corner order above; they are the same for all sizes."""
    unit = box((1.0, 1.0, 1.0), 0.2)
    corners = _CORNER_SIGNS * (1.0 - 0.2 * (1 - np.eye(3)[_CORNER_FACE]))
    order = np.argmin(norm(unit.vertices[:, None] - corners[None]), axis=1)
    return order[unit.faces].astype(np.int32)


_FACES = _panel_faces()


class LinkParts:
    """What a link is made of, in the link's frame."""

    def __init__(self, origin: ArrayLike, rng: np.random.Generator) -> None:
        """Start with nothing.

        Args:
            origin: of the link's frame, in the object frame; the frames are parallel.
            rng: draws surface samples and where in its texture each board lies.
        """
        self._origin = np.asarray(origin, dtype=float)
        self._rng = rng
        self._visuals: dict[tuple[str, int], tuple[Material, list[TriMesh]]] = {}
        self.collisions: list[CollisionShape] = []

    def add_visual(self, mesh: TriMesh, material: Material, part: str) -> None:
        """Add a mesh in the link's frame; meshes of one material and part become one."""
        self._visuals.setdefault((part, id(material)), (material, []))[1].append(mesh)

    def add_collision(self, shape: CollisionShape) -> None:
        """Add a shape in the link's frame."""
        self.collisions.append(shape)

    def add_collision_box(self, low: ArrayLike, high: ArrayLike, part: str) -> None:
        """Add a box between two corners in the object frame."""
        centre, half = self._box(low, high, part)
        self.add_collision(CollisionShape("box", tuple(half.tolist()), centre, IDENTITY, part=part))

    def add_panel(
        self,
        low: ArrayLike,
        high: ArrayLike,
        material: Material,
        part: str,
        grain: int | None = None,
        collide: bool = True,
    ) -> None:
        """Add a bevelled board between two corners in the object frame.

        Args:
            low: smallest x, y, z.
            high: largest x, y, z.
            material: of all its faces.
            part: semantic name.
            grain: axis along which the grain runs, by default the longest.
            collide: whether it also gets a collision shape.
        """
        centre, half = self._box(low, high, part)
        axis = int(np.argmax(half)) if grain is None else grain
        self.add_visual(panel_mesh(centre, half, axis, self._rng), material, part)
        if collide:
            self.add_collision(CollisionShape("box", tuple(half.tolist()), centre, IDENTITY, part=part))

    def add_prism(self, outline: np.ndarray, z0: float, z1: float, material: Material, part: str) -> None:
        """Add a board of a convex outline (P, 2) in x and y, counter-clockwise, in the object frame.

        Its grain runs along y.
        """
        mesh = upright_prism(outline, z0, z1)
        self.add_mapped(mesh, 1, material, part)
        centre = mesh.vertices.mean(axis=0)
        corners = mesh.vertices - centre
        self.add_collision(CollisionShape("hull", (), self.local(centre), IDENTITY, corners, part))

    def add_mapped(self, mesh: TriMesh, grain: int, material: Material, part: str) -> None:
        """Add a mesh in the object frame, its texture projected along x, or along z where the mesh is flat."""
        y, z = mesh.vertices[:, 1], mesh.vertices[:, 2]
        if np.ptp(z) < np.ptp(mesh.vertices[:, 0]):
            z = mesh.vertices[:, 0]
        uv = _placed_texture(np.stack((y, z) if grain == 1 else (z, y), axis=1), self._rng)
        self.add_visual(TriMesh(mesh.vertices - self._origin, mesh.faces, uv), material, part)

    def add_tilted_panel(
        self, centre: ArrayLike, half: ArrayLike, turn: np.ndarray, grain: int, material: Material, part: str
    ) -> None:
        """Add the mesh of a bevelled board turned about its centre; `half` extents are those before the turn."""
        mesh = panel_mesh(np.zeros(3), np.asarray(half, dtype=float), grain, self._rng)
        self.add_visual(mesh.transformed(self.local(centre), turn), material, part)

    def local(self, point: ArrayLike) -> np.ndarray:
        """Return a point of the object frame in the link's frame."""
        return np.asarray(point, dtype=float) - self._origin

    def link(self, name: str, parent: int, joint: Joint | None, density_kg_m3: float) -> Link:
        """Return the link, with samples of its drawn surface; its parent's frame is the object frame."""
        visuals, points, shapes = self.visuals(), self.surface_points(), tuple(self.collisions)
        return Link(name, parent, self._origin, IDENTITY, joint, visuals, shapes, density_kg_m3, points)

    def visuals(self) -> tuple[VisualMesh, ...]:
        """Return one mesh per part and material."""
        return tuple(
            VisualMesh(merge(meshes), material, part) for (part, _), (material, meshes) in self._visuals.items()
        )

    def surface_points(self) -> np.ndarray:
        """Sample everything drawn: (200, 3)."""
        meshes = [mesh for _, meshes in self._visuals.values() for mesh in meshes]
        return sample_surface(meshes, _SURFACE_POINTS, self._rng)

    def _box(self, low: ArrayLike, high: ArrayLike, part: str) -> tuple[np.ndarray, np.ndarray]:
        """Return centre and half extents in the link's frame of a box in the object frame."""
        corners = np.array((low, high), dtype=float) - self._origin
        centre, half = corners.mean(axis=0), (corners[1] - corners[0]) / 2
        assert (half > 0).all(), f"{part} has no volume: half extents {half}"
        return centre, half


def standing_disc(radius_m: float, low_m: float, high_m: float, part: str) -> CollisionShape:
    """Return a round foot or floor about the z axis that stands on the ground, as a prism of 24 sides.

    It is no cylinder: MuJoCo 4.0.1 lets one sink up to 22 mm into a plane when its axis is off the plane's normal
    by about 1e-15, and kicks it up. Settled objects are in just this state.
    """
    around = np.arange(_DISC_SIDES) * (2 * np.pi / _DISC_SIDES)
    ring = np.round(radius_m * np.stack((np.cos(around), np.sin(around)), axis=1), 6)
    half = (high_m - low_m) / 2
    corners = np.concatenate([np.column_stack((ring, np.full(_DISC_SIDES, z))) for z in (-half, half)])
    return CollisionShape("hull", (), np.array((0.0, 0.0, low_m + half)), IDENTITY, corners, part)


def panel_mesh(centre: np.ndarray, half: np.ndarray, grain: int, rng: np.random.Generator) -> TriMesh:
    """Return a bevelled box with texture coordinates: u along the grain, v across it, at a random place.

    Every corner of a bevelled box belongs to one face, so that each face has its own planar map.
    """
    bevel = min(_BEVEL_M, 0.45 * float(half.min()))
    vertices = _CORNER_SIGNS * (half - bevel * (1 - np.eye(3)[_CORNER_FACE]))
    across = np.array([next(a for a in (2, 1, 0) if a not in (face, grain)) for face in range(3)])
    along = np.array([grain if face != grain else (grain + 1) % 3 for face in range(3)])
    across = np.where(across == along, 3 - along - np.arange(3), across)
    rows = np.arange(len(vertices))
    uv = np.stack((vertices[rows, along[_CORNER_FACE]], vertices[rows, across[_CORNER_FACE]]), axis=1)
    return TriMesh(vertices + centre, _FACES, _placed_texture(uv, rng))


def _placed_texture(uv: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Turn coordinates in metres, (N, 2), into float32 ones at a random place of a grain texture."""
    uv = (uv - uv.min(axis=0)) / GRAIN_TILE_M
    uv += rng.random(2) * np.maximum(1.0 - uv.max(axis=0), 0.0)
    return uv.astype(np.float32)

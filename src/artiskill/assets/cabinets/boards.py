"""`Boards`: a link's parts, with what joinery adds to panels: prisms, tilted boards and boards of any form."""

import numpy as np
from numpy.typing import ArrayLike

from artiskill.assets.articulated_object import CollisionShape, Material
from artiskill.assets.finishes import GRAIN_TILE_M
from artiskill.assets.parts import IDENTITY, LinkParts, panel_mesh
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import upright_prism


class Boards(LinkParts):
    """What a link of a cabinet is made of; everything is given in the object frame."""

    def prism(
        self, outline: np.ndarray, z0: float, z1: float, material: Material, part: str, collide: bool = True
    ) -> None:
        """A board of a convex outline (P, 2) in x and y, counter-clockwise, its grain along y."""
        mesh = upright_prism(outline, z0, z1)
        self.form(mesh, 1, material, part)
        if collide:
            centre = mesh.vertices.mean(axis=0)
            corners = mesh.vertices - centre
            self.add_collision(CollisionShape("hull", (), self.local(centre), IDENTITY, corners, part))

    def form(self, mesh: TriMesh, grain: int, material: Material, part: str) -> None:
        """Draw a mesh, mapped flat from the front: exact on what faces the room."""
        y, z = mesh.vertices[:, 1], mesh.vertices[:, 2]
        if np.ptp(z) < np.ptp(mesh.vertices[:, 0]):  # it lies: mapped from above
            z = mesh.vertices[:, 0]
        uv = np.stack((y, z) if grain == 1 else (z, y), axis=1)
        uv = (uv - uv.min(axis=0)) / GRAIN_TILE_M
        uv += self._rng.random(2) * np.maximum(1.0 - uv.max(axis=0), 0.0)
        self.add_visual(TriMesh(mesh.vertices - self._origin, mesh.faces, uv.astype(np.float32)), material, part)

    def tilted(
        self, centre: ArrayLike, half: ArrayLike, turn: np.ndarray, grain: int, material: Material, part: str
    ) -> None:
        """Draw a bevelled board turned about its centre; `half` extents before the turn."""
        mesh = panel_mesh(np.zeros(3), np.asarray(half, dtype=float), grain, self._rng)
        self.add_visual(mesh.transformed(self.local(centre), turn), material, part)

    def add_collision_box(self, low: ArrayLike, high: ArrayLike, part: str) -> None:
        """Touch a box between two corners, without drawing it."""
        corners = np.array((low, high), dtype=float) - self._origin
        half = (corners[1] - corners[0]) / 2
        assert (half > 0).all(), f"{part} has no volume: half extents {half}"
        self.add_collision(CollisionShape("box", tuple(half.tolist()), corners.mean(axis=0), IDENTITY, part=part))

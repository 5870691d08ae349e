"""Adds drawn and touched parts, given in the object's frame or in one of their own, to a link."""

from typing import Any

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.chairs.appearance import Skin
from artiskill.assets.chairs.beams import Beam, Tube
from artiskill.assets.chairs.pads import Faces, Pad, hull_shape, pad_hulls, pad_mesh
from artiskill.assets.parts import IDENTITY, LinkParts
from artiskill.geometry.arrays import matmul
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.rotations import quat_multiply, quat_rotate

# Texture coordinates of a mesh without its own: a plane that no face of a chair stands square to.
_PLANE = np.array(((0.94, 0.1), (0.1, 0.94), (0.3, 0.3)))
_TEXTURE_PLACE = (0.37, 0.61)  # of a pad's middle


class Pen:
    """Adds to one link."""

    def __init__(self, parts: LinkParts, origin: Any = (0.0, 0.0, 0.0), turn: np.ndarray = IDENTITY) -> None:
        """Parts are given in a frame whose origin and rotation in the object frame these are."""
        self._parts = parts
        self._origin = parts.local(origin)
        self._turn = turn

    def mesh(self, mesh: TriMesh, skin: Skin, part: str) -> None:
        """Draw a mesh; texture coordinates are made for it where its material needs them."""
        uvs = mesh.uvs
        if skin.material.texture is None:
            uvs = None
        elif uvs is None:
            uvs = (matmul(mesh.vertices, _PLANE) / skin.tile_m).astype(np.float32)
        placed = TriMesh(mesh.vertices, mesh.faces, uvs).transformed(self._origin, self._turn)
        self._parts.add_visual(placed, skin.material, part)

    def shape(self, shape: CollisionShape) -> None:
        """Touch a shape."""
        position = self._origin + quat_rotate(self._turn, np.asarray(shape.position, dtype=float))
        turn = quat_multiply(self._turn, shape.quaternion)
        self._parts.add_collision(
            CollisionShape(shape.kind, shape.size, position, turn, shape.vertices, shape.part)
        )

    def bar(
        self,
        bar: Beam | Tube,
        skin: Skin,
        part: str,
        fillet_m: float = 0.0,
        count: int = 8,
        touched: bool = True,
    ) -> None:
        """Draw and, unless told otherwise, touch a bar or a tube."""
        mesh = bar.mesh(count, fillet_m)
        if mesh.uvs is not None:
            mesh = TriMesh(mesh.vertices, mesh.faces, mesh.uvs / np.float32(skin.tile_m))
        self.mesh(mesh, skin, part)
        for shape in bar.shapes(part) if touched else ():
            self.shape(shape)

    def cushion(self, pad: Pad, skin: Skin, part: str, count: int = 28, seen: Faces = "both") -> None:
        """Draw a pad; a face that is not seen is drawn coarsely."""
        self.mesh(pad_mesh(pad, skin.tile_m, _TEXTURE_PLACE, count, seen), skin, part)

    def touch_pad(self, pad: Pad, part: str, pieces: int = 1, along: int = 1, count: int = 16) -> None:
        """Touch a pad."""
        for points in pad_hulls(pad, pieces, along, count):
            self.shape(hull_shape(points, part))

"""A little scene: a cabinet-like box with a round handle, a table, balls, a textured sheet."""

import math
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from artiskill.assets.articulated_object import Material, VisualMesh
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import box, capsule, cylinder, sphere, tube
from artiskill.geometry.rotations import quat_from_rpy, transform_points
from artiskill.sensors.camera import Camera
from artiskill.sensors.renderer import BodyVisual


@dataclass(frozen=True)
class LittleScene:
    visuals: list[BodyVisual]
    positions_w: np.ndarray  # (N, 3)
    quaternions_w: np.ndarray  # (N, 4)
    camera: Camera

    def triangles_w(self) -> tuple[np.ndarray, np.ndarray]:
        """All corners (F, 3, 3) in the world and their visuals (F,), computed apart from the renderer."""
        corners, geoms = [], []
        for geom, item in enumerate(self.visuals):
            mesh = item.visual.mesh
            vertices = mesh.vertices
            if item.body >= 0:
                vertices = transform_points(self.positions_w[item.body], self.quaternions_w[item.body], vertices)
            corners.append(vertices[mesh.faces])
            geoms.append(np.full(len(mesh.faces), geom))
        return np.concatenate(corners), np.concatenate(geoms)


def material(colour=(0.6, 0.6, 0.6), shininess=0.2, texture=None) -> Material:
    return Material("test", (*colour, 1.0), texture, shininess)


def visual(mesh: TriMesh, body: int = -1, part: str = "part", **looks) -> BodyVisual:
    return BodyVisual(body, VisualMesh(mesh, material(**looks), part))


def sheet(half_m: float = 0.5) -> TriMesh:
    """A square in the plane x = 0 that looks towards -x, its texture upright seen from there."""
    vertices = half_m * np.array([[0, 1, -1], [0, -1, -1], [0, -1, 1], [0, 1, 1]], dtype=float)
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32)
    return TriMesh(vertices, np.array([[0, 2, 1], [0, 3, 2]])[:, ::-1], uvs)


@pytest.fixture(scope="session")
def little_scene() -> LittleScene:
    texture = np.zeros((8, 8, 3), dtype=np.uint8)
    texture[::2, ::2] = 255
    handle = [(0, -0.1, 0), (-0.03, -0.09, 0), (-0.03, 0.09, 0), (0, 0.1, 0)]
    parts = [
        (box((0.3, 0.4, 0.45), 0.004), (0.0, 0.0, 0.46), (0, 0, 0.1)),
        (tube(handle, 0.008), (-0.31, 0.0, 0.6), (0, 0, 0.1)),
        (box((0.35, 0.5, 0.02), 0.006), (-0.1, 1.3, 0.7), (0, 0, 0)),
        (cylinder(0.04, 0.34, 24), (-0.1, 1.3, 0.34), (0, 0.1, 0)),
        (sphere(0.12, 32, 13), (-0.15, 1.2, 0.85), (0.4, 0, 0)),
        (capsule(0.05, 0.08), (-0.3, 1.5, 0.81), (1.2, 0.3, 0)),
        (sheet(0.3), (0.2, -0.9, 0.4), (0, 0.2, 0.3)),
    ]
    visuals = [
        visual(mesh, body, colour=(0.2 + 0.1 * body, 0.5, 0.8 - 0.1 * body), texture=texture)
        for body, (mesh, _, _) in enumerate(parts)
    ]
    visuals.append(visual(box((0.05, 0.05, 0.4)).transformed((-1.0, -0.3, 0.4))))
    camera = Camera.look_at((-2.4, -1.1, 1.5), (0, 0.3, 0.5), width=160, height=120, fov_rad=math.radians(50))
    positions = np.array([p for _, p, _ in parts], dtype=float)
    return LittleScene(visuals, positions, np.array([quat_from_rpy(r) for _, _, r in parts]), camera)


@pytest.fixture(scope="session")
def make() -> SimpleNamespace:
    """`visual(mesh, body, **looks)` and `sheet(half_m)`."""
    return SimpleNamespace(visual=visual, sheet=sheet)

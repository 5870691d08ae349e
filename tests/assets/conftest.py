"""A box with a drawer, small enough to be exported and imported in no time."""

import numpy as np
import pytest

from artiskill.assets.articulated_object import (
    ArticulatedObject,
    CollisionShape,
    Joint,
    Link,
    Material,
    VisualMesh,
)
from artiskill.assets.handles import handle_from_mesh
from artiskill.geometry.meshes import sample_surface
from artiskill.geometry.primitives import box

STILL = np.array((1.0, 0.0, 0.0, 0.0))


@pytest.fixture(scope="session")
def drawer_box() -> ArticulatedObject:
    """The drawer slides 0.2 m towards -x; its material has a texture; one shape is a hull."""
    rng = np.random.default_rng(0)
    oak = Material("oak", (0.5, 0.4, 0.2, 1.0), np.arange(60, dtype=np.uint8).reshape(4, 5, 3))
    slide = Joint("slide", "prismatic", np.array((-1.0, 0.0, 0.0)), np.zeros(3), (0.0, 0.2))
    case = [_part((0.2, 0.2, 0.1), (0.0, 0.0, 0.1), "side", oak)]
    drawer = [
        _part((0.01, 0.2, 0.1), (0.0, 0.0, 0.0), "front", oak),
        _part((0.005, 0.05, 0.005), (-0.045, 0.0, 0.0), "handle", oak),
    ]
    links = (
        _link("base", -1, (0.0, 0.0, 0.0), None, case, rng),
        _link("link_0", 0, (-0.22, 0.0, 0.1), slide, drawer, rng),
    )
    handle = handle_from_mesh("link_0", "bar", drawer[1][0].mesh, np.array((-1.0, 0.0, 0.0)), rng, hookable=True)
    bounds = np.array(((-0.27, -0.2, 0.0), (0.2, 0.2, 0.2)))
    metadata = {"source": "own", "sizes": [1, 2.5, (True, None)], "origin": np.zeros(3), "seed": np.int64(3)}
    return ArticulatedObject("drawer-box", "cabinet", links, (handle,), bounds, metadata)


def _part(half, centre, name, material):  # type: ignore[no-untyped-def]
    place = np.array(centre)
    mesh = box(half)
    kind = "hull" if name == "side" else "box"
    vertices = mesh.vertices if kind == "hull" else None
    shape = CollisionShape(kind, () if kind == "hull" else half, place, STILL, vertices, name)
    return VisualMesh(mesh.transformed(centre), material, name), shape


def _link(name, parent, position, joint, parts, rng):  # type: ignore[no-untyped-def]
    visuals, shapes = zip(*parts, strict=True)
    points = sample_surface([visual.mesh for visual in visuals], 20, rng)
    return Link(name, parent, np.array(position), STILL, joint, visuals, shapes, 600.0, points)

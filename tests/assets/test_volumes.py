"""Volumes of collision shapes against the engine's."""

import mujoco
import numpy as np
import pytest

from artiskill.assets.articulated_object import CollisionShape, ShapeKind
from artiskill.assets.volumes import density_for_mass, first_moment_m4, shape_volume_m3, shapes_volume_m3
from artiskill.robots.shapes import GEOM_TYPES

ORIGIN, UNTURNED = np.zeros(3), np.array((1.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("kind", "size"),
    [("box", (0.1, 0.2, 0.3)), ("cylinder", (0.1, 0.2)), ("capsule", (0.1, 0.2)), ("sphere", (0.1,))],
)
def test_primitives_weigh_what_they_do_in_the_engine(kind: ShapeKind, size: tuple[float, ...]) -> None:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="one")
    body.add_geom(type=GEOM_TYPES[kind], size=(*size, *[0.0] * (3 - len(size))), density=500)
    volume = shape_volume_m3(CollisionShape(kind, size, ORIGIN, UNTURNED))
    assert spec.compile().body("one").mass[0] == pytest.approx(500 * volume)


def test_hulls_and_sums() -> None:
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 3)], dtype=float)
    shapes = [
        CollisionShape("hull", (), ORIGIN, UNTURNED, corners),
        CollisionShape("box", (0.5, 0.5, 0.5), ORIGIN, UNTURNED),
    ]
    assert shapes_volume_m3(shapes) == pytest.approx(7.0)
    assert density_for_mass(14.0, shapes) == pytest.approx(2.0)
    np.testing.assert_allclose(first_moment_m4(shapes), (3.0, 6.0, 9.0))


def test_first_moment_turns_with_the_shape() -> None:
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 3)], dtype=float)
    about_z = np.array((np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)))  # x becomes y, y becomes -x
    shape = CollisionShape("hull", (), np.array((10.0, 0.0, 0.0)), about_z, corners)
    np.testing.assert_allclose(first_moment_m4([shape]), (6.0 * 9.0, 6.0 * 0.5, 6.0 * 1.5))

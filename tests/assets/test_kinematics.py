"""Forward kinematics and volumes against the engine's."""

import math

import mujoco
import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape, Joint, Link, ShapeKind
from artiskill.assets.catalog import load_object
from artiskill.assets.kinematics import (
    density_for_mass,
    drawn_points,
    first_moment_m4,
    joint_values,
    link_poses,
    shape_volume_m3,
    shapes_volume_m3,
)
from artiskill.errors import ConfigError
from artiskill.geometry.rotations import quat_to_matrix
from artiskill.robots.model import GEOM_TYPES

ORIGIN, UNTURNED = np.zeros(3), np.array((1.0, 0.0, 0.0, 0.0))


def engine_poses(obj: ArticulatedObject, qpos: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same tree of bodies and joints in the engine, built here from the object's description."""
    spec = mujoco.MjSpec()
    bodies = []
    for link in obj.links:
        parent = spec.worldbody if link.parent < 0 else bodies[link.parent]
        body = parent.add_body(name=link.name, pos=link.position, quat=link.quaternion)
        body.explicitinertial, body.mass, body.inertia = True, 1.0, (0.1, 0.1, 0.1)
        if link.joint is not None:
            slides = link.joint.kind == "prismatic"
            kind = mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
            body.add_joint(name=link.joint.name, type=kind, axis=link.joint.axis, pos=link.joint.origin)
        bodies.append(body)
    model = spec.compile()
    data = mujoco.MjData(model)
    order = [model.joint(obj.links[i].joint.name).qposadr[0] for i in obj.jointed_links]
    data.qpos[order] = qpos
    mujoco.mj_kinematics(model, data)
    ids = [model.body(link.name).id for link in obj.links]
    return data.xpos[ids], data.xmat[ids].reshape(-1, 3, 3)


@pytest.mark.parametrize("object_id", ["cabinet-0001", "cabinet-0003", "generated:7"])
@pytest.mark.parametrize("seed", [0, 1])
def test_poses_are_the_engines(object_id: str, seed: int) -> None:
    obj = load_object(object_id)
    qpos = joint_values(obj, np.random.default_rng(seed).uniform(0, 1, len(obj.jointed_links)))
    positions, quaternions = link_poses(obj, qpos)
    expected_positions, expected_rotations = engine_poses(obj, qpos)
    np.testing.assert_allclose(positions, expected_positions, atol=1e-12)
    np.testing.assert_allclose(quat_to_matrix(quaternions), expected_rotations, atol=1e-12)


def test_a_chain_of_joints_with_shifted_axes(swivel: ArticulatedObject) -> None:
    qpos = np.array((0.3, -2.0))
    positions, quaternions = link_poses(swivel, qpos)
    expected_positions, expected_rotations = engine_poses(swivel, qpos)
    np.testing.assert_allclose(positions, expected_positions, atol=1e-12)
    np.testing.assert_allclose(quat_to_matrix(quaternions), expected_rotations, atol=1e-12)


def test_shares_of_ranges(swivel: ArticulatedObject) -> None:
    np.testing.assert_allclose(joint_values(swivel, 0.0), (-0.1, 0.0))
    np.testing.assert_allclose(joint_values(swivel, 0.5), (0.1, math.pi))
    np.testing.assert_allclose(joint_values(swivel, (1.0, 0.25)), (0.3, math.pi / 2))


def test_bad_values_are_named(swivel: ArticulatedObject) -> None:
    with pytest.raises(ConfigError, match=r"has 2 joints.*\(2,\), not \(3,\)"):
        link_poses(swivel, np.zeros(3))
    with pytest.raises(ConfigError, match="finite"):
        link_poses(swivel, (0.0, math.nan))
    with pytest.raises(ConfigError, match="one share for all of them or 2, not 3"):
        joint_values(swivel, (0.0, 0.0, 0.0))
    for share in (-0.1, 1.1, math.nan):
        with pytest.raises(ConfigError, match=r"lie in \[0, 1\]"):
            joint_values(swivel, share)


def test_drawn_points_move_with_their_links() -> None:
    obj = load_object("cabinet-0003")
    closed, opened = (drawn_points(obj, joint_values(obj, share)) for share in (0.0, 1.0))
    np.testing.assert_allclose((closed.min(axis=0), closed.max(axis=0)), obj.bounds, atol=1e-6)
    assert opened[:, 0].min() < closed[:, 0].min() - 0.1  # cabinets face -x


def test_an_object_that_draws_nothing_has_its_bounds(swivel: ArticulatedObject) -> None:
    points = drawn_points(swivel, (0.0, 0.0))
    np.testing.assert_array_equal((points.min(axis=0), points.max(axis=0)), swivel.bounds)


@pytest.fixture
def swivel() -> ArticulatedObject:
    """A lift on which something turns without end, about an axis beside its frame."""
    tilted = np.array((math.cos(0.3), 0.0, math.sin(0.3), 0.0))
    axis = np.array((1.0, 2.0, 2.0)) / 3.0
    root = Link("base", -1, np.array((0.1, 0.2, 0.0)), tilted, None, (), (), 1.0, np.zeros((0, 3)))
    lift = Joint("lift", "prismatic", np.array((0.0, 0.0, 1.0)), np.zeros(3), (-0.1, 0.3))
    turn = Joint("turn", "revolute", axis, np.array((0.3, -0.1, 0.2)), (-math.inf, math.inf))
    first = Link("link_0", 0, np.array((0.0, 0.5, 0.1)), tilted, lift, (), (), 1.0, np.zeros((0, 3)))
    second = Link("link_1", 1, np.array((0.2, 0.0, 0.4)), tilted, turn, (), (), 1.0, np.zeros((0, 3)))
    return ArticulatedObject("swivel", "chair", (root, first, second), (), np.array(((-1, -2, 0), (1, 2, 3.0))))


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

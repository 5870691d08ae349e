"""Buckets: a hollow body that holds a ball, a bail on a hinge, names from anywhere."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.partnet import import_partnet
from artiskill.assets.partnet.collisions import shape_hull
from artiskill.errors import AssetError
from artiskill.geometry.meshes import TriMesh, depth_inside, merge
from artiskill.geometry.primitives import box, lathe, tube
from artiskill.scene.object_model import add_object
from artiskill.scene.physics import Group, PhysicsConfig, set_contact, set_options

# Radius and height, file units (0.3 m each): 0.72 units high, a wall of 0.035
OUTSIDE = [(0.0, 0.0), (0.32, 0.0), (0.44, 0.72)]
INSIDE = [(0.405, 0.72), (0.29, 0.04), (0.0, 0.04)]
SCALE = 0.3
BALL_RADIUS_M = 0.05


def bail() -> TriMesh:
    """A wire over the opening, upright as drawn, from ear to ear along y."""
    turn = np.linspace(0, np.pi, 25)
    return tube(np.stack((0 * turn, 0.46 * np.cos(turn), 0.68 + 0.46 * np.sin(turn)), axis=1), 0.015)


@pytest.fixture
def bucket(writer: Any, tmp_path: Path, cache_dir: Path) -> Callable[..., ArticulatedObject]:
    def make(
        body: TriMesh | None = None,
        names: str = "urdf",
        limits: tuple[object, object] = (-1.3, 1.3),
        body_part: str = "bucket_body",
    ) -> ArticulatedObject:
        body = lathe(OUTSIDE + INSIDE, 28) if body is None else body
        links = [
            writer.ToyLink("link_1", "base", "fixed", [(body_part, body)]),
            writer.ToyLink("link_0", "link_1", "revolute", [("handle", bail())], (0, 0, 0.68), (0, 1, 0), limits),
        ]
        return import_partnet(writer.write_object(tmp_path / names, "Bucket", links, names), cache_dir=cache_dir)

    return make


def test_stands_upright_with_a_bail(bucket):
    obj = bucket()
    assert obj.category == "bucket"
    assert obj.metadata["scale"] == SCALE
    assert obj.metadata["warnings"] == ()
    assert obj.bounds[0, 2] == pytest.approx(0, abs=1e-9)
    hinge = obj.links[1].joint
    assert hinge.limits == (-1.3, 1.3)
    np.testing.assert_allclose(np.abs(hinge.axis), (0, 1, 0), atol=1e-9)
    np.testing.assert_allclose(obj.links[1].position, (0, 0, 0.68 * SCALE), atol=2e-4)
    (handle,) = obj.handles
    assert handle.link == "link_0"
    assert handle.hookable
    assert {s.part for s in obj.links[0].collisions} == {"wall", "floor"}
    assert {s.part for s in obj.links[1].collisions} == {"handle"}


def test_its_bounds_are_those_at_rest(bucket):
    """The bail lies at its lower limit, turned by 1.3 from upright: it stands out in front."""
    obj = bucket()
    assert obj.bounds[1, 2] < (0.68 + 0.46) * SCALE - 0.05
    assert min(abs(obj.bounds[0, 0]), obj.bounds[1, 0]) == pytest.approx(0.44 * SCALE, rel=0.02)
    assert max(abs(obj.bounds[0, 0]), obj.bounds[1, 0]) == pytest.approx(0.46 * np.sin(1.3) * SCALE, rel=0.05)


def test_the_hollow_is_free_and_the_shapes_hug_the_wall(bucket):
    body = bucket().links[0]
    assert 12 <= len(body.collisions) <= 40
    hulls = [shape_hull(shape) for shape in body.collisions]
    heights = np.linspace(0.06, 0.7, 9)
    angles = np.linspace(0, 2 * np.pi, 50)
    for z in heights * SCALE:
        inner = (0.29 + (z / SCALE - 0.04) * (0.405 - 0.29) / 0.68) * SCALE
        ring = np.stack((np.cos(angles), np.sin(angles), 0 * angles), axis=1)
        free = ring * (inner - 0.007) + (0, 0, z)
        assert max(depth_inside(hull.planes, free).max() for hull in hulls) < 0
        wall = ring * (inner + 0.006) + (0, 0, z)
        assert np.max([depth_inside(hull.planes, wall) for hull in hulls], axis=0).min() > 0
    volume = sum(hull.volume_m3 for hull in hulls)
    assert 1 < 1000 * volume < 5  # litres: kilograms at the density of a bucket


BODIES = {
    "sheet": lathe(OUTSIDE, 24),
    "belly": lathe(
        [(0, 0), (0.3, 0), (0.45, 0.3), (0.38, 0.75), (0.35, 0.75), (0.41, 0.3), (0.27, 0.04), (0, 0.04)]
    ),
    "square": lathe(OUTSIDE + INSIDE, 4),
    "ring foot": merge([lathe([(0, 0.06), (0.32, 0.06), (0.44, 0.72)], 24), lathe([(0.3, 0), (0.31, 0.06)], 24)]),
}


@pytest.mark.slow
@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_a_ball_dropped_in_stays_in(bucket, body):
    obj = bucket(body)
    assert obj.metadata["warnings"] == ()
    model = _model_with_ball(obj)
    data = mujoco.MjData(model)
    for push in np.linspace(0, 2 * np.pi, 5, endpoint=False):
        mujoco.mj_resetData(model, data)
        ball = model.joint("ball").qposadr[0]
        data.qpos[ball : ball + 3] = (0.03, 0.0, obj.bounds[1, 2] + 0.1)
        for step in range(750):
            # once it has come down, it is driven against the wall all round
            force = 6.0 * np.array((np.cos(push + 0.01 * step), np.sin(push + 0.01 * step)))
            data.xfrc_applied[model.body("ball").id, :2] = force if step > 300 else 0.0
            mujoco.mj_step(model, data)
        place = data.body("ball").xpos - data.body("object/base").xpos
        assert 0.03 < place[2] < 0.2
        assert np.linalg.norm(place[:2]) < 0.44 * SCALE


def test_stands_still(bucket):
    model = _model_with_ball(bucket(), ball=False)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 1000)
    assert np.abs(data.qpos[:3]).max() < 2e-3
    assert 1 - 2 * (data.qpos[4] ** 2 + data.qpos[5] ** 2) > np.cos(np.radians(1))


@pytest.mark.parametrize("names", ["annotations", "links"])
def test_names_from_elsewhere_make_the_same_bucket(bucket, names):
    named, other = bucket(), bucket(names=names)
    assert [[v.part for v in link.visuals] for link in other.links] == [["wall"], ["handle"]]
    assert len(other.handles) == 1
    if names == "annotations":
        named.metadata.pop("partnet_id"), other.metadata.pop("partnet_id")
        assert other.content_hash == named.content_hash


def test_without_any_name_there_is_no_handle_and_it_is_said(bucket):
    obj = bucket(names="none")
    assert obj.handles == ()
    text = " ".join(obj.metadata["warnings"])
    assert "without a part name" in text
    assert "no movable link has a part named handle" in text
    assert len(obj.links[0].collisions) >= 12  # hollow all the same


def test_a_body_with_a_lid_is_warned_of(bucket):
    obj = bucket(lathe([(0, 0), (0.4, 0), (0.4, 0.7), (0, 0.7)], 24))
    assert any("'base' is no open vessel" in text for text in obj.metadata["warnings"])


@pytest.mark.parametrize("limits", [(0.5, 0.5), (1.0, 0.2), (0, "inf"), (0, 9)])
def test_degenerate_limits_are_named(bucket, limits):
    with pytest.raises(AssetError, match="joint 'joint_link_0'"):
        bucket(limits=limits)


def test_parts_may_be_named_one_by_one(writer, tmp_path, cache_dir):
    """Feet and a lip are found by name, and the body stays hollow."""
    body = lathe(OUTSIDE + INSIDE, 24)
    lip = lathe([(0.43, 0.7), (0.46, 0.7), (0.46, 0.74), (0.43, 0.74), (0.43, 0.7)], 24)
    foot = box((0.05, 0.05, 0.01)).transformed((0, 0, -0.01))
    links = [writer.ToyLink("link_0", "base", "fixed", [("side", body), ("rim", lip), ("bottom", foot)])]
    obj = import_partnet(writer.write_object(tmp_path / "a", "Bucket", links), cache_dir=cache_dir)
    assert [v.part for v in obj.links[0].visuals] == ["wall", "lip", "floor"]
    assert obj.metadata["parts"] == {"bottom": "floor", "rim": "lip", "side": "wall"}
    assert any("no bail" in text for text in obj.metadata["warnings"])


def _model_with_ball(obj: ArticulatedObject, ball: bool = True) -> Any:
    physics, spec = PhysicsConfig(), mujoco.MjSpec()
    set_options(spec, physics)
    ground = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(2, 2, 1))
    set_contact(ground, Group.GROUND, Group.OBJECT | Group.LOOSE, 0.5, physics)
    add_object(spec, obj, physics)
    if ball:
        body = spec.worldbody.add_body(name="ball")
        body.add_joint(name="ball", type=mujoco.mjtJoint.mjJNT_FREE)
        geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(BALL_RADIUS_M, 0, 0), density=1000.0)
        set_contact(geom, Group.LOOSE, Group.OBJECT | Group.GROUND, 0.5, physics)
    return spec.compile()

"""Chairs: joints and helper links, part names, wheels that roll, what settles and what is left out."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.partnet import import_partnet
from artiskill.assets.partnet.round_parts import TREAD_HALF_WIDTH_M
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import box, cylinder, sphere
from artiskill.scene.object_model import add_object
from artiskill.scene.physics import Group, PhysicsConfig, set_contact, set_options

SCALE = 0.8
WHEEL_RADIUS, REACH, TRAIL = 0.05, 0.35, 0.03
_HALF = np.sqrt(0.5)
ACROSS = (_HALF, _HALF, 0.0, 0.0)  # turns a cylinder's axis from z to y


def at(mesh: TriMesh, *place: float, quaternion: Any = (1, 0, 0, 0)) -> TriMesh:
    return mesh.transformed(place, quaternion)


def links(writer: Any, wheel: TriMesh | None = None) -> list[Any]:
    """Four legs with single casters, a column, a seat that slides on a helper link and turns, a back, two arms."""
    wheel = wheel or cylinder(WHEEL_RADIUS, 0.015, 24).transformed(quaternion=ACROSS)
    legs = [at(box((0.18, 0.02, 0.02)), 0.18, 0, 0.16), at(box((0.18, 0.02, 0.02)), -0.18, 0, 0.16)]
    legs += [at(box((0.02, 0.18, 0.02)), 0, 0.18, 0.16), at(box((0.02, 0.18, 0.02)), 0, -0.18, 0.16)]
    link = writer.ToyLink
    found = [
        link("link_0", "base", "fixed", [*(("leg", leg) for leg in legs), ("central_support", _column())]),
        link("helper", "link_0", "prismatic", [], (0, 0, 0.4), (0, 0, -1), (0, 0.1)),
        link("link_1", "helper", "continuous", _seat(), (0, 0, 0.4), (0, 0, 1)),
    ]
    for k, (x, y) in enumerate(((REACH, 0), (-REACH, 0), (0, REACH), (0, -REACH))):
        stem = at(cylinder(0.01, 0.03), x, y, 0.12)
        swivel, axle = (x, y, 0.12), (x + TRAIL, y, WHEEL_RADIUS)
        found.append(link(f"caster_{k}", "link_0", "continuous", [("caster_stem", stem)], swivel))
        part = [("wheel", at(wheel, *axle))]
        found.append(link(f"wheel_{k}", f"caster_{k}", "continuous", part, axle, (0, 1, 0)))
    return found


def _column() -> TriMesh:
    return at(cylinder(0.025, 0.12), 0, 0, 0.28)


def _seat() -> list[tuple[str, TriMesh]]:
    return [
        ("seat_soft_surface", at(box((0.24, 0.24, 0.03)), 0, 0, 0.5)),
        ("back_soft_surface", at(box((0.02, 0.22, 0.3)), 0.26, 0, 0.8)),
        ("armrest_hard_surface", at(box((0.15, 0.03, 0.01)), 0, 0.27, 0.7)),
        ("chair_head", at(box((0.02, 0.1, 0.05)), 0.26, 0, 1.15)),
    ]


@pytest.fixture
def chair(writer: Any, tmp_path: Path, cache_dir: Path) -> Callable[..., ArticulatedObject]:
    def make(change: Callable[[list[Any]], None] | None = None, names: str = "urdf", **options: Any) -> Any:
        found = links(writer, **options)
        if change is not None:
            change(found)
        return import_partnet(writer.write_object(tmp_path / names, "Chair", found, names), cache_dir=cache_dir)

    return make


def test_tree_frame_and_parts(chair):
    obj = chair()
    assert obj.category == "chair"
    assert obj.metadata["scale"] == SCALE
    assert [link.name for link in obj.links][:3] == ["base", "helper", "link_1"]
    assert len(obj.jointed_links) == 10
    kinds = [obj.links[i].joint.kind for i in obj.jointed_links]
    assert kinds.count("prismatic") == 1
    assert obj.bounds[0, 2] == pytest.approx(0)
    np.testing.assert_allclose(obj.links[1].position[:2], (-TRAIL * SCALE, 0), atol=1e-3)  # the casters trail
    parts = {v.part for link in obj.links for v in link.visuals}
    assert parts == {"base", "column", "seat", "back", "arm", "headrest", "caster", "wheel"}
    assert all(link.density_kg_m3 == 200 for link in obj.links)


def test_the_front_is_minus_x(chair):
    seat = chair().links[2]
    back = next(v for v in seat.visuals if v.part == "back")
    assert back.mesh.bounds[:, 0].mean() > 0.15


def test_wheels_are_round_about_their_axles(chair):
    wheels = [link for link in chair().links if link.name.startswith("wheel")]
    for link in wheels:
        (shape,) = link.collisions
        assert shape.kind == "cylinder"
        assert shape.part == "wheel"
        np.testing.assert_allclose(shape.size, (WHEEL_RADIUS * SCALE, TREAD_HALF_WIDTH_M), rtol=1e-6)
        np.testing.assert_allclose(shape.position, 0, atol=1e-9)


def test_a_ball_is_a_sphere(chair):
    obj = chair(wheel=sphere(WHEEL_RADIUS, 24, 9))
    assert {s.kind for link in obj.links if link.name.startswith("wheel") for s in link.collisions} == {"sphere"}


def test_an_oval_wheel_is_warned_of(chair):
    oval = cylinder(WHEEL_RADIUS, 0.015, 24).scaled((1.0, 0.9, 1.0)).transformed(quaternion=ACROSS)
    obj = chair(wheel=oval)
    assert any(
        text == "'wheel_0': a wheel is out of round by 4 mm: it rolls on its greatest radius"
        for text in obj.metadata["warnings"]
    )


def test_a_wheel_without_axle_keeps_its_round_shape(chair):
    def weld(found: list[Any]) -> None:
        for link in found:
            if link.name.startswith("wheel"):
                link.joint = "fixed"

    obj = chair(weld)
    caster = next(link for link in obj.links if link.name == "caster_0")
    (wheel,) = [shape for shape in caster.collisions if shape.part == "wheel"]
    assert wheel.kind == "cylinder"
    np.testing.assert_allclose(wheel.size, (WHEEL_RADIUS * SCALE, TREAD_HALF_WIDTH_M), rtol=1e-6)


def test_the_seat_is_let_down_and_it_is_said(chair):
    obj = chair()
    slide = obj.links[1].joint
    np.testing.assert_allclose(slide.axis, (0, 0, 1), atol=1e-9)
    assert slide.limits == pytest.approx((0, 0.1 * SCALE))
    assert obj.bounds[1, 2] == pytest.approx(1.1 * SCALE)  # drawn: 1.2
    text = " ".join(obj.metadata["warnings"])
    assert "joint 'joint_helper' of 'helper': limits (0, 0.1): nothing holds it up" in text
    assert "link 'helper' has no mesh: a joint in a chain" in text


def test_links_that_carry_nothing_are_left_out(chair, writer):
    def add(found: list[Any]) -> None:
        found.append(writer.ToyLink("ghost", "link_1", "revolute", [], (0, 0, 0.5), (0, 1, 0), (0.5, 0.5)))

    obj = chair(add)
    assert "ghost" not in [link.name for link in obj.links]
    assert any("link 'ghost' and its joint 'joint_ghost' are left out" in t for t in obj.metadata["warnings"])


def test_a_full_turn_has_no_end_and_a_tilt_keeps_its_limits(chair):
    def limit(found: list[Any]) -> None:
        found[2].joint, found[2].limits = "revolute", (-3.14159, 3.14159)

    obj = chair(limit)
    assert obj.links[2].joint.limits == (-np.inf, np.inf)
    assert any("are a full turn" in text for text in obj.metadata["warnings"])

    def tilt(found: list[Any]) -> None:
        found[2].joint, found[2].axis, found[2].limits = "revolute", (0, 1, 0), (-0.1, 0.2)

    obj = chair(tilt)
    assert obj.links[2].joint.limits == (-0.1, 0.2)
    assert any("rests at the lower one, not as drawn" in text for text in obj.metadata["warnings"])


def test_names_from_annotations_make_the_same_chair(chair):
    named, other = chair(), chair(names="annotations")
    for obj in (named, other):
        obj.metadata.pop("partnet_id")
    assert named.content_hash == other.content_hash


def test_without_wheels_it_is_said(chair):
    obj = chair(names="none")
    assert any("no part is named wheel" in text for text in obj.metadata["warnings"])


def test_dropped_it_settles_on_all_wheels_and_rolls(chair):
    model = _on_ground(chair())
    assert model.body_mass[1:].min() > 1e-3
    data = mujoco.MjData(model)
    data.qpos[2] = 0.03
    mujoco.mj_step(model, data, 1500)
    assert np.abs(data.qvel).max() < 0.01
    assert 2 * np.hypot(data.qpos[4], data.qpos[5]) < np.radians(1)
    on_ground = {model.body(model.geom_bodyid[g]).name for c in data.contact for g in c.geom} - {"world"}
    assert on_ground == {f"object/wheel_{k}" for k in range(4)}
    start = data.qpos[0]
    data.body("object/base").xfrc_applied[:] = (25.0, 0, 0, 0, 0, 0)
    mujoco.mj_step(model, data, 500)
    assert data.qpos[0] - start > 0.1
    assert 2 * np.hypot(data.qpos[4], data.qpos[5]) < np.radians(3)


def _on_ground(obj: ArticulatedObject) -> Any:
    physics, spec = PhysicsConfig(), mujoco.MjSpec()
    set_options(spec, physics)
    ground = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(5, 5, 1))
    set_contact(ground, Group.GROUND, Group.OBJECT, 0.1, physics)
    add_object(spec, obj, physics)
    return spec.compile()

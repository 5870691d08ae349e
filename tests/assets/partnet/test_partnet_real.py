"""The two real objects, where the data set is at hand."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.partnet import hull_cache, import_partnet
from artiskill.assets.partnet.collisions import find_overlaps, shape_hull
from artiskill.assets.partnet.part_names import read_part_names
from artiskill.assets.partnet.urdf import build_bodies, read_urdf
from artiskill.geometry.rotations import quat_rotate
from artiskill.scene.object_model import add_object
from artiskill.scene.physics import Group, PhysicsConfig, set_contact, set_options

pytestmark = pytest.mark.partnet


@pytest.fixture(scope="module")
def cabinet(dataset: Path, cache_dir: Path) -> ArticulatedObject:
    return import_partnet(dataset / "40147", cache_dir=cache_dir)


def test_cabinet_stands_as_it_should(cabinet):
    assert cabinet.category == "cabinet"
    np.testing.assert_allclose(cabinet.bounds[:, 2], (0, 0.65), atol=1e-9)
    np.testing.assert_allclose(cabinet.bounds.sum(axis=0)[:2], 0, atol=1e-9)
    assert [link.name for link in cabinet.links] == ["base", "link_0", "link_1"]
    np.testing.assert_allclose(cabinet.links[2].joint.axis, (-1, 0, 0), atol=1e-9)
    np.testing.assert_allclose(np.abs(cabinet.links[1].joint.axis), (0, 0, 1), atol=1e-9)
    (said,) = cabinet.metadata["warnings"]  # the drawer's bar stands near to its front
    assert said == "a handle of 'link_1' has no room for the usual grasp: its pose is 4 mm from it"
    assert cabinet.target_links("prismatic") == ("link_1",)
    assert cabinet.target_links("revolute") == ("link_0",)


def test_cabinet_handles(cabinet):
    for handle in cabinet.handles:
        np.testing.assert_allclose(
            quat_rotate(handle.grasp_quaternions[0], np.array([0.0, 0.0, 1.0])), (1, 0, 0), atol=1e-6
        )
        assert handle.hookable
        assert 0.01 < handle.grasp_width_m < 0.03


def test_cabinet_collision_shapes_are_few_small_and_free(cabinet):
    shapes = [shape for link in cabinet.links for shape in link.collisions]
    assert len(shapes) <= 80
    assert max(len(shape_hull(shape).mesh.vertices) for shape in shapes) <= 32
    assert find_overlaps(cabinet.links) == []


def test_cached_import_decomposes_nothing_and_is_equal(cabinet, dataset, cache_dir, monkeypatch):
    def refuse(*arguments: object) -> None:
        raise AssertionError("it is kept")

    for name in ("decompose", "decompose_quickly"):
        monkeypatch.setattr(hull_cache, name, refuse)
    again = import_partnet(dataset / "40147", cache_dir=cache_dir, workers=1)
    assert again.content_hash == cabinet.content_hash


def test_names_stripped(cabinet, dataset, cache_dir, tmp_path):
    assert _stripped(dataset / "40147", tmp_path, cache_dir).content_hash == cabinet.content_hash


def _stripped(source: Path, tmp_path: Path, cache_dir: Path) -> ArticulatedObject:
    """The object from a copy of its folder whose visuals have no names."""
    folder = shutil.copytree(source, tmp_path / source.name, copy_function=shutil.copyfile)
    folder.chmod(0o755)
    text = (source / "mobility.urdf").read_text()
    stripped, count = re.subn(r'<visual name="[^"]*">', "<visual>", text)
    assert count > 30
    (folder / "mobility.urdf").write_text(stripped)
    return import_partnet(folder, cache_dir=cache_dir)


@pytest.mark.parametrize("number", ["40147", "179"])
def test_annotations_agree_with_the_names_in_the_urdf(dataset, number):
    if not (dataset / number).is_dir():
        pytest.skip(f"no object {number} in {dataset}")
    names = read_part_names(dataset / number)
    for meshes in read_urdf(dataset / number / "mobility.urdf").links.values():
        for mesh in meshes:
            assert names.label(replace(mesh, name=None)) == names.label(mesh)


def test_chair_tree(dataset):
    if not (dataset / "179").is_dir():
        pytest.skip(f"no object 179 in {dataset}")
    bodies = build_bodies(read_urdf(dataset / "179" / "mobility.urdf"))
    assert bodies[0].name == "base"
    assert len(bodies) == 18
    assert [body.name for body in bodies[1:4]] == ["link_0", "link_1", "link_2"]
    kinds = [body.joint.kind for body in bodies[1:]]
    assert kinds.count("continuous") == 16
    assert kinds.count("prismatic") == 1


@pytest.fixture(scope="module")
def chair(dataset: Path, cache_dir: Path) -> ArticulatedObject:
    if not (dataset / "179").is_dir():
        pytest.skip(f"no object 179 in {dataset}")
    return import_partnet(dataset / "179", cache_dir=cache_dir)


@pytest.mark.slow
def test_chair(chair):
    assert chair.category == "chair"
    joints = [link.joint for link in chair.links[1:]]
    assert [j.kind for j in joints].count("revolute") == 16
    assert all(j.limits == (-np.inf, np.inf) for j in joints if j.kind == "revolute")
    assert any("link_15_helper" in text for text in chair.metadata["warnings"])
    assert sum(len(link.collisions) for link in chair.links) <= 50
    assert sum(len(v.mesh.faces) for link in chair.links for v in link.visuals) <= 15_000
    parts = {v.part for link in chair.links for v in link.visuals}
    assert parts == {"wheel", "caster", "base", "column", "seat", "back", "arm"}


@pytest.mark.slow
def test_chair_stands_on_its_wheels_and_rolls(chair):
    physics, spec = PhysicsConfig(), mujoco.MjSpec()
    set_options(spec, physics)
    ground = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(5, 5, 1))
    set_contact(ground, Group.GROUND, Group.OBJECT, 0.1, physics)
    add_object(spec, chair, physics)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[2] = 0.05
    mujoco.mj_step(model, data, 2000)
    touching = {model.geom_bodyid[g] for contact in data.contact for g in contact.geom} - {0}
    assert len(touching) == 10
    assert np.abs(data.qvel).max() < 0.01
    assert np.linalg.norm(data.qpos[:3]) < 2e-3
    data.body("object/base").xfrc_applied[:2] = (30.0, 30.0)
    mujoco.mj_step(model, data, 500)
    assert np.linalg.norm(data.qpos[:2]) > 0.1


@pytest.mark.slow
def test_chair_names_stripped(chair, dataset, cache_dir, tmp_path):
    assert _stripped(dataset / "179", tmp_path, cache_dir).content_hash == chair.content_hash

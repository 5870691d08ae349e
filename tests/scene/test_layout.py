"""Layouts and padding: all of the catalogue fits, and what pads an object changes nothing about it."""

from collections import Counter
from dataclasses import replace
from itertools import count
from unittest import mock

import mujoco
import numpy as np
import pytest

from artiskill.assets.cabinets import build_cabinet, default_cabinet_config, sample_cabinet
from artiskill.assets.cabinets.sample import collision_count
from artiskill.assets.cabinets.spec import Wall
from artiskill.assets.catalog import list_objects, load_object
from artiskill.robots.config import load_robot
from artiskill.scene import scene as scene_module
from artiskill.scene.layout import (
    PADDING_PREFIX,
    _bounding_volumes,
    _depths,
    _fans,
    category_layouts,
    inertia_entries,
    plan_padding,
)
from artiskill.scene.object_model import object_spec
from artiskill.scene.physics import PhysicsConfig
from artiskill.scene.scene import Scene, build_scene

ROBOT, PHYSICS = load_robot("one_arm"), PhysicsConfig()


def scene_of(object_id: str) -> Scene:
    return build_scene(ROBOT, load_object(object_id), PHYSICS)


def unpadded(object_id: str) -> Scene:
    with mock.patch.object(scene_module, "plan_padding", return_value=None):
        return scene_of(object_id)


def test_objects_of_a_category_share_few_layouts() -> None:
    for category in ("cabinet", "chair", "bucket"):
        ids = [*list_objects(category=category, split="test"), *list_objects(category=category, split="ood")[:3]]
        layouts = {scene_of(object_id).layout for object_id in ids}
        assert len(layouts) <= len(category_layouts(category))


@pytest.mark.slow
def test_all_of_the_catalogue_fits() -> None:
    for category, most in (("cabinet", 3), ("chair", 19), ("bucket", 0)):
        ids = [*list_objects(category=category, split="all"), *list_objects(category=category, split="ood")]
        counts = Counter(scene_of(object_id).layout for object_id in ids)
        assert len(counts) <= len(category_layouts(category))
        assert {layout.links for layout in counts} <= {config.links for config in category_layouts(category)}
        assert sum(counts.values()) - max(counts.values()) <= most, "nearly all share one"


@pytest.mark.parametrize("object_id", ["cabinet-0005", "cabinet-0006", "chair-0003", "chair-0040", "bucket-0005"])
def test_padding_is_inert(object_id: str) -> None:
    """In free flight, with everything moving, robot and object accelerate as they did."""
    plain, padded = unpadded(object_id), scene_of(object_id)
    assert plain.layout != padded.layout
    named = [padded.model.joint(int(joint)).name for joint in padded.model.dof_jntid]
    own = np.array([i for i, name in enumerate(named) if not name.startswith(PADDING_PREFIX)])
    assert len(own) == plain.model.nv
    velocity = np.random.default_rng(0).uniform(-1, 1, len(own))
    found = []
    for scene, dofs in ((plain, np.arange(len(own))), (padded, own)):
        data = mujoco.MjData(scene.model)
        data.qpos[scene.index.object_qpos], data.qvel[dofs] = scene.object.rest_qpos, velocity
        data.qpos[scene.index.root_qpos][2:3] = 3.0
        mujoco.mj_forward(scene.model, data)
        found.append(data.qacc_smooth[dofs])
    np.testing.assert_allclose(*found, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("object_id", ["cabinet-0005", "cabinet-0006"])  # the second hangs on a wall
def test_padding_touches_nothing(object_id: str) -> None:
    model = scene_of(object_id).model
    padding = [b for b in range(model.nbody) if model.body(b).name.startswith(PADDING_PREFIX)]
    assert padding
    geoms = np.isin(model.geom_bodyid, padding)
    assert not (model.geom_contype[geoms] | model.geom_conaffinity[geoms]).any()
    assert model.body_mass[padding].sum() < 1e-4


def test_what_hangs_on_a_wall_has_the_layout_of_what_stands() -> None:
    """Also with the most doors and drawers that a layout has room for: no padding body is left over then."""
    standing = scene_of("cabinet-0005").layout
    assert scene_of("cabinet-0006").layout == standing
    config = default_cabinet_config()
    specs = ((seed, sample_cabinet(np.random.default_rng(seed), config)) for seed in count())
    seed, spec = next(
        (k, s)
        for k, s in specs
        if s.wall is None and s.count("drawer") + s.count("door") == 5 and collision_count(s) < 52
    )
    hung = replace(spec, wall=Wall(4.0, 2.5, 0.1, spec.appearance.top))
    obj = build_cabinet(hung, f"hung-{seed}", np.random.default_rng(seed))
    assert obj.links[-1].is_wall
    assert build_scene(ROBOT, obj, PHYSICS).layout == standing


def test_a_strange_object_has_a_layout_of_its_own() -> None:
    obj = load_object("cabinet-0005")
    with mock.patch.object(scene_module, "plan_padding", return_value=None):
        scene = build_scene(ROBOT, obj, PHYSICS)
    assert (scene.layout.links, scene.layout.joints) == (len(obj.links), len(obj.joints))


@pytest.mark.parametrize(("number", "extra"), [(1, 0), (4, 0), (4, 1), (4, 3), (4, 6), (7, 12), (10, 45)])
def test_depths_add_up_and_hang_together(number: int, extra: int) -> None:
    depths = _depths(number, number * 7 + extra, root_dof=6)
    assert depths is not None
    assert sum(depth + 6 for depth in depths) == number * 7 + extra
    assert set(depths) == set(range(1, max(depths) + 1)), "each hangs on one of the depth before it"


@pytest.mark.parametrize(("number", "entries"), [(-1, 0), (0, 3), (2, 13), (2, 16), (3, 25)])
def test_depths_that_cannot_be(number: int, entries: int) -> None:
    assert _depths(number, entries, root_dof=6) is None


def test_fans_have_as_many_volumes_as_are_missing() -> None:
    for volumes in (0, 5, 7, 10, 11, 500, 1001):
        fans = _fans(volumes)
        assert fans is not None
        assert sum(2 * n - 1 for n in fans) == volumes
    assert all(_fans(volumes) is None for volumes in (-3, 1, 2, 3, 4, 6, 8))


def test_inertia_entries_are_the_engines() -> None:
    for object_id, free in (("cabinet-0005", False), ("chair-0003", True)):
        scene = unpadded(object_id)
        entries = 0
        for dof in range(scene.index.object_dof.start, scene.index.object_dof.stop):
            while dof != -1:
                entries, dof = entries + 1, int(scene.model.dof_parentid[dof])
        assert inertia_entries(scene.object, free) == entries


@pytest.mark.parametrize("object_id", ["cabinet-0005", "cabinet-0006", "chair-0003", "bucket-0005"])
def test_bounding_volumes_are_the_engines(object_id: str) -> None:
    """Also without the engine, where no shape is a hull: the first cabinet is boxes only."""
    obj = load_object(object_id)
    spec, part = object_spec(obj, PHYSICS, ground=False)
    model = spec.compile()
    assert _bounding_volumes(obj, part, spec) == model.nbvhstatic


def test_what_has_no_hulls_is_compiled_once() -> None:
    obj = load_object("cabinet-0005")
    assert all(shape.kind != "hull" for link in obj.links for shape in link.collisions)
    _, part = object_spec(obj, PHYSICS)
    assert plan_padding(obj, part, spec=None) is not None, "the specification is not read"

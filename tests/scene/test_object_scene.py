"""An object alone: at rest, free or held, with or without a ground."""

import mujoco
import numpy as np
import pytest

from artiskill.assets.catalog import load_object
from artiskill.assets.kinematics import link_poses
from artiskill.scene.object_model import build_object_scene
from artiskill.scene.physics import PhysicsConfig

NAMES = ("generated:cabinet:1", "generated:chair:1", "generated:bucket:1")


@pytest.mark.parametrize("name", NAMES)
def test_links_are_where_kinematics_says(name: str) -> None:
    obj = load_object(name)
    scene = build_object_scene(obj, PhysicsConfig(), hold=True)
    data = scene.rest_data()
    rng = np.random.default_rng(1)
    qpos = rng.uniform(-0.1, 0.1, len(scene.qpos))
    data.qpos[scene.qpos] = qpos
    mujoco.mj_kinematics(scene.model, data)
    np.testing.assert_allclose(data.xpos[scene.bodies], link_poses(obj, qpos)[0], atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_rest_free_and_held(name: str) -> None:
    obj = load_object(name)
    scene = build_object_scene(obj, PhysicsConfig())
    assert scene.is_free == (obj.category != "cabinet")
    data = scene.rest_data()
    rest = [obj.links[i].joint.rest for i in obj.jointed_links]  # type: ignore[union-attr]
    np.testing.assert_array_equal(data.qpos[scene.qpos], rest)
    held = build_object_scene(obj, PhysicsConfig(), ground=False, hold=True)
    assert not held.is_free
    assert held.model.nq == len(obj.jointed_links)
    assert "ground" not in [held.model.geom(i).name for i in range(held.model.ngeom)]

"""The exported MJCF against the model of our own scenes."""

import mujoco
import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object
from artiskill.exports.export import export_object
from artiskill.geometry.rotations import quat_to_matrix
from artiskill.scene.object_model import build_object_scene
from artiskill.scene.physics import PhysicsConfig

TOLERANCE = 1e-6


@pytest.fixture(params=["odd", "cabinet", "chair", "bucket"])
def given(request: pytest.FixtureRequest, odd_chair: ArticulatedObject) -> ArticulatedObject:
    if request.param == "odd":
        return odd_chair
    return load_object(f"generated:{request.param}:3")


def test_same_physics_as_our_scenes(given, tmp_path):
    path = export_object(given, "mjcf", tmp_path / "out")
    theirs = mujoco.MjModel.from_xml_path(str(path))
    ours = build_object_scene(given, PhysicsConfig(), ground=False).model
    names = [mujoco.mj_id2name(theirs, mujoco.mjtObj.mjOBJ_BODY, i) for i in range(1, theirs.nbody)]
    assert sorted(names) == sorted(link.name for link in given.links)
    for field in (
        *("body_parentid", "body_pos", "body_quat", "body_mass", "body_inertia", "body_ipos"),
        *("jnt_type", "jnt_bodyid", "jnt_axis", "jnt_pos", "jnt_range", "jnt_limited"),
        *("qpos_spring", "dof_damping", "dof_frictionloss", "dof_armature", "qpos0"),
    ):
        np.testing.assert_allclose(getattr(theirs, field), getattr(ours, field), atol=TOLERANCE, err_msg=field)
    limited = ours.jnt_limited.astype(bool)
    for field in ("jnt_solref", "jnt_solimp"):
        np.testing.assert_allclose(getattr(theirs, field)[limited], getattr(ours, field)[limited], atol=TOLERANCE)
    np.testing.assert_allclose(np.ravel(theirs.jnt_stiffness), np.ravel(ours.jnt_stiffness), atol=TOLERANCE)
    for mine, other in zip(ours.body_iquat, theirs.body_iquat, strict=True):
        np.testing.assert_allclose(quat_to_matrix(mine), quat_to_matrix(other), atol=TOLERANCE)
    for field in ("timestep", "impratio", "iterations", "cone", "integrator", "solver"):
        assert getattr(theirs.opt, field) == getattr(ours.opt, field), field


def test_same_contacts_as_our_scenes(given, tmp_path):
    path = export_object(given, "mjcf", tmp_path / "out")
    theirs = mujoco.MjModel.from_xml_path(str(path))
    ours = build_object_scene(given, PhysicsConfig(), ground=False).model
    solid = theirs.geom_group == 3
    assert solid.sum() == ours.ngeom
    for field in ("geom_type", "geom_contype", "geom_conaffinity", "geom_friction", "geom_solref", "geom_solimp"):
        np.testing.assert_allclose(
            getattr(theirs, field)[solid], getattr(ours, field), atol=TOLERANCE, err_msg=field
        )
    primitive = ours.geom_type != mujoco.mjtGeom.mjGEOM_MESH
    for field in ("geom_size", "geom_pos", "geom_quat"):
        np.testing.assert_allclose(
            getattr(theirs, field)[solid][primitive], getattr(ours, field)[primitive], atol=TOLERANCE
        )
    drawn = theirs.geom_group == 2
    assert drawn.sum() == sum(len(v.mesh.faces) > 0 for link in given.links for v in link.visuals)
    assert not theirs.geom_contype[drawn].any()
    assert not theirs.geom_conaffinity[drawn].any()


def test_drawn_surfaces_stand_where_they_should(odd_chair, tmp_path):
    path = export_object(odd_chair, "mjcf", tmp_path / "out")
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    scene = build_object_scene(odd_chair, PhysicsConfig(), ground=False)
    data.qpos[scene.qpos] = [odd_chair.links[i].joint.rest for i in odd_chair.jointed_links]
    mujoco.mj_kinematics(model, data)
    corners = []
    for geom in np.flatnonzero(model.geom_group == 2):
        mesh = model.geom_dataid[geom]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        local = model.mesh_vert[first : first + count]
        corners.append(local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    points = np.concatenate(corners)
    np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)], odd_chair.bounds, atol=1e-5)


def test_textures_and_colours_come_along(odd_chair, tmp_path):
    path = export_object(odd_chair, "mjcf", tmp_path / "out")
    model = mujoco.MjModel.from_xml_path(str(path))
    assert model.ntex == 1
    assert (model.tex_height[0], model.tex_width[0]) == (8, 4)
    assert model.nmat == 4, "equal materials are written once; cloth without coordinates is plain"
    clear = [model.mat(i).rgba[3] for i in range(model.nmat)]
    assert min(clear) == pytest.approx(0.3)


def test_the_scene_file_stands_on_a_floor(odd_chair, tmp_path):
    path = export_object(odd_chair, "mjcf", tmp_path / "out")
    model = mujoco.MjModel.from_xml_path(str(path.with_name("scene.xml")))
    data = mujoco.MjData(model)
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert data.ncon > 0, "it lies on the floor"
    assert data.contact.dist.min() > -0.002, "and not in it"

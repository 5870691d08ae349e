"""The importer on a toy cabinet of known dimensions."""

import json

import mujoco
import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.partnet import import_partnet
from artiskill.assets.partnet.collisions import shape_hull
from artiskill.assets.partnet.placement import default_scale
from artiskill.errors import AssetError, MissingExtraError
from artiskill.gallery.facts import object_mass_kg
from artiskill.geometry.meshes import depth_inside
from artiskill.geometry.rotations import quat_rotate

SCALE = 0.5


@pytest.fixture
def obj(toy, load) -> ArticulatedObject:
    return load(toy, scale=SCALE)


def test_frame_ground_and_front(obj):
    np.testing.assert_allclose(obj.bounds, [[-0.23, -0.325, 0], [0.23, 0.325, 0.6]], atol=1e-9)
    front = obj.links[obj.link_index("link_1")]
    assert front.position[0] < 0
    assert obj.category == "cabinet"
    assert obj.id == "toy"


def test_links_and_joints(obj):
    assert [link.name for link in obj.links] == ["base", "link_0", "link_1"]
    door, drawer = obj.links[1].joint, obj.links[2].joint
    assert door is not None
    assert drawer is not None
    np.testing.assert_allclose(drawer.axis, (-1, 0, 0), atol=1e-9)
    assert drawer.limits == (0.0, 0.25)
    # the file's -y is -z after the turn; the door's left edge, x = -0.6 in the file, is y = +0.3
    np.testing.assert_allclose(door.axis, (0, 0, -1), atol=1e-9)
    assert door.limits == (0.0, 1.5)
    assert obj.links[1].position[1] == pytest.approx(0.3)
    assert obj.target_links("prismatic") == ("link_1",)
    assert obj.target_links("revolute") == ("link_0",)
    assert obj.metadata["warnings"] == ()


def test_handle_grasp_pose_reaches_into_the_furniture(obj):
    (handle,) = obj.handles_of("link_1")
    for quaternion in handle.grasp_quaternions:
        np.testing.assert_allclose(quat_rotate(quaternion, np.array([0.0, 0.0, 1.0])), (1, 0, 0), atol=1e-9)
        closing = quat_rotate(quaternion, np.array([0.0, 1.0, 0.0]))
        np.testing.assert_allclose(np.abs(closing), (0, 0, 1), atol=1e-9)
    assert handle.kind == "bar"
    assert handle.hookable
    assert handle.grasp_width_m == pytest.approx(0.02 * SCALE)
    assert depth_inside(handle.planes, handle.grasp_positions)[0] > 0
    # the bar's front face is at file z = 0.52, world x = -0.26 + 0.02 (the shift centres the footprint)
    tool_x = (obj.links[2].position + handle.grasp_positions[0])[0]
    assert -0.235 < tool_x < -0.215
    np.testing.assert_allclose(obj.metadata["handle_gaps_m"], 0.06 * SCALE, atol=5e-4)


def test_door_handle_faces_the_room_although_its_hinge_is_off_the_panel(obj):
    (handle,) = obj.handles_of("link_0")
    np.testing.assert_allclose(
        quat_rotate(handle.grasp_quaternions[0], np.array([0.0, 0.0, 1.0])), (1, 0, 0), atol=1e-9
    )


def test_materials_textures_and_parts(obj):
    visuals = obj.links[2].visuals
    assert {v.part for v in visuals} == {"drawer_front", "drawer_box", "handle"}
    wood = next(v for v in visuals if v.material.texture is not None)
    assert wood.material.texture.shape == (1, 2, 3)
    assert wood.mesh.uvs is not None
    paint = next(v for v in visuals if v.material.texture is None)
    np.testing.assert_allclose(paint.material.rgba, (0.2140, 0, 0, 0.75), atol=1e-3)  # 0.5 sRGB in linear light


def test_collision_shapes_are_the_boxes(obj):
    assert [s.kind for link in obj.links for s in link.collisions] == ["box"] * (5 + 4 + 6)
    volume = sum(shape_hull(s).volume_m3 for s in obj.links[0].collisions)
    expected = (2 * 0.05 * 1.2 * 0.8 + 2 * 1.2 * 0.05 * 0.8 + 1.2 * 1.1 * 0.05) * SCALE**3
    assert volume == pytest.approx(expected, rel=1e-6)


def test_surface_points_lie_on_the_surface_and_imports_agree(obj, toy, load):
    again = load(toy, scale=SCALE)
    assert again.content_hash == obj.content_hash
    assert all(link.surface_points.shape == (200, 3) for link in obj.links)
    assert load(toy, scale=0.6).content_hash != obj.content_hash


def test_names_from_annotations_where_the_urdf_has_none(obj, toy, load):
    toy.names = False
    assert load(toy, scale=SCALE).content_hash == obj.content_hash


def test_compiles_and_drawer_slides_out(obj):
    spec = mujoco.MjSpec()
    bodies = []
    for link in obj.links:
        parent = spec.worldbody if link.parent < 0 else bodies[link.parent]
        body = parent.add_body(name=link.name, pos=link.position, quat=link.quaternion)
        bodies.append(body)
        if link.joint is not None:
            kinds = {"prismatic": mujoco.mjtJoint.mjJNT_SLIDE, "revolute": mujoco.mjtJoint.mjJNT_HINGE}
            body.add_joint(type=kinds[link.joint.kind], axis=link.joint.axis, pos=link.joint.origin)
        for k, shape in enumerate(link.collisions):
            mesh = spec.add_mesh(name=f"{link.name}-{k}", uservert=shape_hull(shape).mesh.vertices.ravel())
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh.name, density=link.density_kg_m3)
    model = spec.compile()
    data = mujoco.MjData(model)
    for opening in (0.0, 0.1, 0.25):
        data.qpos[:] = (0.0, opening)
        mujoco.mj_forward(model, data)
        assert all(contact.dist > -1e-6 for contact in data.contact)
    assert data.body("link_1").xpos[0] == pytest.approx(obj.links[2].position[0] - 0.25)


def test_default_scale_is_documented_and_bounded():
    assert default_scale("cabinet", np.array([0.8, 1.4, 1.2])) == pytest.approx(0.65 / 1.2)
    assert default_scale("cabinet", np.array([0.8, 1.0, 1.5])) == pytest.approx(0.9 / 1.5)
    assert default_scale("cabinet", np.array([0.8, 1.9, 0.3])) == 0.81
    assert default_scale("chair", np.ones(3)) == 0.8
    assert default_scale("bucket", np.ones(3)) == 0.3


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), float("inf"), "a", [1.0]])
def test_bad_scale(toy, load, scale):
    with pytest.raises(AssetError, match="scale must be a positive number"):
        load(toy, scale=scale)


@pytest.mark.parametrize("scale", [100.0, 5.0, 0.03])
def test_absurd_sizes_are_refused(toy, load, scale):
    with pytest.raises(
        AssetError, match=r"at a scale of .* it measures .* m; legal: 0.05 to 5 m\. The scale stands in meta.json"
    ):
        load(toy, scale=scale)


def test_an_absurd_scale_in_meta_json_is_refused(toy, load):
    folder = toy.write()
    meta = json.loads((folder / "meta.json").read_text())
    (folder / "meta.json").write_text(json.dumps(meta | {"artiskill": {"scale": 100.0}}))
    with pytest.raises(AssetError, match="at a scale of 100 metres per unit of the file it measures"):
        import_partnet(folder)


def test_measures_have_the_names_that_generated_objects_give_them(obj):
    meta = obj.metadata
    np.testing.assert_allclose(
        (meta["depth_m"], meta["width_m"], meta["height_m"]), np.ptp(obj.bounds, axis=0), atol=1e-4
    )
    assert meta["joints"] == 2
    assert meta["handles"] == ["bar"]
    assert meta["mass_kg"] == pytest.approx(object_mass_kg(obj), abs=1e-3)


def test_path_of_another_type():
    with pytest.raises(AssetError, match="path must be an object's folder or a zip of one, not 5"):
        import_partnet(5)  # type: ignore[arg-type]


def test_object_id(toy, load):
    assert load(toy, object_id="my-cabinet.1").id == "my-cabinet.1"
    with pytest.raises(AssetError, match="legal are letters"):
        load(toy, object_id="my cabinet")
    toy.folder = toy.folder.with_name("my_cabinet (1)")
    assert load(toy).id == "my_cabinet--1-"


def test_without_coacd(toy, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "coacd", None)
    with pytest.raises(MissingExtraError, match=r"artiskill\[import\]"):
        import_partnet(toy.write())


def test_no_handles_is_a_warning(toy, load):
    for link in ("link_0", "link_1"):
        toy.parts[link] = [part for part in toy.parts[link] if part[0] != "handle"]
    obj = load(toy)
    assert obj.handles == ()
    assert obj.target_links("prismatic") == ()
    assert any("no target links" in text for text in obj.metadata["warnings"])


def test_flat_handle_is_thickened_and_said(toy, load):
    toy.parts["link_1"][2] = ("handle", 7, "original-5", [((-0.2, 0.3, 0.5), (0.2, 0.34, 0.5))])
    obj = load(toy, scale=SCALE)
    (handle,) = obj.handles_of("link_1")
    assert np.isfinite(handle.planes).all()
    assert any("thinner than 2 mm" in text for text in obj.metadata["warnings"])
    assert handle.hookable  # 30 mm free behind the sheet
    (shape,) = [s for s in obj.links[2].collisions if s.part == "handle"]
    assert min(shape.size) == pytest.approx(0.001)


def test_solid_handle_is_not_hookable(toy, load):
    toy.parts["link_1"][2] = ("handle", 7, "original-5", [((-0.02, 0.3, 0.44), (0.02, 0.34, 0.5))])
    (handle,) = load(toy).handles_of("link_1")
    assert not handle.hookable
    assert handle.kind == "knob"


def test_overlapping_drawer_is_warned_of(toy, load):
    toy.parts["link_1"][1] = ("drawer_box", 6, "original-4", [((-0.62, 0.2, -0.3), (-0.53, 0.4, 0.4))])
    warnings = load(toy).metadata["warnings"]
    assert any("'link_1' overlap those of 'base'" in text for text in warnings)


def test_missing_texture_is_a_warning(toy, cache_dir):
    folder = toy.write()
    (folder / "images" / "texture_0.png").unlink()
    obj = import_partnet(folder, cache_dir=cache_dir)
    assert any("texture_0.png" in text for text in obj.metadata["warnings"])


def test_unknown_names_are_a_warning(toy, cache_dir):
    toy.names = False
    folder = toy.write()
    (folder / "result.json").unlink()
    obj = import_partnet(folder, cache_dir=cache_dir)
    assert obj.handles == ()
    assert any("without a part name" in text for text in obj.metadata["warnings"])


def test_continuous_joint(toy, load):
    toy.joints["link_0"] = toy.joints["link_0"].replace("revolute", "continuous")
    obj = load(toy)
    assert obj.links[1].joint.limits == (-np.inf, np.inf)
    assert obj.target_links("revolute") == ()
    assert any("turns without end" in text for text in obj.metadata["warnings"])


def test_handle_on_the_hinge_side_is_warned_of(toy, load):
    name, number, stem, boxes = toy.parts["link_0"][1]
    moved = [((low[0] - 0.42, *low[1:]), (high[0] - 0.42, *high[1:])) for low, high in boxes]
    toy.parts["link_0"][1] = (name, number, stem, moved)
    warnings = load(toy, scale=SCALE).metadata["warnings"]
    assert warnings == ("'link_0': the handle is on the hinge side: 63 mm from the hinge of 300 mm",)


def test_a_second_import_reads_the_decomposition_from_disk(toy, load, monkeypatch):
    first = load(toy, scale=0.37)
    monkeypatch.setattr("artiskill.assets.partnet.decompose.decompose", lambda *_: pytest.fail("decomposed"))
    assert load(toy, scale=0.37).content_hash == first.content_hash


def test_link_names_are_the_last_resort(toy, cache_dir):
    toy.names = False
    folder = toy.write()
    (folder / "result.json").unlink()
    (folder / "semantics.txt").write_text("link_0 hinge rotation_door\nlink_1 slider drawer\nodd line here too\n")
    obj = import_partnet(folder, cache_dir=cache_dir)
    assert {v.part for v in obj.links[1].visuals} == {"rotation_door"}
    assert any("on: base" in text for text in obj.metadata["warnings"])  # link_2 has no line

"""The exported URDF, read by our importer and by the engine."""

import json
import math
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject, VisualMesh
from artiskill.assets.catalog import load_object
from artiskill.assets.kinematics import link_poses
from artiskill.assets.partnet import import_partnet
from artiskill.errors import AssetError
from artiskill.exports.export import export_object
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.rotations import quat_angle, quat_rotate
from artiskill.scene.object_model import build_object_scene
from artiskill.scene.physics import PhysicsConfig

coacd = pytest.importorskip("coacd", reason="the importer needs the extra `import`")
TOLERANCE = 1e-4


def joints_in_object_frame(
    obj: ArticulatedObject,
) -> dict[str, tuple[str, np.ndarray, np.ndarray, tuple[float, float]]]:
    """Kind, axis, moment of the axis about the origin (the same for every point on it) and limits, by name."""
    positions, quaternions = link_poses(obj, np.zeros(len(obj.jointed_links)))
    found = {}
    for i in obj.jointed_links:
        joint = obj.links[i].joint
        axis = quat_rotate(quaternions[i], joint.axis)
        point = positions[i] + quat_rotate(quaternions[i], joint.origin)
        moment = np.cross(point, axis) if joint.kind == "revolute" else np.zeros(3)
        found[joint.name] = (joint.kind, axis, moment, joint.limits)
    return found


def assert_alike(first: ArticulatedObject, second: ArticulatedObject) -> None:
    mine, theirs = joints_in_object_frame(first), joints_in_object_frame(second)
    assert mine.keys() == theirs.keys()
    for name, (kind, *values) in mine.items():
        assert theirs[name][0] == kind
        for value, other in zip(values, theirs[name][1:], strict=True):
            np.testing.assert_allclose(other, value, atol=TOLERANCE, err_msg=name)
    np.testing.assert_allclose(second.bounds, first.bounds, atol=TOLERANCE)


@pytest.mark.slow
@pytest.mark.parametrize("category", ["cabinet", "chair", "bucket"])
def test_imports_back(category: str, tmp_path: Path) -> None:
    given = load_object(f"generated:{category}:3")
    path = export_object(given, "urdf", tmp_path / "back")
    back = import_partnet(path.parent)
    assert back.category == category
    assert_alike(given, back)
    gripped = {handle.link for handle in given.handles if category == "cabinet"}
    assert gripped <= {handle.link for handle in back.handles}


@pytest.mark.slow
def test_a_wall_imports_back(tmp_path: Path) -> None:
    """It stays a link of its own: the cabinet is as wide and as heavy as without it."""
    given = load_object("cabinet-0052")
    back = import_partnet(export_object(given, "urdf", tmp_path / "back").parent)
    assert_alike(given, back)
    assert back.own_links == given.own_links
    np.testing.assert_allclose(back.links[-1].visuals[0].mesh.bounds[1, 1:], (2.0, 2.5), atol=TOLERANCE)
    assert back.metadata["mass_kg"] == pytest.approx(given.metadata["mass_kg"], rel=0.4)


def test_odd_frames_import_back(odd_chair, tmp_path):
    back = import_partnet(export_object(odd_chair, "urdf", tmp_path / "back").parent)
    assert_alike(odd_chair, back)
    assert [link.name for link in back.links if link.joint] == ["lift", "seat", "lever", "wheel"]


def test_several_handles_of_one_link_stay_apart(tmp_path):
    given = load_object("generated:cabinet:3")
    assert len(given.handles) > 1
    root = ET.parse(export_object(given, "urdf", tmp_path / "out")).getroot()
    labels = [visual.get("name") for visual in root.iter("visual")]
    handles = {label for label in labels if label.startswith("handle-")}
    assert len(handles) == len(given.handles)


def test_the_engine_reads_it(odd_chair, tmp_path):
    model = mujoco.MjModel.from_xml_path(str(export_object(odd_chair, "urdf", tmp_path / "out")))
    ours = build_object_scene(odd_chair, PhysicsConfig(), ground=False, hold=True)
    assert model.njnt == len(odd_chair.jointed_links)
    for link, body in zip(odd_chair.links[1:], ours.bodies[1:], strict=True):
        assert model.body(link.name).mass[0] == pytest.approx(ours.model.body_mass[body], abs=1e-6)
    for name, limits in ((j.name, j.limits) for j in (odd_chair.links[i].joint for i in odd_chair.jointed_links)):
        assert bool(model.joint(name).limited[0]) == math.isfinite(limits[0])
        if math.isfinite(limits[0]):
            np.testing.assert_allclose(model.joint(name).range, limits, atol=1e-6)
    # the pieces that touch: capsule as three, the others as one
    solid = list(ET.parse(tmp_path / "out" / "mobility.urdf").getroot().iter("collision"))
    assert len(solid) == 1 + 3 + 1 + 1 + 1


def test_moves_like_the_object(odd_chair, tmp_path):
    model = mujoco.MjModel.from_xml_path(str(export_object(odd_chair, "urdf", tmp_path / "out")))
    data = mujoco.MjData(model)
    values = np.array((0.05, 0.2, 1.0, 0.01))  # lift, tilt, wheel, lever
    for name, value in zip((odd_chair.links[i].joint.name for i in odd_chair.jointed_links), values, strict=True):
        data.qpos[model.jnt_qposadr[model.joint(name).id]] = value
    mujoco.mj_kinematics(model, data)
    positions, quaternions = link_poses(odd_chair, values)
    for i, link in enumerate(odd_chair.links[1:], start=1):
        body = data.body(link.name)
        origin = np.zeros(3) if link.joint is None else link.joint.origin
        np.testing.assert_allclose(body.xpos, positions[i] + quat_rotate(quaternions[i], origin), atol=1e-6)
        assert quat_angle(body.xquat, quaternions[i]) < 1e-6


def test_the_engine_reads_flat_surfaces(odd_chair, tmp_path):
    sheet = TriMesh([(0, 0, 0), (0.1, 0, 0), (0.1, 0.1, 0), (0, 0.1, 0)], [(0, 1, 2), (0, 2, 3)])
    base = odd_chair.links[0]
    flat = replace(base, visuals=(*base.visuals, VisualMesh(sheet, base.visuals[0].material, "paper")))
    obj = replace(odd_chair, links=(flat, *odd_chair.links[1:]))
    for kind in ("urdf", "mjcf"):
        mujoco.MjModel.from_xml_path(str(export_object(obj, kind, tmp_path / kind)))


def test_paths_are_relative_and_there(odd_chair, tmp_path):
    path = export_object(odd_chair, "urdf", tmp_path / "out")
    files = [mesh.get("filename") for mesh in ET.parse(path).getroot().iter("mesh")]
    assert files
    for file in files:
        assert not Path(file).is_absolute()
        assert (path.parent / file).is_file()


@pytest.mark.parametrize("given", [3, {"scale": -1}, {"scale": True}, {"origin": [0, 0]}, {"skale": 1.0}])
def test_a_frame_that_makes_no_sense_is_refused(given, odd_chair, tmp_path):
    folder = export_object(odd_chair, "urdf", tmp_path / "out").parent
    meta = json.loads((folder / "meta.json").read_text())
    (folder / "meta.json").write_text(json.dumps(meta | {"artiskill": given}))
    with pytest.raises(AssetError, match="'artiskill' must be a mapping with a positive number 'scale'"):
        import_partnet(folder)

"""The exported glTF, read back by the library that wrote it."""

import json
import struct
import sys
from pathlib import Path

import numpy as np
import pytest

from artiskill.assets.catalog import load_object
from artiskill.errors import MissingExtraError
from artiskill.exports.common import smooth_mesh
from artiskill.exports.export import export_object
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import box


def header(path: Path) -> dict:
    """The JSON part of a binary glTF file."""
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    return json.loads(data[20 : 20 + size])


def test_surfaces_stand_where_they_should(odd_chair, tmp_path):
    trimesh = pytest.importorskip("trimesh", reason="needs the extra `export`")
    path = export_object(odd_chair, "glb", tmp_path / "out")
    lower, upper = trimesh.load_scene(path).bounds
    # object x, y, z are -z, -x, y in glTF
    low, high = odd_chair.bounds
    np.testing.assert_allclose(lower, (-high[1], low[2], -high[0]), atol=1e-5)
    np.testing.assert_allclose(upper, (-low[1], high[2], -low[0]), atol=1e-5)


def test_nodes_tell_the_joints(odd_chair, tmp_path):
    pytest.importorskip("trimesh", reason="needs the extra `export`")
    tree = header(export_object(odd_chair, "glb", tmp_path / "out"))
    nodes = {node["name"]: node for node in tree["nodes"]}
    assert nodes["object"]["extras"] == {"id": "odd-chair", "category": "chair"}
    children = {tree["nodes"][i]["name"] for i in nodes["base"]["children"]}
    assert {"lift", "wheel"} <= children
    joint = nodes["seat"]["extras"]["joint"]
    assert joint["name"] == "seat_tilt"
    assert joint["limits"] == [-0.2, 0.3]
    assert joint["value"] == -0.2
    assert joint["stiffness"] == 40
    assert nodes["wheel"]["extras"]["joint"]["limits"] == [None, None]


def test_materials_and_textures_are_inside(odd_chair, tmp_path):
    pytest.importorskip("trimesh", reason="needs the extra `export`")
    tree = header(export_object(odd_chair, "glb", tmp_path / "out"))
    assert len(tree["materials"]) == 4
    assert len(tree["images"]) == 1
    assert "bufferView" in tree["images"][0], "embedded, not a file beside it"
    modes = sorted(material.get("alphaMode", "OPAQUE") for material in tree["materials"])
    assert modes == ["BLEND", "OPAQUE", "OPAQUE", "OPAQUE"]


@pytest.mark.parametrize("object_id", ["odd-chair", "bucket-0001"])
def test_textures_are_on_surfaces_with_coordinates_only(object_id, odd_chair, tmp_path):
    """Without them our pictures show the plain colour, and Khronos' validator speaks of an error."""
    pytest.importorskip("trimesh", reason="needs the extra `export`")
    obj = odd_chair if object_id == odd_chair.id else load_object(object_id)
    tree = header(export_object(obj, "glb", tmp_path / "out"))
    drawn = [primitive for mesh in tree["meshes"] for primitive in mesh["primitives"]]
    look = [tree["materials"][primitive["material"]]["pbrMetallicRoughness"] for primitive in drawn]
    textured = [p for p, material in zip(drawn, look, strict=True) if "baseColorTexture" in material]
    assert textured
    assert all("TEXCOORD_0" in primitive["attributes"] for primitive in textured)


def test_the_same_bytes_each_time(odd_chair, tmp_path):
    pytest.importorskip("trimesh", reason="needs the extra `export`")
    first, second = (export_object(odd_chair, "glb", tmp_path / name) for name in "ab")
    assert first.read_bytes() == second.read_bytes()


def test_without_the_library_it_says_what_to_install(odd_chair, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'artiskill\[export\]'"):
        export_object(odd_chair, "glb", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_creases_double_vertices():
    mesh, normals = smooth_mesh(box((1, 1, 1)))
    assert len(mesh.vertices) == len(normals) == 24, "each corner of a box has three normals"
    assert len(mesh.faces) == 12


def test_triangles_without_area_get_a_unit_normal():
    """Real objects have some; a normal of length 0 is an error of Khronos' validator."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, 0]], dtype=float)
    mesh, normals = smooth_mesh(TriMesh(vertices, np.array([[0, 1, 2], [0, 3, 1]])))
    assert len(mesh.faces) == 2
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-3)

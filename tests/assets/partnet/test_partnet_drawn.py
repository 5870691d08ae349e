"""OBJ and MTL: what PartNet writes and what it might."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from artiskill.assets.partnet.drawn import read_obj
from artiskill.assets.partnet.mtl import load_material, read_mtl

QUAD = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 2 0\nvt 2 2\nvt 0 2\n"


def _read(folder: Path, text: str):
    (folder / "a.obj").write_text(text)
    return read_obj(folder / "a.obj", "test")


def test_quads_and_negative_indices(tmp_path):
    (positive,) = _read(tmp_path, QUAD + "f 1/1 2/2 3/3 4/4  # a comment\n")
    (negative,) = _read(tmp_path, QUAD + "f -4/-4 -3/-3 -2/-2 -1/-1\n")
    for part in (positive, negative):
        np.testing.assert_array_equal(part.mesh.faces, [[0, 1, 2], [0, 2, 3]])
        np.testing.assert_array_equal(part.mesh.vertices[:, :2] * 2, part.mesh.uvs)


def test_a_seam_splits_vertices(tmp_path):
    (part,) = _read(tmp_path, QUAD + "f 1/1 2/2 3/3\nf 1/2 3/3 4/4\n")
    assert len(part.mesh.vertices) == 5


def test_normals_are_skipped_and_missing_uvs_mean_none(tmp_path):
    (part,) = _read(tmp_path, QUAD + "vn 0 0 1\nf 1//1 2//1 3//1\nf 1/1/1 3/3/1 4/4/1\n")
    assert part.mesh.uvs is None
    assert len(part.mesh.faces) == 2


def test_materials_split_the_mesh(tmp_path):
    (tmp_path / "a.mtl").write_text(
        "newmtl red one\nKd 1 0 0\nTr 0.25\nnewmtl wood\nKd 1 1 1\nmap_Kd -s 2 2 1 ../images/wood.jpg\nNs 400\n"
    )
    text = "mtllib a.mtl\n" + QUAD + "usemtl red one\nf 1 2 3\nusemtl wood\nf 1 3 4\nusemtl red one\nf 2 3 4\n"
    red, wood = _read(tmp_path, text)
    assert red.material.rgb == (1, 0, 0)
    assert red.material.alpha == 0.75
    assert len(red.mesh.faces) == 2
    assert wood.material.texture == tmp_path / "../images/wood.jpg"
    assert load_material(wood.material, {}).shininess == 1.0
    assert load_material(wood.material, {}).texture is None  # no such image


def test_missing_material_file_is_grey(tmp_path):
    (part,) = _read(tmp_path, "mtllib no.mtl\nusemtl x\n" + QUAD + "f 1 2 3\n")
    assert part.material.rgb == (0.7, 0.7, 0.7)
    assert read_mtl(tmp_path / "no.mtl", "test") == {}


def test_line_ends_objects_groups_and_continued_lines(tmp_path):
    text = "o one\n" + QUAD + "g two\ns off\nf 1 2 \\\n 3 4\no three\nl 1 2\nf 1 2 3\n"
    (plain,) = _read(tmp_path, text)
    (tmp_path / "a.obj").write_bytes(text.replace("\n", "\r\n").encode())
    (crlf,) = read_obj(tmp_path / "a.obj", "test")
    assert len(plain.mesh.faces) == 2  # the triangle of the second object lies on the first's
    np.testing.assert_array_equal(plain.mesh.faces, crlf.mesh.faces)
    np.testing.assert_array_equal(plain.mesh.vertices, crlf.mesh.vertices)


def test_negative_indices_count_from_where_they_stand(tmp_path):
    (part,) = _read(tmp_path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 1\nf -4 -3 -1\n")
    np.testing.assert_array_equal(part.mesh.vertices[part.mesh.faces[1]], [[0, 0, 0], [1, 0, 0], [0, 0, 1]])


def test_polygons_become_fans(tmp_path):
    (part,) = _read(tmp_path, "v 0 0 0\nv 1 0 0\nv 2 1 0\nv 1 2 0\nv 0 1 0\nf 1 2 3 4 5\n")
    np.testing.assert_array_equal(part.mesh.faces, [[0, 1, 2], [0, 2, 3], [0, 3, 4]])


TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
SIDES = ["1 3 2", "1 2 4", "1 4 3", "2 3 4"]  # seen from outside


def _skins(outer: str, inner: str, sides: list[str] = SIDES) -> str:
    faces = [f"f {side}\n" for side in sides]
    backs = [f"f {' '.join(reversed(side.split()))}\n" for side in sides]
    return f"mtllib a.mtl\n{TETRAHEDRON}usemtl {outer}\n{''.join(faces)}usemtl {inner}\n{''.join(backs)}"


def test_the_inside_of_a_closed_surface_is_left_out(tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl out\nKd 1 0 0\nnewmtl in\nKd 0 1 0\n")
    (first,) = _read(tmp_path, _skins("out", "in"))
    corners = first.mesh.vertices[first.mesh.faces] - 0.25
    assert np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) > 0
    assert first.material.rgb == (1, 0, 0)
    turned = [" ".join(reversed(side.split())) for side in SIDES]
    (second,) = _read(tmp_path, _skins("out", "in", turned))
    assert second.material.rgb == (0, 1, 0)
    assert len(_read(tmp_path, _skins("out", "in", SIDES[:3]))) == 2  # an open one shows both
    (same,) = _read(tmp_path, _skins("out", "out"))
    assert len(same.mesh.faces) == 4


@pytest.mark.parametrize(
    ("statement", "file"),
    [
        ("map_Kd wood grain.png", "wood grain.png"),
        ("map_Kd -s 2 3 1 -o 0.5 wood grain.png", "wood grain.png"),
        ("map_Kd -blendu on -clamp off -mm 0 1 wood grain.png", "wood grain.png"),
        ("map_Kd WOOD Grain.PNG", "wood grain.png"),
        ("map_Kd C:\\\\models\\\\wood grain.png", "wood grain.png"),
        ("map_Kd /home/someone/wood grain.png", "wood grain.png"),
        ("map_Kd ./wood grain.png", "wood grain.png"),
        ("map_Kd 7.png", "7.png"),
    ],
)
def test_texture_names(tmp_path, statement, file):
    for name in ("wood grain.png", "7.png"):
        Image.new("RGB", (2, 1), (255, 0, 0)).save(tmp_path / name)
    (tmp_path / "a.mtl").write_text(f"newmtl x\n{statement}\n")
    material = read_mtl(tmp_path / "a.mtl", "test")["x"]
    assert material.texture is not None
    assert material.texture.resolve() == (tmp_path / file).resolve()
    assert material.rgb == (0.7, 0.7, 0.7)  # no Kd
    assert material.stretch == ((2, 3) if "-s 2 3" in statement else (1, 1))
    assert load_material(material, {}).texture is not None


@pytest.mark.parametrize("ending", ["jpg", "png", "bmp"])
def test_image_formats_and_missing_files(tmp_path, ending):
    Image.new("L", (4, 2), 128).save(tmp_path / f"a.{ending}")
    (tmp_path / "a.mtl").write_text(f"newmtl x\nmap_Kd a.{ending}\nnewmtl y\nmap_Kd b.{ending}\n")
    materials = read_mtl(tmp_path / "a.mtl", "test")
    assert load_material(materials["x"], {}).texture.shape == (2, 4, 3)
    assert load_material(materials["y"], {}).texture is None


def test_a_stretch_multiplies_the_coordinates(tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl x\nmap_Kd -s 2 3 a.png\n")
    (part,) = _read(tmp_path, "mtllib a.mtl\n" + QUAD + "usemtl x\nf 1/1 2/2 3/3 4/4\n")
    np.testing.assert_allclose(part.mesh.uvs.max(axis=0), (4, 6))  # tiled: beyond 1


def test_several_material_files(tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl x\nKd 1 0 0\n")
    (tmp_path / "b c.mtl").write_text("newmtl x\nKd 0 1 0\n")
    (part,) = _read(tmp_path, "mtllib a.mtl other.mtl\nusemtl x\n" + QUAD + "f 1 2 3\n")
    assert part.material.rgb == (1, 0, 0)
    (part,) = _read(tmp_path, "mtllib b c.mtl\nusemtl x\n" + QUAD + "f 1 2 3\n")
    assert part.material.rgb == (0, 1, 0)

"""OBJ and MTL: what PartNet writes and what it might."""

from pathlib import Path

import numpy as np

from artiskill.assets.partnet.obj import load_material, read_mtl, read_obj

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

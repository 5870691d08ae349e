"""Folders, zips and files that are not as they must be: one AssetError that names the thing."""

import zipfile
from pathlib import Path

import pytest

from artiskill.assets.partnet import find_partnet_folder, import_partnet
from artiskill.errors import AssetError, UnknownNameError


def _zip(folder: Path, target: Path, prefixes: list[str]) -> Path:
    with zipfile.ZipFile(target, "w") as archive:
        for prefix in prefixes:
            for file in sorted(folder.rglob("*")):
                archive.write(file, prefix + str(file.relative_to(folder)))
    return target


def _fails(folder: Path, message: str) -> None:
    with pytest.raises(AssetError, match=message):
        import_partnet(folder)


def test_folder_missing(tmp_path):
    _fails(tmp_path / "nowhere", "nowhere' does not exist")


def test_neither_folder_nor_zip(tmp_path):
    (tmp_path / "a.zip").write_text("not a zip")
    _fails(tmp_path / "a.zip", "neither a folder nor a zip")


@pytest.mark.parametrize("file", ["mobility.urdf", "meta.json"])
def test_file_missing(toy, file):
    (toy.write() / file).unlink()
    _fails(toy.folder, f"has no file '{file}'")


@pytest.mark.parametrize("file", ["meta.json", "result.json", "mobility_v2.json"])
def test_json_broken(toy, file):
    (toy.write() / file).write_text("{")
    _fails(toy.folder, f"toy/{file} is not valid JSON")


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("result.json", "{}", "must hold a list"),
        ("result.json", '[{"children": 3}]', "must be lists"),
        ("mobility_v2.json", '[{"parts": [3]}]', "must be a mapping"),
        ("meta.json", '{"model_cat": "Oven"}', "'Oven'; legal: StorageFurniture, Chair, Bucket"),
        ("mobility.urdf", "<robot>", "not valid XML"),
        ("mobility.urdf", "<sdf/>", "must be <robot>, not <sdf>"),
        ("mobility.urdf", "<robot/>", "exactly one link"),
        ("mobility.urdf", '<robot><link name="base"/></robot>', "no link has a <visual> mesh"),
    ],
)
def test_content_wrong(toy, file, text, message):
    (toy.write() / file).write_text(text)
    _fails(toy.folder, message)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('type="prismatic"', 'type="floating"', "'floating'; legal: fixed, revolute, continuous, prismatic"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', "axis of length 0"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0"/>', "axis must be 3 numbers, not '0 0'"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 a 1"/>', "must be 3 numbers"),
        ('upper="0.5"', 'upper="far"', "upper limit must be 1 numbers, not 'far'"),
        ('<parent link="link_2"/>', '<parent link="link_9"/>', "'link_9', which does not exist"),
        ('<child link="link_1"/>', "", "has no <child"),
        ('<child link="link_1"/>', '<child link="link_0"/>', "two parent joints"),
        ('<link name="link_1">', '<link name="link_0">', "two links are named 'link_0'"),
        ('<parent link="base"/>', '<parent link="link_1"/>', "make a loop"),
        ("textured_objs/original-3.obj", "../original-3.obj", "inside the object's folder"),
        ("textured_objs/original-3.obj", "textured_objs/original-3.stl", "'.stl'; legal: .obj"),
        ('<mesh filename="textured_objs/original-3.obj"/>', "<box/>", r"it has \['box'\]"),
    ],
)
def test_urdf_wrong(toy, old, new, message):
    urdf = toy.write() / "mobility.urdf"
    text = urdf.read_text()
    assert old in text
    urdf.write_text(text.replace(old, new))
    _fails(toy.folder, message)


def test_mesh_missing(toy):
    (toy.write() / "textured_objs" / "original-3.obj").unlink()
    _fails(toy.folder, "toy: link 'link_1': mesh file 'original-3.obj' does not exist in 'textured_objs'")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "is empty: it has 3 vertices"),
        ("v 0 0\n", "line 1, does not parse: 'v 0 0'"),
        ("v 0 0 0\nv 1 0 0\nv 0 x 0\n", "line 3"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "line 4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n", "line 4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", "line 4"),
        ("v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n", "not finite"),
        ("v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n", "has no area"),
    ],
)
def test_mesh_does_not_parse(toy, text, message):
    (toy.write() / "textured_objs" / "original-3.obj").write_text(text)
    with pytest.raises(AssetError, match=message) as caught:
        import_partnet(toy.folder)
    assert "original-3.obj" in str(caught.value)


@pytest.mark.parametrize("prefix", ["", "40999/", "data/40999/"])
def test_zip_is_a_folder(toy, tmp_path, cache_dir, prefix):
    path = _zip(toy.write(), tmp_path / "40999.zip", [prefix])
    obj = import_partnet(path, cache_dir=cache_dir)
    assert obj.id == "40999"
    assert obj.target_links("prismatic") == ("link_1",)


def test_zip_with_wrong_content(toy, tmp_path):
    folder = toy.write()
    _fails(_zip(folder, tmp_path / "two.zip", ["1/", "2/"]), "2 objects")
    (folder / "mobility.urdf").unlink()
    _fails(_zip(folder, tmp_path / "none.zip", ["1/"]), "holds no mobility.urdf .its top level: 1")


def test_zip_leading_outside(tmp_path):
    path = tmp_path / "evil.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("mobility.urdf", "<robot/>")
        archive.writestr("../evil.txt", "x")
    _fails(path, "leads outside")
    assert not (tmp_path.parent / "evil.txt").exists()


def test_nothing_cached_after_an_error(toy, tmp_path):
    (toy.write() / "textured_objs" / "original-6.obj").write_text("v 1")
    with pytest.raises(AssetError):
        import_partnet(toy.folder, cache_dir=tmp_path / "cache")
    assert not (tmp_path / "cache").exists()


def test_find_folder(tmp_path, monkeypatch):
    (tmp_path / "40147").mkdir()
    (tmp_path / "40148.zip").touch()
    assert find_partnet_folder("40147", tmp_path) == tmp_path / "40147"
    monkeypatch.setenv("PARTNET_MOBILITY_DATASET", str(tmp_path))
    assert find_partnet_folder("40148") == tmp_path / "40148.zip"
    with pytest.raises(UnknownNameError, match=r"did you mean '4014[78]'"):
        find_partnet_folder("40149")
    monkeypatch.setenv("PARTNET_MOBILITY_DATASET", str(tmp_path / "no"))
    with pytest.raises(AssetError, match=r"from PARTNET_MOBILITY_DATASET\) does not exist"):
        find_partnet_folder("40147")
    monkeypatch.delenv("PARTNET_MOBILITY_DATASET")
    with pytest.raises(AssetError, match="set the environment variable PARTNET_MOBILITY_DATASET"):
        find_partnet_folder("40147")

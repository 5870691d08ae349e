"""Folders, zips and files that are not as they must be: one AssetError that names the thing."""

import zipfile
from pathlib import Path

import pytest

from artiskill.assets.needs import TASK_NEEDS
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
        ("result.json", '[{"objs": 3}]', "'objs' must be a list, not 3"),
        ("meta.json", '{"model_cat": ["x"]}', r"model_cat is \['x'\]; legal: StorageFurniture, Chair, Bucket"),
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
        ('upper="0.5"', 'upper="far"', "upper limit must be a number, not 'far'"),
        ('upper="0.5"', 'upper="nan"', "upper limit must be a finite number, not 'nan'"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 nan 1"/>', "axis must be 3 finite numbers, not '0 nan 1'"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1e300"/>', "axis must be 3 finite numbers of at most 1e[+]06"),
        ('<origin xyz="0 0 0"/>', '<origin xyz="0 0 inf"/>', "origin xyz must be 3 finite numbers"),
        ('original-3.obj"/>', 'original-3.obj" scale="1e300 1 1"/>', "mesh scale must be 3 finite numbers"),
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
        ("v 0 0 0\nv 1 0 1e300\nv 0 1 0\nf 1 2 3\n", "vertex coordinate that is too large: 1e[+]300"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 1e300 0\nf 1/1 2/1 3/1\n", "texture coordinate that is too large"),
        ("v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n", "has no area"),
    ],
)
def test_mesh_does_not_parse(toy, text, message):
    (toy.write() / "textured_objs" / "original-3.obj").write_text(text)
    with pytest.raises(AssetError, match=message) as caught:
        import_partnet(toy.folder)
    assert "original-3.obj" in str(caught.value)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("Kd 1 x 1", "Kd must be 3 finite numbers, not '1 x 1'"),
        ("Kd 1 1", "Kd must be 3 finite numbers, not '1 1'"),
        ("Kd nan 1 1", "Kd must be 3 finite numbers, not 'nan 1 1'"),
        ("d", "d must be a finite number, not ''"),
        ("Ns inf", "Ns must be a finite number, not 'inf'"),
    ],
)
def test_material_does_not_parse(toy, line, message):
    (toy.write() / "textured_objs" / "original-3.mtl").write_text(f"newmtl wood\n{line}\n")
    _fails(toy.folder, f"'link_1': mesh file 'original-3.obj': material file 'original-3.mtl', line 2: {message}")


@pytest.fixture
def _no_decomposition(monkeypatch):
    """Whoever decomposes a mesh fails."""
    monkeypatch.setattr("artiskill.assets.partnet.importer.decompose_cached", lambda *_: pytest.fail("decomposed"))


@pytest.mark.usefixtures("_no_decomposition")
def test_wrong_category_is_refused_before_anything_else_is_read(toy):
    toy.meta = {"model_cat": "Chair"}
    (toy.write() / "mobility.urdf").unlink()
    with pytest.raises(AssetError, match="object 'toy' is a chair; OpenCabinetDrawer needs a cabinet"):
        import_partnet(toy.folder, needs=TASK_NEEDS["OpenCabinetDrawer"])


@pytest.mark.usefixtures("_no_decomposition")
def test_object_without_target_is_refused_before_decomposition(toy):
    toy.parts["link_1"] = toy.parts["link_1"][:2]  # without its handle
    with pytest.raises(AssetError, match="object 'toy' has no drawer with a handle") as caught:
        import_partnet(toy.write(), needs=TASK_NEEDS["OpenCabinetDrawer"])
    assert "it has: door link_0 (with a handle), drawer link_1 (no usable handle)." in str(caught.value)


@pytest.mark.usefixtures("_no_decomposition")
def test_door_that_turns_without_end_is_no_target(toy):
    toy.joints["link_0"] = toy.joints["link_0"].replace("revolute", "continuous")
    with pytest.raises(AssetError, match=r"no door with a handle.*door link_0 \(no usable handle\)"):
        import_partnet(toy.write(), needs=TASK_NEEDS["OpenCabinetDoor"])


def test_object_with_a_target_meets_the_needs(toy, load):
    for task, needs in TASK_NEEDS.items():
        if needs.category == "cabinet":
            assert load(toy, needs=needs).target_links(needs.motion), task


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

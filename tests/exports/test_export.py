"""Folders of exports: complete or absent, and never someone else's."""

import json

import pytest

from artiskill.assets.catalog import load_object
from artiskill.errors import AssetError, ConfigError, UnknownNameError
from artiskill.exports import mjcf
from artiskill.exports.export import FORMATS, MARKER, export_object, export_objects


@pytest.mark.parametrize("kind", ["mjcf", "urdf"])
def test_exports_are_the_same_each_time(kind, odd_chair, tmp_path):
    first, second = (export_object(odd_chair, kind, tmp_path / name).parent for name in "ab")
    files = sorted(path.relative_to(first) for path in first.rglob("*") if path.is_file())
    assert files == sorted(path.relative_to(second) for path in second.rglob("*") if path.is_file())
    for file in files:
        assert (first / file).read_bytes() == (second / file).read_bytes(), file


def test_the_folder_says_what_it_is(odd_chair, tmp_path):
    export_object(odd_chair, "mjcf", tmp_path / "out")
    marker = json.loads((tmp_path / "out" / MARKER).read_text())
    assert (marker["object"], marker["format"]) == ("odd-chair", "mjcf")
    assert marker["content_hash"] == odd_chair.content_hash


def test_nothing_outside_is_mentioned(odd_chair, tmp_path):
    for kind in ("mjcf", "urdf"):
        folder = export_object(odd_chair, kind, tmp_path / kind).parent
        for path in folder.rglob("*"):
            if path.is_file() and path.suffix not in (".png", ".npz"):
                assert str(tmp_path) not in path.read_text(), path


def test_an_earlier_export_is_replaced(odd_chair, tmp_path):
    path = export_object(odd_chair, "urdf", tmp_path / "out")
    whole = path.read_bytes()
    path.write_text("changed")
    export_object(odd_chair, "urdf", tmp_path / "out")
    assert path.read_bytes() == whole
    assert [path.name for path in tmp_path.iterdir()] == ["out"], "no temporary folder is left"


def test_other_files_beside_an_export_are_left_alone_unless_forced(odd_chair, tmp_path):
    folder = export_object(odd_chair, "urdf", tmp_path / "out").parent
    (folder / "mine").mkdir()
    (folder / "mine" / "weights.pt").write_text("mine")
    with pytest.raises(ConfigError, match=r"holds 'mine/weights\.pt', which no export wrote.*--force"):
        export_object(odd_chair, "urdf", folder)
    assert (folder / "mine" / "weights.pt").read_text() == "mine"
    export_object(odd_chair, "urdf", folder, force=True)
    assert not (folder / "mine").exists()


def test_an_export_in_another_format_is_left_alone_unless_forced(odd_chair, tmp_path):
    path = export_object(odd_chair, "mjcf", tmp_path / "out")
    with pytest.raises(ConfigError, match=r"an export of 'odd-chair' as mjcf.*--force"):
        export_object(odd_chair, "urdf", tmp_path / "out")
    assert path.is_file()
    export_object(odd_chair, "urdf", tmp_path / "out", force=True)
    assert not path.exists()


def test_a_folder_of_several_exports_is_told_as_such(odd_chair, tmp_path):
    list(export_objects([odd_chair, "bucket-0001"], "mjcf", tmp_path / "all"))
    with pytest.raises(
        ConfigError, match=r"exports in folders of their own \(bucket-0001, odd-chair\).*all/odd-chair"
    ):
        export_object(odd_chair, "mjcf", tmp_path / "all")


@pytest.mark.parametrize("object_id", ["bucket-0001", "bucket-0002"])
def test_another_object_is_left_alone_unless_forced(object_id, odd_chair, tmp_path):
    path = export_object(odd_chair, "urdf", tmp_path / "out")
    before = path.read_bytes()
    with pytest.raises(ConfigError, match=r"an export of 'odd-chair'.*--force"):
        export_object(load_object(object_id), "urdf", tmp_path / "out")
    assert path.read_bytes() == before
    export_object(load_object(object_id), "urdf", tmp_path / "out", force=True)
    assert path.read_bytes() != before


@pytest.mark.parametrize(
    "marker", ["{", "[]", "{}", "\0", "[" * 60_000, "{" + " " * 70_000 + '"object": "odd-chair"}']
)
def test_a_damaged_marker_is_nobodys(marker, odd_chair, tmp_path):
    path = export_object(odd_chair, "urdf", tmp_path / "out")
    (tmp_path / "out" / MARKER).write_text(marker)
    with pytest.raises(ConfigError, match="which no export wrote"):
        export_object(odd_chair, "mjcf", tmp_path / "out")
    assert path.is_file()


def test_several_objects_get_a_folder_each(odd_chair, tmp_path):
    written = list(export_objects((odd_chair, "bucket-0001"), "urdf", tmp_path))
    assert [(obj.id, path) for obj, path in written] == [
        ("odd-chair", tmp_path / "odd-chair" / "mobility.urdf"),
        ("bucket-0001", tmp_path / "bucket-0001" / "mobility.urdf"),
    ]
    assert next(export_objects(("bucket-0001",), "urdf", tmp_path))[1] == written[1][1]


def test_no_folder_is_written_if_one_of_them_is_taken(odd_chair, tmp_path):
    (tmp_path / "bucket-0001").mkdir()
    (tmp_path / "bucket-0001" / "thesis.tex").write_text("years of work")
    with pytest.raises(ConfigError, match=r"thesis\.tex"):
        list(export_objects((odd_chair, "bucket-0001"), "urdf", tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == ["bucket-0001"]


def test_a_foreign_folder_is_left_alone_unless_forced(odd_chair, tmp_path):
    foreign = tmp_path / "out" / "thesis.tex"
    foreign.parent.mkdir()
    foreign.write_text("years of work")
    with pytest.raises(ConfigError, match=r"thesis\.tex.*--force"):
        export_object(odd_chair, "mjcf", tmp_path / "out")
    assert foreign.read_text() == "years of work"
    export_object(odd_chair, "mjcf", tmp_path / "out", force=True)
    assert not foreign.exists()


def test_an_empty_folder_is_used(odd_chair, tmp_path):
    (tmp_path / "out").mkdir()
    assert export_object(odd_chair, "mjcf", tmp_path / "out").is_file()


def test_a_file_is_never_replaced(odd_chair, tmp_path):
    (tmp_path / "out").write_text("mine")
    with pytest.raises(ConfigError, match="a file or link"):
        export_object(odd_chair, "mjcf", tmp_path / "out", force=True)


def test_a_failure_leaves_the_earlier_export(odd_chair, tmp_path, monkeypatch):
    path = export_object(odd_chair, "mjcf", tmp_path / "out")
    before = path.read_bytes()

    def fail(*_: object) -> None:
        raise AssetError("stopped")

    monkeypatch.setattr(mjcf, "compile_object", fail)
    with pytest.raises(AssetError, match="stopped"):
        export_object(odd_chair, "mjcf", tmp_path / "out")
    assert path.read_bytes() == before
    assert [found.name for found in tmp_path.iterdir()] == ["out"]


def test_formats_are_named(odd_chair, tmp_path):
    with pytest.raises(UnknownNameError, match="did you mean 'urdf'"):
        export_object(odd_chair, "urdfs", tmp_path / "out")
    with pytest.raises(UnknownNameError, match="Legal: glb, gltf, mjcf, urdf"):
        export_object(odd_chair, "glft", tmp_path / "out")
    assert FORMATS == ("mjcf", "urdf", "glb")


def test_gltf_is_another_name_of_glb(odd_chair, tmp_path):
    pytest.importorskip("trimesh", reason="needs the extra `export`")
    path = export_object(odd_chair, "gltf", tmp_path / "out")
    assert path.name == "odd-chair.glb"
    assert json.loads(path.with_name(MARKER).read_text())["format"] == "glb"

"""A folder that an export made is the object itself, until somebody changes a file in it."""

import json
import sys
import zipfile
from pathlib import Path

import pytest

from artiskill.assets.catalog import load_object, resolve_objects
from artiskill.assets.exported_folder import MARKER, OBJECT_FILE, read_exported
from artiskill.errors import AssetError, MissingExtraError
from artiskill.exports.export import export_object


@pytest.fixture
def folder(drawer_box, tmp_path) -> Path:
    return export_object(drawer_box, "urdf", tmp_path / "my_box").parent


def edit_marker(folder: Path, **changes: object) -> None:
    marker = json.loads((folder / MARKER).read_text())
    (folder / MARKER).write_text(json.dumps(marker | changes))


def test_it_is_the_object_itself_without_the_importer(drawer_box, folder, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "coacd", None)
    found = load_object(folder)
    assert (found.id, found.content_hash) == ("drawer-box", drawer_box.content_hash)
    assert [one.id for one in resolve_objects(str(folder), "OpenCabinetDrawer")] == ["drawer-box"]
    assert capsys.readouterr() == ("", "")


def test_a_zip_of_it_is_the_object_itself(drawer_box, folder, tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for file in sorted(folder.rglob("*")):
            archive.write(file, f"elsewhere/{file.relative_to(folder)}")
    assert load_object(tmp_path / "a.zip").content_hash == drawer_box.content_hash


def test_files_beside_it_change_nothing(drawer_box, folder):
    (folder / "notes.txt").write_text("mine")
    assert load_object(folder).content_hash == drawer_box.content_hash


@pytest.mark.parametrize("name", ["mobility.urdf", "meta.json", OBJECT_FILE])
def test_a_changed_folder_is_imported_and_says_so(name, drawer_box, folder, capsys):
    pytest.importorskip("coacd", reason="the importer needs the extra `import`")
    with (folder / name).open("ab") as file:
        file.write(b"\n")
    found = load_object(folder)
    remark = f"'{name}' was changed since the export: collision shapes, masses and handles are new"
    assert found.metadata["warnings"][0] == remark
    assert f"'my_box': {remark}\n" in capsys.readouterr().err
    assert found.metadata["source"] == "PartNet-Mobility"
    assert found.content_hash != drawer_box.content_hash


def test_a_changed_folder_needs_the_importer(folder, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "coacd", None)
    (folder / OBJECT_FILE).unlink()
    with pytest.raises(MissingExtraError, match="import"):
        load_object(folder)
    assert "'object.npz' was changed since the export" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("marker", "changed"),
    [
        ({"files": {"../outside": "00", OBJECT_FILE: "00"}}, "../outside"),
        ({"files": {"/etc/hostname": "00", OBJECT_FILE: "00"}}, "/etc/hostname"),
        ({"files": {"gone": "00", OBJECT_FILE: "00"}}, "gone"),
        ({"files": {OBJECT_FILE: "00"}}, OBJECT_FILE),
        ({"files": ["mobility.urdf", OBJECT_FILE]}, ""),  # no checksums: of an early export
        ({"files": 3}, ""),
    ],
)
def test_markers_that_do_not_fit(marker, changed, folder):
    edit_marker(folder, **marker)
    assert read_exported(folder) == (None, changed)


def test_more_than_an_object_is_not_read(folder, monkeypatch):
    monkeypatch.setattr("artiskill.assets.exported_folder._MOST_BYTES", 300)
    assert read_exported(folder)[0] is None


def test_another_object_under_its_name_is_refused(folder):
    edit_marker(folder, content_hash="0" * 16)
    with pytest.raises(AssetError, match=r"object\.npz holds an object with the content hash .*says 0000"):
        load_object(folder)

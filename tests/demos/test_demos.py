"""Folders of demonstrations and their manifests, lost ones too, and the pack that comes with the package."""

import dataclasses
import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

import artiskill
from artiskill.demos import demos as module
from artiskill.demos.collect import collect
from artiskill.demos.demos import (
    PACK,
    Demos,
    find_folders,
    load_demo_pack,
    read_manifest,
    unlisted_files,
    write_manifest,
)
from artiskill.demos.hdf5 import load_h5py
from artiskill.demos.plan import CollectionPlan
from artiskill.demos.verify import differences, verify
from artiskill.errors import DemoError, UnknownNameError
from artiskill.tasks.registry import task_names

from .conftest import begin, contents

REMAKE = "remake it: python tools/make_demo_pack.py"
MakePlan = Callable[..., CollectionPlan]


@pytest.mark.parametrize("task", task_names())
def test_the_pack_fits_the_package(task: str) -> None:
    """Objects and tasks are those of this version, and one trajectory of each object comes out bit for bit."""
    demos = Demos(load_demo_pack(task).folder, check=True)
    assert len(demos.objects) == 3
    assert len(demos) == 12
    for file in demos.files():
        obj = file.load_object()
        env = file.make_env()
        trajectory = file.trajectory(0)
        assert trajectory.success
        assert differences(trajectory, env, obj) == "", REMAKE


@pytest.mark.slow
@pytest.mark.parametrize("task", task_names())
def test_all_of_the_pack(task: str) -> None:
    verdicts = verify(PACK / task)
    assert sum(verdict.exact for verdict in verdicts) == 12, (REMAKE, verdicts)


def test_it_is_small() -> None:
    assert sum(path.stat().st_size for path in PACK.rglob("*")) < 2_000_000


def test_names() -> None:
    assert artiskill.load_demo_pack is load_demo_pack
    with pytest.raises(UnknownNameError, match="unknown task 'PushChairs'; did you mean 'PushChair'"):
        load_demo_pack("PushChairs")


def test_folders(own_drawers: Path, tmp_path: Path) -> None:
    assert find_folders(own_drawers) == find_folders(tmp_path) == [own_drawers]
    with pytest.raises(DemoError, match=r"neither it nor a folder in it has a manifest.json"):
        find_folders(tmp_path / "nothing")
    with pytest.raises(DemoError, match="is a file; name its folder"):
        find_folders(own_drawers / "cabinet-0002.h5")
    with pytest.raises(DemoError, match=r"cabinet-0002\.h5' is a file, not a folder of demonstrations"):
        Demos(own_drawers / "cabinet-0002.h5")
    (own_drawers / "cabinet-0002.h5").unlink()
    with pytest.raises(DemoError, match="is missing: the manifest lists it"):
        Demos(own_drawers)


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"format": "other"}'])
def test_bad_manifests(tmp_path: Path, text: str) -> None:
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(DemoError, match=r"damaged|holds no demonstrations"):
        read_manifest(tmp_path)


def test_training_files_among_demonstrations_are_left_out(
    own_drawers: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    training, damaged = tmp_path / "training", tmp_path / "damaged"
    for folder, text in ((training, '{"format": "artiskill-training"}'), (damaged, "{")):
        folder.mkdir()
        (folder / "manifest.json").write_text(text)
    assert find_folders(tmp_path) == [damaged, own_drawers]
    assert caplog.messages == [f"{training} is left out: it holds no demonstrations, but artiskill-training"]


@pytest.mark.parametrize(
    "name", ["../evil.h5", "evil.h5", "/tmp/cabinet-0002.h5", ".cabinet-0002.h5", "cabinet-0002"]
)
@pytest.mark.parametrize("with_object", [True, False])
def test_a_manifest_names_files_of_its_folder_only(own_drawers: Path, name: str, with_object: bool) -> None:
    """Paths are made of the names, and of those of the objects."""
    path = own_drawers / "manifest.json"
    content = json.loads(path.read_text())
    entry = content["files"].pop("cabinet-0002.h5")
    if with_object and name != "evil.h5":
        entry["object"] = name.removesuffix(".h5")
    content["files"][name] = entry
    path.write_text(json.dumps(content))
    with pytest.raises(DemoError, match=rf"a file is called '{name}'; its name must be that of its object"):
        read_manifest(own_drawers)


def test_a_manifest_is_on_the_disk(own_drawers: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A power cut leaves no empty one."""
    synced: list[int] = []
    monkeypatch.setattr(module.os, "fsync", lambda handle: synced.append(os.fstat(handle).st_size))
    write_manifest(read_manifest(own_drawers), own_drawers)
    assert synced == [(own_drawers / "manifest.json").stat().st_size]


def test_a_manifest_with_a_key_too_many(own_drawers: Path) -> None:
    path = own_drawers / "manifest.json"
    path.write_text(path.read_text().replace('"settings": {', '"setings": {', 1))
    with pytest.raises(DemoError, match="did you mean 'settings'"):
        read_manifest(own_drawers)


def test_a_lost_manifest_is_no_licence(own_drawers: Path, plan: MakePlan, tmp_path: Path) -> None:
    """Neither finished files nor staged attempts go over to another plan, even of other objects."""
    (own_drawers / "manifest.json").unlink()
    begin(plan(), tmp_path / "begun", 2)
    (tmp_path / "begun" / "manifest.json").unlink()
    for folder, told in (
        (
            own_drawers,
            r"does not fit: cabinet-0002.h5 was made with other settings \(per_object 3 there, 1 here\)",
        ),
        (tmp_path / "begun", "holds attempts made with other settings: their hash was"),
    ):
        before = contents(folder)
        for objects in (["cabinet-0002"], ["cabinet-0012"]):
            with pytest.raises(DemoError, match=told):
                collect(plan(objects=objects, per_object=1), folder)
            assert contents(folder) == before


@pytest.mark.parametrize("text", [None, ""])
def test_a_lost_manifest_is_made_anew(own_drawers: Path, plan: MakePlan, drawers: Path, text: str | None) -> None:
    manifest = own_drawers / "manifest.json"
    manifest.unlink()
    if text is not None:
        manifest.write_text(text)
    with pytest.raises(DemoError, match=r"remove what is left of manifest.json and collect with the options of"):
        Demos(own_drawers)
    manifest.unlink(missing_ok=True)
    attempts = []
    collect(plan(objects=["cabinet-0002"]), own_drawers, on_attempt=attempts.append)
    assert not attempts
    assert contents(own_drawers) == contents(drawers)


def test_files_of_another_machine_are_taken_in(own_drawers: Path, plan: MakePlan, drawers: Path) -> None:
    """Copied in without their manifest: neither overlooked nor overwritten."""
    name = "cabinet-0026.h5"
    listed = read_manifest(own_drawers)
    write_manifest(
        dataclasses.replace(listed, files={"cabinet-0002.h5": listed.files["cabinet-0002.h5"]}), own_drawers
    )
    assert unlisted_files(own_drawers) == [own_drawers / name]
    before = (own_drawers / name).stat().st_ino
    attempts = []
    collect(plan(), own_drawers, on_attempt=attempts.append)
    assert not attempts
    assert (own_drawers / name).stat().st_ino == before
    assert contents(own_drawers) == contents(drawers)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("cabinet-0002.h5", r"cabinet-0002.h5 was made with other settings \(variety true there, false here"),
        ("copy.h5", r"copy.h5 holds demonstrations of 'cabinet-0026'"),
        ("damaged.h5", r"damaged.h5': it is truncated"),
        ("foreign.h5", r"foreign.h5' holds no demonstrations"),
    ],
)
def test_files_that_do_not_fit_are_an_error(own_drawers: Path, plan: MakePlan, name: str, told: str) -> None:
    manifest, source, given = own_drawers / "manifest.json", own_drawers / "cabinet-0026.h5", own_drawers / name
    if name == "cabinet-0002.h5":
        (own_drawers / "cabinet-0026.h5").unlink()
        manifest.unlink()
    elif name == "copy.h5":
        given.write_bytes(source.read_bytes())
    elif name == "damaged.h5":
        given.write_bytes(source.read_bytes()[:1000])
    else:
        load_h5py().File(given, "w").close()
    before = contents(own_drawers)
    with pytest.raises(DemoError, match=rf"does not list, and that does not fit: .*{told}.*; move it elsewhere"):
        collect(plan(variety=name != "cabinet-0002.h5"), own_drawers)
    assert contents(own_drawers) == before


def test_a_folder_that_is_refused_stays_as_it_is(own_drawers: Path, plan: MakePlan) -> None:
    (own_drawers / ".part-abcd1234.h5").write_bytes(b"somebody's")
    before = contents(own_drawers)
    with pytest.raises(
        DemoError, match="holds demonstrations of OpenCabinetDrawer, not of OpenCabinetDoor; choose"
    ):
        collect(plan(task="OpenCabinetDoor", objects=["cabinet-0006"]), own_drawers)
    assert contents(own_drawers) == before

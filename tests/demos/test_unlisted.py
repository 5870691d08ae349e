"""Manifests that were lost, and files that none lists."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import pytest

from artiskill.demos.collect import collect
from artiskill.demos.demos import Demos, read_manifest, unlisted_files, write_manifest
from artiskill.demos.hdf5 import load_h5py
from artiskill.demos.plan import CollectionPlan
from artiskill.errors import DemoError

from .conftest import begin, contents

MakePlan = Callable[..., CollectionPlan]


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

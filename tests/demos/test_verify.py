import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artiskill.demos.demos import read_manifest, sha256_of
from artiskill.demos.hdf5 import load_h5py
from artiskill.demos.verify import verify
from artiskill.errors import ConfigError, DemoError

NAME = "cabinet-0002.h5"


def rewrite(folder: Path, change: Any) -> None:
    """Change a file, and its checksum in the manifest with it: as somebody would who wants it to look true."""
    path, manifest = folder / NAME, folder / "manifest.json"
    with load_h5py().File(path, "r+") as file:
        change(file)
    content = json.loads(manifest.read_text())
    content["files"][NAME] |= {"sha256": sha256_of(path), "bytes": path.stat().st_size}
    manifest.write_text(json.dumps(content))


def fault_of(folder: Path, change: Any) -> str:
    rewrite(folder, change)
    first, second = verify(folder)
    assert not second.faults
    (fault,) = first.faults
    return fault


@pytest.mark.parametrize("workers", [1, 2])
def test_all_is_as_recorded(drawers: Path, workers: int) -> None:
    told: list[bool] = []
    results = verify(drawers, workers, told.append)
    assert [result.object for result in results] == ["cabinet-0002", "cabinet-0026"]
    assert all(result.exact == result.trajectories == 3 and not result.faults for result in results)
    assert all(result.steps > 100 for result in results)
    assert told == [True] * 6


def set_row(name: str, row: Any, value: Any) -> Any:
    def change(file: Any) -> None:
        file[f"traj_1/{name}"][row] = value

    return change


@pytest.mark.parametrize(
    ("name", "row", "value", "fault"),
    [
        ("actions", (5, 2), 0.123, "; digests differ from row 6 on"),
        ("rewards", 5, 0.25, "trajectory 1: rewards differ from row 5 on"),
        ("flags", (5, 0), True, "trajectory 1: flags differ from row 5 on"),
        ("digests", 5, 7, "trajectory 1: digests differ from row 5 on"),
        ("states", (5, 0), 9.0, "trajectory 1: states differ from row 5 on"),
        ("key_frames", (1, 20), 9.0, "trajectory 1: key_frames differ from row 1 on"),
    ],
)
def test_every_number_counts(own_drawers: Path, name: str, row: Any, value: Any, fault: str) -> None:
    found = fault_of(own_drawers, set_row(name, row, value))
    assert fault in found


def test_what_was_disturbed_has_its_form(own_drawers: Path) -> None:
    """It does not follow from the actions: only its form and the checksum can be wrong."""

    def shorten(file: Any) -> None:
        values = file["traj_1/disturbed"][:-1]
        del file["traj_1/disturbed"]
        file["traj_1/disturbed"] = values

    assert "(disturbed are bool (" in fault_of(own_drawers, shorten)


def test_another_level(own_drawers: Path) -> None:
    def change(file: Any) -> None:
        file["traj_1"].attrs["level"] = 17

    assert "digests differ from row 0 on" in fault_of(own_drawers, change)


def test_a_trajectory_that_ends_too_soon(own_drawers: Path) -> None:
    def change(file: Any) -> None:
        group = file["traj_1"]
        for name in ("actions", "disturbed", "rewards", "flags", "digests", "states"):
            values = group[name][:-1]
            del group[name]
            group[name] = values

    assert "trajectory 1" in fault_of(own_drawers, change)


def test_counts_that_do_not_add_up(own_drawers: Path) -> None:
    def change(file: Any) -> None:
        table = file["attempts"][()]
        table["success"][0] = 0
        file["attempts"][...] = table

    assert "do not add up" in fault_of(own_drawers, change)


def test_a_trajectory_too_few(own_drawers: Path) -> None:
    def change(file: Any) -> None:
        del file["traj_2"]

    assert "holds something else than the manifest says" in fault_of(own_drawers, change)


def test_checksums(own_drawers: Path) -> None:
    path = own_drawers / NAME
    path.write_bytes(path.read_bytes()[:-1] + b"x")
    first, second = verify(own_drawers)
    assert "is not the file that the manifest lists" in first.faults[0]
    assert (first.trajectories, second.exact) == (0, 3)
    path.unlink()
    assert "No such file" in verify(own_drawers)[0].faults[0]


def test_a_size_that_the_manifest_has_otherwise(own_drawers: Path) -> None:
    manifest = own_drawers / "manifest.json"
    content = json.loads(manifest.read_text())
    content["files"][NAME]["bytes"] += 1
    manifest.write_text(json.dumps(content))
    first, second = verify(own_drawers)
    assert "holds something else than the manifest says" in first.faults[0]
    assert not second.faults


def test_another_catalogue(own_drawers: Path) -> None:
    manifest = own_drawers / "manifest.json"
    content = json.loads(manifest.read_text())
    content["files"][NAME]["content_hash"] = "0" * 16
    manifest.write_text(json.dumps(content))

    def change(file: Any) -> None:
        file.attrs["content_hash"] = "0" * 16

    assert "was made with another 'cabinet-0002'" in fault_of(own_drawers, change)


def set_attribute(name: str, value: Any, group: str = "/") -> Any:
    def change(file: Any) -> None:
        file[group].attrs[name] = value

    return change


def set_json(attribute: str, **values: Any) -> Any:
    def change(file: Any) -> None:
        file.attrs[attribute] = json.dumps(json.loads(file.attrs[attribute]) | values)

    return change


def replace_array(name: str, new: Any) -> Any:
    def change(file: Any) -> None:
        values = file[name][()]
        del file[name]
        file[name] = new(values)

    return change


def with_rows(**values: int) -> Any:
    """The table of attempts, changed."""

    def change(table: Any) -> Any:
        for name, value in values.items():
            table[name] = value
        return table

    return change


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (
            set_attribute("level", -5, "traj_1"),
            "cannot read trajectory 1 (a level is an integer from 0 to 2147483647",
        ),
        (set_attribute("target", "drawer", "traj_1"), "cannot read trajectory 1 (unknown target 'drawer'"),
        (replace_array("traj_1/actions", lambda a: a * np.float32(np.nan)), "trajectory 1: "),
        (replace_array("traj_1/actions", lambda a: a[:, :3]), "trajectory 1: "),
        (replace_array("traj_1/rewards", lambda a: a.astype(np.float32)), "rewards are float32"),
        (set_attribute("success", False, "traj_1"), "its attribute says success False, its flags True"),
        (replace_array("attempts", with_rows(level=7)), "trajectory 0: it is not what the table of attempts says"),
        (replace_array("attempts", with_rows(steps=7)), "trajectory 0: it is not what the table of attempts says"),
        (replace_array("attempts", lambda table: np.zeros(3)), "cannot read its attempts (they are float64, not"),
        (replace_array("attempts", with_rows(target=7)), "cannot read its attempts (the header has 1 targets)"),
        (replace_array("attempts", with_rows(trajectory=1)), "they do not list the 3 trajectories"),
        (
            set_json("settings", control_mode="operational_space"),
            'control_mode "operational_space" there, "joint"',
        ),
        (set_json("facts", name="cabinet-0020"), "was made with another 'cabinet-0002'"),
        (set_json("facts", family="golden"), "has other facts than 'cabinet-0002'"),
        (set_attribute("flag_names", '["done"]'), "has flags ('done',), the task ("),
    ],
)
def test_whatever_is_wrong_there_is_a_verdict(own_drawers: Path, change: Any, fault: str) -> None:
    rewrite(own_drawers, change)
    first, second = verify(own_drawers)
    assert not second.faults
    assert fault in first.faults[0]
    assert first.exact < 3


@pytest.mark.parametrize(
    ("columns", "fault"),
    [
        ([["robot_qpos", [3]]], "cannot read trajectory"),
        (None, "the file's state_columns are other ones"),
    ],
)
def test_columns_are_those_that_are_simulated(own_drawers: Path, columns: Any, fault: str) -> None:
    def change(file: Any) -> None:
        found = json.loads(file.attrs["state_columns"])
        file.attrs["state_columns"] = json.dumps(
            columns or [[f"{name}_m", shape] if "root" in name else [name, shape] for name, shape in found]
        )

    rewrite(own_drawers, change)
    faults = verify(own_drawers)[0].faults
    assert len(faults) == 3
    assert all(fault in found for found in faults)


def test_the_manifest_has_the_settings_of_its_files(own_drawers: Path) -> None:
    manifest = own_drawers / "manifest.json"
    content = json.loads(manifest.read_text())
    content["settings"]["expert"]["name"] = "Nobody"
    manifest.write_text(json.dumps(content))
    for result in verify(own_drawers):
        (fault,) = result.faults
        assert 'expert.name "OpenCabinetExpert" there, "Nobody" here (there: the file' in fault


def test_objects_may_be_handed_over_by_name(own_drawers: Path) -> None:
    rewrite(own_drawers, set_json("facts", name="cabinet-9999"))
    assert "may be handed over: `--objects FOLDER`" in verify(own_drawers)[0].faults[0]
    assert (
        "has other facts" in verify(own_drawers, objects=["cabinet-0002"])[0].faults[0]
    )  # the name, which is ours


def test_bad_input(drawers: Path, tmp_path: Path) -> None:
    with pytest.raises(DemoError, match=r"has no manifest.json"):
        verify(tmp_path)
    with pytest.raises(ConfigError, match="workers"):
        verify(drawers, workers=0)


def test_digests_are_independent_of_the_reader(drawers: Path) -> None:
    """Eight bytes of BLAKE2b over the state's arrays, as the docs say."""
    from hashlib import blake2b

    from artiskill.demos.demo_file import DemoFile

    with DemoFile(drawers / NAME) as file:
        trajectory, columns = file.trajectory(0), file.header.key_frame_columns
        frame = trajectory.recording.key_frames[1]
        count = columns.slices["streaks"].start
        assert columns.parts[-1][0] == "streaks"
        digest = blake2b(np.ascontiguousarray(frame[:count]).tobytes(), digest_size=8).digest()
        assert int.from_bytes(digest, "little") == trajectory.recording.digests[30]


def test_other_versions_are_told(drawers: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = read_manifest(drawers).settings
    assert settings.other_versions == ""
    now = settings.versions | {"numpy": "9.9"}
    monkeypatch.setattr("artiskill.demos.settings.versions", lambda: now)
    assert settings.other_versions == f'numpy "{settings.versions["numpy"]}" there, "9.9" here'

import json
import os
from pathlib import Path

import numpy as np
import pytest

from artiskill.demos import demos as module
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demos import Demos, find_folders, read_manifest, write_manifest
from artiskill.demos.file_format import DEMONSTRATIONS
from artiskill.demos.hdf5 import load_h5py
from artiskill.errors import DemoError

from .conftest import PER_OBJECT


def changed(path: Path, **attributes: object) -> Path:
    with load_h5py().File(path, "r+") as file:
        file.attrs.update(attributes)
    return path


@pytest.fixture
def path(own_drawers: Path) -> Path:
    return own_drawers / "cabinet-0002.h5"


def test_what_a_file_says(path: Path) -> None:
    with DemoFile(path) as file:
        header = file.header
        assert (header.object, header.facts["category"], header.facts["split"]) == (
            "cabinet-0002",
            "cabinet",
            "train",
        )
        assert header.settings.task == "OpenCabinetDrawer"
        assert header.settings.expert.name == "OpenCabinetExpert"
        assert header.settings.versions["numpy"] == np.__version__
        assert file.load_object().content_hash == header.content_hash
        assert file.attempts["success"].tolist() == [1, 1, 1]
        trajectory = file.trajectory(0)
        steps = len(trajectory)
        assert trajectory.actions.shape == (steps, 13)
        assert trajectory.actions.dtype == np.float32
        assert trajectory.disturbed.shape == (steps,)
        assert trajectory.disturbed.dtype == np.bool_
        assert trajectory.recording.flags.shape == (steps, len(header.flag_names))
        assert trajectory.recording.digests.shape == (steps + 1,)
        assert trajectory.states["robot_qpos"].shape == (steps + 1, 13)
        with pytest.raises(IndexError, match="has the trajectories 0 to 2, not 3"):
            file.trajectory(3)


def test_a_file_is_a_sequence(path: Path) -> None:
    with DemoFile(path) as file:
        levels = [trajectory.level for trajectory in file]
        assert [file[k].level for k in (0, 1, 2, -3, -2, -1)] == levels * 2
        for k in (3, -4):
            with pytest.raises(IndexError, match="has the trajectories 0 to 2"):
                file[k]
            with pytest.raises(IndexError, match=f"not {k}$"):
                file[k]
        for wrong in ("0", 1.0, None):
            for read in (file.__getitem__, file.trajectory, lambda i: file.array(i, "actions")):
                with pytest.raises(TypeError, match="a trajectory's number must be a whole number, not"):
                    read(wrong)  # type: ignore[arg-type, no-untyped-call]


def test_a_closed_file_is_not_called_damaged(path: Path) -> None:
    with DemoFile(path) as file:
        pass
    for read in (lambda: file[0], lambda: file.array(0, "actions"), lambda: file.attempts):
        with pytest.raises(DemoError, match=r"cabinet-0002\.h5' has been closed: read it before"):
            read()  # type: ignore[no-untyped-call]


def test_an_object_may_be_handed_over_by_name(path: Path) -> None:
    with DemoFile(path) as file:
        env = file.make_env(obj="cabinet-0002")
        env.reset(seed=0)
        assert env.scene.object.id == "cabinet-0002"
        with pytest.raises(DemoError, match="made with another 'cabinet-0002'"):
            file.make_env(obj="cabinet-0026")


def test_an_outcome_that_the_flags_do_not_have(path: Path) -> None:
    with load_h5py().File(path, "r+") as file:
        assert file["traj_1"].attrs["success"]
        file["traj_1"].attrs["success"] = False
    with (
        DemoFile(path) as file,
        pytest.raises(DemoError, match=r"trajectory 1 \(its attribute says success False"),
    ):
        file.trajectory(1)


def test_a_trajectory_in_one_line(path: Path) -> None:
    with DemoFile(path) as file:
        first = file[0]
    said = "cabinet-0002.h5, trajectory 0: link_0, level 0"
    assert repr(first) == f"Trajectory({said}, {len(first)} steps, solved)"


def test_plain_hdf5_readers_find_their_way(path: Path) -> None:
    """The documented layout, without our reader."""
    with load_h5py().File(path, "r") as file:
        assert file.attrs["format"] == "artiskill-demonstrations"
        assert file.attrs["schema_version"] == 2
        group = file["traj_0"]
        assert set(group) == {"actions", "disturbed", "rewards", "flags", "digests", "states", "key_frames"}
        assert set(group.attrs) == {"target", "level", "success"}


def test_truncated(path: Path) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(DemoError, match=r"cannot read .*cabinet-0002.h5': it is truncated"):
        DemoFile(path)


def test_no_hdf5(path: Path) -> None:
    path.write_text("hello")
    with pytest.raises(DemoError, match="it is no HDF5 file"):
        DemoFile(path)
    path.unlink()
    with pytest.raises(DemoError, match="there is no file"):
        DemoFile(path)


def test_foreign(path: Path) -> None:
    with load_h5py().File(path, "w") as file:
        file.create_group("traj_0")
    with pytest.raises(DemoError, match="holds no demonstrations of artiskill"):
        DemoFile(path)


def test_another_schema(path: Path) -> None:
    newer = DEMONSTRATIONS.version + 1
    with pytest.raises(DemoError, match=rf"has schema version {newer}; this version of artiskill reads"):
        DemoFile(changed(path, schema_version=newer))


def test_a_damaged_header(path: Path) -> None:
    with pytest.raises(DemoError, match="is damaged: cannot read its header"):
        DemoFile(changed(path, settings="{"))


def test_a_damaged_trajectory(path: Path) -> None:
    with load_h5py().File(path, "r+") as file:
        start = file["traj_1/states"].id.get_chunk_info(0).byte_offset
        del file["traj_2/rewards"]
    data = bytearray(path.read_bytes())
    data[start : start + 64] = bytes(64)
    path.write_bytes(data)
    with DemoFile(path) as file:
        file.trajectory(0)
        with pytest.raises(DemoError, match="is damaged: cannot read states of trajectory 1"):
            file.trajectory(1)
        with pytest.raises(DemoError, match="is damaged: cannot read rewards of trajectory 2"):
            file.trajectory(2)


def test_another_catalogue(path: Path) -> None:
    with (
        DemoFile(changed(path, content_hash="0" * 16)) as file,
        pytest.raises(DemoError, match=r"made with another 'cabinet-0002': its content hash was 0000"),
    ):
        file.make_env()


def test_another_task_of_the_same_configuration(path: Path) -> None:
    with DemoFile(path) as file:
        known = file.header.settings.config_hash
    with load_h5py().File(path, "r+") as raw:
        raw.attrs["settings"] = raw.attrs["settings"].replace(known, "0" * len(known))
    with DemoFile(path) as file, pytest.raises(DemoError, match="makes another OpenCabinetDrawer"):
        file.make_env()


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


def test_every_success_has_a_trajectory(own_drawers: Path) -> None:
    path = own_drawers / "cabinet-0002.h5"
    with load_h5py().File(path, "r+") as file:
        table = file["attempts"][()]
        table["trajectory"][table["trajectory"] == PER_OBJECT - 1] = -1
        file["attempts"][...] = table
        del file[f"traj_{PER_OBJECT - 1}"]
    with DemoFile(path) as file, pytest.raises(DemoError, match="one that was solved has no trajectory"):
        _ = file.attempts

"""Opening and reading training sets, whole ones and such as something happened to."""

import json
import os
import pickle
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from artiskill.errors import DemoError
from artiskill.learning.batch import Sizes
from artiskill.learning.building import build_training_set
from artiskill.learning.set_sources import SetOptions
from artiskill.learning.training_set import (
    FRAMES,
    MANIFEST,
    STEPS,
    TrainingSet,
    is_training_set,
    manifest_text,
    read_set_manifest,
)

from .training_files import write_files


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sets")
    return build_training_set(write_files(folder / "files"), folder / "set", SetOptions(num_points=4)).folder


@pytest.fixture
def folder(whole: Path, tmp_path: Path) -> Path:
    """A copy for whoever changes it."""
    return Path(shutil.copytree(whole, tmp_path / "set"))


def test_reading_in_any_order(whole: Path) -> None:
    training_set = TrainingSet(whole, check=True)
    everything = np.fromfile(whole / FRAMES, dtype=training_set.layout.dtype)
    chosen = np.array([9, 0, 9, 4])
    np.testing.assert_array_equal(training_set.read(chosen)[:, 0], everything[chosen])
    with_next = training_set.read(chosen, following=1)
    np.testing.assert_array_equal(with_next, np.stack([everything[chosen], everything[chosen + 1]], axis=1))
    assert training_set.read(np.array([], dtype=np.int64)).shape == (0, 1)


def test_another_process_opens_it_itself(whole: Path) -> None:
    copy = pickle.loads(pickle.dumps(TrainingSet(whole)))
    assert (len(copy), copy.folder) == (11, whole)


def test_reading_needs_neither_engine_nor_hdf5_nor_torch(whole: Path) -> None:
    code = (
        "import sys\n"
        "for name in ('mujoco', 'numba', 'llvmlite', 'scipy', 'h5py', 'torch'): sys.modules[name] = None\n"
        "from artiskill.learning.training_set import TrainingSet\n"
        "training_set = TrainingSet(sys.argv[1], check=True)\n"
        "print(len(training_set.layout.decode(training_set.read(training_set.steps['frame'])[:, 0]).points))"
    )
    done = subprocess.run([sys.executable, "-c", code, str(whole)], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "11", done.stderr


def edit(key: str, value: object) -> Callable[[Path], None]:
    def do(folder: Path) -> None:
        values = json.loads((folder / MANIFEST).read_text())
        (folder / MANIFEST).write_text(json.dumps(values | {key: value}))

    return do


def edit_and_sign(**changes: object) -> Callable[[Path], None]:
    def do(folder: Path) -> None:
        manifest = read_set_manifest(folder)
        (folder / MANIFEST).write_text(manifest_text(replace(manifest, **changes)))  # type: ignore[arg-type]

    return do


def cut(name: str) -> Callable[[Path], None]:
    return lambda folder: os.truncate(folder / name, (folder / name).stat().st_size - 1)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (shutil.rmtree, "is no training set: it has no manifest"),
        (
            edit("format", "artiskill-training"),
            "is no training set: its manifest's format is 'artiskill-training'",
        ),
        (edit("version", 2), "of version 2; this version of artiskill reads 1: use the version"),
        (edit("steps", 12), "was edited or damaged"),
        (edit("point_mean", [0.0, 0.0, 0.0]), "was edited or damaged"),
        (edit("new", 1), "was edited or damaged"),
        (edit_and_sign(frames=14), "contradicts itself"),
        (edit_and_sign(sizes=Sizes(10**12, 2, 3, 2)), "contradicts itself"),
        (edit_and_sign(sizes=Sizes(4, 9, 3, 2)), "contradicts itself"),
        (edit_and_sign(files={}), "contradicts itself"),
        (edit_and_sign(steps=12), r"steps\.npy' does not hold what the manifest says"),
        (lambda folder: (folder / MANIFEST).write_text("{"), "is damaged: Expecting"),
        (lambda folder: (folder / MANIFEST).write_text("[]"), "is no training set: its manifest's format is None"),
        (cut(FRAMES), r"frames\.bin' has 779 bytes, the manifest says 780: it was truncated or changed"),
        (cut(STEPS), r"steps\.npy' has .*: it was truncated or changed"),
        (
            lambda folder: (folder / STEPS).unlink(),
            r"steps\.npy' is missing: the training set was not copied whole",
        ),
    ],
)
def test_what_cannot_be_opened(change: Callable[[Path], None], message: str, folder: Path) -> None:
    change(folder)
    with pytest.raises(DemoError, match=message):
        TrainingSet(folder)


def test_changed_bytes_are_found_where_checksums_are_compared(folder: Path) -> None:
    with (folder / FRAMES).open("r+b") as file:
        file.write(b"\xff")
    assert len(TrainingSet(folder)) == 11
    with pytest.raises(DemoError, match=r"frames\.bin' was changed or damaged"):
        TrainingSet(folder, check=True)


def test_a_file_of_other_rows_is_refused(folder: Path) -> None:
    size = (folder / STEPS).stat().st_size
    header = (size - 128) // 4
    with (folder / STEPS).open("wb") as file:
        np.save(file, np.zeros(header, dtype=np.int32))
        file.write(bytes(size - file.tell()))
    with pytest.raises(DemoError, match="does not hold what the manifest says"):
        TrainingSet(folder)


def test_a_file_that_is_cut_while_it_is_read(folder: Path) -> None:
    training_set = TrainingSet(folder)
    cut(FRAMES)(folder)
    assert len(training_set.read(np.arange(14))) == 14
    with pytest.raises(DemoError, match=r"frames\.bin' was truncated while it was read"):
        training_set.read(np.array([14]))


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ({"task": "PushChair"}, "is of task OpenCabinetDrawer, not 'PushChair'"),
        ({"control_mode": "operational_space"}, "is of control mode joint, not 'operational_space'"),
        ({"num_points": 256}, "is of number of points 4, not 256"),
        ({"frame": "world"}, "is of frame robot, not 'world'"),
    ],
)
def test_what_a_caller_requires(wanted: dict[str, object], message: str, whole: Path) -> None:
    training_set = TrainingSet(whole)
    training_set.require(task="OpenCabinetDrawer", control_mode="joint", num_points=4, frame="robot")
    with pytest.raises(DemoError, match=message):
        training_set.require(**wanted)  # type: ignore[arg-type]


def test_folders_are_told_apart(whole: Path, tmp_path: Path) -> None:
    assert is_training_set(whole)
    assert not is_training_set(whole.parent / "files")
    assert not is_training_set(tmp_path)
    with pytest.raises(DemoError, match="is not a path"):
        TrainingSet("a\0b")

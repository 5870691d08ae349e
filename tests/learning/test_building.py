"""Training sets made from training files, and from demonstrations."""

import errno
import os
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artiskill.demos.demos import load_demo_pack
from artiskill.demos.replay import replay
from artiskill.demos.training_file import Sampling, TrainingFile
from artiskill.envs.wrappers import PointCloudDownsample
from artiskill.errors import ArtiSkillError, ConfigError, DemoError
from artiskill.files import lock_folder
from artiskill.learning import building
from artiskill.learning.building import Moments, build_training_set, choose_trajectories
from artiskill.learning.set_sources import SetOptions
from artiskill.learning.training_set import TrainingSet

from .training_files import FILES, Episode, change_file, settings, write_files

Replayed = tuple[TrainingSet, list[tuple[str, int, int]]]
FOUR = SetOptions(num_points=4)
DRAWERS = load_demo_pack("OpenCabinetDrawer")


@pytest.fixture
def files(tmp_path: Path) -> Path:
    return write_files(tmp_path / "files")


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def solved(files: Path) -> list[dict[str, np.ndarray]]:
    """Arrays of all solved trajectories, in the order of the set."""
    found = []
    for name, episodes in FILES.items():
        with TrainingFile(files / f"{name}.h5") as file:
            paths = [f"obs/pointcloud/{part}" for part in ("xyz", "rgb", "seg")] + ["obs/agent", "actions"]
            kept = [number for number, episode in enumerate(episodes) if episode.success]
            found += [{path: file.array(number, path) for path in paths} for number in kept]
    return found


def test_a_set_holds_what_the_files_hold(files: Path, tmp_path: Path) -> None:
    made = build_training_set(files, tmp_path / "set", FOUR)
    assert (made.manifest.trajectories, len(made), made.manifest.frames) == (4, 3 + 2 + 5 + 1, 11 + 4)
    records = made.read(np.arange(15))[:, 0]
    wanted = {path: np.concatenate([one[path] for one in solved(files)]) for path in solved(files)[0]}
    np.testing.assert_array_equal(records["points"], wanted["obs/pointcloud/xyz"].astype(np.float16))
    np.testing.assert_array_equal(records["colors"], wanted["obs/pointcloud/rgb"])
    np.testing.assert_array_equal(records["agent"], wanted["obs/agent"])
    seg = wanted["obs/pointcloud/seg"]
    np.testing.assert_array_equal(records["codes"][:, :3], 128 + seg[:, :3, 0] + 2 * seg[:, :3, 1])
    assert (records["codes"][:, 3] < 128).all()
    np.testing.assert_array_equal(made.steps["action"], wanted["actions"])


def test_steps_know_what_is_seen_and_what_came_of_them(files: Path, tmp_path: Path) -> None:
    made = build_training_set(files, tmp_path / "set", FOUR)
    steps = made.steps
    assert steps["frame"].tolist() == [0, 1, 2, 4, 5, 7, 8, 9, 10, 11, 13]
    assert steps["trajectory"].tolist() == [0] * 3 + [1] * 2 + [2] * 5 + [3]
    assert steps["reward"].tolist() == [-3, -2, -1, -2, -1, -5, -4, -3, -2, -1, -1]
    assert np.flatnonzero(steps["terminated"]).tolist() == [2, 4, 9, 10]
    assert np.flatnonzero(steps["disturbed"]).tolist() == [3, 6, 7]
    assert made.trajectories["first_step"].tolist() == [0, 3, 5, 10]
    assert made.trajectories["steps"].tolist() == [3, 2, 5, 1]
    assert made.trajectories["level"].tolist() == [5, 6, 0, 0]
    assert made.groups == (("cabinet-0002", "link_0"), ("cabinet-0020", "link_0"), ("cabinet-0020", "link_1"))
    assert made.group_of_trajectory.tolist() == [0, 0, 2, 1]


def test_an_episode_that_ran_out_of_time_is_not_terminated(tmp_path: Path) -> None:
    files = write_files(tmp_path / "files", {"cabinet-0002": [Episode("link_0")]})
    change_file(files, "cabinet-0002", lambda file: file["traj_0/success"].__setitem__(slice(None), False))
    assert not build_training_set(files, tmp_path / "set", FOUR).steps["terminated"].any()


def test_statistics_are_those_of_all_real_points(files: Path, tmp_path: Path) -> None:
    made = build_training_set(files, tmp_path / "set", FOUR)
    records = made.read(np.arange(15))[:, 0]
    points = records["points"][:, :3].reshape(-1, 3).astype(np.float64)
    agent = records["agent"].astype(np.float64)
    steps = made.steps[~made.steps["disturbed"]]
    units = np.maximum(steps["action"].std(0), 0.02)
    wanted = (points.mean(0), points.std(0), agent.mean(0), agent.std(0), units)
    for found, expected in zip(made.statistics, wanted, strict=True):
        assert found.dtype == np.float32
        np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_moments_do_not_depend_on_the_parts() -> None:
    rows = np.random.default_rng(0).normal(1e4, 1e-2, (1000, 2))  # far from 0: sums of squares would cancel
    rows[:, 1] = 7.1
    moments = Moments()
    for part in np.split(rows, [1, 1, 40, 900]):
        moments.add(part)
    np.testing.assert_allclose(moments.mean, rows.mean(0), rtol=1e-7)
    assert moments.std[0] == pytest.approx(rows[:, 0].std(), rel=1e-4)
    assert moments.std[1] == 1  # it never changes


def test_the_source_determines_every_byte(files: Path, tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    build_training_set(files, first, FOUR)
    build_training_set(files, second, FOUR)
    assert contents(first) == contents(second)


def test_a_set_that_is_there_is_opened(files: Path, tmp_path: Path) -> None:
    build_training_set(files, tmp_path / "set", FOUR)
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "set").iterdir()}
    assert len(build_training_set(files, tmp_path / "set", FOUR)) == 11
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "set").iterdir()} == before


def test_a_set_of_something_else_is_kept(files: Path, tmp_path: Path) -> None:
    build_training_set(files, tmp_path / "set", FOUR)
    with pytest.raises(
        DemoError, match=r"made from something else \(options.num_points 4 there, 3 here\); choose"
    ):
        build_training_set(files, tmp_path / "set", SetOptions(num_points=3))
    other = write_files(tmp_path / "other", seed=1)
    with pytest.raises(DemoError, match=r"made from something else \(sources\.cabinet-0002\.h5"):
        build_training_set(other, tmp_path / "set", FOUR)
    with pytest.raises(DemoError, match="is no training set: its manifest's format is 'artiskill-training'"):
        build_training_set(files, other, FOUR)


def test_an_interrupted_build_leaves_no_set_and_starts_again(files: Path, tmp_path: Path) -> None:
    whole = contents(build_training_set(files, tmp_path / "whole", FOUR).folder)

    def stop(phase: str, done: int, total: int) -> None:
        assert (phase, total) == ("writing", 5)
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build_training_set(files, tmp_path / "set", FOUR, on_progress=stop)
    assert not (tmp_path / "set").exists()
    assert contents(build_training_set(files, tmp_path / "set", FOUR).folder) == whole


def test_one_build_at_a_time(files: Path, tmp_path: Path) -> None:
    with lock_folder(tmp_path / "set"), pytest.raises(ConfigError, match="another build of a training set"):
        build_training_set(files, tmp_path / "set", FOUR)


def test_a_full_disk_is_one_line(files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("artiskill.learning.building.os.fsync", full)
    with pytest.raises(DemoError, match=r"cannot write to .*: No space left on device"):
        build_training_set(files, tmp_path / "set", FOUR)
    assert not (tmp_path / "set").exists()  # what was written takes no place


def test_a_disk_that_takes_no_more_is_no_fault_of_the_source(
    files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    add = building._Builder._add

    def onto_a_full_quota(self: Any, file: Any, number: int, out: Any) -> None:
        class Full:
            def write(self, content: bytes) -> None:
                raise OSError(errno.EDQUOT, os.strerror(errno.EDQUOT))

        add(self, file, number, Full())

    monkeypatch.setattr(building._Builder, "_add", onto_a_full_quota)
    with pytest.raises(DemoError, match=r"^cannot write to .*: Disk quota exceeded$"):
        build_training_set(files, tmp_path / "set", FOUR)


def test_what_a_kill_left_is_in_nobodys_way(files: Path, tmp_path: Path) -> None:
    whole = contents(build_training_set(files, tmp_path / "whole", FOUR).folder)
    left = tmp_path / "set"
    (left / ".unfinished").mkdir(parents=True)
    for path in (left / "frames.bin", left / ".unfinished" / "frames.bin", left / ".artiskill.lock"):
        path.write_bytes(b"left")
    assert contents(build_training_set(files, left, FOUR).folder) == whole


def test_a_changed_source_is_noticed(files: Path, tmp_path: Path) -> None:
    path = files / "cabinet-0020.h5"
    path.write_bytes(path.read_bytes()[:-1] + b"x")
    with pytest.raises(DemoError, match=r"cabinet-0020\.h5' is not the file that the manifest lists"):
        build_training_set(files, tmp_path / "set", FOUR)


def put(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Any], None]:
    """What changes one array of the first trajectory."""

    def do(file: Any) -> None:
        values = change(file[f"traj_0/{name}"][()])
        del file[f"traj_0/{name}"]
        file[f"traj_0/{name}"] = values

    return do


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put("actions", lambda v: v * np.nan), "actions have numbers that are not finite"),
        (put("rewards", lambda v: v * np.inf), "rewards have numbers that are not finite"),
        (put("obs/pointcloud/xyz", lambda v: v * np.nan), "numbers that are not finite, or coordinates beyond"),
        (put("obs/pointcloud/xyz", lambda v: v * np.float32(1e6)), "coordinates beyond 65504.0 m"),
        (put("obs/agent", lambda v: v * np.nan), "not finite"),
        (put("obs/agent", lambda v: v[:-1]), r"obs/agent are float32 \(5, 3\), not float32 \(6, 3\)"),
        (put("obs/pointcloud/rgb", lambda v: v.astype(np.float32)), "obs/pointcloud/rgb are float32"),
        (put("actions", lambda v: v[:, :1]), "its sizes are .*, those of the trajectories before"),
        (put("actions", lambda v: v[:0]), "it has no steps"),
        (lambda file: file["traj_0/obs"].pop("agent"), "cannot read trajectory 0"),
        (lambda file: file["traj_0"].attrs.pop("target"), "cannot read its trajectories"),
    ],
)
def test_damaged_files_are_refused(change: Callable[[Any], None], message: str, tmp_path: Path) -> None:
    files = write_files(tmp_path / "files")
    change_file(files, "cabinet-0020", change)
    with pytest.raises(ArtiSkillError, match=message) as error:
        build_training_set(files, tmp_path / "set", FOUR)
    assert "cabinet-0020.h5" in str(error.value)
    assert not (tmp_path / "set" / "manifest.json").exists()


def test_only_failures_make_no_set(tmp_path: Path) -> None:
    files = write_files(tmp_path / "files", {"cabinet-0002": [Episode("link_0", success=False)]})
    with pytest.raises(DemoError, match="has no solved trajectory"):
        build_training_set(files, tmp_path / "set", FOUR)


def test_full_clouds_have_their_points_chosen(tmp_path: Path) -> None:
    files = write_files(tmp_path / "files", made=settings(sampling=None))
    made = build_training_set(files, tmp_path / "set", SetOptions(num_points=6))
    sampling = {"num_points": 6, "method": "maniskill", "frame": "world", "settings": {}}
    assert made.manifest.sampling == sampling | {"settings": {"masked_points": 4, "points_per_mask": 0}}
    seen = made.layout.decode(made.read(np.arange(15))[:, 0])
    assert (seen.masks.any(axis=-1).sum(axis=-1) <= 4).all()
    assert seen.valid[:, 0].all()


def test_only_some_objects(files: Path, tmp_path: Path) -> None:
    options = SetOptions(num_points=4, objects=("cabinet-0020",))
    made = build_training_set(files, tmp_path / "set", options)
    assert made.groups == (("cabinet-0020", "link_0"), ("cabinet-0020", "link_1"))
    assert list(made.manifest.sources) == ["cabinet-0020.h5"]
    with pytest.raises(ConfigError, match="another"), lock_folder(tmp_path / "set"):
        build_training_set(files, tmp_path / "set", options)


def test_a_count_takes_targets_in_turn(tmp_path: Path) -> None:
    targets = ["link_0", "link_0", "link_0", "link_1", "link_1"]
    episodes = [Episode(target, success=number != 0) for number, target in enumerate(targets)]
    files = write_files(tmp_path / "files", {"cabinet-0020": episodes})
    with TrainingFile(files / "cabinet-0020.h5") as file:
        chosen = {count: choose_trajectories(file, count) for count in (1, 2, 3, 9, None)}
    assert chosen == {1: [1], 2: [1, 3], 3: [1, 2, 3], 9: [1, 2, 3, 4], None: [1, 2, 3, 4]}


READ_ALL = """
import sys
import numpy as np
from artiskill.learning.training_set import TrainingSet

def most_kb():
    lines = open("/proc/self/status").read().splitlines()
    return int(next(line for line in lines if line.startswith("VmHWM")).split()[1])

training_set = TrainingSet(sys.argv[1])
frames = np.random.default_rng(0).permutation(training_set.manifest.frames)
training_set.read(frames[:64])
before = most_kb()
for start in range(0, len(frames), 64):
    training_set.layout.decode(training_set.read(frames[start : start + 64])[:, 0])
print(most_kb() - before)
"""


def test_memory_does_not_grow_with_the_set(tmp_path: Path) -> None:
    episodes = [Episode("link_0", steps=99, level=level) for level in range(40)]
    made = settings(sampling=Sampling(1000, "uniform"))
    files = write_files(tmp_path / "files", {"cabinet-0002": episodes}, made)
    tracemalloc.start()
    try:
        folder = build_training_set(files, tmp_path / "set", SetOptions(num_points=1000)).folder
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert (folder / "frames.bin").stat().st_size > 40_000_000
    assert peak < 20_000_000  # a trajectory takes 2 MB in the file
    command = [sys.executable, "-c", READ_ALL, str(folder)]
    grown = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout
    assert int(grown) < 10_000  # kB; 64 frames take 3 MB


@pytest.fixture(scope="module")
def replayed(tmp_path_factory: pytest.TempPathFactory) -> Replayed:
    """A set of one demonstration, and what was told of its progress."""
    phases: list[tuple[str, int, int]] = []
    options = SetOptions(num_points=64, objects=("cabinet-0002",), count=1, frame="robot")
    folder = tmp_path_factory.mktemp("sets") / "set"
    made = build_training_set(DRAWERS.folder, folder, options, on_progress=lambda *told: phases.append(told))
    return made, phases


def test_from_demonstrations(replayed: Replayed, tmp_path: Path) -> None:
    """The replay is part of it, and what it makes does not stay."""
    made, phases = replayed
    assert phases == [("replaying", 1, 1), ("writing", 1, 1)]
    assert sorted(contents(made.folder)) == ["frames.bin", "manifest.json", "steps.npy", "trajectories.npy"]
    assert made.manifest.sampling["frame"] == "robot"
    wanted = settings(sampling=Sampling(64, frame="robot"), count=1, keep_failures=False, compression=1)
    replay(DRAWERS.folder, tmp_path / "files", wanted, objects=["cabinet-0002"])
    other = build_training_set(tmp_path / "files", tmp_path / "other", SetOptions(num_points=64))
    for name in ("frames.bin", "steps.npy", "trajectories.npy"):
        assert made.manifest.files[name] == other.manifest.files[name]
    assert made.manifest.overrides == DRAWERS.manifest.settings.overrides


def test_who_acts_sees_what_was_learned_from(replayed: Replayed) -> None:
    made, _ = replayed
    with DRAWERS.open("cabinet-0002") as file:
        obj = file.load_object()
        env = file.header.settings.make_env([obj], obs_mode="pointcloud")
    sampling = made.manifest.sampling
    sampled = PointCloudDownsample(
        env, sampling["method"], sampling["num_points"], sampling["frame"], **sampling["settings"]
    )
    first = made.trajectories[0]
    target = made.manifest.targets[first["target"]]
    observation, _ = sampled.reset(options={"level": int(first["level"]), "object": obj, "target": target})
    for row in made.steps[:3]:
        learned = made.layout.decode(made.read(np.array([row["frame"]]))[:, 0])
        for seen, wanted in zip(made.layout.observe(observation), learned, strict=True):
            np.testing.assert_array_equal(seen, wanted)
        observation = sampled.step(row["action"])[0]


def test_the_wrong_task_is_refused(files: Path, tmp_path: Path) -> None:
    with pytest.raises(DemoError, match="is of task OpenCabinetDrawer, not 'PushChair'"):
        build_training_set(files, tmp_path / "set", FOUR, task="PushChair")

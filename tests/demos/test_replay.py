import dataclasses
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import artiskill.demos.replay as module
from artiskill.assets.catalog import load_object
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demos import UNFINISHED, Demos, read_manifest, write_manifest
from artiskill.demos.hdf5 import load_h5py
from artiskill.demos.replay import replay
from artiskill.demos.settings import load_demos_config
from artiskill.demos.training_file import (
    ReplaySettings,
    TrainingFile,
    TrainingFiles,
    TrainingManifest,
    make_sampling,
)
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.wrappers import PointCloudDownsample
from artiskill.errors import ConfigError, DemoError, UnknownNameError
from artiskill.files import lock_folder
from artiskill.versions import versions

SMALL = {"cameras.width": 40, "cameras.height": 16}
POINTS = 48


def settings_for(folder: Path, **changes: Any) -> ReplaySettings:
    values = {
        "source": read_manifest(folder).settings,
        "obs_mode": "pointcloud",
        "control_mode": "joint",
        "way": "simulate",
        "sampling": make_sampling(POINTS, frame="robot"),
        "seen": SMALL,
        "count": None,
        "keep_failures": False,
        "compression": 1,
        "versions": versions(),
    }
    return ReplaySettings(**(values | changes))


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def clouds(drawers: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Training files of the small collection; to be read only."""
    folder = tmp_path_factory.mktemp("training") / "clouds"
    replay(drawers, folder, settings_for(drawers))
    return folder


def test_what_is_in_a_file(drawers: Path, clouds: Path) -> None:
    """Observations, actions and rewards are what an environment of one's own gives."""
    demos, training = Demos(drawers), TrainingFiles(clouds)
    assert len(training) == 6
    with demos.open("cabinet-0026") as source, TrainingFile(clouds / "cabinet-0026.h5") as file:
        assert file.object == "cabinet-0026"
        assert file.settings == training.settings
        for number in range(3):
            trajectory, group = source.trajectory(number), file.groups[number]
            about = {"target": trajectory.target, "level": trajectory.level, "success": True, "exact": True}
            assert dict(group.attrs) == about | {"source": number}
            base = ManipulationEnv("OpenCabinetDrawer", "cabinet-0026", obs_mode="pointcloud", config=SMALL)
            env = PointCloudDownsample(base, "maniskill", POINTS, "robot", masked_points=32, points_per_mask=2)
            observation, _ = env.reset(options={"level": trajectory.level, "target": trajectory.target})
            seen = [observation]
            for step, action in enumerate(file.array(number, "actions")):
                observation, reward, terminated, _, info = env.step(action)
                seen.append(observation)
                assert reward == group["rewards"][step]
                assert terminated == info["success"] == group["dones"][step] == group["success"][step]
            assert terminated
            np.testing.assert_array_equal(file.array(number, "actions"), trajectory.actions)
            np.testing.assert_array_equal(file.array(number, "disturbed"), trajectory.disturbed)
            assert 0 < trajectory.disturbed.sum() < len(trajectory) / 3
            for name in ("xyz", "rgb", "seg"):
                found = file.array(number, f"obs/pointcloud/{name}")
                wanted = np.stack([one["pointcloud"][name] for one in seen])
                assert found.dtype == wanted.dtype
                np.testing.assert_array_equal(found, wanted)
            np.testing.assert_array_equal(file.array(number, "obs/agent"), [one["agent"] for one in seen])
            assert group["obs/state"] == group["obs/agent"]
            assert list(training.spaces[0]) == ["agent", "pointcloud"]


def test_the_manifest_counts(clouds: Path) -> None:
    for entry in TrainingFiles(clouds).manifest.files.values():
        counts = entry.counts
        assert (counts.replayed, counts.solved, counts.exact, counts.clipped) == (3, 3, 3, 0)
        assert entry.frames == counts.steps + 3
        assert entry.bytes == (clouds / f"{entry.object}.h5").stat().st_size


def test_any_number_of_workers(drawers: Path, clouds: Path, tmp_path: Path) -> None:
    replay(drawers, tmp_path / "two", settings_for(drawers), workers=2)
    assert contents(tmp_path / "two") == contents(clouds)


def test_it_goes_on_where_it_was_killed(drawers: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_JOB_TRAJECTORIES", 2)
    folder, settings = tmp_path / "killed", settings_for(drawers)
    replay(drawers, tmp_path / "at once", settings)
    told = 0

    def die(news: object) -> None:
        nonlocal told
        told += 1
        if told % 4 == 0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        replay(drawers, folder, settings, on_replayed=die)
    # one object is finished; of the other, the fourth trajectory was not yet in its block's file
    missing: list[int] = []
    replay(drawers, folder, settings, on_start=lambda work: missing.append(work.missing))
    assert missing == [3]
    assert contents(folder) == contents(tmp_path / "at once")
    replay(drawers, folder, settings, on_replayed=die)
    assert told == 4


def test_restored_states_are_near_the_simulated_ones(drawers: Path, clouds: Path, tmp_path: Path) -> None:
    settings = settings_for(drawers, way="restore")
    (entry,) = replay(drawers, tmp_path / "r", settings, objects=["cabinet-0026"]).files.values()
    assert (entry.counts.replayed, entry.counts.solved, entry.counts.exact) == (3, 3, 0)  # most states are rounded
    with TrainingFile(clouds / "cabinet-0026.h5") as one, TrainingFile(tmp_path / "r/cabinet-0026.h5") as other:
        for number in range(3):
            for name in ("actions", "disturbed", "rewards", "dones", "success"):
                np.testing.assert_array_equal(one.array(number, name), other.array(number, name))
            ours, theirs = one.array(number, "obs/agent"), other.array(number, "obs/agent")
            np.testing.assert_allclose(ours, theirs, atol=4e-3)
            clouds_of = [file.array(number, "obs/pointcloud/xyz") for file in (one, other)]
            np.testing.assert_array_equal(clouds_of[0][::30], clouds_of[1][::30])  # the states there are exact
            near = np.abs(clouds_of[0] - clouds_of[1]).max(axis=2) < 2e-3
            assert near.mean() > 0.9  # at edges, another surface may be seen


def test_restored_ones_are_exact_where_all_states_are(plan: Any, tmp_path: Path) -> None:
    from artiskill.demos.collect import collect

    every = load_demos_config({"store.key_frame_steps": 1})
    collect(plan(objects=["cabinet-0002"], per_object=1, demos_config=every), tmp_path / "demos")
    state = {"obs_mode": "state", "sampling": None, "seen": {}}
    for way in ("simulate", "restore"):
        settings = settings_for(tmp_path / "demos", **state, way=way)
        (entry,) = replay(tmp_path / "demos", tmp_path / way, settings).files.values()
        assert entry.counts.exact == 1
    found = [TrainingFile(tmp_path / way / "cabinet-0002.h5") for way in ("simulate", "restore")]
    np.testing.assert_array_equal(*(file.array(0, "obs/state") for file in found))
    for file in found:
        file.close()


def test_another_control_mode(drawers: Path, tmp_path: Path) -> None:
    """The actions that are stored solve the levels in an environment of that mode."""
    settings = settings_for(
        drawers, obs_mode="state", control_mode="operational_space", sampling=None, seen={}, count=1
    )
    manifest = replay(drawers, tmp_path / "os", settings)
    for entry in manifest.files.values():
        counts = entry.counts
        assert (counts.replayed, counts.solved, counts.exact) == (1, 1, 0)
        env = ManipulationEnv("OpenCabinetDrawer", entry.object, control_mode="operational_space")
        with TrainingFile(tmp_path / "os" / f"{entry.object}.h5") as file:
            (group,) = file.groups
            env.reset(options={"level": int(group.attrs["level"]), "target": group.attrs["target"]})
            for action in file.array(0, "actions"):
                observation, _, terminated, _, _ = env.step(action)
            assert terminated
            np.testing.assert_array_equal(observation, group["obs/state"][-1])
    settings = settings_for(
        drawers, obs_mode="state", control_mode="operational_space", sampling=None, seen={}, way="restore"
    )
    manifest = replay(drawers, tmp_path / "restored", settings, objects=["cabinet-0002"])
    (entry,) = manifest.files.values()
    assert entry.counts.solved == 3


def test_what_is_no_longer_solved_is_left_out(
    drawers: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("artiskill.demos.replay_episode._MORE_STEPS", 0)
    monkeypatch.setattr("artiskill.demos.demo_file.Trajectory.__len__", lambda self: 20)
    monkeypatch.setattr(
        "artiskill.demos.demo_file.Trajectory.actions", property(lambda self: self.recording.actions[:20])
    )
    state = {"obs_mode": "state", "sampling": None, "seen": {}, "count": 1}
    manifest = replay(drawers, tmp_path / "a", settings_for(drawers, **state), objects=["cabinet-0002"])
    (entry,) = manifest.files.values()
    assert (entry.trajectories, entry.frames, entry.counts.solved) == (0, 0, 0)
    settings = settings_for(drawers, **state, keep_failures=True)
    (entry,) = replay(drawers, tmp_path / "b", settings, objects=["cabinet-0002"]).files.values()
    assert (entry.trajectories, entry.frames, entry.counts.solved) == (1, 21, 0)


def test_images(drawers: Path, tmp_path: Path) -> None:
    settings = settings_for(drawers, obs_mode="rgbd", sampling=None, count=1)
    replay(drawers, tmp_path / "rgbd", settings, objects=[load_object("cabinet-0002")])
    with TrainingFile(tmp_path / "rgbd/cabinet-0002.h5") as file:
        frames = len(file.array(0, "actions")) + 1
        assert file.array(0, "obs/rgbd/rgb").shape == (frames, 16, 40, 9)
        assert file.array(0, "obs/rgbd/depth").dtype == np.float32
        assert file.array(0, "obs/rgbd/seg").any()


def test_a_count_is_shared_by_the_targets(drawers: Path) -> None:
    from artiskill.demos.replay import choose

    with DemoFile(drawers / "cabinet-0026.h5") as file:
        assert [str(file.trajectory(k).target) for k in range(3)] == ["link_0", "link_0", "link_1"]
        assert [choose(file, count) for count in (1, 2, 3, None, 9)] == [
            (0,),
            (0, 2),
            (0, 1, 2),
            (0, 1, 2),
            (0, 1, 2),
        ]


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"obs_mode": "clouds"}, UnknownNameError, "unknown observation mode 'clouds'"),
        ({"control_mode": "joints"}, UnknownNameError, "unknown control mode 'joints'; did you mean 'joint'"),
        ({"way": "remember"}, UnknownNameError, "unknown way of replaying"),
        ({"obs_mode": "state"}, ConfigError, "points are of obs_mode pointcloud, not of state"),
        ({"count": 0}, ConfigError, "the count must be at least 1"),
        ({"compression": 12}, ConfigError, "compression"),
        ({"seen": {"reward.weights.open": 2}}, ConfigError, "can change what is seen"),
        ({"seen": {"cameras.widht": 2}}, ConfigError, "did you mean"),
    ],
)
def test_settings_are_checked(
    drawers: Path, tmp_path: Path, changes: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        replay(drawers, tmp_path / "x", settings_for(drawers, **changes))
    assert not (tmp_path / "x").exists()


def test_samplings_are_checked() -> None:
    with pytest.raises(ConfigError, match="num_points"):
        make_sampling(0)
    with pytest.raises(UnknownNameError, match="did you mean 'voxel'"):
        make_sampling(100, "voxels")
    with pytest.raises(UnknownNameError, match="frame"):
        make_sampling(100, frame="moon")
    with pytest.raises(ConfigError, match="full cloud is in the world's frame"):
        make_sampling(None, frame="robot")
    with pytest.raises(ConfigError, match="full cloud has every point; method 'voxel' is for fewer points"):
        make_sampling(None, "voxel")
    assert make_sampling(None) is None


def truncate(folder: Path) -> None:
    path = folder / "cabinet-0002.h5"
    path.write_bytes(path.read_bytes()[:9000])


def other_catalogue(folder: Path) -> None:
    with load_h5py().File(folder / "cabinet-0002.h5", "r+") as file:
        file.attrs["content_hash"] = "0" * 16
    relist(folder)


def foreign(folder: Path) -> None:
    with load_h5py().File(folder / "cabinet-0002.h5", "w") as file:
        file["x"] = 1
    relist(folder)


def other_schema(folder: Path) -> None:
    with load_h5py().File(folder / "cabinet-0002.h5", "r+") as file:
        file.attrs["schema_version"] = 7
    relist(folder)


def relist(folder: Path) -> None:
    """The manifest's checksum as somebody would change it who wants the file to look true."""
    import json

    from artiskill.demos.demos import sha256_of

    content = json.loads((folder / "manifest.json").read_text())
    content["files"]["cabinet-0002.h5"]["sha256"] = sha256_of(folder / "cabinet-0002.h5")
    (folder / "manifest.json").write_text(json.dumps(content))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (truncate, "is not the file that the manifest lists"),
        (other_catalogue, "was made with another 'cabinet-0002'"),
        (foreign, "holds no demonstrations of artiskill"),
        (other_schema, "has schema version 7; this version of artiskill reads 2"),
    ],
)
def test_bad_demonstrations(
    own_drawers: Path, tmp_path: Path, change: Callable[[Path], None], message: str
) -> None:
    change(own_drawers)
    with pytest.raises(DemoError, match=message):
        replay(own_drawers, tmp_path / "x", settings_for(own_drawers))


def test_bad_folders(drawers: Path, clouds: Path, tmp_path: Path) -> None:
    settings = settings_for(drawers)
    with pytest.raises(DemoError, match="holds no demonstrations"):
        replay(tmp_path, tmp_path / "x", settings)
    with pytest.raises(DemoError, match="holds no demonstrations of artiskill"):
        replay(clouds, tmp_path / "x", settings)
    with pytest.raises(ConfigError, match="holds the demonstrations; choose another folder"):
        replay(drawers, drawers, settings)
    with pytest.raises(UnknownNameError, match="unknown object 'cabinet-0020'"):
        replay(drawers, tmp_path / "x", settings, objects=["cabinet-0020"])
    with pytest.raises(ConfigError, match="workers"):
        replay(drawers, tmp_path / "x", settings, workers=0)
    with pytest.raises(DemoError, match="holds no training files"):
        TrainingFiles(drawers.parent)
    with pytest.raises(DemoError, match="holds no training files of artiskill"):
        TrainingFiles(drawers)
    with lock_folder(tmp_path / "x", "replay"), pytest.raises(ConfigError, match="another collector or replay"):
        replay(drawers, tmp_path / "x", settings)


def test_what_was_begun_otherwise(drawers: Path, clouds: Path, tmp_path: Path, plan: Any) -> None:
    from artiskill.demos.collect import collect

    own = Path(shutil.copytree(clouds, tmp_path / "own"))
    with pytest.raises(DemoError, match=r"holds training files of other settings .*frame"):
        replay(drawers, own, settings_for(drawers, sampling=make_sampling(POINTS)))
    other = tmp_path / "other"
    collect(plan(objects=["cabinet-0002"], per_object=3, first_level=50), other)
    with pytest.raises(DemoError, match=r"other settings .*first_level"):
        replay(other, own, settings_for(other))
    everything = settings_for(
        drawers, obs_mode="state", sampling=None, control_mode="operational_space", count=1, compression=2, seen={}
    )
    with pytest.raises(
        DemoError, match=r"other settings \(obs_mode [^;]*; control_mode [^;]*; [^;]*; and \d+ more\)"
    ):
        replay(drawers, own, everything)
    source = dataclasses.replace(everything.source, task="PushChair")
    text = everything.differences(dataclasses.replace(everything, source=source))
    assert text == "task OpenCabinetDrawer there, PushChair here"
    (own / "cabinet-0002.h5").write_bytes(b"x")
    with pytest.raises(DemoError, match="was changed or damaged: remove it and replay again"):
        replay(drawers, own, settings_for(drawers))
    (own / "cabinet-0002.h5").unlink()
    replay(drawers, own, settings_for(drawers))
    assert contents(own) == contents(clouds)


STATE = {"obs_mode": "state", "sampling": None, "seen": {}, "way": "restore"}


def begun(drawers: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A replay that was killed after its first block of one trajectory; the block's file."""
    monkeypatch.setattr(module, "_JOB_TRAJECTORIES", 1)
    told: list[object] = []

    def die(news: object) -> None:
        told.append(news)
        if len(told) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        replay(drawers, folder, settings_for(drawers, **STATE), on_replayed=die)
    (part,) = (folder / UNFINISHED).rglob("*.h5")
    return part


def missing_of(drawers: Path, folder: Path, **changes: Any) -> int:
    """Go on; how many trajectories that took."""
    missing: list[int] = []
    settings = settings_for(drawers, **(STATE | changes))
    replay(drawers, folder, settings, on_start=lambda work: missing.append(work.missing))
    return missing[0]


def test_damaged_parts_are_replayed_again(drawers: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    part = begun(drawers, tmp_path / "a", monkeypatch)
    assert missing_of(drawers, tmp_path / "a") == 5
    part = begun(drawers, tmp_path / "b", monkeypatch)
    data = bytearray(part.read_bytes())
    data[len(data) // 2] ^= 1
    part.write_bytes(data)
    assert missing_of(drawers, tmp_path / "b") == 6
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_parts_are_checked_before_they_are_merged(
    drawers: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    part = begun(drawers, tmp_path / "b", monkeypatch)

    def spoil(work: Any) -> None:
        part.write_bytes(part.read_bytes()[:-1] + b"x")

    with pytest.raises(DemoError, match=r"0.h5' was changed or damaged since it was written; the same command"):
        replay(drawers, tmp_path / "b", settings_for(drawers, **STATE), on_start=spoil)
    assert missing_of(drawers, tmp_path / "b") == 4  # of the first object, only the spoilt one
    assert missing_of(drawers, tmp_path / "c") == 6
    assert contents(tmp_path / "b") == contents(tmp_path / "c")


def test_a_lost_manifest_is_no_licence(drawers: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    part = begun(drawers, tmp_path / "a", monkeypatch)
    (tmp_path / "a" / "manifest.json").unlink()
    with pytest.raises(DemoError, match=r"has training files \(.unfinished\), but its manifest.json is missing"):
        missing_of(drawers, tmp_path / "a", compression=0)
    assert part.exists()
    # somebody has put a manifest of other settings there: parts of the first ones are not taken over
    write_manifest(TrainingManifest(settings_for(drawers, **STATE, compression=0)), tmp_path / "a")
    assert missing_of(drawers, tmp_path / "a", compression=0) == 6
    (tmp_path / "a" / "manifest.json").unlink()
    before = contents(tmp_path / "a")
    with pytest.raises(DemoError, match=r"has training files \(cabinet-0002.h5, cabinet-0026.h5\), but"):
        missing_of(drawers, tmp_path / "a")
    assert contents(tmp_path / "a") == before


def test_what_a_killed_end_left_is_removed(clouds: Path, drawers: Path, tmp_path: Path) -> None:
    own = Path(shutil.copytree(clouds, tmp_path / "own"))
    (own / UNFINISHED / "cabinet-0002").mkdir(parents=True)
    (own / UNFINISHED / "cabinet-0002" / "0.h5").write_bytes(b"merged")
    replay(drawers, own, settings_for(drawers))
    assert contents(own) == contents(clouds)
    assert not (own / UNFINISHED).exists()


def test_the_manifest_has_the_settings_of_its_files(own_drawers: Path, tmp_path: Path) -> None:
    manifest = own_drawers / "manifest.json"
    text = manifest.read_text()
    manifest.write_text(text.replace('"control_mode": "joint"', '"control_mode": "operational_space"'))
    settings = settings_for(own_drawers, **STATE, control_mode="operational_space")
    with pytest.raises(DemoError, match='other settings than its manifest says: control_mode "joint" there'):
        replay(own_drawers, tmp_path / "x", settings)


def test_training_files_can_be_checked(clouds: Path, tmp_path: Path) -> None:
    own = Path(shutil.copytree(clouds, tmp_path / "own"))
    assert len(TrainingFiles(own, check=True)) == 6
    path = own / "cabinet-0026.h5"
    path.write_bytes(path.read_bytes()[:-1] + b"x")
    files = TrainingFiles(own)
    assert [file.object for file in files.files()] == ["cabinet-0002", "cabinet-0026"]
    for read in (lambda: TrainingFiles(own, check=True), lambda: list(files.files(check=True))):
        with pytest.raises(
            DemoError,
            match=r"cabinet-0026.h5' is not the file .*; it was changed or damaged: remove it and replay",
        ):
            read()


def test_each_kind_of_folder_names_its_reader(drawers: Path, clouds: Path) -> None:
    name = "cabinet-0002.h5"
    for read, path, reader in (
        (Demos, clouds, "TrainingFiles"),
        (TrainingFiles, drawers, "Demos"),
        (DemoFile, clouds / name, "TrainingFile"),
        (TrainingFile, drawers / name, "DemoFile"),
    ):
        with pytest.raises(DemoError, match=rf"of artiskill: {reader} reads what it holds$"):
            read(path)


def test_a_full_disk(drawers: Path, clouds: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_room(path: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", no_room)
    with pytest.raises(DemoError, match=r"cannot write .*No space left on device"):
        replay(drawers, tmp_path / "x", settings_for(drawers))
    monkeypatch.undo()
    replay(drawers, tmp_path / "x", settings_for(drawers))
    assert contents(tmp_path / "x") == contents(clouds)


def test_free_objects_are_put_in_place(tmp_path: Path) -> None:
    """A bucket, its bail and its ball: what is restored is what was there, as far as it was written down."""
    from artiskill.demos.collect import collect
    from artiskill.demos.plan import CollectionOptions, make_plan

    config = load_demos_config({"store.key_frame_steps": 40})
    collect(
        make_plan("MoveBucket", ["bucket-0001"], CollectionOptions(per_object=1), demos_config=config),
        tmp_path / "demos",
    )
    state = {"obs_mode": "state", "sampling": None, "seen": {}}
    for way in ("simulate", "restore"):
        replay(tmp_path / "demos", tmp_path / way, settings_for(tmp_path / "demos", **state, way=way))
    found = [TrainingFile(tmp_path / way / "bucket-0001.h5") for way in ("simulate", "restore")]
    ours, theirs = (file.array(0, "obs/state") for file in found)
    for file in found:
        file.close()
    assert len(ours) > 80
    np.testing.assert_allclose(ours, theirs, atol=5e-3)
    assert np.abs(ours - theirs).mean() < 5e-4

import io
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from tests.demos.test_export import TASK, training_files

from artiskill.demos.export import export_dataset
from artiskill.demos.lerobot import action_names, camera_names
from artiskill.demos.lerobot_files import stats_of, total_stats
from artiskill.demos.training_file import TrainingFile
from artiskill.envs.control import JOINT, OPERATIONAL
from artiskill.errors import ConfigError, DemoError, MissingExtraError

parquet = pytest.importorskip("pyarrow.parquet")


def test_columns_and_episodes(tmp_path: Path) -> None:
    training = training_files(tmp_path / "t", "pointcloud")
    path = export_dataset(training, tmp_path / "home", "lerobot")
    assert path == tmp_path / "home" / f"artiskill/{TASK}-joint-pointcloud"
    info = json.loads((path / "meta/info.json").read_text())
    rows = parquet.read_table(path / info["data_path"].format(chunk_index=0, file_index=0))
    episodes = parquet.read_table(path / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    tasks = parquet.read_table(path / "meta/tasks.parquet").to_pylist()
    assert tasks == [{"task_index": 0, "__index_level_0__": "Open the marked drawer of the cabinet."}]
    assert list(info["features"]) == rows.column_names
    assert (info["codebase_version"], info["fps"], info["total_episodes"]) == ("v3.0", 20, 2)
    assert info["total_frames"] == len(rows) == episodes[-1]["dataset_to_index"]
    assert info["video_path"] is None
    stats = json.loads((path / "meta/stats.json").read_text())
    assert stats.keys() == info["features"].keys()
    assert np.shape(stats["observation.pointcloud.xyz"]["mean"]) == (1, 3)
    with TrainingFile(next(training.folder.glob("*.h5"))) as file:
        for number, episode in enumerate(episodes):
            part = rows.slice(episode["dataset_from_index"], episode["length"])
            count = episode["length"]
            assert part["frame_index"].to_pylist() == list(range(count))
            assert set(part["episode_index"].to_pylist()) == {number}
            assert part["timestamp"].to_numpy() == pytest.approx(np.arange(count) / 20)
            found = file.array
            np.testing.assert_array_equal(part["action"].to_pylist(), found(number, "actions"))
            np.testing.assert_array_equal(part["observation.state"].to_pylist(), found(number, "obs/agent")[:-1])
            for name in ("xyz", "rgb", "seg"):
                cloud = part[f"observation.pointcloud.{name}"].to_pylist()
                np.testing.assert_array_equal(cloud, found(number, f"obs/pointcloud/{name}")[:-1])
            np.testing.assert_array_equal(part["disturbed"].to_pylist(), found(number, "disturbed"))
            np.testing.assert_array_equal(part["next.success"].to_pylist(), found(number, "success"))
            assert part["next.done"].to_pylist() == [False] * (count - 1) + [True]
            assert (episode["object"], episode["level"]) == (file.object, file.groups[number].attrs["level"])
            mean = found(number, "actions").mean(axis=0)
            np.testing.assert_allclose(episode["stats/action/mean"], mean, atol=1e-6)


def test_videos(tmp_path: Path) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    training = training_files(tmp_path / "t", "rgbd")
    path = export_dataset(training, tmp_path / "home", "lerobot", "mine/drawers")
    info = json.loads((path / "meta/info.json").read_text())
    keys = [key for key, feature in info["features"].items() if feature["dtype"] == "video"]
    cameras = [f"observation.images.{name}" for name in ("front", "left", "right")]
    assert keys == cameras
    episodes = parquet.read_table(path / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    with TrainingFile(next(training.folder.glob("*.h5"))) as file:
        rgb = np.concatenate([file.array(k, "obs/rgbd/rgb")[:-1] for k in range(2)])
    for camera, key in enumerate(cameras):
        assert info["features"][key]["shape"] == [34, 32, 3]
        place = info["video_path"].format(video_key=key, chunk_index=0, file_index=0)
        command = [ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", str(path / place)]
        raw = subprocess.run(
            [*command, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], capture_output=True, check=True
        )
        frames = np.frombuffer(raw.stdout, np.uint8).reshape(-1, 34, 32, 3)
        assert len(frames) == info["total_frames"]
        own = rgb[..., 3 * camera : 3 * camera + 3].astype(float)
        assert np.abs(frames - own).mean() < 8  # H.264 loses colour at edges
    starts = [episode[f"videos/{cameras[0]}/from_timestamp"] for episode in episodes]
    assert starts == [0.0, episodes[0]["length"] / 20]


def test_masks_are_exact(tmp_path: Path) -> None:
    """Each as a PNG in the table, in the form that the library `datasets` has for pictures."""
    training = training_files(tmp_path / "t", "rgbd")
    path = export_dataset(training, tmp_path / "home", "lerobot", "mine/drawers")
    info = json.loads((path / "meta/info.json").read_text())
    rows = parquet.read_table(path / info["data_path"].format(chunk_index=0, file_index=0))
    stats = json.loads((path / "meta/stats.json").read_text())
    with TrainingFile(next(training.folder.glob("*.h5"))) as file:
        seg = np.concatenate([file.array(k, "obs/rgbd/seg")[:-1] for k in range(2)])
    assert len(rows) == len(seg)
    for camera, name in enumerate(("front", "left", "right")):
        key = f"observation.images.{name}_masks"
        names = ["height", "width", "channel"]
        assert info["features"][key] == {"dtype": "image", "shape": [34, 32, 3], "names": names}
        pictures = np.stack([np.asarray(Image.open(io.BytesIO(row["bytes"]))) for row in rows[key].to_pylist()])
        own = seg[..., 3 * camera : 3 * camera + 3]
        assert own.any() or name != "front"
        np.testing.assert_array_equal(pictures, own * np.uint8(255))
        assert np.shape(stats[key]["mean"]) == (3, 1, 1)


def test_cameras_are_called_by_where_they_look_to_only_if_they_are_the_usual_three() -> None:
    assert camera_names(3) == ("front", "left", "right")
    assert camera_names(2) == ("camera_0", "camera_1")


def test_the_same_bytes_again(tmp_path: Path) -> None:
    training = training_files(tmp_path / "t", "rgbd", 1)
    one, other = (export_dataset(training, tmp_path / home, "lerobot") for home in ("a", "b"))
    files = [path.relative_to(one) for path in one.rglob("*") if path.is_file()]
    assert len(files) == 8
    assert all((one / name).read_bytes() == (other / name).read_bytes() for name in files)


def test_stats() -> None:
    rng = np.random.default_rng(0)
    first, second = rng.normal(size=(50, 4)), rng.normal(size=(30, 4))
    total = total_stats([{"x": stats_of(first)}, {"x": stats_of(second)}])["x"]
    both = np.concatenate((first, second))
    for name, wanted in (("mean", both.mean(0)), ("std", both.std(0)), ("min", both.min(0)), ("max", both.max(0))):
        np.testing.assert_allclose(total[name], wanted)
    assert total["count"] == [80]
    assert stats_of(first[:, 0])["q50"].shape == (1,)
    pictures = np.zeros((7, 8, 8, 3), np.uint8)
    pictures[..., 1] = 255
    assert stats_of(pictures)["mean"].tolist() == [[[0.0]], [[1.0]], [[0.0]]]


def test_names_of_actions() -> None:
    assert len(action_names(JOINT, 1)) == len(set(action_names(OPERATIONAL, 1))) == 13
    assert len(set(action_names(JOINT, 2))) == 22


def test_videos_meet_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ffmpeg ends, and leaves a broken pipe; or it cannot write the file's end, and nobody hears of it."""
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    training = training_files(tmp_path / "t", "rgbd", 1)

    def breaking(*_: object, **__: object) -> Iterator[None]:
        yield
        raise OSError("[Errno 32] Broken pipe\n\nFFMPEG COMMAND:\n...")

    with monkeypatch.context() as patched:
        patched.setattr(imageio_ffmpeg, "write_frames", breaking)
        with pytest.raises(DemoError, match=r"cannot write .*ffmpeg could not write 'file-000.mp4'"):
            export_dataset(training, tmp_path, "lerobot", "x")
        patched.setattr("shutil.disk_usage", lambda path: SimpleNamespace(free=4096))
        with pytest.raises(DemoError, match=r"cannot write .*: No space left on device"):
            export_dataset(training, tmp_path, "lerobot", "x")
    with monkeypatch.context() as patched:
        patched.setattr(imageio_ffmpeg, "count_frames_and_secs", lambda path: (3, 0.15))
        with pytest.raises(DemoError, match=r"ffmpeg could not write 'file-000.mp4'"):
            export_dataset(training, tmp_path, "lerobot", "x")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["t"]


@pytest.mark.parametrize("name", ["../x", "/tmp/x", "a/../../x", "", ".", "a//b", "x/"])
def test_names_stay_at_home(name: str, tmp_path: Path) -> None:
    training = training_files(tmp_path / "t", "state", 1)
    with pytest.raises(ConfigError, match="an id of LeRobot looks like artiskill/doors, not"):
        export_dataset(training, tmp_path / "home", "lerobot", name)
    assert not (tmp_path / "home").exists()


def test_damaged_training_files_are_not_exported(tmp_path: Path) -> None:
    training = training_files(tmp_path / "t", "state", 1)
    path = next(training.folder.glob("*.h5"))
    path.write_bytes(path.read_bytes()[:-1] + b"x")
    with pytest.raises(DemoError, match="was changed or damaged: remove it and replay again"):
        export_dataset(training, tmp_path / "home", "lerobot")
    assert not list((tmp_path / "home").rglob("*.parquet"))


def test_bad_input(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    training = training_files(tmp_path / "t", "state", 1)
    export_dataset(training, tmp_path, "lerobot", "x")
    with pytest.raises(DemoError, match="exists: remove it"):
        export_dataset(training, tmp_path, "lerobot", "x")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r"artiskill\[lerobot\]"):
        export_dataset(training, tmp_path, "lerobot", "y")
    assert not (tmp_path / "y").exists()
    assert not list(tmp_path.glob(".part-*"))

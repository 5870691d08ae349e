import sys

import numpy as np
import pytest
from PIL import Image, ImageSequence

from artiskill.errors import ConfigError, MissingExtraError
from artiskill.evaluation.video import caption, write_video


@pytest.fixture
def frames(rng):
    """A red square that moves over a grainy grey gradient, still as a rendered one is; odd sides on purpose."""
    backdrop = np.repeat(np.linspace(60, 200, 61)[None, :, None], 45, axis=0).repeat(3, axis=2)
    backdrop = backdrop + rng.integers(-1, 2, backdrop.shape)
    result = []
    for i in range(6):
        frame = backdrop.copy()
        frame[10:20, 5 + 6 * i : 15 + 6 * i] = (220, 30, 30)
        result.append(frame.astype(np.uint8))
    return result


def read(path):
    with Image.open(path) as image:
        return [
            np.asarray(frame.convert("RGB")).astype(int) for frame in ImageSequence.Iterator(image)
        ], image.info


@pytest.mark.parametrize("suffix", [".gif", ".webp", ".GIF"])
def test_frames_come_back(tmp_path, frames, suffix):
    path = write_video(tmp_path / "deep" / f"episode{suffix}", frames, 20)
    back, info = read(path)
    assert len(back) == len(frames)
    assert info["loop"] == 0
    for given, got in zip(frames, back, strict=True):
        assert np.abs(got - given).mean() < 6
    assert back[3][15, 28, 0] > back[3][15, 28, 1] + 120
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_a_still_background_does_not_flicker_in_a_gif(tmp_path, frames):
    back, _ = read(write_video(tmp_path / "a.gif", frames, 20))
    for frame in back[1:]:
        np.testing.assert_array_equal(frame[25:], back[0][25:])


def test_gif_keeps_the_rate_on_average(tmp_path, frames):
    with Image.open(write_video(tmp_path / "a.gif", frames, 30)) as image:
        total = 0
        for i in range(image.n_frames):
            image.seek(i)
            total += image.info["duration"]
    assert total == 200


def test_mp4_is_written_whole(tmp_path, frames):
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    path = write_video(tmp_path / "a.mp4", frames, 20)
    count, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert count == len(frames)
    assert seconds == pytest.approx(len(frames) / 20, abs=0.06)


def test_mp4_without_its_extra_says_so_and_leaves_nothing(tmp_path, frames, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingExtraError, match=r"artiskill\[video\]"):
        write_video(tmp_path / "a.mp4", frames, 20)
    assert not list(tmp_path.iterdir())


def test_a_failed_write_keeps_the_old_file(tmp_path, frames, monkeypatch):
    path = tmp_path / "a.gif"
    path.write_bytes(b"old")

    def fail(*_args, **_kwargs):
        raise OSError("disk full")

    monkeypatch.setattr(Image.Image, "save", fail)
    with pytest.raises(OSError, match="disk full"):
        write_video(path, frames, 20)
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.gif"]


@pytest.mark.parametrize(
    ("name", "change", "rate", "message"),
    [
        ("a.avi", lambda f: f, 20, r"\.gif, \.webp, \.mp4, not 'a\.avi'"),
        ("a", lambda f: f, 20, "must end in"),
        ("a.gif", lambda f: [], 20, "at least one frame"),
        ("a.gif", lambda f: [*f, f[0][1:]], 20, "frame 6"),
        ("a.gif", lambda f: [f[0].astype(float)], 20, "float64"),
        ("a.gif", lambda f: [f[0][..., 0]], 20, "frame 0"),
        ("a.gif", lambda f: f, 0, "frames_per_second"),
        ("a.gif", lambda f: f, 60, "50"),
        ("a.gif", lambda f: f, float("nan"), "frames_per_second"),
    ],
)
def test_illegal_requests_are_named_and_leave_nothing(tmp_path, frames, name, change, rate, message):
    with pytest.raises(ConfigError, match=message):
        write_video(tmp_path / name, change(frames), rate)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("size", [(360, 480), (120, 160), (8, 5)])
@pytest.mark.parametrize(
    "text", ["", "cabinet-0031 · link_2 · drawer 63 % open · success", "a very long line " * 20]
)
def test_caption_stays_inside_and_leaves_the_rest_alone(size, text):
    frame = np.full((*size, 3), 200, dtype=np.uint8)
    before = frame.copy()
    marked = caption(frame, text)
    assert marked.shape == frame.shape
    assert marked.dtype == np.uint8
    np.testing.assert_array_equal(frame, before)
    np.testing.assert_array_equal(marked[: size[0] // 2], frame[: size[0] // 2]) if size[0] > 50 else None
    assert marked[-1].max() < 100


def test_caption_is_legible():
    marked = caption(np.full((360, 480, 3), 200, dtype=np.uint8), "success")
    assert (marked[-30:] > 200).any(axis=-1).sum() > 100  # bright letters on the dark band

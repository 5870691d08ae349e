"""The files of a LeRobotDataset: Parquet tables, videos (H.264), and statistics; pyarrow and ffmpeg are extras."""

import errno
import io
import json
import os
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from artiskill.errors import MissingExtraError

FILES_PER_CHUNK = 1000
_MEBI = 1 << 20
_LEAST_FREE_BYTES = 1_000_000  # with fewer, it was the disk that ended ffmpeg
_MOST_FRAMES = 20_000  # a file that has reached so many gets no more episodes; by bytes would depend on time
# any frame is near a key frame, so that single ones are read fast; no frames in another order than they are shown
_QUALITY = ("-crf", "23", "-g", "2", "-bf", "0", "-preset", "veryfast", "-threads", "1", "-bitexact")
_QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
_PICTURES, _STRIDE = 20, 4  # of an episode's pictures so many, and of their rows and columns every so-many-th

Stats = dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Feature:
    """One column, or one video."""

    key: str  # its name
    dtype: str  # of its numbers; `video` for a video, `image` for pictures that are kept as they are
    shape: tuple[int, ...]  # of a frame
    names: tuple[str, ...] | None  # of its numbers, or of its axes
    read: Callable[[Any], np.ndarray]  # a training file's trajectory -> (T or T + 1, ...)


def load_pyarrow() -> tuple[Any, Any]:
    """Return the modules pyarrow and pyarrow.parquet.

    Raises:
        MissingExtraError: they are not installed.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise MissingExtraError("a LeRobotDataset", "lerobot") from error
    return pyarrow, pyarrow.parquet


class FrameTable:
    """The frames of all episodes, in files of about one size.

    Args:
        folder: of the dataset.
        pattern: of the files' names.
        features: the columns.
        most_mb: a file that has reached this size, uncompressed, gets no more episodes.
    """

    def __init__(self, folder: Path, pattern: str, features: Sequence[Feature], most_mb: int) -> None:
        self._pa, self._parquet = load_pyarrow()
        self._folder, self._pattern, self._features, self._most = folder, pattern, features, most_mb * _MEBI
        self._schema = self._pa.schema([(feature.key, self._type(feature)) for feature in features])
        self._writer: Any = None
        self._file, self._bytes = -1, 0

    def add(self, columns: dict[str, np.ndarray]) -> int:
        """Write an episode's rows; return the number of the file that has them."""
        if self._writer is None or self._bytes >= self._most:
            self.close()
            self._file, self._bytes = self._file + 1, 0
            path = _new_path(self._folder, self._pattern, self._file)
            self._writer = self._parquet.ParquetWriter(path, self._schema, compression="snappy")
        arrays = [self._array(columns[feature.key], feature) for feature in self._features]
        table = self._pa.Table.from_arrays(arrays, schema=self._schema)
        self._bytes += table.nbytes
        self._writer.write_table(table)
        return self._file

    def close(self) -> None:
        """End the last file."""
        if self._writer is not None:
            self._writer.close()

    def _type(self, feature: Feature) -> Any:
        if feature.dtype == "image":  # as the library `datasets` has them
            return self._pa.struct({"bytes": self._pa.binary(), "path": self._pa.string()})
        found = self._pa.from_numpy_dtype(np.dtype(feature.dtype))
        if feature.shape == (1,):
            return found
        if len(feature.shape) == 1:
            return self._pa.list_(found, feature.shape[0])
        for _ in feature.shape:
            found = self._pa.list_(found)
        return found

    def _array(self, values: np.ndarray, feature: Feature) -> Any:
        pa = self._pa
        if feature.dtype == "image":
            return pa.array([{"bytes": _png(value), "path": None} for value in values], self._type(feature))
        flat = pa.array(np.ascontiguousarray(values).reshape(-1))
        if feature.shape == (1,):
            return flat
        if len(feature.shape) == 1:
            return pa.FixedSizeListArray.from_arrays(flat, feature.shape[0])
        for size in reversed(feature.shape):
            offsets = np.arange(0, len(flat) + 1, size, dtype=np.int32)
            flat = pa.ListArray.from_arrays(pa.array(offsets), flat)
        return flat


def _new_path(folder: Path, pattern: str, number: int, **about: str) -> Path:
    """Return the path of a dataset's file; its folder is made."""
    chunk, file = divmod(number, FILES_PER_CHUNK)
    path = folder / pattern.format(chunk_index=chunk, file_index=file, **about)
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def _png(picture: np.ndarray) -> bytes:
    """Return (H, W, 3) uint8 as a file, without loss."""
    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, "PNG", compress_level=1)
    return stream.getvalue()


class EpisodeTable:
    """A row per episode: where its frames are, and its statistics.

    Args:
        folder: of the dataset.

    Attributes:
        stats: of each episode by feature.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._rows: list[dict[str, Any]] = []
        self.stats: list[dict[str, Stats]] = []

    def add(self, row: dict[str, Any], stats: dict[str, Stats]) -> None:
        """Add an episode."""
        self.stats.append(stats)
        plain = {
            f"stats/{key}/{name}": value.tolist()
            for key, of_key in stats.items()
            for name, value in of_key.items()
        }
        self._rows.append(row | plain | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0})

    def write(self) -> None:
        """Write all episodes, in one file."""
        pa, parquet = load_pyarrow()
        path = self._folder / "meta/episodes/chunk-000/file-000.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        parquet.write_table(pa.Table.from_pylist(self._rows), path, compression="snappy")


def write_tasks(folder: Path, instruction: str) -> None:
    """Write `meta/tasks.parquet` with the dataset's one task, as pandas writes a table with texts as its index."""
    pa, parquet = load_pyarrow()
    index = "__index_level_0__"
    text = {"pandas_type": "unicode", "numpy_type": "object", "metadata": None}
    number = {"pandas_type": "int64", "numpy_type": "int64", "metadata": None}
    about = {
        "index_columns": [index],
        "column_indexes": [{"name": None, "field_name": None, **text, "metadata": {"encoding": "UTF-8"}}],
        "columns": [
            {"name": "task_index", "field_name": "task_index", **number},
            {"name": None, "field_name": index, **text},
        ],
        "pandas_version": "2.0.0",
    }
    table = pa.table({"task_index": pa.array([0], pa.int64()), index: [instruction]})
    parquet.write_table(
        table.replace_schema_metadata({"pandas": json.dumps(about)}), folder / "meta/tasks.parquet"
    )


class VideoFile:
    """The videos of one camera: its episodes one after the other.

    Args:
        folder: of the dataset.
        pattern: of the files' names.
        feature: the camera.
        frames_per_s: of the data.

    Raises:
        MissingExtraError: imageio-ffmpeg is not installed.
    """

    def __init__(self, folder: Path, pattern: str, feature: Feature, frames_per_s: int) -> None:
        try:
            import imageio_ffmpeg
        except ImportError as error:
            raise MissingExtraError("the videos of a LeRobotDataset", "lerobot") from error
        self._start, self._count = imageio_ffmpeg.write_frames, imageio_ffmpeg.count_frames_and_secs
        self._path = folder
        self._folder, self._pattern, self._feature = folder, pattern, feature
        self._rate = frames_per_s
        self._writer: Any = None
        self._file, self._frames = -1, 0

    def add(self, pictures: np.ndarray) -> dict[str, Any]:
        """Write an episode's pictures, (T, H, W, 3) uint8; return where they are, for the table of episodes.

        Raises:
            OSError: they cannot be written.
        """
        if self._writer is None or self._frames >= _MOST_FRAMES:
            self._next_file()
        assert pictures.shape[1:] == self._feature.shape, "pictures are of the size that the feature says"
        start, self._frames = self._frames, self._frames + len(pictures)
        try:
            for picture in pictures:
                self._writer.send(np.ascontiguousarray(picture))
        except OSError as error:  # that ffmpeg is gone: a broken pipe
            raise self._failure() from error
        chunk, file = divmod(self._file, FILES_PER_CHUNK)
        values = {
            "chunk_index": chunk,
            "file_index": file,
            "from_timestamp": start / self._rate,
            "to_timestamp": self._frames / self._rate,
        }
        return {f"videos/{self._feature.key}/{name}": value for name, value in values.items()}

    def finish(self) -> None:
        """End the last file, and check that all of it is there: ffmpeg may have failed at its end.

        Raises:
            OSError: it is not.
        """
        if self._writer is None:
            return
        self.close()
        try:
            found = self._count(str(self._path))[0]
        except (OSError, RuntimeError, ValueError) as error:
            raise self._failure() from error
        if found != self._frames:
            raise self._failure()

    def close(self) -> None:
        """End ffmpeg, whatever it has written."""
        if self._writer is not None:
            self._writer.close()
        self._writer = None

    def _failure(self) -> OSError:
        """Return why ffmpeg failed."""
        if shutil.disk_usage(self._folder).free < _LEAST_FREE_BYTES:
            return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return OSError(errno.EIO, f"ffmpeg could not write {self._path.name!r}")

    def _next_file(self) -> None:
        self.finish()
        self._file, self._frames = self._file + 1, 0
        self._path = _new_path(self._folder, self._pattern, self._file, video_key=self._feature.key)
        height, width, _ = self._feature.shape
        self._writer = self._start(
            str(self._path),
            (width, height),
            fps=self._rate,
            codec="libx264",
            pix_fmt_out="yuv420p",
            macro_block_size=1,
            output_params=[*_QUALITY, "-movflags", "+faststart"],
            ffmpeg_log_level="error",
        )
        self._writer.send(None)


def stats_of(values: np.ndarray) -> Stats:
    """Return the statistics of a feature's values in an episode.

    Of pictures (T, H, W, 3) uint8 per channel as shares of 255, (3, 1, 1) each; of numbers (T,), per number of
    (T, n), or per channel of the points (T, N, n): (1,), (n,) or (1, n) each.
    """
    if values.ndim == 4:
        chosen = np.unique(np.linspace(0, len(values) - 1, min(_PICTURES, len(values))).astype(int))
        sample = values[chosen, ::_STRIDE, ::_STRIDE]
        return _stats_of_rows(sample.reshape(-1, sample.shape[-1]) / 255.0, len(chosen), (sample.shape[-1], 1, 1))
    rows = values.reshape(len(values), 1) if values.ndim == 1 else values
    flat = rows.reshape(-1, rows.shape[-1]).astype(np.float64)
    return _stats_of_rows(flat, len(values), ((1,) * (rows.ndim - 2) + (rows.shape[-1],)))


def _stats_of_rows(rows: np.ndarray, count: int, shape: tuple[int, ...]) -> Stats:
    stats = {
        "min": rows.min(axis=0),
        "max": rows.max(axis=0),
        "mean": rows.mean(axis=0),
        "std": rows.std(axis=0),
    }
    quantiles = np.quantile(rows, list(_QUANTILES.values()), axis=0)
    stats |= dict(zip(_QUANTILES, quantiles, strict=True))
    return {name: value.reshape(shape) for name, value in stats.items()} | {"count": np.array([count])}


def total_stats(episodes: Sequence[dict[str, Stats]]) -> dict[str, Any]:
    """Return the statistics of all episodes, plain values.

    Quantiles are means of the episodes' quantiles, as LeRobot has them.
    """
    found: dict[str, Any] = {}
    for key in episodes[0]:
        each = {name: np.stack([one[key][name] for one in episodes]) for name in episodes[0][key]}
        weight = each["count"].reshape(-1, *(1,) * (each["mean"].ndim - 1)) / each["count"].sum()
        mean = (weight * each["mean"]).sum(axis=0)
        variance = (weight * (each["std"] ** 2 + (each["mean"] - mean) ** 2)).sum(axis=0)
        total = {
            "min": each["min"].min(axis=0),
            "max": each["max"].max(axis=0),
            "mean": mean,
            "std": np.sqrt(variance),
            "count": each["count"].sum(axis=0),
        }
        total |= {name: (weight * each[name]).sum(axis=0) for name in _QUANTILES}
        found[key] = {name: value.tolist() for name, value in total.items()}
    return found

"""The Parquet files of a LeRobotDataset; pyarrow is an extra."""

import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from artiskill.demos.export.lerobot_features import Feature
from artiskill.demos.export.lerobot_stats import Stats
from artiskill.errors import MissingExtraError

_MEBI = 1 << 20


def load_pyarrow() -> tuple[Any, Any]:
    """The modules pyarrow and pyarrow.parquet.

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
        """Write an episode's rows; the number of the file that has them."""
        if self._writer is None or self._bytes >= self._most:
            self._next_file()
        arrays = [self._array(columns[feature.key], feature) for feature in self._features]
        table = self._pa.Table.from_arrays(arrays, schema=self._schema)
        self._bytes += table.nbytes
        self._writer.write_table(table)
        return self._file

    def close(self) -> None:
        """End the last file."""
        if self._writer is not None:
            self._writer.close()

    def _next_file(self) -> None:
        self.close()
        self._file, self._bytes = self._file + 1, 0
        chunk, file = divmod(self._file, 1000)
        path = self._folder / self._pattern.format(chunk_index=chunk, file_index=file)
        path.parent.mkdir(parents=True, exist_ok=True)
        self._writer = self._parquet.ParquetWriter(path, self._schema, compression="snappy")

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


def _png(picture: np.ndarray) -> bytes:
    """(H, W, 3) uint8 as a file, without loss."""
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
        """One more episode."""
        self.stats.append(stats)
        plain = {
            f"stats/{key}/{name}": value.tolist()
            for key, of_key in stats.items()
            for name, value in of_key.items()
        }
        self._rows.append(row | plain | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0})

    def write(self) -> None:
        """All of them, in one file."""
        pa, parquet = load_pyarrow()
        path = self._folder / "meta/episodes/chunk-000/file-000.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        parquet.write_table(pa.Table.from_pylist(self._rows), path, compression="snappy")


def write_tasks(folder: Path, instruction: str) -> None:
    """`meta/tasks.parquet` with the one task of the dataset, as pandas writes a table with texts as its index."""
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

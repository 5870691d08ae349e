"""The videos of a LeRobotDataset: the episodes of one camera one after the other, H.264; ffmpeg is an extra."""

import errno
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.demos.export.lerobot_features import Feature
from artiskill.errors import MissingExtraError

_LEAST_FREE_BYTES = 1_000_000  # with fewer, it was the disk that ended ffmpeg
_MOST_FRAMES = 20_000  # a file that has reached so many gets no more episodes; by bytes would depend on time
# any frame is near a key frame, so that single ones are read fast; no frames in another order than they are shown
_QUALITY = ("-crf", "23", "-g", "2", "-bf", "0", "-preset", "veryfast", "-threads", "1", "-bitexact")


class VideoFile:
    """Writes the videos of one camera.

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
        """Write an episode's pictures, (T, H, W, 3) uint8; where they are, as the table of episodes has it.

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
        chunk, file = divmod(self._file, 1000)
        return {
            f"videos/{self._feature.key}/{name}": value
            for name, value in {
                "chunk_index": chunk,
                "file_index": file,
                "from_timestamp": start / self._rate,
                "to_timestamp": self._frames / self._rate,
            }.items()
        }

    def finish(self) -> None:
        """End the last file, and see whether all of it is there: ffmpeg may have failed at its end.

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
        """Let ffmpeg go, whatever it has written."""
        if self._writer is not None:
            self._writer.close()
        self._writer = None

    def _failure(self) -> OSError:
        """What ffmpeg failed for."""
        if shutil.disk_usage(self._folder).free < _LEAST_FREE_BYTES:
            return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return OSError(errno.EIO, f"ffmpeg could not write {self._path.name!r}")

    def _next_file(self) -> None:
        self.finish()
        self._file, self._frames = self._file + 1, 0
        chunk, file = divmod(self._file, 1000)
        name = self._pattern.format(video_key=self._feature.key, chunk_index=chunk, file_index=file)
        self._path = self._folder / name
        self._path.parent.mkdir(parents=True, exist_ok=True)
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

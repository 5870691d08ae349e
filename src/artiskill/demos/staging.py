"""Attempts of objects that are not finished, one file each: what a killed collector leaves to the next one."""

import json
import shutil
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.demos.attempts import Attempt
from artiskill.demos.columns import Columns
from artiskill.demos.recording import ARRAYS, Recording
from artiskill.errors import DemoError
from artiskill.jobs.whole_files import remove_leftovers, whole_file

STAGING_FOLDER = ".unfinished"


class Staging:
    """The folder for attempts in a folder of demonstrations.

    Args:
        folder: of the demonstrations.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder / STAGING_FOLDER

    def save(self, attempt: Attempt) -> None:
        """Keep an attempt.

        Raises:
            DemoError: it cannot be written; what was written before is as it was.
        """
        path = self._folder / attempt.object / f"{attempt.target}.{attempt.level}.npz"
        recording = attempt.recording
        arrays = {} if recording is None else {name: getattr(recording, name) for name in ARRAYS}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(path) as temporary, temporary.open("wb") as file:
                np.savez(file, about=np.array(json.dumps(_about(attempt))), **arrays)
        except OSError as error:
            raise DemoError(
                f"cannot write to {str(path.parent)!r}: {error.strerror or error}; all that was collected "
                "before is kept: the same command goes on from there"
            ) from error

    def load(self, object_id: str) -> list[Attempt]:
        """All attempts at an object that can be read; others are as if they had never been made."""
        folder = self._folder / object_id
        if not folder.is_dir():
            return []
        remove_leftovers(folder)
        found = [_read(path) for path in sorted(folder.glob("*.npz"))]
        return [attempt for attempt in found if attempt is not None]

    def remove(self, object_id: str) -> None:
        """Forget the attempts at an object, whose file is finished."""
        shutil.rmtree(self._folder / object_id, ignore_errors=True)
        if self._folder.is_dir() and not any(self._folder.iterdir()):
            self._folder.rmdir()


def _about(attempt: Attempt) -> dict[str, Any]:
    names = ("object", "target", "level", "success", "steps", "fault")
    about = {name: getattr(attempt, name) for name in names}
    if attempt.recording is not None:
        about["state_columns"] = attempt.recording.state_columns.to_list()
        about["key_frame_columns"] = attempt.recording.key_frame_columns.to_list()
    return about


def _read(path: Path) -> Attempt | None:
    try:
        with np.load(path, allow_pickle=False) as file:
            about = json.loads(str(file["about"]))
            layout = [Columns.from_list(about.pop(name, ())) for name in ("state_columns", "key_frame_columns")]
            arrays = {name: file[name] for name in ARRAYS if name in file.files}
            return Attempt(
                **about,
                recording=Recording(**arrays, state_columns=layout[0], key_frame_columns=layout[1])
                if arrays
                else None,
            )
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile):
        return None

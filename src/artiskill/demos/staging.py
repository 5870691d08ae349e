"""Attempts of objects that are not finished, one file each: what a killed collector leaves to the next one."""

import json
import tokenize
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.demos.attempts import Attempt
from artiskill.demos.columns import Columns
from artiskill.demos.recording import ARRAYS, Recording
from artiskill.demos.unfinished import KEPT, UNFINISHED, remove_unfinished
from artiskill.errors import DemoError
from artiskill.files import atomic_write, remove_leftovers
from artiskill.tasks.levels import check_level

# what numpy raises of damaged files
_DAMAGED = (
    OSError,
    EOFError,
    ValueError,
    KeyError,
    TypeError,
    AttributeError,
    RuntimeError,
    MemoryError,
    SyntaxError,
    tokenize.TokenError,
    zipfile.BadZipFile,
)


class Staging:
    """The folder for attempts in a folder of demonstrations.

    Args:
        folder: of the demonstrations.
        settings_hash: of the collection's settings.
    """

    def __init__(self, folder: Path, settings_hash: str) -> None:
        self._demos, self._folder, self._settings_hash = folder, folder / UNFINISHED, settings_hash

    def save(self, attempt: Attempt, content_hash: str) -> None:
        """Keep an attempt.

        Args:
            attempt: what is kept.
            content_hash: of its object.

        Raises:
            DemoError: it cannot be written; what was written before is as it was.
        """
        # levels differ from target to target; the names of links may be anything, `../up` say
        path = self._folder / attempt.object / f"{attempt.level}.npz"
        recording = attempt.recording
        arrays = {} if recording is None else {name: getattr(recording, name) for name in ARRAYS}
        about = _about(attempt) | {"content_hash": content_hash, "settings_hash": self._settings_hash}
        with _writing(path.parent):
            path.parent.mkdir(parents=True, exist_ok=True)
            with atomic_write(path) as temporary, temporary.open("wb") as file:
                np.savez(file, about=np.array(json.dumps(about)), **arrays)

    def begin(self, object_id: str) -> None:
        """Leave a trace of an object that is to be collected, be it killed before its first attempt.

        Raises:
            DemoError: it cannot be written.
        """
        with _writing(self._folder):
            (self._folder / object_id).mkdir(parents=True, exist_ok=True)

    def load(self, object_id: str, content_hash: str | None = None) -> list[Attempt]:
        """All attempts at an object that can be read; others are as if they had never been made.

        Args:
            object_id: of the object.
            content_hash: of the object; None for whichever they were made with.

        Raises:
            DemoError: some were made with another object of this id, or with other settings.
        """
        folder = self._folder / object_id
        read = [found for path in sorted(folder.glob("*.npz")) if (found := _read(path)) is not None]
        for _, hashes in read:
            self._check(folder, object_id, hashes, content_hash or hashes[0])
        remove_leftovers(folder)
        return [attempt for attempt, _ in read if attempt.object == object_id]

    def check(self) -> None:
        """See whether all attempts, at whichever objects, belong to this collection.

        Raises:
            DemoError: some were made with other settings.
        """
        for folder in sorted(self._folder.glob("*")):
            self.load(folder.name)

    def remove(self, object_id: str) -> None:
        """Forget the attempts at an object, whose file is finished."""
        remove_unfinished(self._demos, object_id)

    def _check(self, folder: Path, object_id: str, hashes: tuple[str, str], content_hash: str) -> None:
        """See whether an attempt belongs to this collection."""
        told = (
            (f"with another {object_id!r}: its content hash was", hashes[0], content_hash),
            ("with other settings: their hash was", hashes[1], self._settings_hash),
        )
        for what, there, here in told:
            if there != here:
                raise DemoError(
                    f"{str(folder)!r} holds attempts made {what} {there}, now it is {here}; "
                    "choose another folder, or remove this one to make them anew"
                )


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    """Turn what the file system says into an error that names the folder."""
    try:
        yield
    except OSError as error:
        raise DemoError(f"cannot write to {str(folder)!r}: {error.strerror or error}; {KEPT}") from error


def _about(attempt: Attempt) -> dict[str, Any]:
    names = ("object", "target", "level", "success", "steps", "fault")
    about = {name: getattr(attempt, name) for name in names}
    if attempt.recording is not None:
        about["state_columns"] = attempt.recording.state_columns.to_list()
        about["key_frame_columns"] = attempt.recording.key_frame_columns.to_list()
    return about


def _check_about(about: dict[str, Any]) -> None:
    check_level(about["level"])
    types = {"object": str, "target": str, "success": bool, "steps": int, "fault": str}
    wrong = [name for name, kind in types.items() if type(about[name]) is not kind]
    if wrong or (about["success"] and "state_columns" not in about):
        raise ValueError(f"not of an attempt: {wrong or 'a success that was not recorded'}")


def _read(path: Path) -> tuple[Attempt, tuple[str, str]] | None:
    """An attempt, and the hashes of its object and settings; None if the file is damaged."""
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            about = json.loads(str(file["about"]))
            hashes = str(about.pop("content_hash")), str(about.pop("settings_hash"))
            _check_about(about)
            if "state_columns" not in about:
                return Attempt(**about, recording=None), hashes
            states, frames = (
                Columns.from_list(about.pop(name)) for name in ("state_columns", "key_frame_columns")
            )
            arrays = {name: file[name] for name in ARRAYS}
            recording = Recording(**arrays, state_columns=states, key_frame_columns=frames)
            return Attempt(**about, recording=recording), hashes
    except _DAMAGED:
        return None

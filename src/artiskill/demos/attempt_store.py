"""Attempts at objects that are not finished, one file each: what a killed collector leaves to the next one."""

import json
import tokenize
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.demos.demonstrator import DemoAttempt
from artiskill.demos.demos import KEPT, UNFINISHED, remove_unfinished
from artiskill.demos.recording import ARRAYS, Columns, Recording
from artiskill.errors import DemoError
from artiskill.files import atomic_write, remove_leftovers
from artiskill.tasks.levels import check_level

# what numpy raises of damaged files
_DAMAGED = (
    *(OSError, EOFError, ValueError, KeyError, TypeError, AttributeError, RuntimeError, MemoryError, SyntaxError),
    tokenize.TokenError,
    zipfile.BadZipFile,
)
# what an attempt's file says about it, beside its recording
_ABOUT = {"object": str, "target": str, "level": int, "success": bool, "steps": int, "fault": str}


class AttemptStore:
    """The attempts in a folder of demonstrations.

    Args:
        folder: of the demonstrations.
        settings_hash: of the collection's settings.
    """

    def __init__(self, folder: Path, settings_hash: str) -> None:
        self._demos, self._folder, self._settings_hash = folder, folder / UNFINISHED, settings_hash

    def begin(self, object_id: str) -> None:
        """Leave a trace of an object that is to be collected, even if killed before its first attempt.

        Raises:
            DemoError: it cannot be written.
        """
        with _writing(self._folder):
            (self._folder / object_id).mkdir(parents=True, exist_ok=True)

    def save(self, attempt: DemoAttempt, content_hash: str) -> None:
        """Save an attempt at an object with this content hash.

        Raises:
            DemoError: it cannot be written; what was written before is as it was.
        """
        # levels differ from target to target; the names of links may be anything, `../up` say
        path = self._folder / attempt.object / f"{attempt.level}.npz"
        about = {name: getattr(attempt, name) for name in _ABOUT}
        arrays: dict[str, Any] = {}
        if attempt.recording is not None:
            for name in ("state_columns", "key_frame_columns"):
                about[name] = getattr(attempt.recording, name).to_list()
            arrays = {name: getattr(attempt.recording, name) for name in ARRAYS}
        about |= {"content_hash": content_hash, "settings_hash": self._settings_hash}
        with _writing(path.parent):
            path.parent.mkdir(parents=True, exist_ok=True)
            with atomic_write(path) as temporary, temporary.open("wb") as file:
                np.savez(file, about=np.array(json.dumps(about)), **arrays)

    def load(self, object_id: str, content_hash: str | None = None) -> list[DemoAttempt]:
        """Return all attempts at an object that can be read; others are as if they had never been made.

        Args:
            object_id: of the object.
            content_hash: of the object; None for whichever they were made with.

        Raises:
            DemoError: some were made with another object of this id, or with other settings.
        """
        folder = self._folder / object_id
        found = [read for path in sorted(folder.glob("*.npz")) if (read := _read(path)) is not None]
        for _, made_of, made_with in found:
            for what, there, here in (
                (f"with another {object_id!r}: its content hash was", made_of, content_hash or made_of),
                ("with other settings: their hash was", made_with, self._settings_hash),
            ):
                if there != here:
                    raise DemoError(
                        f"{str(folder)!r} holds attempts made {what} {there}, now it is {here}; "
                        "choose another folder, or remove this one to make them anew"
                    )
        remove_leftovers(folder)
        return [attempt for attempt, _, _ in found if attempt.object == object_id]

    def check(self) -> None:
        """Raise `DemoError` unless all attempts, at any object, were made with the collection's settings."""
        for folder in sorted(self._folder.glob("*")):
            self.load(folder.name)

    def remove(self, object_id: str) -> None:
        """Remove the attempts at an object, whose file is finished."""
        remove_unfinished(self._demos, object_id)


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    """Turn what the file system raises into an error that names the folder."""
    try:
        yield
    except OSError as error:
        raise DemoError(f"cannot write to {str(folder)!r}: {error.strerror or error}; {KEPT}") from error


def _read(path: Path) -> tuple[DemoAttempt, str, str] | None:
    """Return an attempt, and the hashes of its object and settings; None if the file is damaged."""
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            about = json.loads(str(file["about"]))
            hashes = str(about.pop("content_hash")), str(about.pop("settings_hash"))
            check_level(about["level"])
            wrong = [name for name, kind in _ABOUT.items() if type(about[name]) is not kind]
            is_recorded = "state_columns" in about
            if wrong or (about["success"] and not is_recorded):
                return None
            columns = ("state_columns", "key_frame_columns") if is_recorded else ()
            layout: dict[str, Any] = {name: Columns.from_list(about.pop(name)) for name in columns}
            recording = Recording(**{name: file[name] for name in ARRAYS}, **layout) if is_recorded else None
            return DemoAttempt(**about, recording=recording), *hashes
    except _DAMAGED:
        return None

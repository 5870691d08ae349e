"""Files that users name: read within limits, if they are regular files; written whole, by one process at a time.

What is wrong with a file or a name comes out of a function that reads as an `OSError` with a reason in plain
words, as the system's own errors do; what is wrong with its text, as a `ValueError`. The caller turns them into
an error of its own kind, with the file's name.
"""

import errno
import fcntl
import glob
import hashlib
import io
import json
import os
import re
import secrets
import shutil
import stat
import tempfile
import tokenize
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

import yaml
from yaml.composer import Composer

from artiskill.errors import ConfigError, shown

# what reading of an archive of arrays (`.npz`) raises where it is damaged, holds something else, or is too large
DAMAGED_ARCHIVE = (
    *(OSError, EOFError, ValueError, LookupError, TypeError, AttributeError, RuntimeError, MemoryError),
    *(SyntaxError, tokenize.TokenError, zipfile.BadZipFile, zlib.error),
)
MOST_JSON_BYTES = 100_000_000  # a manifest has 400 bytes for each object
MOST_YAML_BYTES = 500_000  # a split file has 20 bytes for each object; without libyaml, 100 kB take a second
_MOST_BYTES = 2 * 1024**3
_LEAST_BUFFER = 1 << 20  # for files whose size the system does not know: those of /proc
_MOST_NAME_BYTES, _MOST_PATH_BYTES = 255, 4095  # of Linux: NAME_MAX, PATH_MAX without its end
_MOST_DEPTH = 50  # of nested lists and mappings: the deepest of ours is 6
_MOST_VALUES = 50_000  # of a YAML text, each as often as aliases repeat it
_MOST_DIGITS = 1000  # of a number in YAML, which may count in sixties: 1:1:1:...
_TOO_DEEP = f"it is nested more than {_MOST_DEPTH} levels deep"
_TOO_MANY = f"it has more than {_MOST_VALUES} values, what aliases stand for included"

# of names that a killed process may leave behind; the only process that writes to a folder may remove them
TEMPORARY_PREFIX = ".part-"
_TEMPORARY = re.compile(re.escape(TEMPORARY_PREFIX) + r"[a-z0-9_]{8}(\.[a-z0-9]+)?")
LOCK_FILE = ".artiskill.lock"
_TRIES = 100
_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)


def check_path(path: Path | str) -> Path:
    """Return the path, if a file could have it.

    Raises:
        OSError: it holds NUL, or text that is no UTF-8, or is too long.
    """
    text = str(path)
    if "\0" in text:
        raise OSError(errno.EINVAL, "a path must not contain NUL", shown(text))
    try:
        raw = os.fsencode(text)
    except UnicodeEncodeError as error:
        raise OSError(errno.EILSEQ, "it is not valid UTF-8", shown(text)) from error
    if len(raw) > _MOST_PATH_BYTES or max(map(len, raw.split(b"/"))) > _MOST_NAME_BYTES:
        raise OSError(errno.ENAMETOOLONG, os.strerror(errno.ENAMETOOLONG), shown(text))
    return Path(path)


def open_regular(path: Path | str) -> io.BufferedReader:
    """Open a regular file for reading: no device, which may never end, and no pipe, which may never begin.

    Raises:
        OSError: it cannot be opened, or is none.
    """
    path = check_path(path)
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    try:
        mode = os.fstat(handle).st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not stat.S_ISREG(mode):
            raise OSError(errno.EINVAL, "it is a device or a pipe, not a regular file", str(path))
        return open(handle, "rb")
    except BaseException:
        os.close(handle)
        raise


def file_sha256(path: Path | str) -> str:
    """Return the SHA-256 of a regular file's bytes.

    Raises:
        OSError: it cannot be read, or is none.
    """
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def read_bytes(path: Path | str, most_bytes: int = _MOST_BYTES) -> bytes:
    """Read a regular file's content.

    Raises:
        OSError: it cannot be read, is no regular file, or is larger than it may be.
    """
    with open_regular(path) as file:
        size = max(
            os.fstat(file.fileno()).st_size, _LEAST_BUFFER
        )  # reading takes the memory that it may need first
        content = file.read(min(most_bytes, size) + 1)
    if len(content) > most_bytes:
        raise OSError(errno.EFBIG, f"it has more than the {_size(most_bytes)} allowed", str(path))
    return content


def read_text(path: Path | str, most_bytes: int = _MOST_BYTES, errors: str = "strict") -> str:
    """Read a regular file's text, UTF-8.

    Raises:
        OSError: as `read_bytes`.
        UnicodeDecodeError: it is no UTF-8.
    """
    return read_bytes(path, most_bytes).decode("utf-8", errors)


def is_file(path: Path | str) -> bool:
    """Whether there is a regular file; False, too, for what no file can be called."""
    return os.path.isfile(path)


def is_folder(path: Path | str) -> bool:
    """Whether there is a folder; False, too, for what no folder can be called."""
    return os.path.isdir(path)


def check_writable(path: Path | str) -> Path:
    """Return the path, if a file may be written there: nothing is there, or a regular file, perhaps behind a link.

    Raises:
        OSError: its name is not legal, or it is a folder, a device or a pipe, or it must not be looked at.
    """
    path = check_path(path)
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return path
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "it is a device or a pipe, not a regular file", str(path))
    return path


def parse_json(text: bytes | str) -> Any:
    """Parse a JSON text.

    Raises:
        ValueError: it is no JSON, too long, or nested too deeply.
    """
    if len(text) > MOST_JSON_BYTES:
        raise ValueError(f"it has {_size(len(text))}, more than the {_size(MOST_JSON_BYTES)} allowed")
    try:
        found = json.loads(text)
    except RecursionError as error:
        raise ValueError(_TOO_DEEP) from error
    level = [found]
    for _ in range(_MOST_DEPTH):
        level = [below for value in level if isinstance(value, list | dict) for below in _values(value)]
        if not level:
            return found
    raise ValueError(_TOO_DEEP)


def _values(value: list[Any] | dict[str, Any]) -> Iterable[Any]:
    return value.values() if isinstance(value, dict) else value


def parse_yaml(text: str) -> Any:
    """Parse a YAML text.

    Raises:
        ValueError: it is no YAML, too long, nested too deeply, or its aliases stand for too much, or themselves.
    """
    if len(text) > MOST_YAML_BYTES:
        raise ValueError(f"it has {_size(len(text))}, more than the {_size(MOST_YAML_BYTES)} allowed")
    try:
        return yaml.load(text, _Loader)
    except (yaml.YAMLError, ValueError) as error:
        is_deep = "maximum nesting depth" in str(error)  # libyaml's own limit
        raise ValueError(_TOO_DEEP if is_deep else " ".join(str(error).split())) from error
    except (ArithmeticError, AttributeError, LookupError, TypeError) as error:  # of tags: !!timestamp noon, say
        raise ValueError(f"a value does not fit its tag ({type(error).__name__}: {error})") from error


if hasattr(yaml, "CSafeLoader"):

    class _Base(Composer, yaml.CSafeLoader):
        """Python composes the nodes from events that libyaml finds, in a tenth of the time."""

        def __init__(self, text: str) -> None:
            yaml.CSafeLoader.__init__(self, text)
            Composer.__init__(self)

else:  # PyYAML was built without libyaml
    _Base = yaml.SafeLoader  # type: ignore[misc, assignment]


class _Loader(_Base):
    """YAML's safe loader with a limit on depth, and on what its aliases stand for."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._depth = self._count = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        self._depth, self._count = self._depth + 1, self._count + 1
        if self._depth > _MOST_DEPTH:
            raise ValueError(_TOO_DEEP)
        if self._count > _MOST_VALUES:
            raise ValueError(_TOO_MANY)
        found = super().compose_node(parent, index)
        self._depth -= 1
        return found

    def construct_scalar(self, node: yaml.ScalarNode | yaml.MappingNode) -> Any:
        if node.tag in _NUMBERS and len(node.value) > _MOST_DIGITS:
            raise ValueError(f"a number has {len(node.value)} digits")
        return super().construct_scalar(node)

    def compose_document(self) -> yaml.Node | None:
        found = super().compose_document()
        if found is not None:
            _count_values(found, {})
        return found


_NUMBERS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")


def _count_values(node: yaml.Node, counts: dict[yaml.Node, int | None]) -> int:
    """Count the values of a node, aliases followed; `counts` has those that are known, None on the way."""
    if node in counts:
        known = counts[node]
        if known is None:
            raise ValueError("an alias stands for something that it is part of")
        return known
    counts[node] = None
    below = node.value if isinstance(node, yaml.CollectionNode) else ()
    parts = (part for item in below for part in (item if isinstance(item, tuple) else (item,)))
    count = 1 + sum(_count_values(part, counts) for part in parts)
    if count > _MOST_VALUES:
        raise ValueError(_TOO_MANY)
    counts[node] = count
    return count


def check_archive(file: BinaryIO, most_bytes: int) -> None:
    """Check that a zip (an `.npz` too) unpacks to no more than it may.

    Raises:
        ValueError: it does not.
    """
    with zipfile.ZipFile(file) as archive:
        size = sum(info.file_size for info in archive.infolist())
    if size > most_bytes:
        raise ValueError(f"it unpacks to {_size(size)}, more than the {_size(most_bytes)} allowed")
    file.seek(0)


def _size(count: int) -> str:
    return f"{count / 1e6:.0f} MB" if count >= 1_000_000 else f"{count} bytes"


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside a path; what is written there is renamed at the end, if all went well.

    The file's mode is what the user's umask leaves of 0666, as of every file that a program makes.

    Raises:
        OSError: a folder, a device or a pipe is in its place, or nothing can be written there.
    """
    check_writable(path)
    temporary = path.with_name(f"{TEMPORARY_PREFIX}{secrets.token_hex(4)}{path.suffix.lower()}")
    os.close(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666))
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def output_path(given: Path | str) -> Path:
    """Return the path of a file or folder to be written, if it is a legal one.

    Raises:
        ConfigError: it is no path, or a device or pipe is there.
    """
    if not isinstance(given, Path | str):
        raise ConfigError(f"the path of a file or folder was expected, not {shown(given)}")
    try:
        return check_writable(given)
    except IsADirectoryError:
        return check_path(given)
    except OSError as error:
        raise ConfigError(f"cannot write {shown(str(given))}: {error.strerror}") from error


def check_output_folder(folder: Path) -> None:
    """See whether a folder can be written to, or made, without making it.

    Raises:
        ConfigError: it cannot.
    """
    folder = output_path(folder)
    existing = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    if not existing.is_dir():
        raise ConfigError(f"cannot write to {str(folder)!r}: {str(existing)!r} is not a folder")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise ConfigError(f"cannot write to {str(folder)!r}: no permission for {str(existing)!r}")


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files of `atomic_write` in a folder that no other process writes to."""
    for path in folder.glob(f"{TEMPORARY_PREFIX}*"):
        if _TEMPORARY.fullmatch(path.name) and path.is_file():
            path.unlink(missing_ok=True)


@contextmanager
def lock_folder(folder: Path, what: str = "evaluation") -> Iterator[None]:
    """Make the folder and keep others out; leaves neither the lock nor a folder made in vain.

    The lock is the kernel's (`flock`) on a file in the folder: it ends with its process, however that ends. Where
    a file system has no such locks, nothing is kept out.

    Args:
        folder: that is written to.
        what: another one of which is kept out, for the error.

    Raises:
        ConfigError: another process is at it, or the folder cannot be made.
    """
    folder = output_path(folder)
    made = [path for path in (folder, *folder.parents) if not path.exists()]  # deepest first
    try:
        handle = _lock(folder, what)
        try:
            yield
        finally:
            (folder / LOCK_FILE).unlink(missing_ok=True)  # while it is ours
            os.close(handle)
    finally:
        for path in made:
            with suppress(OSError):  # not empty
                path.rmdir()


def _lock(folder: Path, what: str) -> int:
    """Return the handle of the lock file, which is still in its place."""
    try:
        for left in reversed(range(_TRIES)):  # its last owner may remove the file, or the folder, while we take it
            try:
                handle = _try_lock(folder, what)
            except FileNotFoundError:
                if not left:
                    raise
            else:
                if handle is not None:
                    return handle
    except OSError as error:
        raise ConfigError(f"cannot write to {str(folder)!r}: {error.strerror or error}") from error
    raise ConfigError(f"cannot write to {str(folder)!r}: its lock disappears again and again")


def _try_lock(folder: Path, what: str) -> int | None:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / LOCK_FILE
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    is_ours = False
    try:
        _flock(handle)
        is_ours = os.path.samestat(os.fstat(handle), os.stat(path))
        if is_ours:
            os.ftruncate(handle, 0)
            os.pwrite(handle, str(os.getpid()).encode(), 0)
    except BlockingIOError as error:
        owner = os.pread(handle, 20, 0).decode(errors="replace")
        by = f" (process {owner})" if owner else ""
        raise ConfigError(
            f"another {what}{by} is already writing to {str(folder)!r}; choose another folder"
        ) from error
    finally:
        if not is_ours:
            os.close(handle)
    return handle if is_ours else None


def _flock(handle: int) -> None:
    """Lock it; `BlockingIOError` if somebody else has."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise


def temporary_folder(prefix: str) -> tuple[str, int]:
    """Make a temporary folder and lock it; remove those of processes that were killed, which nobody locks.

    Args:
        prefix: of its name, and of theirs.

    Returns:
        Its path, and the handle of the lock, to be closed when it is removed; -1 where there are no locks.
    """
    pattern = os.path.join(glob.escape(tempfile.gettempdir()), prefix + "?" * 8)
    for old in glob.glob(pattern):
        with suppress(OSError):
            handle = _locked(old)
            try:  # while it is ours: whoever has just made it would lock it otherwise, and lose it
                shutil.rmtree(old, ignore_errors=True)
            finally:
                os.close(handle)
    while True:
        folder = tempfile.mkdtemp(prefix=prefix)
        try:
            return folder, _locked(folder)
        except (BlockingIOError, FileNotFoundError):  # another process takes it for one that was left
            continue
        except OSError:  # there are no locks
            return folder, -1


def _locked(folder: str) -> int:
    """Return the handle of a folder that is locked, and still in its place."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if not os.path.samestat(os.fstat(handle), os.stat(folder)):
            raise FileNotFoundError(folder)
    except OSError:
        os.close(handle)
        raise
    return handle

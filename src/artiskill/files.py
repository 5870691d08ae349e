"""Files and names that strangers give: read whole, within limits, and never anything but a regular file.

What is wrong with a file or a name comes out as an `OSError` with a reason in plain words, as the system's own
errors do; what is wrong with its text, as a `ValueError`. Whoever reads turns them into an error of its own kind,
with the file's name.
"""

import errno
import io
import json
import os
import stat
import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any, BinaryIO

import yaml

from artiskill.errors import shown

MOST_JSON_BYTES = 100_000_000  # a manifest has 400 bytes for each object
MOST_YAML_BYTES = 500_000  # a split file has 20 bytes for each object; PyYAML reads about 100 kB a second
_MOST_BYTES = 2 * 1024**3
_MOST_NAME_BYTES, _MOST_PATH_BYTES = 255, 4095  # of Linux: NAME_MAX, PATH_MAX without its end
_MOST_DEPTH = 50  # of nested lists and mappings: the deepest of ours is 6
_MOST_VALUES = 50_000  # of a YAML text, each as often as aliases repeat it
_MOST_DIGITS = 1000  # of a number in YAML, which may count in sixties: 1:1:1:...
_TOO_DEEP = f"it is nested more than {_MOST_DEPTH} levels deep"
_TOO_MANY = f"it has more than {_MOST_VALUES} values, what aliases stand for included"


def check_path(path: Path | str) -> Path:
    """The path, if a file could bear it.

    Raises:
        OSError: it holds NUL, or text that is no UTF-8, or is too long.
    """
    text = str(path)
    if "\0" in text:
        raise OSError(errno.EINVAL, "a path holds no NUL", shown(text))
    try:
        raw = os.fsencode(text)
    except UnicodeEncodeError as error:
        raise OSError(errno.EILSEQ, "it is not valid UTF-8", shown(text)) from error
    if len(raw) > _MOST_PATH_BYTES or max(map(len, raw.split(b"/"))) > _MOST_NAME_BYTES:
        raise OSError(errno.ENAMETOOLONG, os.strerror(errno.ENAMETOOLONG), shown(text))
    return Path(path)


def open_regular(path: Path | str) -> io.BufferedReader:
    """A regular file, open for reading: no device, which may never end, and no pipe, which may never begin.

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


def read_bytes(path: Path | str, most_bytes: int = _MOST_BYTES) -> bytes:
    """A regular file's content.

    Raises:
        OSError: it cannot be read, is no regular file, or is larger than it may be.
    """
    with open_regular(path) as file:
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise OSError(errno.EFBIG, f"it has more than the {_size(most_bytes)} that are legal", str(path))
    return content


def read_text(path: Path | str, most_bytes: int = _MOST_BYTES, errors: str = "strict") -> str:
    """A regular file's text, UTF-8.

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
    """The path, if a file may be written there: nothing is there, or a regular file, perhaps behind a link.

    Raises:
        OSError: its name is none, or it is a folder, a device or a pipe, or nobody may look.
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
    """What a JSON text says.

    Raises:
        ValueError: it is no JSON, too long, or nested too deeply.
    """
    if len(text) > MOST_JSON_BYTES:
        raise ValueError(f"it has {_size(len(text))}, more than the {_size(MOST_JSON_BYTES)} that are legal")
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
    """What a YAML text says.

    Raises:
        ValueError: it is no YAML, too long, nested too deeply, or its aliases stand for too much, or themselves.
    """
    if len(text) > MOST_YAML_BYTES:
        raise ValueError(f"it has {_size(len(text))}, more than the {_size(MOST_YAML_BYTES)} that are legal")
    try:
        return yaml.load(text, _Loader)
    except (yaml.YAMLError, ValueError) as error:
        raise ValueError(" ".join(str(error).split())) from error
    except (ArithmeticError, AttributeError, LookupError, TypeError) as error:  # of tags: !!timestamp noon, say
        raise ValueError(f"a value does not fit its tag ({type(error).__name__}: {error})") from error


class _Loader(yaml.SafeLoader):
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
    """How many values a node stands for, aliases followed; `counts` has those that are known, None on the way."""
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
    """See whether a zip, `.npz` say, unpacks to no more than it may.

    Raises:
        ValueError: it does not.
    """
    with zipfile.ZipFile(file) as archive:
        size = sum(info.file_size for info in archive.infolist())
    if size > most_bytes:
        raise ValueError(f"it unpacks to {_size(size)}, more than the {_size(most_bytes)} that are legal")
    file.seek(0)


def _size(count: int) -> str:
    return f"{count / 1e6:.0f} MB" if count >= 1_000_000 else f"{count} bytes"

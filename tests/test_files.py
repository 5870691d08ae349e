"""Files and names of strangers: limits, regular files only, one reason in plain words."""

import os
import time
from pathlib import Path

import pytest

from artiskill.errors import ArtiSkillError, UnknownNameError, closest, shown
from artiskill.files import (
    check_path,
    check_writable,
    is_file,
    is_folder,
    open_regular,
    parse_json,
    parse_yaml,
    read_bytes,
    read_text,
)

IMPOSSIBLE = {
    "nul": "a\0b",
    "surrogate": "\ud800",
    "long name": "x" * 256,
    "long path": "/".join(["d"] * 3000),
}


@pytest.mark.parametrize("name", IMPOSSIBLE.values(), ids=IMPOSSIBLE)
def test_names_that_no_file_can_bear(name: str) -> None:
    assert not is_file(name)
    assert not is_folder(name)
    for use in (check_path, check_writable, open_regular, read_bytes, read_text):
        with pytest.raises(OSError):  # noqa: PT011 - `strerror` is what is looked at
            use(name)
    with pytest.raises(OSError) as caught:  # noqa: PT011
        check_path(Path(name))
    assert caught.value.strerror
    assert len(str(caught.value)) < 500


def test_longest_legal_names(tmp_path: Path) -> None:
    path = tmp_path / ("ä" * 127)  # 254 bytes
    path.write_text("a")
    assert read_text(check_path(path)) == "a"


def test_only_regular_files_are_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("/dev/zero")
    for path in (tmp_path / "pipe", tmp_path / "link", Path("/dev/zero")):
        start = time.monotonic()
        with pytest.raises(OSError, match="not a regular file"):
            open_regular(path)
        with pytest.raises(OSError, match="not a regular file"):
            check_writable(path)
        assert time.monotonic() - start < 1
    with pytest.raises(IsADirectoryError):
        open_regular(tmp_path)
    (tmp_path / "file").write_bytes(b"12345")
    (tmp_path / "good").symlink_to("file")
    assert read_bytes(tmp_path / "good", 5) == b"12345"
    with pytest.raises(OSError, match="more than the 4 bytes"):
        read_bytes(tmp_path / "good", 4)


def laughs(levels: int) -> str:
    lines = ["- &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"- &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, levels)]
    return "\n".join(lines)


BAD_YAML = {
    "deep lists": ("[" * 5000, "nested more than 50"),
    "deep mappings": ("{a: " * 5000, "nested more than 50"),
    "deep blocks": ("? " * 5000, "nested more than 50"),
    "a billion laughs": (laughs(12), "what aliases stand for"),
    "many values": ("- a\n" * 60_000, "more than 50000 values"),
    "an alias in itself": ("&a [*a]", "part of"),
    "a merged alias in itself": ("&a {<<: *a}", "part of"),
    "long": ("a" * 600_000, "legal"),
    "timestamp": ("!!timestamp noon", "does not fit its tag"),
    "bool": ("!!bool noon", "does not fit its tag"),
    "empty int": ("!!int ''", "does not fit its tag"),
    "no day": ("2001-99-99", "month"),
    "digits": ("9" * 5000, "5000 digits"),
    "sixties": ("1:" * 100_000 + "1", "digits"),
    "NUL": ("a: \0", "not allowed"),
    "python": ("!!python/object/apply:os.system [id]", "constructor"),
}


@pytest.mark.parametrize(("text", "reason"), BAD_YAML.values(), ids=BAD_YAML)
def test_yaml_within_limits(text: str, reason: str) -> None:
    start = time.process_time()
    with pytest.raises(ValueError, match=reason) as caught:
        parse_yaml(text)
    assert time.process_time() - start < 5
    assert "\n" not in str(caught.value)


def test_legal_yaml_is_as_it_was() -> None:
    assert parse_yaml("a: &x [1, 2.5]\nb: *x\nc: {<<: {d: 1}, e: 1e-3}") == {
        "a": [1, 2.5],
        "b": [1, 2.5],
        "c": {"d": 1, "e": "1e-3"},
    }
    assert parse_yaml("") is None
    assert parse_yaml("[" * 40 + "]" * 40)


@pytest.mark.parametrize("text", ["[" * 100_000, "[" * 60 + "]" * 60, '{"a":' * 990, "9" * 5000, b"\xff", '"', ""])
def test_json_within_limits(text: str | bytes) -> None:
    with pytest.raises(ValueError):  # noqa: PT011 - json's own, or ours
        parse_json(text)


def test_legal_json_is_as_it_was() -> None:
    assert parse_json(b'{"a": [1, {"b": "[[["}], "c": "\\ud800"}') == {"a": [1, {"b": "[[["}], "c": "\ud800"}


class Evil:
    def __getattr__(self, name: str) -> object:
        raise RuntimeError("no")

    def __repr__(self) -> str:
        raise RuntimeError("no")


def test_whatever_is_shown_is_short() -> None:
    nested: list[object] = []
    for _ in range(60):
        nested = [nested] * 9
    for value in (10**5000, "x" * 10**6, nested, Evil(), [Evil()], {"a": nested}, b"x" * 10**6, "\ud800"):
        assert 0 < len(shown(value)) < 2500
    for value in ("a'b", 3, 0.1, None, [1, "a"], {"a": (1,)}, True):
        assert shown(value) == repr(value)


def test_names_are_compared_in_time() -> None:
    start = time.process_time()
    for given in ("x" * 10**6, Evil(), 10**5000, ["a"]):
        message = str(UnknownNameError("task", given, ["PushChair"] * 1000))
        assert "unknown task" in message
        assert len(message) < 2500
    assert time.process_time() - start < 1
    assert closest("PushChiar", ["PushChair", "MoveBucket"]) == "PushChair"


def test_a_very_long_message_is_cut_in_its_middle() -> None:
    message = str(ArtiSkillError("begin" + "x" * 10**6 + "end"))
    assert message.startswith("begin")
    assert message.endswith("end")
    assert len(message) < 2100

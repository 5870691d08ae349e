"""Files and names of strangers: limits, regular files only, one reason in plain words."""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from runpy import run_path
from typing import Any

import pytest
import yaml

from artiskill import files
from artiskill.errors import ArtiSkillError, ConfigError, UnknownNameError, closest, shown
from artiskill.files import (
    LOCK_FILE,
    TEMPORARY_PREFIX,
    atomic_write,
    check_path,
    check_writable,
    is_file,
    is_folder,
    lock_folder,
    open_regular,
    output_path,
    parse_json,
    read_bytes,
    read_text,
    remove_leftovers,
    temporary_folder,
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
        assert time.monotonic() - start < 60
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
    "deep lists": ("[" * 500, "nested more than 50"),
    "deeper lists": ("[" * 5000, "nested more than 50"),
    "deep mappings": ("{a: " * 500, "nested more than 50"),
    "deep blocks": ("? " * 5000, "nested more than 50"),
    "a billion laughs": (laughs(12), "what aliases stand for"),
    "many values": ("- a\n" * 60_000, "more than 50000 values"),
    "an alias in itself": ("&a [*a]", "part of"),
    "a merged alias in itself": ("&a {<<: *a}", "part of"),
    "long": ("a" * 600_000, "allowed"),
    "timestamp": ("!!timestamp noon", "does not fit its tag"),
    "bool": ("!!bool noon", "does not fit its tag"),
    "empty int": ("!!int ''", "does not fit its tag"),
    "no day": ("2001-99-99", "month"),
    "digits": ("9" * 5000, "5000 digits"),
    "sixties": ("1:" * 100_000 + "1", "digits"),
    "NUL": ("a: \0", "not allowed"),
    "python": ("!!python/object/apply:os.system [id]", "constructor"),
}


@pytest.fixture(params=["libyaml", "PyYAML alone"])
def parse_yaml(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Any]:
    """The parser of a PyYAML that was built with libyaml, and of one that was not."""
    if request.param == "PyYAML alone":
        monkeypatch.delattr(yaml, "CSafeLoader", raising=False)
    elif not hasattr(yaml, "CSafeLoader"):
        pytest.skip("this PyYAML was built without libyaml")
    found: Callable[[str], Any] = run_path(files.__file__)["parse_yaml"]
    return found


@pytest.mark.parametrize(("text", "reason"), BAD_YAML.values(), ids=BAD_YAML)
def test_yaml_within_limits(parse_yaml: Callable[[str], Any], text: str, reason: str) -> None:
    start = time.process_time()
    with pytest.raises(ValueError, match=reason) as caught:
        parse_yaml(text)
    assert time.process_time() - start < 5
    assert "\n" not in str(caught.value)


def test_legal_yaml(parse_yaml: Callable[[str], Any]) -> None:
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
    assert closest("export", ["report", "export-policy"]) == "export-policy", "what was given is its first word"


def test_a_very_long_message_is_cut_in_its_middle() -> None:
    message = str(ArtiSkillError("begin" + "x" * 10**6 + "end"))
    assert message.startswith("begin")
    assert message.endswith("end")
    assert len(message) < 2100


def test_all_or_nothing(tmp_path: Path) -> None:
    path = tmp_path / "file.txt"
    path.write_text("old")
    with pytest.raises(UnicodeEncodeError), atomic_write(path) as temporary:
        temporary.write_text("half \u00e4", encoding="ascii")
    assert path.read_text() == "old"
    with atomic_write(path) as temporary:
        temporary.write_text("new")
        assert temporary.suffix == ".txt"
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_leftovers(tmp_path: Path) -> None:
    """Those of `atomic_write` go; what anybody else calls alike stays."""
    with atomic_write(tmp_path / "file.h5") as temporary:
        ours = temporary
    (tmp_path / "file.h5").rename(ours)  # as a killed process leaves it
    (tmp_path / f"{TEMPORARY_PREFIX}of-my-own.txt").touch()
    (tmp_path / "file.txt").touch()
    remove_leftovers(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"{TEMPORARY_PREFIX}of-my-own.txt", "file.txt"]


def test_regular_files_only(tmp_path: Path) -> None:
    """What is no regular file stays what it is; links stand for devices, lest a fault here harm the machine."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "device").symlink_to("/dev/null")
    (tmp_path / "folder").mkdir()
    for name in ("pipe", "device", "folder"):
        kind = (tmp_path / name).lstat().st_mode
        with pytest.raises(OSError, match=r"regular file|directory"), atomic_write(tmp_path / name):
            pytest.fail("it was opened")
        assert (tmp_path / name).lstat().st_mode == kind
    for name in ("pipe", "device"):
        with pytest.raises(ConfigError, match="not a regular file"):
            output_path(tmp_path / name)
    assert output_path(tmp_path / "folder") == tmp_path / "folder"
    for bad in ("a\0b", "x" * 300, "\ud800", None, 3):
        with pytest.raises(ConfigError):
            output_path(bad)  # type: ignore[arg-type]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["device", "folder", "pipe"]


@pytest.mark.parametrize("umask", [0o022, 0o077, 0o002])
def test_files_have_the_users_umask(tmp_path: Path, umask: int) -> None:
    before = os.umask(umask)
    try:
        (tmp_path / "usual").touch()
        with atomic_write(tmp_path / "ours.PNG") as temporary:
            temporary.write_text("a")
    finally:
        os.umask(before)
    assert (tmp_path / "ours.PNG").stat().st_mode == (tmp_path / "usual").stat().st_mode


HOLD = """
import sys, time
from pathlib import Path
from artiskill.files import lock_folder
with lock_folder(Path(sys.argv[1])):
    print("holds", flush=True)
    time.sleep(60)
"""


def test_one_at_a_time(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "out"
    with lock_folder(folder):
        with pytest.raises(
            ConfigError, match=rf"another evaluation \(process {os.getpid()}\) is already writing to '{folder}'"
        ):
            lock_folder(folder).__enter__()
        (folder / "result").touch()
        assert (folder / LOCK_FILE).exists()
    assert [path.name for path in folder.iterdir()] == ["result"]
    with lock_folder(folder):
        pass


def test_nothing_made_in_vain_stays(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    with pytest.raises(KeyboardInterrupt), lock_folder(tmp_path / "mine" / "a" / "b"):
        raise KeyboardInterrupt
    assert [path.name for path in tmp_path.rglob("*")] == ["mine"]


def test_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, match="Not a directory"), lock_folder(tmp_path / "file" / "out"):
        pass


def test_the_lock_of_a_killed_process_is_none(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        with pytest.raises(ConfigError, match=rf"process {process.pid}\b"), lock_folder(tmp_path):
            pass
        process.send_signal(signal.SIGKILL)
    assert (tmp_path / LOCK_FILE).read_text() == str(process.pid)
    with lock_folder(tmp_path):
        assert (tmp_path / LOCK_FILE).read_text() == str(os.getpid())
    assert not list(tmp_path.iterdir())


def test_a_lock_on_a_file_that_is_gone_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The last owner removes its file, and another one makes a new one, between our look at it and our lock."""
    flock, calls = files._flock, []

    def late(handle: int) -> None:
        calls.append(handle)
        if len(calls) == 1:
            (tmp_path / LOCK_FILE).unlink()
            (tmp_path / LOCK_FILE).touch()
        flock(handle)

    monkeypatch.setattr(files, "_flock", late)
    with lock_folder(tmp_path):
        assert len(calls) == 2
        assert (tmp_path / LOCK_FILE).read_text() == str(os.getpid())


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no /proc")
def test_a_folder_that_no_file_system_takes() -> None:
    with (
        pytest.raises(ConfigError, match="cannot write to '/proc/demos': No such file"),
        lock_folder(Path("/proc/demos")),
    ):
        pass


def test_the_error_says_what_is_kept_out(tmp_path: Path) -> None:
    with (
        lock_folder(tmp_path),
        pytest.raises(ConfigError, match=r"another collector \(process"),
        lock_folder(tmp_path, "collector"),
    ):
        pass


def test_a_folder_that_is_removed_cannot_be_locked_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another process has just made it, and is about to lock it: it must not take what we are about to remove."""
    left, remove = tmp_path / "work-abcdefgh", shutil.rmtree
    left.mkdir()

    def late(folder: str, **options: bool) -> None:
        with pytest.raises(BlockingIOError):
            files._locked(folder)
        remove(folder, **options)

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(shutil, "rmtree", late)
    folder, lock = temporary_folder("work-")
    os.close(lock)
    assert [str(path) for path in tmp_path.iterdir()] == [folder]


def test_a_temporary_folder_that_another_process_removed_is_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened, open_file = list[str](), os.open

    def late(path: str, flags: int) -> int:
        handle = open_file(path, flags)
        opened.append(path)
        if len(opened) == 1:
            os.rmdir(path)
        return handle

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with monkeypatch.context() as patched:
        patched.setattr(files.os, "open", late)
        folder, lock = temporary_folder("work-")
    os.close(lock)
    assert opened[0] != opened[1] == folder
    assert Path(folder).is_dir()

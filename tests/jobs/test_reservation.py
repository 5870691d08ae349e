import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from artiskill.errors import ConfigError
from artiskill.jobs import reservation
from artiskill.jobs.reservation import LOCK_FILE, reserved

HOLD = """
import sys, time
from pathlib import Path
from artiskill.jobs.reservation import reserved
with reserved(Path(sys.argv[1])):
    print("holds", flush=True)
    time.sleep(60)
"""


def test_one_at_a_time(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "out"
    with reserved(folder):
        with pytest.raises(
            ConfigError, match=rf"another evaluation \(process {os.getpid()}\) writes to '{folder}'"
        ):
            reserved(folder).__enter__()
        (folder / "result").touch()
        assert (folder / LOCK_FILE).exists()
    assert [path.name for path in folder.iterdir()] == ["result"]
    with reserved(folder):
        pass


def test_nothing_made_in_vain_stays(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    with pytest.raises(KeyboardInterrupt), reserved(tmp_path / "mine" / "a" / "b"):
        raise KeyboardInterrupt
    assert [path.name for path in tmp_path.rglob("*")] == ["mine"]


def test_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, match="Not a directory"), reserved(tmp_path / "file" / "out"):
        pass


def test_the_lock_of_a_killed_process_is_none(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        with pytest.raises(ConfigError, match=rf"process {process.pid}\b"), reserved(tmp_path):
            pass
        process.send_signal(signal.SIGKILL)
    assert (tmp_path / LOCK_FILE).read_text() == str(process.pid)
    with reserved(tmp_path):
        assert (tmp_path / LOCK_FILE).read_text() == str(os.getpid())
    assert not list(tmp_path.iterdir())


def test_a_lock_on_a_file_that_is_gone_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The last owner removes its file, and another one makes a new one, between our look at it and our lock."""
    flock, calls = reservation._flock, []

    def late(handle: int) -> None:
        calls.append(handle)
        if len(calls) == 1:
            (tmp_path / LOCK_FILE).unlink()
            (tmp_path / LOCK_FILE).touch()
        flock(handle)

    monkeypatch.setattr(reservation, "_flock", late)
    with reserved(tmp_path):
        assert len(calls) == 2
        assert (tmp_path / LOCK_FILE).read_text() == str(os.getpid())


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no /proc")
def test_a_folder_that_no_file_system_takes() -> None:
    with (
        pytest.raises(ConfigError, match="cannot write to '/proc/demos': No such file"),
        reserved(Path("/proc/demos")),
    ):
        pass


def test_the_error_says_what_is_kept_out(tmp_path: Path) -> None:
    with (
        reserved(tmp_path),
        pytest.raises(ConfigError, match=r"another collector \(process"),
        reserved(tmp_path, "collector"),
    ):
        pass

"""Processes that are forked from a clean one: what they begin with, and that none is left."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from artiskill.errors import PolicyError
from artiskill.jobs import parallel as parallel_module
from artiskill.jobs import worker as worker_module
from artiskill.jobs.fork_server import ForkServer, fork_server
from artiskill.jobs.parallel import run_jobs, run_source
from artiskill.jobs.worker import NO_DEADLINE, Deadline

from .test_parallel import Doubling, fail_at_home, hang_or_stumble, square, stumble, vanish

Send = Callable[[object], None]
remembered: list[int] = []


def remember(job: int, send: Send) -> tuple[list[int], int]:
    remembered.append(job)
    return remembered, os.getpid()


def look_around(job: str, send: Send) -> tuple[str, str | None, str, int]:
    return os.getcwd(), os.environ.get(job), sys.path[0], hash("a text")


def leave(job: Path, send: Send) -> None:
    """Leaves a process that would live on, and a thread that would."""
    import threading

    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
    job.write_text(str(child.pid))
    threading.Thread(target=time.sleep, args=(600,)).start()


def hang(job: Path, send: Send) -> None:
    job.write_text(str(os.getpid()))
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    while True:
        pass


def dawdle(job: int, send: Send) -> int:
    send(Deadline(f"job {job} dawdles", 5.0))
    time.sleep(300.0 * (job == 2))
    send(NO_DEADLINE)
    return job


def fail_after_tenths(job: int, send: Send) -> None:
    for _ in range(job):
        time.sleep(0.1)
        send("messages")
    raise PolicyError(f"job {job} failed")


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def ends(pid: int) -> bool:
    """Whether a process ends soon; machines may be busy."""
    end = time.perf_counter() + 60
    while is_running(pid) and time.perf_counter() < end:
        time.sleep(0.02)
    return not is_running(pid)


@pytest.mark.parametrize("workers", [1, 2])
def test_every_job_begins_anew(workers: int) -> None:
    found = run_jobs(remember, [1, 2, 3], workers, isolated=True)
    assert [memory for memory, _ in found] == [[1], [2], [3]]
    assert len({pid for _, pid in found} | {os.getpid()}) == 4
    assert remembered == []


def test_it_begins_where_its_parent_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And with the same hashes, and so the same order of sets, as in any other run."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TEST_FORKED", "here")
    monkeypatch.syspath_prepend(str(tmp_path / "modules"))
    folder, variable, path, text_hash = run_jobs(look_around, ["TEST_FORKED"], 1, isolated=True)[0]
    assert (folder, variable, path) == (str(tmp_path), "here", str(tmp_path / "modules"))
    code = "import sys; print(hash('a text'))"
    environment = {"PYTHONHASHSEED": "0"} | os.environ
    shown = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert text_hash == int(shown.stdout)


def test_messages_results_and_sources_are_as_ever() -> None:
    messages: list[object] = []
    assert run_jobs(square, [3, 1, 2], 2, messages.append, isolated=True) == [9, 1, 4]
    assert sorted(messages, key=str) == [1, 2, 3]
    assert run_jobs(square, [], 2, isolated=True) == []
    source = Doubling(10)
    run_source(square, source, 3, isolated=True)
    assert source.results == {job: job * job for job in range(1, 11)}


@pytest.mark.parametrize("workers", [1, 2])
def test_errors_are_as_ever(workers: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker_module, "_GRACE_S", 0.2)
    monkeypatch.setattr(parallel_module, "_PATIENCE_S", 1.0)
    with pytest.raises(PolicyError, match=r"^job 0: a worker process died \(exit status 7\): because$"):
        run_jobs(vanish, [0], workers, describe="job {}".format, isolated=True, hint="because")
    with pytest.raises(RuntimeError, match=r"^HomebodyError: 3 and 4\n"):
        run_jobs(fail_at_home, [3], workers, isolated=True)
    with pytest.raises(PolicyError, match="job 1 stumbled"):
        run_jobs(stumble, [1, 2], workers, isolated=True)
    with pytest.raises(PolicyError, match="job 2 dawdles"):
        run_jobs(dawdle, [1, 2], workers, isolated=True)
    if workers == 2:
        with pytest.raises(PolicyError, match="job 1 stumbled"):
            run_jobs(hang_or_stumble, [0, 1], workers, isolated=True)


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_of_several_that_fail_the_first_in_order_counts(workers: int) -> None:
    with pytest.raises(PolicyError, match="job 5 failed"):
        run_jobs(fail_after_tenths, [5, 0, 1], workers, isolated=True)


def test_what_a_job_starts_ends_with_it(tmp_path: Path) -> None:
    start = time.perf_counter()
    run_jobs(leave, [tmp_path / "pid"], 1, isolated=True)
    assert ends(int((tmp_path / "pid").read_text()))
    assert time.perf_counter() - start < 120


def wait_for(path: Path) -> int:
    """The process id that is written to a file."""
    end = time.perf_counter() + 60
    while not (path.is_file() and path.read_text()) and time.perf_counter() < end:
        time.sleep(0.02)
    return int(path.read_text())


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_nothing_outlives_the_process_that_asked(tmp_path: Path, number: int) -> None:
    code = (
        "import signal, sys; from pathlib import Path; from artiskill.jobs.parallel import run_jobs\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        f"sys.path.insert(0, {str(Path(__file__).parents[2])!r})\n"
        "from tests.jobs.test_fork_server import hang\n"
        f"run_jobs(hang, [Path({str(tmp_path / 'pid')!r})], 1, isolated=True)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL)
    pid = wait_for(tmp_path / "pid")
    server = int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
    process.send_signal(number)
    process.wait(timeout=60)
    assert ends(pid)
    assert ends(server)


def test_a_script_needs_no_main_block(tmp_path: Path) -> None:
    """Processes never run it: not even the second line is printed twice."""
    script = tmp_path / "script.py"
    script.write_text(
        f"import sys; sys.path.insert(0, {str(Path(__file__).parents[2])!r})\nprint('begins')\n"
        "from artiskill.jobs.parallel import run_jobs\nfrom tests.jobs.test_parallel import square\n"
        "print(run_jobs(square, [1, 2, 3], 2, isolated=True))\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=True, timeout=60)
    assert (done.stdout, done.stderr) == ("begins\n[1, 4, 9]\n", "")


@pytest.fixture
def server() -> Iterator[ForkServer]:
    one = ForkServer()
    yield one
    one.close()


def count(job: int, send: Send) -> Any:
    import colorsys

    return getattr(colorsys, "prepared", None)


def prepare() -> None:
    import colorsys

    colorsys.prepared = getattr(colorsys, "prepared", 0) + 1  # type: ignore[attr-defined]


def fail_to_prepare() -> None:
    raise ValueError("not here")


def test_what_is_prepared_is_done_once_and_its_errors_are_nobodys(
    server: ForkServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    for call in (prepare, fail_to_prepare, prepare):
        server.prepare(call)
    monkeypatch.setattr("artiskill.jobs.parallel.fork_server", lambda: server)
    assert run_jobs(count, [1, 2], 2, isolated=True) == [1, 1]


def test_a_server_that_has_ended_is_replaced(server: ForkServer, monkeypatch: pytest.MonkeyPatch) -> None:
    first = fork_server()
    assert fork_server() is first
    server.close()
    assert not server.is_usable
    with pytest.raises(PolicyError, match="could not start"):
        server.start()
    monkeypatch.setattr("artiskill.jobs.fork_server._shared", server)
    other = fork_server()
    assert other is not server
    assert other.is_usable
    other.close()

import os
import signal
import time
from collections.abc import Callable

import pytest

from artiskill.errors import PolicyError, UnknownNameError
from artiskill.jobs import worker as worker_module
from artiskill.jobs.parallel import available_cores, run_jobs, run_source
from artiskill.jobs.worker import NO_DEADLINE, Deadline

Send = Callable[[object], None]


def square(job: int, send: Send) -> int:
    send(job)
    return job * job


def stumble(job: int, send: Send) -> int:
    send(job)
    if job == 1:
        raise PolicyError("job 1 stumbled")
    for _ in range(6000):
        time.sleep(0.05)
        send(job)
    return job


def vanish(job: int, send: Send) -> int:
    os._exit(7)


def killed(job: int, send: Send) -> None:
    if job == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.5)


def fail(job: Exception, send: Send) -> None:
    raise job


class HomebodyError(Exception):
    def __init__(self, first: int, second: int) -> None:
        super().__init__(f"{first} and {second}")


def fail_at_home(job: int, send: Send) -> None:
    raise HomebodyError(3, 4)


def hang_or_stumble(job: int, send: Send) -> None:
    if job == 1:
        time.sleep(0.3)
        raise PolicyError("job 1 stumbled")
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    while True:
        pass


def dawdle(job: int, send: Send) -> int:
    send(Deadline(f"job {job} dawdles", 5.0))
    time.sleep(300.0 * (job == 2))
    send(NO_DEADLINE)
    time.sleep(5.5)  # within no limit
    send(job)
    return job


@pytest.mark.parametrize("workers", [1, 2])
def test_results_keep_their_order_and_all_messages_arrives(workers: int) -> None:
    messages: list[object] = []
    assert run_jobs(square, [3, 1, 2], workers, messages.append) == [9, 1, 4]
    assert sorted(messages, key=str) == [1, 2, 3]


class Doubling:
    """Names 1, then, when it has finished, the two numbers below twice that, and so on, up to a most one."""

    def __init__(self, most: int) -> None:
        self.most, self.waiting, self.given, self.results = most, [1], list[int](), dict[int, int]()

    def next(self) -> int | None:
        if not self.waiting:
            return None
        self.given.append(self.waiting.pop(0))
        return self.given[-1]

    def finished(self, number: int, result: int) -> None:
        job = self.given[number]
        self.results[job] = result
        self.waiting += [new for new in (2 * job, 2 * job + 1) if new <= self.most]


@pytest.mark.parametrize("workers", [1, 3])
def test_jobs_that_are_not_known_beforehand(workers: int) -> None:
    source, messages = Doubling(10), list[object]()
    run_source(square, source, workers, messages.append)
    assert source.results == {job: job * job for job in range(1, 11)}
    assert sorted(messages, key=str) == sorted(range(1, 11), key=str)


@pytest.mark.parametrize("workers", [1, 3])
def test_no_jobs(workers: int) -> None:
    source = Doubling(0)
    source.waiting = []
    run_source(square, source, workers)
    assert source.results == {}
    assert run_jobs(square, [], workers) == []


def test_an_error_ends_the_other_jobs() -> None:
    start = time.perf_counter()
    with pytest.raises(PolicyError, match="job 1 stumbled"):
        run_jobs(stumble, [0, 1, 2, 3], 2)
    assert time.perf_counter() - start < 120  # one job to its end takes five minutes


def test_a_vanished_worker_is_explained() -> None:
    with pytest.raises(PolicyError, match=r"^job [01]: a worker process died \(exit status 7\)"):
        run_jobs(vanish, [0, 1], 2, describe="job {}".format)
    with pytest.raises(PolicyError, match=r"^1: a worker process died \(killed by signal 9, Killed\)"):
        run_jobs(killed, [0, 1], 2)


class Doomed:
    """Ends the process that unpacks it."""

    def __init__(self, how: str) -> None:
        self.how = how

    def __reduce__(self) -> tuple[Callable[[str], object], tuple[str]]:
        return eval, (self.how,)

    def __call__(self, job: int, send: Send) -> None:
        """Nobody comes so far."""


@pytest.mark.parametrize(
    ("code", "how"),
    [
        ("__import__('os').kill(__import__('os').getpid(), 9)", "killed by signal 9, Killed"),
        ("__import__('os')._exit(7)", "exit status 7"),
    ],
)
def test_a_worker_that_ends_while_it_unpacks_its_job_is_explained(code: str, how: str) -> None:
    with pytest.raises(PolicyError, match=rf"^[01]: a worker process died \({how}\): memory ran out"):
        run_jobs(Doomed(code), [0, 1], 2)


def test_a_function_that_cannot_be_imported_is_an_error_of_its_job() -> None:
    with pytest.raises(AttributeError, match="of_a_script"):
        run_jobs(Doomed("__import__('time').of_a_script"), [0, 1], 2)


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("error", [UnknownNameError("thing", "a", ["b"]), KeyError("x")])
def test_errors_are_the_same_for_any_number_of_workers(workers: int, error: Exception) -> None:
    with pytest.raises(type(error)) as caught:
        run_jobs(fail, [error, error], workers)
    assert str(caught.value) == str(error)
    if workers > 1:
        assert "in fail\n" in caught.value.__notes__[0]


def test_an_error_that_cannot_travel_is_told_by_its_text() -> None:
    with pytest.raises(RuntimeError, match=r"^HomebodyError: 3 and 4\n"):
        run_jobs(fail_at_home, [3, 4], 2)


def test_a_hanging_job_does_not_hold_an_error_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker_module, "_GRACE_S", 0.2)
    start = time.perf_counter()
    with pytest.raises(PolicyError, match="job 1 stumbled"):
        run_jobs(hang_or_stumble, [0, 1], 2)
    assert time.perf_counter() - start < 120


def test_a_job_of_another_process_may_have_a_time_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker_module, "_GRACE_S", 0.2)
    messages: list[object] = []
    start = time.perf_counter()
    with pytest.raises(PolicyError, match="job 2 dawdles"):
        run_jobs(dawdle, [0, 2], 1, messages.append, isolated=True)
    assert time.perf_counter() - start < 120
    assert messages == [0]


def test_cores() -> None:
    assert 1 <= available_cores() <= (os.cpu_count() or 1)

"""What the foreman makes of what the driver says is tested without Ray; the same contract with it is slow."""

import importlib.util
import logging
import os
import signal
import socket
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any, cast

import pytest

from artiskill.errors import ClusterError, ConfigError, MissingExtraError, UnknownNameError
from artiskill.jobs import ray_jobs
from artiskill.jobs.ray_driver import do_at_node, facts
from artiskill.jobs.ray_jobs import RayCluster, RayProcess, connected
from artiskill.jobs.worker import pack

from .test_parallel import Doubling, fail_at_home
from .two_nodes import TwoNodes, children

Send = Callable[[object], None]


def square(job: int, send: Send) -> int:
    send(job)
    send(-job)
    return job * job


def stumble(job: int, send: Send) -> int:
    send(job)
    if job == 1:
        raise UnknownNameError("job", "1", ["2"])
    time.sleep(60)
    return job


def vanish(job: int, send: Send) -> None:
    os._exit(7)


def linger(job: tuple[int, int], send: Send) -> int:
    """Send something, and, at the node with the raylet that is named, stay for long."""
    number, raylet = job
    send(number)
    if os.getppid() == raylet:
        time.sleep(60)
    return number


def doze(job: int, send: Send) -> None:
    send(job)
    time.sleep(60 * job)


def take_time(job: Path, send: Send) -> bool:
    """Whether another one is at it."""
    try:
        job.mkdir()
    except FileExistsError:
        return False
    time.sleep(0.05)
    job.rmdir()
    return True


class Listed:
    """A list of jobs."""

    def __init__(self, jobs: list[Any]) -> None:
        self.waiting, self.results = deque(jobs), dict[int, Any]()

    def next(self) -> Any | None:
        return self.waiting.popleft() if self.waiting else None

    def finished(self, number: int, result: Any) -> None:
        self.results[number] = result


class FakeProcess:
    """A driver with room for three jobs, without Ray; it says what it is told to say first."""

    address = "fake:1"

    def __init__(self, *first: tuple[Any, ...]) -> None:
        self.messages, self.jobs, self.has_next = deque(first), dict[int, bytes](), False

    def send(self, message: Any) -> None:
        self.has_next = bool(message)
        if isinstance(message, tuple):
            self.jobs[message[0]] = message[1]

    def receive(self, most_s: float) -> tuple[Any, ...] | None:
        if self.has_next and len(self.jobs) < 3:
            return ("want",)
        if self.messages:
            return self.messages.popleft()
        if not self.jobs:
            time.sleep(most_s)
            return None
        self.has_next = True
        number, packed = self.jobs.popitem()  # the last one first
        return "ended", number, do_at_node(packed, facts())


def run_fake(function: Any, source: Any, *messages: tuple[Any, ...], **options: Any) -> None:
    ray_jobs._RemoteRun(cast(RayProcess, FakeProcess(*messages)), function, source, **options).run()


def test_results_and_messages() -> None:
    source, messages = Doubling(10), list[object]()
    run_fake(square, source, on_message=messages.append)
    assert source.results == {job: job * job for job in range(1, 11)}
    assert messages[:2] == [1, -1]
    assert sorted(messages, key=str) == sorted([*range(1, 11), *range(-10, 0)], key=str)


def test_no_jobs() -> None:
    run_fake(square, Listed([]))


def test_an_error_comes_after_the_messages_before_it() -> None:
    messages: list[object] = []
    with pytest.raises(UnknownNameError, match="unknown job '1'") as caught:
        run_fake(stumble, Listed([1]), on_message=messages.append)
    assert messages == [1]
    assert "in stumble\n" in caught.value.__notes__[0]


def test_losses_are_logged_and_then_no_longer_borne(caplog: pytest.LogCaptureFixture) -> None:
    source = Listed([5])
    with caplog.at_level(logging.WARNING):
        run_fake(square, source, ("lost", 0, "its node died", True), describe="job {}".format)
    assert caplog.messages == ["job 5: lost, and started again (its node died)"]
    assert source.results == {0: 25}
    with pytest.raises(ClusterError, match="job 5: cannot be done at the Ray cluster: its node died"):
        run_fake(square, Listed([5]), ("lost", 0, "its node died", False), describe="job {}".format)


def test_a_node_with_another_installation() -> None:
    different = do_at_node(pack(square, 5), facts() | {"numpy": "1.0"})
    with pytest.raises(ClusterError, match=r"node .+ would give other results \(numpy .+ there, 1\.0 here\)"):
        run_fake(square, Listed([5]), ("ended", 0, different))


def test_without_nodes_there_is_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ray_jobs, "_NO_CPU_S", 0.0)
    monkeypatch.setattr(ray_jobs, "_POLL_S", 0.01)
    with pytest.raises(ClusterError, match="'fake:1' has had no node with a CPU for 0 s"):
        run_fake(square, Listed([5]), ("cpus", 0))
    source = Listed([5])
    monkeypatch.setattr(ray_jobs, "_NO_CPU_S", 60.0)
    run_fake(square, source, ("cpus", 0), ("cpus", 2))
    assert source.results == {0: 25}


with_ray = pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="needs the extra `distributed`")


@pytest.fixture(scope="module")
def nodes(root: Path) -> Iterator[TwoNodes]:
    nodes = TwoNodes(root)
    yield nodes
    nodes.close()


@pytest.mark.slow
@with_ray
def test_jobs_on_a_cluster(nodes: TwoNodes, tmp_path: Path) -> None:
    with connected(RayCluster(nodes.address)) as run:
        for most in (10, 5):  # one after the other
            source, messages = Doubling(most), list[object]()
            run(square, source, on_message=messages.append)
            assert source.results == {job: job * job for job in range(1, most + 1)}
            assert sorted(messages, key=str) == sorted([*range(1, most + 1), *range(-most, 0)], key=str)
    with connected(RayCluster(nodes.address, most_jobs=1)) as run:
        alone = Listed([tmp_path / "token"] * 10)
        run(take_time, alone)
        assert all(alone.results.values())


@pytest.mark.slow
@with_ray
def test_errors_on_a_cluster(nodes: TwoNodes) -> None:
    messages: list[object] = []
    with (
        pytest.raises(UnknownNameError, match="unknown job '1'") as caught,
        connected(RayCluster(nodes.address)) as run,
    ):
        run(stumble, Listed([0, 1, 2, 3]), on_message=messages.append)
    assert messages == [1]
    assert "in stumble\n" in caught.value.__notes__[0]
    wait_until(nodes, at_work=False)  # the jobs that would have slept on
    with (
        pytest.raises(RuntimeError, match=r"^HomebodyError: 3 and 4\n"),
        connected(RayCluster(nodes.address)) as run,
    ):
        run(fail_at_home, Listed([3, 4]))


@pytest.mark.slow
@with_ray
def test_a_job_that_ends_its_process(nodes: TwoNodes, caplog: pytest.LogCaptureFixture) -> None:
    with (
        caplog.at_level(logging.WARNING),
        pytest.raises(ClusterError, match=r"job 3: cannot be done at the Ray cluster: .*worker died"),
        connected(RayCluster(nodes.address)) as run,
    ):
        run(vanish, Listed([3]), describe="job {}".format)
    assert len(caplog.messages) == 4
    assert caplog.messages[0].startswith("job 3: lost, and started again (")


@pytest.mark.slow
@with_ray
def test_other_versions_on_a_cluster(nodes: TwoNodes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ray_jobs, "facts", lambda: facts() | {"numpy": "1.0"})
    with (
        pytest.raises(ClusterError, match=r"node .+ would give other results \(numpy .+ there, 1\.0 here\)"),
        connected(RayCluster(nodes.address)) as run,
    ):
        run(square, Listed([3]))


@pytest.mark.slow
@with_ray
def test_ctrl_c_cancels_the_jobs(nodes: TwoNodes) -> None:
    def interrupt(messages: object) -> None:
        wait_until(nodes, at_work=True)
        os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt), connected(RayCluster(nodes.address)) as run:
        run(doze, Listed([0, 1, 2, 3]), on_message=interrupt)
    wait_until(nodes, at_work=False)


@pytest.mark.slow
@with_ray
def test_a_lost_node(root: Path, caplog: pytest.LogCaptureFixture) -> None:
    nodes, source, messages = TwoNodes(root), Listed([]), list[object]()
    try:
        source.waiting.extend((number, nodes.raylets[1]) for number in range(6))
        nodes.kill(1)
        with caplog.at_level(logging.WARNING), connected(RayCluster(nodes.address)) as run:
            run(linger, source, on_message=messages.append, describe=str)
        nodes.wait_until_killed()
    finally:
        nodes.close()
    assert source.results == {number: number for number in range(6)}
    assert sorted(messages, key=str) == list(range(6))  # what the killed one told is not heard twice
    assert len(caplog.messages) == 1
    assert "lost, and started again (" in caplog.messages[0]


@pytest.mark.slow
@with_ray
def test_a_lost_head(root: Path) -> None:
    nodes = TwoNodes(root)
    try:
        nodes.kill(0)
        with (
            pytest.raises(ClusterError, match=rf"the Ray cluster at '{nodes.address}' is lost \(exit status"),
            connected(RayCluster(nodes.address)) as run,
        ):
            run(linger, Listed([(0, nodes.raylets[0]), (1, nodes.raylets[1])] * 2))
    finally:
        nodes.close()


def wait_until(nodes: TwoNodes, at_work: bool) -> None:
    """Wait until any job is under way, or none is."""
    for _ in range(300):
        titles = [title for raylet in nodes.raylets for _, title in children(raylet)]
        if any(title.startswith(b"ray::artiskill") for title in titles) == at_work:
            return
        time.sleep(0.05)
    raise AssertionError(titles)


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if Ray were installed."""
    ray = ModuleType("ray")
    ray.__spec__ = ModuleSpec("ray", None)
    monkeypatch.setitem(sys.modules, "ray", ray)


@pytest.mark.parametrize(
    ("address", "parts"),
    [
        ("10.0.0.1:6379", ("10.0.0.1", 6379)),
        ("head.example:1", ("head.example", 1)),
        ("[::1]:6379", ("::1", 6379)),
        ("auto", None),
        ("local", None),
    ],
)
def test_legal_addresses(address: str, parts: tuple[str, int] | None) -> None:
    assert RayCluster(address).host_and_port == parts


@pytest.mark.parametrize(
    "address", ["", "10.0.0.1", ":6379", "head:", "head:0", "head:65536", "head:-1", "head:²"]
)
def test_illegal_addresses(address: str) -> None:
    with pytest.raises(UnknownNameError, match=r"unknown address of a Ray cluster .*HOST:PORT, auto, local"):
        RayCluster(address)


def test_errors_name_what_is_nearest() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'local'"):
        RayCluster("lokal")
    with pytest.raises(
        ConfigError, match="Ray Client, which is not supported: run this on a machine of the cluster"
    ):
        RayCluster("ray://head:10001")


@pytest.mark.parametrize("most", [0, -1, 1.5, True])
def test_illegal_numbers(most: int) -> None:
    with pytest.raises(ConfigError, match="workers must be a whole number of at least 1"):
        RayCluster("auto", most)


def test_without_ray(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'artiskill\[distributed\]'"):
        RayCluster("auto").check()


@pytest.mark.usefixtures("installed")
def test_somebody_must_answer() -> None:
    RayCluster("auto").check()  # only Ray knows
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
        RayCluster(address).check()
    with pytest.raises(ClusterError, match=rf"no Ray cluster at '{address}': Connection refused"):
        RayCluster(address).check()

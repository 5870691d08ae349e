"""Policies as servers: the same numbers as here, bit for bit; faults, health, and an end that leaves nothing."""

import signal
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosedError, ConnectionClosedOK, InvalidStatus
from websockets.sync.client import connect

from artiskill.errors import ArtiSkillError, ConfigError, MissingExtraError, PolicyError, UnknownNameError
from artiskill.evaluation import wire
from artiskill.evaluation.evaluate import evaluate
from artiskill.evaluation.report import Report
from artiskill.evaluation.serve import PolicyServer
from artiskill.evaluation.wire import pack, unpack

OBJECTS = ["cabinet-0005", "cabinet-0010"]
SHORT = {"episode_steps": 6}
WITH_MEMORY = """
import random
import numpy as np

class Policy:
    obs_mode = {obs_mode!r}
    control_mode = "operational_space"
    {declared}

    def __init__(self):
        self.seen = np.zeros(13)

    def reset(self, observation, info):
        self.bias = info["episode"] + random.random() + np.random.rand()

    def act(self, observation):
        self.seen += 0.01
        total = sum(float(np.asarray(a, dtype=np.float64).sum()) for a in leaves(observation))
        return np.cos(np.arange(13) * (self.bias + total)) + self.seen

def leaves(tree):
    return [leaf for key in tree for leaf in leaves(tree[key])] if isinstance(tree, dict) else [tree]
"""
FAILING = """
import numpy as np
def policy(observation):
    if observation[-3] != 1.5:
        return np.zeros(13)
    return {}["gripper"]
"""


@contextmanager
def serving(policy: Any, *options: Any) -> Iterator[tuple[PolicyServer, list[str]]]:
    events: list[str] = []
    with PolicyServer(policy, 0, "127.0.0.1", *options, on_event=events.append) as server:
        thread = threading.Thread(target=server.run)
        thread.start()
        yield server, events
    thread.join(10)
    assert not thread.is_alive()


def assert_same(one: Report, other: Report) -> None:
    assert one.protocol == other.protocol
    assert one.episodes == other.episodes, "success, flags, lengths, rewards and the last states' digests"
    for mine, theirs in zip(one.episodes, other.episodes, strict=True):
        assert mine.actions.tobytes() == theirs.actions.tobytes()


DECLARED = {
    "state": "",
    "pointcloud": "sampling = {'num_points': 48, 'frame': 'end_effector', 'method': 'shares', 'settings': "
    "{'shares': [8, 8, 16, 16]}}; observation_config = {'cameras.width': 64}",
    "rgbd": "observation_config = {'cameras': {'width': 40, 'height': 24}}",
}


@pytest.mark.parametrize("obs_mode", DECLARED)
def test_a_solution_acts_as_here(solution: Callable[[str], Path], obs_mode: str) -> None:
    path = solution(WITH_MEMORY.format(obs_mode=obs_mode, declared=DECLARED[obs_mode]))
    local = evaluate("OpenCabinetDrawer", path, OBJECTS, 2, config=SHORT)
    with serving(path) as (server, events):
        remote = evaluate("OpenCabinetDrawer", server.url, OBJECTS, 2, config=SHORT, workers=2)
    assert_same(remote, local)
    assert sum("ended after 12 answers" in event for event in events) == len(OBJECTS)
    assert local.episodes[0].actions.tobytes() != local.episodes[1].actions.tobytes()


@pytest.mark.parametrize("task", ["OpenCabinetDrawer", "PushChair"])
def test_a_trained_policy_acts_as_here(task: str) -> None:
    objects = "generated:cabinet:1000000" if task == "OpenCabinetDrawer" else "generated:chair:1000000"
    local = evaluate(task, "pretrained", [objects], 1, config={"episode_steps": 40})
    with serving("pretrained", task) as (server, _):
        remote = evaluate(task, server.url, [objects], 1, config={"episode_steps": 40})
    assert_same(remote, local)
    assert remote.sampling == local.sampling
    assert remote.sampling is not None


def test_a_function_is_told_its_modes(solution: Callable[[str], Path]) -> None:
    path = solution("import numpy as np\ndef policy(observation):\n    return np.sin(observation['agent'][:22])\n")
    with serving(path, None, "pointcloud", "operational_space") as (server, _):
        assert unpack(server.metadata)["control_mode"] == "operational_space"
        seen = {"cameras.width": 32, "cameras.height": 16}
        remote = evaluate("PushChair", server.url, ["chair-0001"], 1, config=SHORT | seen)
    modes = {"obs_mode": "pointcloud", "control_mode": "operational_space"}
    assert_same(remote, evaluate("PushChair", path, ["chair-0001"], 1, config=SHORT | seen, **modes))


def test_a_fault_is_told_to_both_and_ends_one_connection(solution: Callable[[str], Path]) -> None:
    state = {
        "observation/state": np.zeros(38, np.float32),
        "observation/environment_state": np.zeros(37, np.float32),
    }
    bad = state | {"observation/state": np.full(38, 1.5, np.float32)}
    path = solution(FAILING)
    with serving(path) as (server, events), connect(server.url) as well, connect(server.url) as ill:
        for connection in (well, ill):
            assert unpack(connection.recv())["obs_mode"] == "state"
        ill.send(pack(state))
        assert unpack(ill.recv())["actions"].tolist() == [[0.0] * 13]
        ill.send(pack(bad))
        said = ill.recv()
        assert isinstance(said, str)
        assert "Traceback (most recent call last)" in said
        assert said.strip().endswith(f"{path}: policy() raised KeyError: 'gripper' (line 6, episode 0, step 1)")
        with pytest.raises(ConnectionClosedError) as caught:
            ill.recv()
        assert caught.value.rcvd.code == 1011
        well.send(pack(state))
        assert unpack(well.recv())["server_timing"]["infer_ms"] > 0
        assert any("ended by a fault: " in event and "KeyError: 'gripper'" in event for event in events)


@pytest.mark.parametrize(
    ("message", "says"),
    [
        ("hello", "the client sends a text; an observation is a binary message"),
        (b"\xc1", "the client sends a message that is not msgpack"),
        (pack({"step": 1}), "an observation needs 'observation/state'"),
        (pack({"observation/state": np.zeros(5), "observation/environment_state": np.zeros(5)}), "has 5 numbers"),
    ],
)
def test_a_clients_faults(solution: Callable[[str], Path], message: Any, says: str) -> None:
    path = solution(FAILING)
    with serving(path) as (server, _), connect(server.url) as client:
        client.recv()
        client.send(message)
        assert says in str(client.recv())


def test_health_and_keys(solution: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch) -> None:
    path = solution(FAILING)
    monkeypatch.setenv(wire.API_KEY, "secret")
    with serving(path) as (server, _):
        with urllib.request.urlopen(server.url.replace("ws", "http", 1) + "/healthz", timeout=60) as answer:
            assert (answer.status, answer.read()) == (200, b"OK\n")
        for headers in ({}, {"Authorization": "Api-Key Secret"}):
            with pytest.raises(InvalidStatus, match="401"):
                connect(server.url, additional_headers=headers)
        with pytest.raises(InvalidStatus, match="403"):  # as a page in a browser asks
            connect(
                server.url, origin="http://evil.example", additional_headers={"Authorization": "Api-Key secret"}
            )
        assert evaluate("OpenCabinetDrawer", server.url, OBJECTS[:1], 1, config=SHORT).total.episodes == 1


@pytest.mark.parametrize(
    ("policy", "options", "error", "says"),
    [
        ("expert", (), PolicyError, "expert needs the simulation itself, and a server only gets observations"),
        ("random", (), PolicyError, "random needs the simulation itself"),
        ("pretrained", (), ConfigError, "pretrained is another policy for each task: give --task"),
        ("ws://localhost:8000", (), PolicyError, "is a server already"),
        ("nothing.py", (), PolicyError, "does not exist"),
        ("expart", (), UnknownNameError, "did you mean 'expert'"),
        ("pretrained", ("PushChair", "state"), PolicyError, "the policy needs obs_mode 'pointcloud', but 'state'"),
        ("pretrained", ("PushChair", None, "torque"), UnknownNameError, "unknown control_mode 'torque'"),
    ],
)
def test_what_cannot_be_served(policy: str, options: Any, error: type[ArtiSkillError], says: str) -> None:
    with pytest.raises(error, match=says):
        PolicyServer(policy, 0, "127.0.0.1", *options)


def test_addresses(solution: Callable[[str], Path]) -> None:
    path = solution(FAILING)
    with serving(path) as (server, _):
        port = int(server.url.rsplit(":", 1)[1])
        with pytest.raises(
            ConfigError, match=rf"cannot listen to 127\.0\.0\.1, port {port}: Address already in use"
        ):
            PolicyServer(path, port)
    with pytest.raises(ConfigError, match="a port must lie in"):
        PolicyServer(path, 70000)
    with pytest.raises(ConfigError, match=r"cannot listen to no\.such.host.invalid"):
        PolicyServer(path, 0, "no.such.host.invalid")


def test_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "msgpack", None)
    with pytest.raises(MissingExtraError, match=r"artiskill\[remote\]"):
        PolicyServer("pretrained", task="PushChair")


@contextmanager
def running(command: list[str]) -> Iterator[subprocess.Popen[str]]:
    made = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # also in the background
    )
    try:
        yield made
    finally:
        made.kill()
        made.communicate()


THINKS = """
import time
def policy(observation):
    time.sleep(600)
"""


def test_ctrl_c_ends_everything(solution: Callable[[str], Path]) -> None:
    """With a client that waits for a policy that thinks forever."""
    path = solution(THINKS)
    command = [sys.executable, "-m", "artiskill", "serve", str(path), "--port", "0"]
    with running(command) as made:
        assert made.stdout is not None
        line = made.stdout.readline()
        assert line.startswith(f"serving {path} at ws://127.0.0.1:"), line
        assert line.endswith("; Ctrl-C ends\n")
        with connect(line.split()[3].rstrip(";")) as client:
            client.recv()
            client.send(pack({"observation/state": np.zeros(38), "observation/environment_state": np.zeros(37)}))
            time.sleep(0.5)
            begun = descendants(made.pid)
            assert begun, "what the policy thinks in"
            made.send_signal(signal.SIGINT)
            with pytest.raises(ConnectionClosedOK, match=r"1001 .* the server ends"):
                client.recv(timeout=60)
        out, err = made.communicate(timeout=60)
    assert made.returncode == 130
    assert err == ""
    assert "Traceback" not in out
    end = time.monotonic() + 60
    while (left := [pid for pid in begun if is_alive(pid)]) and time.monotonic() < end:
        time.sleep(0.1)
    assert not left


def descendants(pid: int) -> list[int]:
    """The processes that a process has begun, and those that they have."""
    parents: dict[int, list[int]] = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            number, rest = path.read_text().split(" ", 1)
            parents.setdefault(int(rest.rsplit(") ", 1)[1].split()[1]), []).append(int(number))
    found = list(parents.get(pid, []))
    for child in found:
        found += parents.get(child, [])
    return found


def is_alive(pid: int) -> bool:
    try:
        return ") Z " not in Path("/proc", str(pid), "stat").read_text()
    except OSError:
        return False

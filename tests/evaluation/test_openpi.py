"""Policies and clients in Pythons without this package: openpi's own client and server, and the example.

`make test-openpi` names a Python in OPENPI_PYTHON that has `openpi-client`, of the openpi project, and
`openpi-server`, which is openpi's `websocket_policy_server.py` as a package.
"""

import importlib.util
import json
import os
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artiskill.errors import PolicyError
from artiskill.evaluation.evaluate import evaluate
from artiskill.evaluation.report import Report
from artiskill.evaluation.serve import PolicyServer

OPENPI = os.environ.get("OPENPI_PYTHON", "")
needs_openpi = pytest.mark.skipif(not OPENPI, reason="make test-openpi runs it")
TASK, OBJECTS, SHORT = "OpenCabinetDrawer", ["cabinet-0005", "generated:cabinet:1000000"], {"episode_steps": 6}
MODES = {"obs_mode": "state", "control_mode": "joint"}
SERVER = """
import sys, threading, numpy as np
from openpi_client.base_policy import BasePolicy
from openpi_server import WebsocketPolicyServer

class Policy(BasePolicy):
    def infer(self, obs):
        if obs["step"] > int(sys.argv[3]):
            raise KeyError("gripper")
        if obs.get("reset"):
            self.count = 0
        self.count += 1
        row = np.cos(obs["observation/state"][:13] * self.count)
        return {"actions": np.stack([row, row / 2]), "extra": {"text": obs["prompt"], "half": np.float16(0.5)}}

WebsocketPolicyServer(Policy(), "127.0.0.1", int(sys.argv[1]), eval(sys.argv[2])).serve_forever()
"""
CLIENT = """
import json, sys, numpy as np
from openpi_client.action_chunk_broker import ActionChunkBroker
from openpi_client.websocket_client_policy import WebsocketClientPolicy

client = WebsocketClientPolicy("127.0.0.1", int(sys.argv[1]))
chunks = ActionChunkBroker(client, action_horizon=1)
state = {"observation/state": np.arange(38, dtype=np.float32), "observation/environment_state": np.zeros(49, "f4")}
answers = [client.infer(state | {"step": step}) for step in range(2)] + [chunks.infer(state)]
try:
    client.infer({"step": 0})
    fault = ""
except RuntimeError as error:
    fault = str(error)
print(json.dumps([client.get_server_metadata(), [a["actions"].tolist() for a in answers], fault, np.__version__]))
"""
SOLUTION = """
import numpy as np
class Policy:
    obs_mode = "state"
    def reset(self, observation, info):
        self.steps = 0
    def act(self, observation):
        self.steps += 1
        return np.cos(observation[-38:-25] * self.steps)
"""


class Chunked:
    """What the server above does, here."""

    obs_mode = "state"

    def reset(self, observation: Any, info: Any) -> None:
        self.count, self.left = 0, []  # type: ignore[var-annotated]

    def act(self, observation: Any) -> Any:
        if not self.left:
            self.count += 1
            row = np.cos(observation[-38:-25] * self.count)
            self.left = [row, row / 2]
        return self.left.pop(0)


@contextmanager
def running(*command: Any) -> Iterator[subprocess.Popen[str]]:
    made = subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, text=True)
    try:
        yield made
    finally:
        made.kill()
        made.communicate()


@contextmanager
def openpi_server(metadata: dict[str, Any], last_step: int = 99) -> Iterator[str]:
    """A server that is ready."""
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    with running(OPENPI, "-c", SERVER, port, repr(metadata), last_step):
        end = time.monotonic() + 60
        while not is_ready(port) and time.monotonic() < end:
            time.sleep(0.1)
        yield f"ws://127.0.0.1:{port}"


def is_ready(port: int) -> bool:
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/healthz", timeout=5) as answer:
            return bool(answer.read() == b"OK\n")
    except OSError:
        return False


def assert_same(one: Report, other: Report) -> None:
    assert one.episodes == other.episodes
    for mine, theirs in zip(one.episodes, other.episodes, strict=True):
        assert mine.actions.tobytes() == theirs.actions.tobytes()


@needs_openpi
def test_openpi_has_an_environment_without_this_package() -> None:
    done = subprocess.run([OPENPI, "-c", "import artiskill"], capture_output=True, text=True, timeout=60)
    assert "No module named 'artiskill'" in done.stderr


@needs_openpi
def test_openpis_server_is_evaluated() -> None:
    """Its metadata are its own affair: here, a pose."""
    with openpi_server({"reset_pose": [0.0] * 7}) as url:
        remote = evaluate(TASK, url, OBJECTS, 2, config=SHORT, **MODES)
        with pytest.raises(PolicyError, match="give --obs-mode and --control-mode"):
            evaluate(TASK, url, OBJECTS, 2, config=SHORT)
    assert_same(remote, evaluate(TASK, Chunked(), OBJECTS, 2, config=SHORT))


@needs_openpi
def test_openpis_server_may_say_what_it_needs_and_how_it_failed() -> None:
    with openpi_server(MODES | {"replan_steps": 1}, last_step=2) as url:
        says = rf"^{url}: the policy failed: KeyError: 'gripper' \(object cabinet-0005, level 0, step 3\)"
        with pytest.raises(PolicyError, match=says):
            evaluate(TASK, url, OBJECTS, 1, config=SHORT)


@needs_openpi
def test_openpis_client_is_served(tmp_path: Path) -> None:
    path = tmp_path / "solution.py"
    path.write_text(SOLUTION)
    with PolicyServer(path, 0, on_event=str) as server:
        thread = threading.Thread(target=server.run)
        thread.start()
        command = [OPENPI, "-c", CLIENT, server.url.rsplit(":", 1)[1]]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    thread.join()
    assert done.returncode == 0, done.stderr
    metadata, actions, fault, numpy = json.loads(done.stdout)
    assert metadata == {"artiskill": 1, **MODES, "replan_steps": 1}
    state = np.arange(13, dtype=np.float32)
    expected = [[np.cos(state)], [np.cos(state * 2)], np.cos(state * 3)]
    for mine, theirs in zip(actions, expected, strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-6)
    assert fault.startswith("Error in inference server:\nTraceback (most recent call last)")
    assert "an observation needs 'observation/state'" in fault
    assert numpy.startswith("1."), "openpi's client needs another NumPy than this package"


@pytest.mark.parametrize("python", [sys.executable, pytest.param(OPENPI, marks=needs_openpi)])
def test_the_example_is_evaluated(python: str, root: Path) -> None:
    """What docs/remote_policies.md says, in this Python and in one without this package."""
    path = root / "examples" / "policy_server.py"
    spec = importlib.util.spec_from_file_location("policy_server", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)

    class Local:
        obs_mode, control_mode = module.METADATA["obs_mode"], module.METADATA["control_mode"]
        sampling = {"num_points": module.METADATA["points"], "frame": module.METADATA["frame"]}  # noqa: RUF012

        def reset(self, observation: Any, info: Any) -> None:
            self.left: list[Any] = []

        def act(self, observation: Any) -> Any:
            if not self.left:
                keys = {f"observation/pointcloud/{key}": value for key, value in observation["pointcloud"].items()}
                self.left = list(module.policy(keys, False)[: module.METADATA["replan_steps"]])
            return self.left.pop(0)

    with running(python, "-I", path, 0) as made:
        assert made.stdout is not None
        url = made.stdout.readline().split()[3].rstrip(";")
        remote = evaluate(TASK, url, OBJECTS, 1, config=SHORT, workers=2)
    assert_same(remote, evaluate(TASK, Local(), OBJECTS, 1, config=SHORT))
    assert remote.episodes[0].actions[0, 0] != 0.0

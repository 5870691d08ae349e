"""`artiskill serve`, and `artiskill evaluate --policy ws://...` as a user types them."""

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from artiskill.cli.main import main
from artiskill.evaluation.serve import PolicyServer

Capture = pytest.CaptureFixture[str]
SOLUTION = """
class Policy:
    obs_mode = "pointcloud"
    sampling = {"num_points": 32, "frame": "robot"}
    def reset(self, observation, info): ...
    def act(self, observation):
        assert observation["pointcloud"]["xyz"].shape == (16, 3), observation["pointcloud"]["xyz"].shape
        return [0.0] * 13
"""
PLAYED = ["--objects", "cabinet-0005", "--episodes", "1", "--workers", "1", "--set", "episode_steps=3"]


@pytest.fixture
def url(tmp_path: Path) -> Iterator[str]:
    path = tmp_path / "solution.py"
    path.write_text(SOLUTION)
    with PolicyServer(path, 0, on_event=lambda text: None) as server:
        thread = threading.Thread(target=server.run)
        thread.start()
        yield server.url
    thread.join(10)


def test_what_overrides_the_server_is_said(url: str, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "report"
    assert main(["evaluate", "--policy", url, *PLAYED, "--points", "16", "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert f"note: points is 16, though {url} says 32\n" in said.err
    assert f"policy {url}: 0.0% solved" in said.out
    assert (out / "latency.csv").read_text().count("\n") == 1 + 3


def test_a_fault_is_one_line(url: str, capsys: Capture) -> None:
    assert main(["evaluate", "--policy", url, *PLAYED]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"error: {url}: the policy failed: ")
    assert "act() raised AssertionError: (32, 3)" in error
    assert error.endswith("(object cabinet-0005, level 0, step 0)\n")
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("command", "says"),
    [
        (["evaluate", "--policy", "random", "--points", "5"], "--points: only of a policy at ws://host:port"),
        (["evaluate", "--policy", "ws://localhost:1", *PLAYED], "no connection: Connection refused"),
        (["evaluate", "--policy", "ws://a:b@c", *PLAYED], "no passwords in addresses"),
        (["serve", "expert"], "expert needs the simulation itself, and a server only gets observations"),
        (["serve", "pretrained", "--task", "PushChair", "--sandbox", "bubble"], "did you mean 'bubblewrap'?"),
        (["serve", "pretrained"], "give --task, PushChair say"),
        (["serve", "pretrained", "--task", "PushChair", "--port", "99999"], "a port must lie in"),
    ],
)
def test_what_is_refused(command: list[str], says: str, capsys: Capture) -> None:
    assert main(command) == 2
    assert says in capsys.readouterr().err

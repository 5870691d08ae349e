"""Evaluation on a Ray cluster of two nodes: the same report, whatever is lost or interrupted."""

import importlib.util
import json
import logging
import os
import re
import signal
import sys
from pathlib import Path
from typing import Any

import pytest
from tests.jobs.two_nodes import TwoNodes

from artiskill.cli.main import main
from artiskill.errors import ClusterError, PolicyError
from artiskill.evaluation.cluster import UNFINISHED, evaluate_on_cluster
from artiskill.evaluation.evaluate import run_evaluation
from artiskill.evaluation.statistics import EpisodeResult
from artiskill.jobs.ray_jobs import RayCluster

from .test_cluster import OBJECTS, TASK, comparable, plan, solution

__all__ = ["solution"]  # a fixture
COMMAND = ["evaluate", "--task", TASK, "--objects", *OBJECTS, "--episodes", "2", "--set", "episode_steps=4"]
ROOT = Path(__file__).parents[2]

needs_ray = pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="needs the extra `distributed`")


@pytest.mark.parametrize(
    ("options", "error"),
    [
        (["--ray", "lokal"], "unknown address of a Ray cluster 'lokal'; did you mean 'local'"),
        (["--ray", "auto", "--workers", "0"], "workers must be a whole number of at least 1, not 0"),
        (["--ray", "auto"], "pip install 'artiskill[distributed]'"),
    ],
)
def test_errors_are_one_line(
    options: list[str], error: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    assert main([*COMMAND, *options]) == 2
    shown = capsys.readouterr().err
    assert error in shown
    assert len(shown.splitlines()) == 1


@pytest.mark.slow
@needs_ray
def test_a_node_is_lost(solution: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """One of two nodes is killed while it plays a row; policies travel, with what is beside them."""
    made = plan(solution)
    nodes = TwoNodes(ROOT)
    try:
        cluster = RayCluster(nodes.address)
        assert comparable(evaluate_on_cluster(plan("pretrained"), cluster)) == comparable(
            run_evaluation(plan("pretrained"))
        )
        nodes.kill(1)
        with caplog.at_level(logging.WARNING):
            found = evaluate_on_cluster(made, cluster)
        nodes.wait_until_killed()
    finally:
        nodes.close()
    assert any("lost, and started again" in message for message in caplog.messages)
    assert comparable(found) == comparable(run_evaluation(made))


def interrupt(episode: EpisodeResult) -> None:
    os.kill(os.getpid(), signal.SIGINT)


@pytest.mark.slow
@needs_ray
def test_interrupted_lost_and_gone_on(solution: Path, tmp_path: Path) -> None:
    """Ctrl-C, then the machine's own node is killed, then a cluster for the purpose."""
    folder, made = tmp_path / "report", plan(solution)
    nodes = TwoNodes(ROOT)
    try:
        cluster = RayCluster(nodes.address, most_jobs=1)
        with pytest.raises(KeyboardInterrupt):
            evaluate_on_cluster(made, cluster, interrupt, folder=folder)
        kept = len(list((folder / UNFINISHED).iterdir()))
        assert kept < 3
        nodes.kill(0)
        with pytest.raises(ClusterError, match="is lost"):
            evaluate_on_cluster(plan("expert", salt="other"), RayCluster(nodes.address))
    finally:
        nodes.close()
    heard: list[Any] = []
    found = evaluate_on_cluster(made, RayCluster("local", most_jobs=1), heard.append, folder=folder)
    assert len(heard) == 6
    assert comparable(found) == comparable(run_evaluation(made))


@pytest.mark.slow
@needs_ray
def test_the_command(solution: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """The terminal shows nothing of Ray, and errors are those of a local evaluation."""
    outs = []
    for name, options in {"ray": ["--ray", "local"], "own": []}.items():
        out = tmp_path / name
        assert main([*COMMAND, "--policy", str(solution), "--out", str(out), "--workers", "1", *options]) == 0
        outs.append(re.sub(r"in [\d.]+ s", "", capfd.readouterr().out.replace(str(out), "")))
        assert not (out / UNFINISHED).exists()
    assert outs[0] == outs[1]
    one, two = (json.loads((tmp_path / name / "report.json").read_text()) for name in ("ray", "own"))
    for found in (one, two):
        del found["timing"], found["sha256"]
    assert one == two
    solution.write_text("import numpy as np\ndef policy(observation):\n    return np.zeros(12)\n")
    with pytest.raises(PolicyError) as caught:
        evaluate_on_cluster(plan(solution), RayCluster("local"))
    assert str(caught.value).startswith(f"{solution}: policy() returned shape (12,)")

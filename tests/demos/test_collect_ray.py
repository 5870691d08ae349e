import dataclasses
import importlib.util
import logging
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.jobs.two_nodes import TwoNodes

from artiskill.assets.catalog import load_object
from artiskill.cli.main import main
from artiskill.demos.collect import collect
from artiskill.demos.demonstrator import DemoAttempt
from artiskill.demos.plan import CollectionPlan
from artiskill.errors import ClusterError
from artiskill.jobs.ray_jobs import RayCluster

from .conftest import contents

MakePlan = Callable[..., CollectionPlan]

COMMAND = ["demos", "collect", "--task", "OpenCabinetDrawer", "--objects", "cabinet-0002", "--per-object", "2"]

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
    options: list[str],
    error: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    assert main([*COMMAND, "--out", str(tmp_path / "d"), *options]) == 2
    shown = capsys.readouterr().err
    assert error in shown
    assert len(shown.splitlines()) == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@needs_ray
def test_a_node_is_lost(root: Path, plan: MakePlan, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """One of two nodes is killed while it plays a block."""
    heard = []
    nodes = TwoNodes(root)
    try:
        nodes.kill(1)
        with caplog.at_level(logging.WARNING):
            collect(plan(per_object=20), tmp_path / "ray", 1, heard.append, cluster=RayCluster(nodes.address))
        nodes.wait_until_killed()
    finally:
        nodes.close()
    assert any("lost, and started again" in message for message in caplog.messages)
    levels = [(attempt.object, attempt.target, attempt.level) for attempt in heard]
    assert len(levels) == len(set(levels))
    collect(plan(per_object=20), tmp_path / "local")
    assert contents(tmp_path / "ray") == contents(tmp_path / "local")


def interrupt(attempt: DemoAttempt) -> None:
    os.kill(os.getpid(), signal.SIGINT)


@pytest.mark.slow
@needs_ray
def test_interrupted_without_nodes_and_gone_on(
    root: Path, plan: MakePlan, drawers: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C, then the machine's own node is killed, then a cluster for the purpose, then none."""
    folder = tmp_path / "drawers"
    nodes = TwoNodes(root)
    monkeypatch.setenv("RAY_ADDRESS", nodes.address)  # there may be other clusters here
    try:
        with pytest.raises(KeyboardInterrupt):
            collect(plan(), folder, on_attempt=interrupt, cluster=RayCluster("auto"))
        nodes.kill(0)
        with pytest.raises(ClusterError, match="is lost"):
            collect(plan(per_object=500), tmp_path / "lost", cluster=RayCluster(nodes.address))
    finally:
        nodes.close()
    heard = []
    collect(plan(objects=["cabinet-0002"]), folder, 1, heard.append, cluster=RayCluster("local", most_jobs=1))
    assert len(heard) < 3  # something had been kept
    collect(plan(), folder)
    assert contents(folder) == contents(drawers)


@pytest.mark.slow
@needs_ray
def test_objects_travel(plan: MakePlan, tmp_path: Path) -> None:
    own = dataclasses.replace(load_object("cabinet-0002"), id="own-cabinet")
    made = plan(objects=[own])
    collect(made, tmp_path / "ray", cluster=RayCluster("local"))
    collect(made, tmp_path / "local")
    assert contents(tmp_path / "ray") == contents(tmp_path / "local")


@pytest.mark.slow
@needs_ray
def test_the_terminal_shows_nothing_of_ray(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main([*COMMAND, "--out", str(tmp_path / "ray"), "--ray", "local", "--workers", "1"]) == 0
    ray = capfd.readouterr()
    assert main([*COMMAND, "--out", str(tmp_path / "own"), "--workers", "1"]) == 0
    own = capfd.readouterr()
    assert ray.out.replace(str(tmp_path / "ray"), "") == own.out.replace(str(tmp_path / "own"), "")
    assert all(line.startswith("OpenCabinetDrawer, joint: ") for line in ray.err.splitlines())

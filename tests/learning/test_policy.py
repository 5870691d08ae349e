# ruff: noqa: E402
"""A run as a policy: what evaluation makes of it, in this process and in others."""

import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from tests.learning.tiny_set import SIZES, TASK, tiny_config

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.wrappers import PointCloudDownsample, Sampling
from artiskill.errors import ArtiSkillError, PolicyError
from artiskill.evaluation.evaluate import evaluate, make_develop
from artiskill.evaluation.plan import plan_evaluation
from artiskill.evaluation.policies import load_policy, trained_task
from artiskill.evaluation.report import Report
from artiskill.learning.policy import RunPolicy, load_trained
from artiskill.learning.run import LATEST, read_info
from artiskill.learning.stopping import StopSignal
from artiskill.learning.train import TrainData, train

OBJECTS = ["cabinet-0002", "cabinet-0020"]
SHORT = {"episode_steps": 5}


@pytest.fixture(scope="module", params=["bc", "bcq"])
def run(request: pytest.FixtureRequest, tiny_set: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a few steps."""
    folder = tmp_path_factory.mktemp("run") / request.param
    train(tiny_config(request.param), TrainData(tiny_set), folder, device="cpu", threads=1)
    return folder


def comparable(report: Report) -> dict[str, Any]:
    return {
        key: value
        for key, value in report.to_mapping().items()
        if key not in ("timing", "policy", "policy_sha256", "sha256")
    }


def test_what_a_run_asks_for(run: Path) -> None:
    actor = load_policy(str(run))
    assert (actor.obs_mode, actor.control_mode) == ("pointcloud", "joint")
    assert actor.sampling == Sampling(SIZES.points)


def test_actions_are_those_of_the_algorithm(run: Path) -> None:
    env = PointCloudDownsample(ManipulationEnv(TASK, OBJECTS[:1], obs_mode="pointcloud"), num_points=SIZES.points)
    observation, info = env.reset(options={"level": 3})
    policy = RunPolicy(run)
    policy.reset(observation, info)
    action = policy.act(observation)
    assert action.shape == (13,)
    assert np.abs(action).max() <= 1
    np.testing.assert_array_equal(action, policy.act(observation))
    torch.set_num_threads(2)
    try:
        np.testing.assert_array_equal(action, RunPolicy(run / LATEST).act(observation))
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(1)
    assert not load_trained(run)[2].training


def test_a_run_knows_its_task(run: Path, tmp_path: Path) -> None:
    assert trained_task(str(run)) == trained_task(run / LATEST) == TASK
    assert trained_task("expert") is None
    with pytest.raises(PolicyError, match="of no training run"):
        trained_task(tmp_path)


def test_a_served_run_acts_as_here(run: Path) -> None:
    """Of two connections at once, in a process whose torch would use several threads."""
    pytest.importorskip("msgpack")
    from artiskill.evaluation.serve import PolicyServer

    torch.set_num_threads(2)
    try:
        with PolicyServer(str(run), 0, on_event=str) as server:
            thread = threading.Thread(target=server.run)
            thread.start()
            remote = evaluate(TASK, server.url, OBJECTS, 2, config=SHORT, workers=2)
        thread.join()
    finally:
        torch.set_num_threads(1)
    assert remote.replan_steps == 1
    local = evaluate(TASK, run, OBJECTS, 2, config=SHORT)
    assert comparable(replace(remote, replan_steps=None)) == comparable(local)


def test_the_number_of_workers_changes_nothing(run: Path) -> None:
    one = evaluate(TASK, run, OBJECTS, 1, config=SHORT)
    assert one.policy == str(run)
    assert one.policy_sha256 is not None
    assert one.total.mean_length == 5
    assert comparable(evaluate(TASK, run, OBJECTS, 1, config=SHORT, workers=2)) == comparable(one)
    assert comparable(evaluate(TASK, run / LATEST, OBJECTS, 1, config=SHORT)) == comparable(one)


def test_success_on_development_objects(run: Path) -> None:
    config = tiny_config(development__episodes=2)
    develop = make_develop(config, OBJECTS, 1, read_info(run))
    # the demonstrations' configuration counts; the run's own says nothing, so episodes have all their steps
    assert develop(run / LATEST, StopSignal()) == [(name, 2, 0) for name in OBJECTS]
    stop = StopSignal()
    stop.is_set = True
    with pytest.raises(KeyboardInterrupt):
        develop(run / LATEST, stop)


def test_folders_that_are_no_runs(tmp_path: Path) -> None:
    with pytest.raises(PolicyError, match="is a folder, but of no training run"):
        plan_evaluation(TASK, str(tmp_path))
    with pytest.raises(PolicyError, match="there is no file"):
        plan_evaluation(TASK, str(tmp_path / "run.pt"))
    with pytest.raises(ArtiSkillError, match=r"Also legal: .* a training run's folder"):
        plan_evaluation(TASK, str(tmp_path / "nothing"))


def test_damaged_runs(run: Path, tmp_path: Path) -> None:
    (tmp_path / "checkpoints").mkdir()
    for name in ("run.json", "config.yaml", LATEST):
        (tmp_path / name).write_bytes((run / name).read_bytes())
    assert RunPolicy(tmp_path).control_mode == "joint"
    (tmp_path / "config.yaml").write_text("steps: 3\n")
    with pytest.raises(PolicyError, match="is missing"):
        load_policy(str(tmp_path))


def test_an_observation_of_another_robot(run: Path) -> None:
    with pytest.raises(PolicyError, match="learned OpenCabinetDrawer, with a cabinet; PushChair has a chair"):
        evaluate("PushChair", run, ["chair-0001"], 1, config=SHORT)
    with pytest.raises(PolicyError, match="were expected"):  # what is no file says nothing of its task
        evaluate("PushChair", RunPolicy(run), ["chair-0001"], 1, config=SHORT)

"""What evaluation on a cluster adds to the cluster's jobs: the policy's files, the order of errors, kept rows."""

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artiskill.errors import ConfigError, PolicyError
from artiskill.evaluation import cluster as cluster_module
from artiskill.evaluation.cluster import UNFINISHED, PolicyFiles, evaluate_on_cluster, pack_policy, remove_kept
from artiskill.evaluation.evaluate import run_evaluation
from artiskill.evaluation.plan import EvaluationPlan, plan_evaluation
from artiskill.evaluation.report import Report, report_files
from artiskill.evaluation.statistics import EpisodeResult
from artiskill.jobs.ray_jobs import RayCluster
from artiskill.jobs.worker import FAILED, do_job, pack
from artiskill.learning.array_policy import pretrained_file

TASK, OBJECTS, SHORT = "OpenCabinetDrawer", ["cabinet-0002", "cabinet-0007", "cabinet-0008"], {"episode_steps": 4}
ANYWHERE = RayCluster("local")
# a policy whose episodes differ from each other, and which needs a module and a file beside it
SOLUTION = """
from pathlib import Path
from gains.helper import GAIN
import numpy as np

WEIGHTS = np.loadtxt(Path(__file__).with_name('weights.txt'))

class Policy:
    obs_mode = 'state'
    def reset(self, observation, info):
        self.episode = info['episode']
    def act(self, observation):
        return np.full(13, GAIN) * WEIGHTS * (1 + self.episode) * np.random.rand(13)
"""


@pytest.fixture
def solution(tmp_path: Path) -> Path:
    folder = tmp_path / "mine"
    for name, text in {
        "solution.py": SOLUTION,
        "gains/__init__.py": "",
        "gains/helper.py": "GAIN = 0.25\n",
        "weights.txt": " ".join(["0.5"] * 13),
        ".git/config": "hidden",
        "__pycache__/solution.pyc": "compiled",
    }.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder / "solution.py"


@pytest.fixture
def one_node(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """A cluster of this process: jobs are pickled, as results are, and done two by two, the second one first."""
    done: list[Any] = []

    @contextmanager
    def connected(cluster: RayCluster) -> Iterator[Callable[..., None]]:
        yield run

    def run(function: Any, source: Any, describe: Callable[[Any], str]) -> None:
        number = 0
        while batch := [job for job in (source.next(), source.next()) if job is not None]:
            for k in reversed(range(len(batch))):
                done.append(describe(batch[k]))
                kind, value = do_job(pack(function, batch[k]), lambda message: None)
                if kind == FAILED:
                    raise value[0]
                source.finished(number + k, value)
            number += len(batch)

    monkeypatch.setattr(cluster_module, "connected", connected)
    return done


def plan(policy: Any, **options: Any) -> EvaluationPlan:
    return plan_evaluation(TASK, policy, OBJECTS, 2, config=SHORT, **options)


def comparable(report: Report) -> dict[str, Any]:
    files = {name: content for name, content in report_files(report).items() if name != "report.md"}
    mapping = json.loads(files.pop("report.json"))
    del mapping["timing"], mapping["sha256"]
    return {**files, "mapping": mapping, "episodes": report.episodes}


def test_the_report_is_the_local_one(solution: Path, one_node: list[Any]) -> None:
    made = plan(solution)
    heard: list[EpisodeResult] = []
    found = evaluate_on_cluster(made, ANYWHERE, heard.append)
    assert comparable(found) == comparable(run_evaluation(made))
    assert len(one_node) == 3
    assert len(heard) == 6
    actions = [episode.actions for episode in found.episodes]
    assert not np.array_equal(actions[0], actions[1])


@pytest.mark.parametrize("policy", ["expert", "random", "pretrained"])
def test_policies_of_the_package(policy: str, one_node: list[Any]) -> None:
    made = plan(policy)
    assert comparable(evaluate_on_cluster(made, ANYWHERE)) == comparable(run_evaluation(made))


def test_a_policy_that_lives_here_cannot_travel() -> None:
    with pytest.raises(ConfigError, match="given by name or path"):
        evaluate_on_cluster(plan(lambda observation: np.zeros(13)), ANYWHERE)


# -- errors -------------------------------------------------------------------------------------------------------


def test_errors_are_those_of_a_local_evaluation(solution: Path, one_node: list[Any]) -> None:
    """The second row is played first, and fails too; the path is the one that was given."""
    solution.write_text(SOLUTION.replace("        return", "        WEIGHTS['x']\n        return"))
    made = plan(solution)
    messages = []
    for run in (run_evaluation, lambda made: evaluate_on_cluster(made, ANYWHERE)):
        with pytest.raises(PolicyError) as caught:
            run(made)
        messages.append(str(caught.value))
    assert messages[0] == messages[1]
    assert "object cabinet-0002, level 0, step 0" in messages[1]
    assert len(one_node) == 2


def test_time_limits_hold_at_nodes(solution: Path, one_node: list[Any]) -> None:
    solution.write_text("import time\ndef policy(observation):\n    time.sleep(60)\n")
    with pytest.raises(PolicyError, match=r"solution\.py: no action within 2 s \(object cabinet-0002, level 0"):
        evaluate_on_cluster(plan(solution), ANYWHERE, step_timeout_s=2)


# -- files --------------------------------------------------------------------------------------------------------


def packed(policy: Path | str) -> PolicyFiles:
    found = pack_policy(str(policy))
    assert found is not None
    return found


def test_what_travels(solution: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = ["gains/__init__.py", "gains/helper.py", "solution.py", "weights.txt"]
    assert sorted(packed(solution).content) == names
    with packed(solution).unpacked() as path:
        assert Path(path).read_text() == SOLUTION
        assert Path(path).with_name("weights.txt").is_file()
    assert not os.path.exists(Path(path).parent)
    monkeypatch.chdir(solution.parent)
    assert sorted(packed("solution.py").content) == names
    assert pack_policy("expert") is None
    exported = packed(pretrained_file(TASK))
    assert list(exported.content) == [exported.main]


def test_the_digest_is_of_all_files(solution: Path) -> None:
    before = packed(solution).digest
    assert packed(solution).digest == before
    (solution.parent / "gains" / "helper.py").write_text("GAIN = 0.5\n")
    assert packed(solution).digest != before


def test_a_folder_that_is_too_large(solution: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "_MOST_FILES", 3)
    with pytest.raises(ConfigError, match="put the solution, and what it needs, into a folder of its own"):
        pack_policy(str(solution))
    monkeypatch.undo()
    monkeypatch.setattr(cluster_module, "_MOST_BYTES", 10)
    with pytest.raises(ConfigError, match="holds more than 2000 files or 0 MiB"):
        pack_policy(str(solution))


# -- kept rows ----------------------------------------------------------------------------------------------------


def interrupt_after(count: int) -> Callable[[EpisodeResult], None]:
    heard = []

    def on_episode(episode: EpisodeResult) -> None:
        heard.append(episode)
        if len(heard) == count:
            raise KeyboardInterrupt

    return on_episode


def test_finished_rows_are_kept(solution: Path, one_node: list[Any], tmp_path: Path) -> None:
    folder, made = tmp_path / "report", plan(solution)
    with pytest.raises(KeyboardInterrupt):
        evaluate_on_cluster(made, ANYWHERE, interrupt_after(3), folder=folder)
    assert len(one_node) == 2
    heard: list[EpisodeResult] = []
    found = evaluate_on_cluster(made, ANYWHERE, heard.append, folder=folder)
    assert len(one_node) == 3  # one more
    assert len(heard) == 6
    assert comparable(found) == comparable(run_evaluation(made))
    again = evaluate_on_cluster(made, ANYWHERE, folder=folder)
    assert comparable(again) == comparable(found)
    assert len(one_node) == 3
    remove_kept(folder)
    assert not (folder / UNFINISHED).exists()


def test_rows_of_another_evaluation_are_not_taken(solution: Path, one_node: list[Any], tmp_path: Path) -> None:
    folder = tmp_path / "report"
    evaluate_on_cluster(plan(solution), ANYWHERE, folder=folder)
    (solution.parent / "weights.txt").write_text(" ".join(["0.25"] * 13))
    changed = evaluate_on_cluster(plan(solution), ANYWHERE, folder=folder)
    assert len(one_node) == 6
    assert comparable(changed) == comparable(run_evaluation(plan(solution)))
    evaluate_on_cluster(plan(solution, first_level=1), ANYWHERE, folder=folder)
    assert len(one_node) == 9


def test_damaged_rows_are_played_again(solution: Path, one_node: list[Any], tmp_path: Path) -> None:
    folder, made = tmp_path / "report", plan(solution)
    evaluate_on_cluster(made, ANYWHERE, folder=folder)
    kept = sorted((folder / UNFINISHED).iterdir())
    assert [path.name for path in kept] == ["0.npz", "1.npz", "2.npz"]
    kept[0].write_bytes(kept[0].read_bytes()[:1000])
    kept[1].write_bytes(b"")
    found = evaluate_on_cluster(made, ANYWHERE, folder=folder)
    assert len(one_node) == 5
    assert comparable(found) == comparable(run_evaluation(made))


def test_a_folder_that_cannot_be_written_to(solution: Path, one_node: list[Any], tmp_path: Path) -> None:
    (tmp_path / "report").write_text("a file")
    with pytest.raises(ConfigError, match="cannot write to"):
        evaluate_on_cluster(plan(solution), ANYWHERE, folder=tmp_path / "report")

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import artiskill
from artiskill.assets.catalog import read_catalog
from artiskill.errors import ArtiSkillError, AssetError, ConfigError, PolicyError, UnknownNameError
from artiskill.evaluation.evaluate import evaluate
from artiskill.evaluation.plan import plan_evaluation
from artiskill.evaluation.report import Report, report_markdown
from artiskill.evaluation.statistics import EpisodeResult, summarize
from artiskill.jobs import worker

OBJECTS = ["cabinet-0005", "cabinet-0010"]
TASK = "OpenCabinetDrawer"
SHORT = {"episode_steps": 5}


class Still:
    obs_mode = "state"

    def reset(self, observation: np.ndarray, info: dict[str, Any]) -> None:
        pass

    def act(self, observation: np.ndarray) -> np.ndarray:
        return np.zeros(13)


@pytest.fixture(scope="module")
def report() -> Report:
    return evaluate(TASK, "expert", OBJECTS, episodes=2, first_level=5)


def comparable(report: Report) -> dict[str, Any]:
    mapping = report.to_mapping()
    mapping.pop("timing")
    mapping.pop("sha256")
    return mapping


def test_the_report_has_what_the_schema_says(report: Report) -> None:
    mapping = report.to_mapping()
    assert {"task", "success_rate", "interval", "objects", "config", "versions"} <= mapping.keys()
    keys = {
        "object",
        "target",
        "content_hash",
        "episodes",
        "successes",
        "success_rate",
        "interval",
        "flags",
        "mean_length",
        "faults",
    }
    assert [row.keys() for row in mapping["objects"]] == [keys, keys]
    assert [row["object"] for row in mapping["objects"]] == OBJECTS
    assert mapping["config"]["success"]["open_fraction"] == 0.9
    hashes = [artiskill.load_object(name).content_hash for name in OBJECTS]
    assert [row["content_hash"] for row in mapping["objects"]] == hashes
    assert mapping["versions"]["artiskill"] == artiskill.__version__
    assert {"numpy", "scipy", "numba", "llvmlite", "gymnasium", "mujoco-core"} < mapping["versions"].keys()
    assert "unknown" not in mapping["versions"].values()


def test_rows_and_total_add_up(report: Report) -> None:
    assert [(e.object, e.level) for e in report.episodes] == [(o, level) for o in OBJECTS for level in (5, 6)]
    for row in report.rows:
        assert row.stats == summarize([e for e in report.episodes if e.object == row.object])
    assert report.total.episodes == sum(row.stats.episodes for row in report.rows) == 4
    assert report.total.mean_length == np.mean([e.length for e in report.episodes])


def test_the_number_of_workers_changes_nothing(report: Report) -> None:
    assert comparable(evaluate(TASK, "expert", OBJECTS, 2, 5, workers=2)) == comparable(report)


def test_counting() -> None:
    results = [
        EpisodeResult("a", "x", level, success, length, {"open": is_open, "still": True})
        for level, (success, length, is_open) in enumerate(
            [(True, 10, True), (False, 200, True), (False, 200, False)]
        )
    ]
    stats = summarize(results)
    assert (stats.episodes, stats.successes, stats.success_rate) == (3, 1, 1 / 3)
    assert stats.flags == {"open": 2 / 3, "still": 1.0}
    assert stats.mean_length == 410 / 3
    assert stats.interval[0] < 1 / 3 < stats.interval[1]


def test_targets_can_be_drawn_fixed_or_all() -> None:
    drawn = plan_evaluation(TASK, "random", OBJECTS[:1])
    fixed = plan_evaluation(TASK, "random", OBJECTS[:1], target="link_1")
    every = plan_evaluation(TASK, "random", OBJECTS[:1], target="all")
    assert [batch.row for batch in drawn.batches] == [("cabinet-0005", "any")]
    assert [batch.row for batch in fixed.batches] == [("cabinet-0005", "link_1")]
    assert [batch.row[1] for batch in every.batches] == ["link_0", "link_1"]


def test_a_function_and_an_object_as_policy() -> None:
    still = evaluate(TASK, Still(), OBJECTS[0], 1, config=SHORT)
    same = evaluate(TASK, lambda observation: np.zeros(13), OBJECTS[0], 1, config=SHORT)
    assert still.episodes == same.episodes
    assert still.total.mean_length == 5
    assert still.success_rate == 0.0
    assert still.policy == "Still"
    assert still.policy_sha256 is None


def test_a_policy_sees_the_cloud_that_it_asks_for(solution: Callable[[str], Path]) -> None:
    path = solution(
        "import numpy as np\n"
        "class Policy:\n"
        "    obs_mode, sampling = 'pointcloud', {'num_points': 96, 'frame': 'robot'}\n"
        "    def reset(self, observation, info): pass\n"
        "    def act(self, observation):\n"
        "        assert observation['pointcloud']['xyz'].shape == (96, 3)\n"
        "        return np.clip(observation['pointcloud']['xyz'].sum() * np.ones(13), -1, 1)\n"
    )
    report = evaluate(TASK, path, OBJECTS, 1, config=SHORT)
    assert report.to_mapping()["sampling"] == {
        "num_points": 96,
        "method": "maniskill",
        "frame": "robot",
        "settings": {},
    }
    assert comparable(evaluate(TASK, path, OBJECTS, 1, config=SHORT, workers=2)) == comparable(report)


def test_a_policy_sees_by_the_cameras_that_it_asks_for(solution: Callable[[str], Path]) -> None:
    path = solution(
        "import numpy as np\n"
        "class Policy:\n"
        "    obs_mode, observation_config = 'rgbd', {'cameras.width': 32, 'cameras': {'height': 20}}\n"
        "    def reset(self, observation, info): pass\n"
        "    def act(self, observation):\n"
        "        return np.full(13, observation['rgbd']['rgb'].shape[-3] / observation['rgbd']['rgb'].shape[-2])\n"
    )
    report = evaluate(TASK, path, OBJECTS[0], 1, config=SHORT)
    cameras = report.to_mapping()["config"]["cameras"]
    assert (cameras["width"], cameras["height"]) == (32, 20)
    wider = evaluate(TASK, path, OBJECTS[0], 1, config=dict(SHORT) | {"cameras.width": 40})
    assert wider.to_mapping()["config"]["cameras"]["width"] == 40  # what the caller says comes last


def test_objects_of_ones_own() -> None:
    cabinet = artiskill.load_object("generated:8")
    report = evaluate(TASK, "random", [cabinet, "cabinet-0005"], 1, config=SHORT, workers=2)
    assert [row.object for row in report.rows] == ["generated-cabinet-8", "cabinet-0005"]


def test_a_solution_is_run_anew_for_every_object(solution: Callable[[str], Path]) -> None:
    path = solution(
        "import numpy as np\ncalls = []\n"
        "def policy(o):\n    calls.append(1)\n"
        "    if len(calls) > 10:\n        raise ValueError('too many')\n    return np.zeros(13)\n"
    )
    report = evaluate(TASK, path, OBJECTS, 2, config=SHORT)
    assert report.total.episodes == 4
    assert report.policy_sha256 is not None
    with pytest.raises(
        PolicyError, match=r"ValueError: too many \(line 6, object cabinet-0005, level 2, step 0\)"
    ):
        evaluate(TASK, path, OBJECTS, 3, config=SHORT)


@pytest.mark.parametrize("num_workers", [1, 2])
def test_an_error_is_of_the_same_kind_for_any_number_of_workers(num_workers: int) -> None:
    objects = ["cabinet-0028", "cabinet-0005"]  # of one joint, and of four
    with pytest.raises(AssetError, match="4 joints"):
        evaluate(TASK, "random", objects, 1, config=SHORT | {"max_object_joints": 1}, workers=num_workers)


def test_a_policy_that_ends_its_process_is_named_with_its_object(solution: Callable[[str], Path]) -> None:
    path = solution("import os\ndef policy(o):\n    os._exit(3)\n")
    says = rf"^{path}: its process ended \(exit status 3\): .* \(object cabinet-0010, level 0, step 0\)(\n|$)"
    with pytest.raises(PolicyError, match=says):
        evaluate(TASK, path, OBJECTS[1], 1, step_timeout_s=60)


def test_a_time_limit_for_each_action(solution: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, "_GRACE_S", 0.2)
    path = solution(
        "import time\nclass Policy:\n    obs_mode = 'state'\n"
        "    def reset(self, observation, info):\n        self.episode, self.step = info['episode'], 0\n"
        "    def act(self, observation):\n"
        "        while (self.episode, self.step) == (1, 2):\n            pass\n"
        "        self.step += 1\n        return [0.0] * 13\n"
    )
    says = rf"^{path}: no action within 4 s \(object cabinet-0005, level 3, step 2\)(\n|$)"
    with pytest.raises(PolicyError, match=says):
        evaluate(TASK, path, OBJECTS[0], 2, 2, config=SHORT, step_timeout_s=4)
    limited = evaluate(TASK, path, OBJECTS[0], 1, config=SHORT, step_timeout_s=30)
    other = evaluate(TASK, path, OBJECTS[0], 1, config=SHORT)
    assert limited.confinement == other.confinement.within(30)
    assert comparable(replace(limited, confinement=other.confinement)) == comparable(other)


def test_objects_that_are_not_the_catalogues(monkeypatch: pytest.MonkeyPatch) -> None:
    cabinet = artiskill.load_object("cabinet-0005")
    changed = replace(cabinet, bounds=cabinet.bounds + 0.01)
    says = rf"'cabinet-0005' has the content hash {changed.content_hash}, but .* {cabinet.content_hash}:"
    with pytest.raises(AssetError, match=says):
        plan_evaluation(TASK, "random", changed)
    plan_evaluation(TASK, "random", replace(changed, id="my-cabinet"))
    category, entry = read_catalog()["cabinet-0010"]
    other = replace(entry, content_hash="0123456789abcdef")
    monkeypatch.setitem(read_catalog(), "cabinet-0010", (category, other))
    with pytest.raises(AssetError, match=f"'cabinet-0010' has .* {entry.content_hash}, but .* 0123456789abcdef:"):
        plan_evaluation(TASK, "random", "cabinet-0010")


@pytest.mark.parametrize(
    ("change", "error", "says"),
    [
        ({"task": "OpenCabinetDrwer"}, UnknownNameError, "did you mean 'OpenCabinetDrawer'"),
        ({"objects": "tst"}, UnknownNameError, "tst"),
        ({"policy": "exprt"}, UnknownNameError, "did you mean 'expert'"),
        ({"episodes": 0}, ConfigError, "episodes"),
        ({"episodes": 1.5}, ConfigError, "episodes"),
        ({"first_level": -1}, ConfigError, "level"),
        ({"first_level": 2**31 - 1, "episodes": 2}, ConfigError, "level"),
        ({"target": "link_99"}, UnknownNameError, "link_99"),
        ({"obs_mode": "stat"}, UnknownNameError, "did you mean 'state'"),
        ({"control_mode": "joints"}, UnknownNameError, "did you mean 'joint'"),
        ({"config": {"episode_stps": 3}}, ConfigError, "did you mean 'episode_steps'"),
        ({"workers": 0}, ConfigError, "workers"),
        ({"workers": 2, "policy": Still()}, ConfigError, "only a policy given by name or path"),
        ({"step_timeout_s": 5, "policy": Still()}, ConfigError, "only a policy given by name or path"),
        ({"step_timeout_s": 0}, ConfigError, "time limit per step must be a positive number of seconds, not 0"),
        ({"step_timeout_s": float("nan")}, ConfigError, "not nan"),
        ({"step_timeout_s": "5"}, ConfigError, "not '5'"),
    ],
)
def test_bad_input(change: dict[str, Any], error: type[ArtiSkillError], says: str) -> None:
    arguments = {"task": TASK, "policy": "random", "objects": OBJECTS, "episodes": 1} | change
    with pytest.raises(error, match=says):
        evaluate(**arguments)


def test_another_observation_mode_than_the_policy_needs() -> None:
    with pytest.raises(PolicyError, match="needs obs_mode 'state', but 'other' was asked for"):
        evaluate(TASK, Still(), OBJECTS, 1, obs_mode="other")


@pytest.mark.parametrize(
    ("task", "objects"),
    [(TASK, OBJECTS[:1]), ("PushChair", ["chair-0012"]), ("MoveBucket", ["bucket-0002"])],
)
def test_experts_act_in_operational_space(task: str, objects: list[str]) -> None:
    report = evaluate(task, "expert", objects, episodes=1, control_mode="operational_space")
    assert (report.control_mode, report.success_rate) == ("operational_space", 1.0)
    assert "`state`, `operational_space`" in report_markdown(report)


class Forward(Still):
    """Gives the same numbers in every mode: the speed of the arm's third joint, or of the hand along its own z."""

    def __init__(self, control_mode: str | None) -> None:
        self.control_mode = control_mode
        self.seen: list[np.ndarray] = []

    def act(self, observation: np.ndarray) -> np.ndarray:
        self.seen.append(observation)
        action = super().act(observation)
        action[6] = 1.0
        return action


def test_a_policy_says_which_actions_it_gives() -> None:
    def play(needs: str | None, **asked: str) -> tuple[str, np.ndarray]:
        policy = Forward(needs)
        report = evaluate(TASK, policy, OBJECTS[:1], 1, config=SHORT, **asked)
        return report.to_mapping()["control_mode"], policy.seen[-1]

    said, twist = play("operational_space")
    asked, same = play(None, control_mode="operational_space")
    usual, other = play(None)
    assert (said, asked, usual) == ("operational_space", "operational_space", "joint")
    assert np.array_equal(twist, same)
    assert not np.allclose(twist, other, atol=1e-3)
    with pytest.raises(PolicyError, match="needs control_mode 'operational_space', but 'joint' was asked for"):
        play("operational_space", control_mode="joint")


def test_a_class_that_says_nothing_gives_joint_actions() -> None:
    with pytest.raises(PolicyError, match="needs control_mode 'joint', but 'operational_space' was asked for"):
        evaluate(TASK, Still(), OBJECTS, 1, control_mode="operational_space")

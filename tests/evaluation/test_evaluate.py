from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import artiskill
from artiskill.errors import ArtiSkillError, ConfigError, PolicyError, UnknownNameError
from artiskill.evaluation.episodes import EpisodeResult
from artiskill.evaluation.evaluate import evaluate
from artiskill.evaluation.plan import make_plan
from artiskill.evaluation.report import Report, count

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
    return mapping


def test_the_report_has_what_the_schema_says(report: Report) -> None:
    mapping = report.to_mapping()
    assert {"task", "success_rate", "interval", "objects", "config", "versions"} <= mapping.keys()
    keys = {"object", "target", "episodes", "successes", "success_rate", "interval", "flags", "mean_length"}
    assert [row.keys() for row in mapping["objects"]] == [keys, keys]
    assert [row["object"] for row in mapping["objects"]] == OBJECTS
    assert mapping["config"]["success"]["open_fraction"] == 0.9
    assert mapping["versions"]["artiskill"] == artiskill.__version__


def test_rows_and_total_add_up(report: Report) -> None:
    assert [(e.object, e.level) for e in report.episodes] == [(o, level) for o in OBJECTS for level in (5, 6)]
    for row in report.rows:
        assert row.tally == count([e for e in report.episodes if e.object == row.object])
    assert report.total.episodes == sum(row.tally.episodes for row in report.rows) == 4
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
    tally = count(results)
    assert (tally.episodes, tally.successes, tally.success_rate) == (3, 1, 1 / 3)
    assert tally.flags == {"open": 2 / 3, "still": 1.0}
    assert tally.mean_length == 410 / 3
    assert tally.interval[0] < 1 / 3 < tally.interval[1]


def test_targets_can_be_drawn_fixed_or_all() -> None:
    drawn = make_plan(TASK, "random", OBJECTS[:1])
    fixed = make_plan(TASK, "random", OBJECTS[:1], target="link_1")
    every = make_plan(TASK, "random", OBJECTS[:1], target="all")
    assert [batch.row for batch in drawn.batches] == [("cabinet-0005", "any")]
    assert [batch.row for batch in fixed.batches] == [("cabinet-0005", "link_1")]
    assert [batch.row[1] for batch in every.batches] == ["link_0", "link_1", "link_2"]


def test_a_function_and_an_object_as_policy() -> None:
    still = evaluate(TASK, Still(), OBJECTS[0], 1, config=SHORT)
    same = evaluate(TASK, lambda observation: np.zeros(13), OBJECTS[0], 1, config=SHORT)
    assert still.episodes == same.episodes
    assert still.total.mean_length == 5
    assert still.success_rate == 0.0
    assert still.policy == "Still"
    assert still.policy_sha256 is None


def test_objects_of_ones_own() -> None:
    cabinet = artiskill.load_object("generated:7")
    report = evaluate(TASK, "random", [cabinet, "cabinet-0005"], 1, config=SHORT, workers=2)
    assert [row.object for row in report.rows] == ["generated-7", "cabinet-0005"]


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


def test_faults_in_a_worker_are_told_as_well(solution: Callable[[str], Path]) -> None:
    with pytest.raises(PolicyError, match="returned None; an action is 13 finite numbers"):
        evaluate(TASK, solution("def policy(o):\n    pass\n"), OBJECTS, 1, workers=2)


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
        ({"config": {"episode_stps": 3}}, ConfigError, "did you mean 'episode_steps'"),
        ({"workers": 0}, ConfigError, "workers"),
        ({"workers": 2, "policy": Still()}, ConfigError, "only a policy given by name or path"),
    ],
)
def test_bad_input(change: dict[str, Any], error: type[ArtiSkillError], says: str) -> None:
    arguments = {"task": TASK, "policy": "random", "objects": OBJECTS, "episodes": 1} | change
    with pytest.raises(error, match=says):
        evaluate(**arguments)


def test_another_observation_mode_than_the_policy_needs() -> None:
    with pytest.raises(PolicyError, match="needs obs_mode 'state', but 'other' was asked for"):
        evaluate(TASK, Still(), OBJECTS, 1, obs_mode="other")

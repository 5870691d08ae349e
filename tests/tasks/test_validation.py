"""A task from outside that returns something else than it should: one error, once, that says what."""

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

import artiskill.envs.base
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.errors import ConfigError
from artiskill.tasks.push_chair import PushChairConfig
from artiskill.tasks.registry import make_task
from artiskill.tasks.task import Task
from artiskill.tasks.validation import check_flags, check_terms

TASK = make_task("PushChair")
FLAGS = {name: np.zeros(3, dtype=bool) for name in TASK.flag_names}
TERMS = {name: np.zeros(3) for name in TASK.reward_weights}


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"flag_names": ()}, "flag_names must be a tuple of one or more different names, not ()"),
        ({"flag_names": ("a", "a")}, "not ('a', 'a')"),
        ({"hold_steps": 0}, "hold_steps must be at least 1, not 0"),
        ({"reward_weights": {"slow": "1"}}, "the weight of 'slow' must be a finite number, not '1'"),
        ({"reward_weights": {"slow": float("nan")}}, "not nan"),
    ],
)
def test_a_task_whose_parts_are_wrong(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigError) as caught:
        replace(TASK, **changes)
    assert str(caught.value).startswith("task PushChair: ")
    assert says in str(caught.value)


def test_a_configuration_that_is_made_in_python() -> None:
    class Unchecked(PushChairConfig):
        def __post_init__(self) -> None:
            """Check nothing, not even what its base checks."""

    values = {f.name: getattr(TASK.config, f.name) for f in fields(TASK.config)}
    config = Unchecked(**values | {"episode_steps": 0})
    with pytest.raises(ConfigError, match=r"episode_steps must lie in \[1, 1000000\], not 0"):
        replace(TASK, config=config)
    with pytest.raises(ConfigError, match=r"a task's config must be a TaskConfig, not \{\}"):
        replace(TASK, config={})


@pytest.mark.parametrize(
    ("check", "given", "says"),
    [
        (check_flags, None, "flags must return a dict, name -> array of (B,), not None"),
        (
            check_flags,
            {"chair_stati" if name == "chair_static" else name: flag for name, flag in FLAGS.items()},
            "flag_names has 'chair_static', but flags returns no such flag; did you mean 'chair_stati'? It",
        ),
        (
            check_flags,
            FLAGS | {"chair_static": np.zeros(3)},
            "flag 'chair_static' must be an array of shape (B,), here (3,), with a bool for each environment; "
            "not (3,) float64",
        ),
        (check_terms, [1], "reward_terms must return a dict, name -> array of (B,), not [1]"),
        (
            check_terms,
            {"slo" if name == "slow" else name: term for name, term in TERMS.items()},
            "there is a weight for 'slow', but reward_terms returns no such term; did you mean 'slo'? It returns",
        ),
        (
            check_terms,
            TERMS | {"fast": np.zeros(3)},
            "reward_terms returns 'fast', which has no weight. Weights (0 only reports a term): hand_distance, ",
        ),
        (
            check_terms,
            TERMS | {"slow": 0.5},
            "reward term 'slow' must be an array of shape (B,), here (3,), with a number for each environment; "
            "not a float",
        ),
        (check_terms, TERMS | {"slow": np.zeros(1)}, "not (1,) float64"),
        (check_terms, TERMS | {"slow": np.zeros((3, 2))}, "not (3, 2) float64"),
        (check_terms, TERMS | {"slow": np.zeros(3, dtype=complex)}, "not (3,) complex128"),
    ],
)
def test_what_functions_return(check: Callable[[Task, Any, int], None], given: Any, says: str) -> None:
    with pytest.raises(ConfigError) as caught:
        check(TASK, given, 3)
    assert str(caught.value).startswith(f"task PushChair: {'' if says.startswith('not') else says}")
    assert says in str(caught.value)


def test_more_than_must_be() -> None:
    """Flags that only the reward asks for, terms of the stages without a weight, numbers of any kind."""
    check_flags(TASK, FLAGS | {"more": np.zeros(3, dtype=bool)}, 3)
    reporting = replace(TASK, reward_weights={"stage": 1.0})
    check_terms(reporting, TERMS | {"slow": np.zeros(3, dtype=np.float32), "upright": np.zeros(3, dtype=bool)}, 3)


def vector_of(task: Task, monkeypatch: pytest.MonkeyPatch) -> ManipulationVectorEnv:
    monkeypatch.setattr(artiskill.envs.base, "make_task", lambda name, config: task)
    return ManipulationVectorEnv(2, "PushChair", objects="chair-0001")


def test_an_environment_is_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    checked = []

    def count(self: Task, snapshot: Any, goal: Any) -> Any:
        checked.append(len(snapshot.time_s))
        return evaluate_checked(self, snapshot, goal)

    evaluate_checked = Task.evaluate_checked
    monkeypatch.setattr(Task, "evaluate_checked", count)
    envs = vector_of(TASK, monkeypatch)
    envs.reset(seed=0)
    for _ in range(3):
        envs.step(envs.action_space.sample())
    envs.reset(seed=1)
    assert checked == [2]

    first = vector_of(
        TASK.with_reward_term("lift", lambda snapshot, goal, flags: -snapshot.time_s[0], 1.0), monkeypatch
    )
    with pytest.raises(ConfigError, match=r"task PushChair: reward term 'lift' must be .* not a float64"):
        first.reset(seed=0)

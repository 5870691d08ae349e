"""The demonstrator: a style by level, flagged pushes, actions stored as played, and what ends its episodes."""

import copy
import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artiskill.assets.catalog import load_object
from artiskill.config import to_mapping
from artiskill.demos import demonstrator as module
from artiskill.demos.collect import collect
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demonstrator import DemoAttempt, Demonstrator
from artiskill.demos.plan import CollectionPlan
from artiskill.demos.recording import Recording, record
from artiskill.demos.settings import load_demos_config
from artiskill.demos.verify import verify
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import DivergedError, PolicyError, StateError
from artiskill.evaluation.policies import load_policy
from artiskill.experts.open_cabinet import OpenCabinetExpert
from artiskill.experts.registry import make_expert
from artiskill.experts.variation import load_variation
from artiskill.tasks.levels import FIRST_DEMONSTRATED
from artiskill.tasks.registry import task_names

TASK, OBJECT, TARGET = "OpenCabinetDrawer", "cabinet-0026", "link_0"
STORE = load_demos_config().store
STEP = 2.0**-STORE.action_bits
MakePlan = Callable[..., CollectionPlan]


@pytest.fixture(scope="module")
def env() -> ManipulationEnv:
    return ManipulationEnv(TASK, OBJECT)


def play(env: ManipulationEnv, level: int, target: str = TARGET, **options: object) -> Recording:
    return record(env, load_object(OBJECT), level, target, Demonstrator(env, **options), STORE)  # type: ignore[arg-type]


def style(env: ManipulationEnv, level: int, target: str = TARGET) -> dict:
    env.reset(options={"level": level, "target": target})
    player = Demonstrator(env)
    player.begin(env)
    assert player._expert is not None
    return to_mapping(player._expert.config)


def test_a_level_determines_style_and_pushes(env: ManipulationEnv) -> None:
    first, other, again = play(env, 1), play(env, 2), play(env, 1)
    np.testing.assert_array_equal(first.actions, again.actions)
    np.testing.assert_array_equal(first.disturbed, again.disturbed)
    assert first.actions.shape != other.actions.shape or (first.actions != other.actions).any()
    fresh = play(ManipulationEnv(TASK, [OBJECT, "cabinet-0002"]), 1)
    np.testing.assert_array_equal(first.actions, fresh.actions)


def test_one_player_many_episodes(env: ManipulationEnv) -> None:
    player, obj = Demonstrator(env), load_object(OBJECT)
    record(env, obj, 4, TARGET, player, STORE)
    np.testing.assert_array_equal(record(env, obj, 1, TARGET, player, STORE).actions, play(env, 1).actions)


def test_styles_differ_by_level_and_target(env: ManipulationEnv) -> None:
    one = style(env, 1)
    assert one == style(env, 1)
    assert one != style(env, 2)
    assert one != style(env, 1, "link_1")
    ranges = load_variation(TASK).ranges
    low, high = ranges["pull_speed_m_s"]
    speeds = [style(env, level)["pull_speed_m_s"] for level in range(30)]
    assert low <= min(speeds) < max(speeds) <= high
    assert len(set(speeds)) == 30


def test_styles_differ_by_object() -> None:
    """A level and the name of a link are not all."""
    one, other = (style(ManipulationEnv(TASK, name), 1) for name in (OBJECT, "cabinet-0002"))
    assert one != other


def test_style_and_pushes_are_drawn_apart(env: ManipulationEnv, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[float] = []

    def first_of(make: Any, which: int) -> Any:
        def wrapped(*arguments: Any) -> Any:
            drawn.append(copy.deepcopy(arguments[which]).uniform())
            return make(*arguments)

        return wrapped

    monkeypatch.setattr(module, "varied", first_of(module.varied, -1))
    monkeypatch.setattr(module, "Disturbance", first_of(module.Disturbance, -1))
    style(env, 1)
    assert len(set(drawn)) == 2


def test_plain_is_the_expert_itself(env: ManipulationEnv) -> None:
    found = play(env, 3, variety=False)
    assert not found.disturbed.any()
    env.reset(options={"level": 3, "target": TARGET})
    expert = make_expert(TASK, env.task.robot)
    expert.reset(env.snapshot, env.goal)
    for action in found.actions:
        np.testing.assert_allclose(action, expert.act(env.snapshot, env.goal), atol=STEP / 2)
        env.step(action)


@pytest.mark.parametrize("mode", ["joint", "operational_space"])
def test_pushed_steps_are_flagged_and_no_others(mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside it acts an undisturbed one of the same style: what it would have done in the same states."""
    env = ManipulationEnv(TASK, OBJECT, control_mode=mode)
    env.reset(options={"level": 5, "target": TARGET})
    player = Demonstrator(env)
    player.begin(env)
    variation = load_variation(TASK)
    calm = dataclasses.replace(variation.disturbance, base_m=0.0, yaw_rad=0.0, lift_m=0.0, arm_rad=0.0)
    monkeypatch.setattr(module, "load_variation", lambda task: dataclasses.replace(variation, disturbance=calm))
    beside = Demonstrator(env)
    beside.begin(env)
    flags, done = [], False
    while not done:
        action, wanted = player.act(env), beside.act(env)
        assert not beside.disturbed
        assert player.disturbed == bool((action != wanted).any())
        assert np.abs(action).max() <= 1
        np.testing.assert_array_equal(action, np.rint(action / STEP) * STEP)
        np.testing.assert_array_equal(action[-2:], wanted[-2:])  # fingers
        flags.append(player.disturbed)
        _, _, terminated, truncated, info = env.step(action)
        done = terminated or truncated
    assert info["success"], "it found back"
    assert 3 <= sum(flags) < len(flags) / 4


def test_actions_are_as_coarse_as_asked(env: ManipulationEnv) -> None:
    found = play(env, 0, action_bits=4).actions
    np.testing.assert_array_equal(found, np.rint(found * 16) / 16)


def test_evaluation_plays_what_is_collected(env: ManipulationEnv) -> None:
    """The policy `demonstrator` is the collector's demonstrator, action by action."""
    found, actor = play(env, 7), load_policy("demonstrator")
    observation, info = env.reset(options={"level": 7, "target": TARGET})
    actor.reset(env, observation, info)
    for action in found.actions:
        np.testing.assert_array_equal(actor.act(env, observation), action)
        observation, _, terminated, _, _ = env.step(action)
    assert terminated == found.success


@pytest.mark.slow
@pytest.mark.parametrize("task", task_names())
def test_every_task_is_solved_after_pushes(task: str) -> None:
    env = ManipulationEnv(task)
    env.reset(seed=0)
    obj, target = env.scene.object, env.save_state().target
    found = [record(env, obj, level, target, Demonstrator(env), STORE) for level in (0, 1, 2)]
    assert all(one.disturbed.any() for one in found)
    assert sum(one.success for one in found) >= 2


def failing(error: Exception) -> Any:
    def record(*arguments: object) -> None:
        raise error

    return record


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (np.linalg.LinAlgError("Singular matrix"), "LinAlgError"),
        (DivergedError({0: ("cabinet-0002", ("bad qpos",))}), "DivergedError"),
        (ZeroDivisionError("division by zero"), "ZeroDivisionError"),
    ],
)
def test_faults_of_an_episode_are_failed_attempts_and_are_counted(
    plan: MakePlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception, kind: str
) -> None:
    monkeypatch.setattr(module, "record", failing(error))
    heard: list[DemoAttempt] = []
    (entry,) = collect(plan(objects=["cabinet-0002"]), tmp_path, on_attempt=heard.append).files.values()
    assert [attempt.fault for attempt in heard] == [f"{kind}: {error}"] * 4
    (count,) = entry.targets
    assert (count.attempts, count.successes, count.gave_up, count.faults) == (4, 0, True, {kind: 4})
    with DemoFile(tmp_path / "cabinet-0002.h5") as file:
        assert file.header.targets == entry.targets


def test_an_action_that_is_none_is_a_failed_attempt(
    plan: MakePlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    act, calls = OpenCabinetExpert.act, []

    def once_nan(self: OpenCabinetExpert, *arguments: Any) -> np.ndarray:
        calls.append(None)
        action = act(self, *arguments)
        return action * np.nan if len(calls) == 10 else action

    monkeypatch.setattr(OpenCabinetExpert, "act", once_nan)
    (entry,) = collect(plan(objects=["cabinet-0002"], per_object=1), tmp_path).files.values()
    (count,) = entry.targets
    assert (count.attempts, count.successes, count.faults) == (2, 1, {"FloatingPointError": 1})
    assert verify(tmp_path)[0].faults == ()


def test_other_errors_name_the_episode(plan: MakePlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    episode = f"object cabinet-0002, target link_0, level {FIRST_DEMONSTRATED}"
    monkeypatch.setattr(module, "record", failing(StateError("of another task")))
    with pytest.raises(PolicyError, match=f"^{episode}: of another task$"):
        collect(plan(objects=["cabinet-0002"]), tmp_path)
    monkeypatch.setattr(module, "record", failing(KeyError("grip")))
    with pytest.raises(KeyError) as caught:
        collect(plan(objects=["cabinet-0002"]), tmp_path)
    assert caught.value.__notes__ == [episode]

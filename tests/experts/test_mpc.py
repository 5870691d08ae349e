"""The planner: its noise, its determinism, and that it improves on doing nothing; solving levels is slow."""

from typing import Any

import numpy as np
import pytest

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError, DivergedError
from artiskill.experts.mpc import Planner, coloured_noise, load_mpc_config, solve_level
from artiskill.geometry.arrays import total
from artiskill.sim.states import SimulationState

SMALL = {"samples": 12, "elites": 4, "iterations": 2, "horizon_steps": 5, "kept_elites": 2}
TASK, OBJECT = "OpenCabinetDrawer", "cabinet-0003"


def planner(env: ManipulationEnv, seed: int = 0, num_threads: int = 1, **changes: Any) -> Planner:
    config = load_mpc_config(SMALL | changes)
    rng = np.random.default_rng(seed)
    return Planner(env.task, env.scene, env.goal, env.control.joint_scale, config, rng, num_threads)


@pytest.mark.parametrize("steps", [7, 12])
@pytest.mark.parametrize("exponent", [0.0, 2.5])
def test_noise_has_unit_variance_and_the_asked_smoothness(steps: int, exponent: float) -> None:
    noise = coloured_noise((20_000, steps), exponent, np.random.default_rng(0))
    np.testing.assert_allclose(noise.var(axis=0), 1.0, atol=0.05)
    neighbours = np.corrcoef(noise[:, 2], noise[:, 3])[0, 1]
    assert neighbours > 0.4 if exponent else abs(neighbours) < 0.05


def test_a_plan_depends_on_state_and_generator_alone() -> None:
    env = ManipulationEnv(TASK, objects=OBJECT)
    env.reset(seed=0)
    state = env.save_state().simulation
    plans = [planner(env, num_threads=threads).plan(state) for threads in (1, 2)]
    np.testing.assert_array_equal(*plans)
    assert plans[0].shape == (5, 13)
    assert np.abs(plans[0]).max() <= 1
    assert not np.array_equal(plans[0], planner(env, seed=1).plan(state))
    np.testing.assert_array_equal(env.save_state().simulation.rows, state.rows)


def test_a_plan_earns_more_than_standing_still() -> None:
    env = ManipulationEnv(TASK, objects=OBJECT)
    env.reset(seed=0)
    before = env.save_state()
    plan = planner(env, samples=32, iterations=3).plan(before.simulation)
    planned = sum(float(env.step(action)[1]) for action in plan)
    env.restore_state(before)
    still = sum(float(env.step(np.zeros(13))[1]) for _ in plan)
    assert planned > still + 0.1


def test_actions_come_from_one_plan_until_it_is_used_up() -> None:
    env = ManipulationEnv(TASK, objects=OBJECT)
    env.reset(seed=0)
    state = env.save_state().simulation
    plan = planner(env, act_steps=3).plan(state)
    acting = planner(env, act_steps=3)
    np.testing.assert_array_equal([acting.act(state) for _ in range(3)], plan[:3])


class Watched:
    """A planner of an episode's first state, and what its iterations have tried."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **changes: Any) -> None:
        self.env = ManipulationEnv(TASK, objects=OBJECT)
        self.env.reset(seed=0)
        self.state = self.env.save_state().simulation
        self.planner = planner(self.env, **changes)
        self.tried: list[np.ndarray] = []
        self.values: list[np.ndarray] = []
        value_of = self.planner._values

        def watch(state: SimulationState, candidates: np.ndarray) -> np.ndarray:
            self.tried.append(candidates.copy())
            self.values.append(value_of(state, candidates))
            return self.values[-1]

        monkeypatch.setattr(self.planner, "_values", watch)

    def best(self, iteration: int, count: int) -> np.ndarray:
        """The best candidates of an iteration, in order."""
        order = np.argsort(-self.values[iteration], kind="stable")
        return self.tried[iteration][order[:count]]


def test_each_iteration_tries_the_best_of_the_last_one_again_and_the_last_one_the_mean(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen = Watched(monkeypatch)
    seen.planner.plan(seen.state)
    np.testing.assert_array_equal(seen.tried[1][:2], seen.best(0, 2))
    mean = (1 - seen.planner._config.momentum) * seen.best(0, 4).mean(axis=0)  # the first one's mean was zero
    np.testing.assert_allclose(seen.tried[1][-1], mean, atol=1e-15)
    assert not np.allclose(seen.tried[0][-1], 0.0)


def test_the_next_plan_goes_on_from_the_last_one(monkeypatch: pytest.MonkeyPatch) -> None:
    narrow = {"start_std": 1e-9, "least_std": 1e-9, "act_steps": 2}
    seen = Watched(monkeypatch, **narrow)
    slope = np.linspace(-0.5, 0.5, 5)[:, None] * np.ones(13)
    seen.planner._mean = slope
    for _ in range(3):  # the third action is of the second plan
        seen.planner.act(seen.state)
    shifted = slope[[2, 3, 4, 4, 4]]
    np.testing.assert_allclose(seen.tried[2], np.broadcast_to(shifted, (12, 5, 13)), atol=1e-6)
    np.testing.assert_array_equal(seen.tried[2][:2], seen.best(1, 2)[:, [2, 3, 4, 4, 4]])


def test_later_rewards_count_less(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = Watched(monkeypatch, discount=0.5)
    monkeypatch.setattr(seen.planner, "_reward", lambda snapshot: np.ones(12))
    seen.planner.plan(seen.state)
    np.testing.assert_array_equal(seen.values[0], np.full(12, 1 + 1 / 2 + 1 / 4 + 1 / 8 + 1 / 16))


def test_candidates_that_diverge_are_the_worst(monkeypatch: pytest.MonkeyPatch) -> None:
    calm, wild = Watched(monkeypatch), Watched(monkeypatch)
    step = wild.planner._simulation.step

    def diverge(targets: np.ndarray) -> None:
        step(targets)
        raise DivergedError({3: (OBJECT, ["BADQACC"]), 7: (OBJECT, ["BADQACC"])})

    monkeypatch.setattr(wild.planner._simulation, "step", diverge)
    for one in (calm, wild):
        one.planner.plan(one.state)
    assert np.flatnonzero(np.isneginf(wild.values[0])).tolist() == [3, 7]
    others = np.delete(np.arange(12), [3, 7])
    np.testing.assert_array_equal(wild.values[0][others], calm.values[0][others])
    assert np.isfinite(wild.tried[1]).all()


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"elites": 13}, "elites"),
        ({"act_steps": 6}, "act_steps"),
        ({"momentum": 1.0}, "momentum"),
        ({"noise_exponent": float("nan")}, "config: noise_exponent: a number was expected, not nan"),
        ({"noise_exponent": 1000}, r"noise_exponent must lie in \[0, 10\], not 1000"),
        ({"sampels": 3}, "samples"),
    ],
)
def test_illegal_values(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        load_mpc_config(SMALL | changes)


def test_only_joint_control() -> None:
    env = ManipulationEnv(TASK, objects=OBJECT, control_mode="operational_space")
    with pytest.raises(ConfigError, match="operational_space"):
        solve_level(env, 0, load_mpc_config(SMALL))


def test_an_attempt_can_be_repeated_from_its_actions() -> None:
    env = ManipulationEnv(TASK, objects=OBJECT, config={"episode_steps": 4})
    attempt = solve_level(env, 3, load_mpc_config(SMALL), num_threads=2)
    assert (attempt.steps, attempt.solved, attempt.level) == (4, False, 3)
    env.reset(seed=3)
    assert attempt.reward == total(float(env.step(action)[1]) for action in attempt.actions)


@pytest.mark.slow
def test_it_opens_a_drawer_from_the_reward_alone() -> None:
    env = ManipulationEnv(TASK, objects=OBJECT)
    assert solve_level(env, 0, load_mpc_config(), num_threads=2).solved

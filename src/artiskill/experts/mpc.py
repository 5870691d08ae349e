"""Model predictive control by the cross-entropy method, on the dense reward alone.

It knows no strategy: what it finds, the reward asks for. So it shows that a task's reward leads to success on an
object, and that the object can be solved at all: `solve_level` acts as it plans. What it does beyond the plain
method (coloured noise, elites and mean carried over from step to step) is after Pinneri et al., "Sample-efficient
Cross-Entropy Method for Real-time Planning", CoRL 2020.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from artiskill.config import CONFIG_DIR, check_positive, check_value, load_config
from artiskill.envs.control import JOINT, ActionScale
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError, DivergedError, shown
from artiskill.geometry.arrays import small_product
from artiskill.scene.scene import Scene
from artiskill.sim.simulation import Simulation
from artiskill.sim.snapshot import Snapshot
from artiskill.sim.states import SimulationState
from artiskill.tasks.levels import RngStream, level_generator
from artiskill.tasks.task import Goal, Task, stack_goals

CONFIG_PATH = CONFIG_DIR / "experts" / "mpc.yaml"
_MOST_EXPONENT = 10.0  # noise of a greater one is a constant


@dataclass(frozen=True)
class MpcConfig:
    """Values of the planner."""

    samples: int  # action sequences tried per iteration
    elites: int  # the best of them, which the next iteration's mean and spread come from
    iterations: int  # per plan
    horizon_steps: int  # environment steps looked ahead
    kept_elites: int  # best sequences that are tried again in the next iteration, and, shifted, in the next plan
    noise_exponent: float  # power spectrum of the noise along time, 1 / f**exponent; 0 is white
    start_std: float  # spread of each plan's first iteration, of actions in [-1, 1]
    least_std: float  # the spread never falls below
    momentum: float  # share of the old mean and spread that stays
    discount: float  # of rewards, per step
    act_steps: int  # environment steps acted per plan

    def __post_init__(self) -> None:
        check_positive(
            self, "samples", "elites", "iterations", "horizon_steps", "start_std", "least_std", "act_steps"
        )
        check_value(self, "elites", self.elites <= self.samples, "must not exceed samples")
        check_value(self, "kept_elites", 0 <= self.kept_elites <= self.elites, "must lie between 0 and elites")
        check_value(self, "act_steps", self.act_steps <= self.horizon_steps, "must not exceed horizon_steps")
        check_value(self, "momentum", 0 <= self.momentum < 1, "must lie in [0, 1)")
        legal = 0 <= self.noise_exponent <= _MOST_EXPONENT
        check_value(self, "noise_exponent", legal, f"must lie in [0, {_MOST_EXPONENT:g}]")
        check_value(self, "discount", 0 < self.discount <= 1, "must lie in (0, 1]")


def load_mpc_config(overrides: dict[str, Any] | None = None) -> MpcConfig:
    """Return the values of `configs/experts/mpc.yaml`, some of them changed."""
    return load_config(MpcConfig, CONFIG_PATH, overrides)


@dataclass(frozen=True)
class SolveResult:
    """What came of a level.

    Attributes:
        object: id.
        target: link.
        level: see `ManipulationEnv`.
        solved: whether the task was.
        steps: environment steps until then, or until the episode's end.
        reward: sum of the dense rewards.
        seconds: that planning and acting took.
        actions: (steps, A) float32, which solve the level again when they are repeated.
    """

    object: str
    target: str
    level: int
    solved: bool
    steps: int
    reward: float
    seconds: float
    actions: np.ndarray


def solve_level(
    env: ManipulationEnv,
    level: int,
    config: MpcConfig,
    num_threads: int = 1,
    on_step: Callable[[int, float], None] | None = None,
) -> SolveResult:
    """Plan and act until the level is solved or its episode over; the same for any number of threads.

    Args:
        env: with joint control and dense reward.
        level: to solve.
        config: of the planner.
        num_threads: that simulate.
        on_step: told steps and reward after each step.

    Raises:
        ConfigError: another control mode, or a level that is no integer in range.
    """
    if env.control.mode != JOINT:
        raise ConfigError(f"planning needs control_mode={JOINT!r}, not {shown(env.control.mode)}")
    start = time.perf_counter()
    _, info = env.reset(options={"level": level})
    rng = level_generator(level, RngStream.PLANNING)
    planner = Planner(env.task, env.scene, env.goal, env.control.joint_scale, config, rng, num_threads)
    total, done, terminated, actions = 0.0, False, False, []
    while not done:
        action = planner.act(env.save_state().simulation).astype(np.float32)
        _, reward, terminated, truncated, _ = env.step(action)
        actions.append(action)
        total, done = total + float(reward), terminated or truncated
        if on_step is not None:
            on_step(len(actions), float(reward))
    seconds = time.perf_counter() - start
    target, object_id = info["target"], info["object"]
    return SolveResult(object_id, target, level, terminated, len(actions), total, seconds, np.stack(actions))


class Planner:
    """Plans actions of one episode.

    Args:
        task: whose dense reward is maximised.
        scene: of the episode.
        goal: of the episode, B = 1.
        scale: what actions mean, of the control mode `joint`.
        config: see there.
        rng: draws the noise.
        num_threads: threads that simulate; any number gives the same plan.
    """

    def __init__(
        self,
        task: Task,
        scene: Scene,
        goal: Goal,
        scale: ActionScale,
        config: MpcConfig,
        rng: np.random.Generator,
        num_threads: int = 1,
    ) -> None:
        self._task, self._scale, self._config, self._rng = task, scale, config, rng
        self._simulation = Simulation(scene, config.samples, min(num_threads, config.samples))
        self._goal = stack_goals([goal] * config.samples)
        self._size = scale.center.size
        self._mean = np.zeros((config.horizon_steps, self._size))
        self._kept = np.zeros((0, config.horizon_steps, self._size))
        self._left: list[np.ndarray] = []

    def act(self, state: SimulationState) -> np.ndarray:
        """Return the next action, (A,), at an instant with B = 1."""
        if not self._left:
            best = self.plan(state)
            self._left = list(best[: self._config.act_steps])
            self._shift(self._config.act_steps)
        return self._left.pop(0)

    def plan(self, state: SimulationState) -> np.ndarray:
        """Return the best action sequence found, (H, A), from an instant with B = 1."""
        config = self._config
        mean, std = self._mean, np.full(self._mean.shape, config.start_std)
        best, best_value = mean, -np.inf
        for iteration in range(config.iterations):
            candidates = self._candidates(mean, std, last=iteration == config.iterations - 1)
            values = self._values(state, candidates)
            order = np.argsort(-values, kind="stable")[: config.elites]
            elites = candidates[order]
            if values[order[0]] > best_value:
                best, best_value = elites[0], values[order[0]]
            mean = config.momentum * mean + (1 - config.momentum) * elites.mean(axis=0)
            std = config.momentum * std + (1 - config.momentum) * elites.std(axis=0)
            std = np.maximum(std, config.least_std)
            self._kept = elites[: config.kept_elites]
        self._mean = mean
        return best

    def _candidates(self, mean: np.ndarray, std: np.ndarray, last: bool) -> np.ndarray:
        """(N, H, A): noise about the mean, the kept sequences, and in the last iteration the mean itself."""
        config = self._config
        shape = (config.samples, self._size, config.horizon_steps)
        noise = coloured_noise(shape, config.noise_exponent, self._rng).swapaxes(1, 2)
        candidates = np.clip(mean + std * noise, -1.0, 1.0)
        candidates[: len(self._kept)] = self._kept
        if last:
            candidates[-1] = mean
        return candidates

    def _values(self, state: SimulationState, actions: np.ndarray) -> np.ndarray:
        """Return discounted rewards of action sequences (N, H, A) from a state, (N,); -inf where they diverge."""
        self._simulation.broadcast_state(state)
        targets, rewards, diverged = self._scale.to_targets(actions), [], set[int]()
        for k in range(actions.shape[1]):
            try:
                self._simulation.step(targets[:, k])
            except DivergedError as error:  # the others have stepped
                diverged.update(error.causes)
            rewards.append(self._reward(self._simulation.snapshot()))
        weights = self._config.discount ** np.arange(len(rewards))
        values = np.asarray(small_product(weights, np.stack(rewards)))
        values[list(diverged)] = -np.inf
        return values

    def _reward(self, snapshot: Snapshot) -> np.ndarray:
        """Return dense rewards, (N,)."""
        return self._task.dense_reward(self._task.evaluate(snapshot, self._goal).reward_terms)

    def _shift(self, steps: int) -> None:
        """Return the plan goes on from the next instant; its last action is repeated."""
        self._mean = _shifted(self._mean[None], steps)[0]
        self._kept = _shifted(self._kept, steps)


def _shifted(plans: np.ndarray, steps: int) -> np.ndarray:
    """Plans (N, H, A) without their first steps, the last one repeated."""
    last = np.repeat(plans[:, -1:], steps, axis=1)
    return np.concatenate((plans[:, steps:], last), axis=1)


def coloured_noise(shape: tuple[int, ...], exponent: float, rng: np.random.Generator) -> np.ndarray:
    """Gaussian noise of unit variance whose power along the last axis falls with frequency as 1 / f**exponent.

    Args:
        shape: the last axis is time.
        exponent: 0 gives white noise; the greater, the smoother.
        rng: draws it.
    """
    steps = shape[-1]
    frequencies = np.fft.rfftfreq(steps)
    frequencies[0] = 1.0 / steps
    amplitude = frequencies ** (-exponent / 2)
    # the first and, of an even number, the last coefficient of real signals are real
    real = rng.standard_normal((*shape[:-1], len(frequencies)))
    imaginary = rng.standard_normal((*shape[:-1], len(frequencies)))
    imaginary[..., 0] = 0.0
    real[..., 0] *= np.sqrt(2.0)
    if steps % 2 == 0:
        imaginary[..., -1] = 0.0
        real[..., -1] *= np.sqrt(2.0)
    noise = np.fft.irfft((real + 1j * imaginary) * amplitude, n=steps, axis=-1)
    variance = (2 * amplitude[0] ** 2 + 4 * (amplitude[1 : (steps + 1) // 2] ** 2).sum()) / steps**2
    if steps % 2 == 0:
        variance += 2 * amplitude[-1] ** 2 / steps**2
    return np.asarray(noise / np.sqrt(variance))

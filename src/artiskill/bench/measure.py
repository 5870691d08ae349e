"""Time environments and bare engine in turn, block by block: other work on the machine slows both alike.

With one thread, time is the process's CPU time, which other work hardly touches; with more, it is the clock's.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol

import gymnasium as gym
import numpy as np

from artiskill.bench.cases import Case
from artiskill.bench.report import Measurement, resident_mb
from artiskill.envs.control import JOINT, Control
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.sampling import EpisodeSampler
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.envs.vision import PointCloudObserver
from artiskill.envs.wrappers import PointCloudDownsample
from artiskill.jobs.parallel import run_jobs
from artiskill.jobs.worker import Send
from artiskill.scene.layout import SceneLayout
from artiskill.scene.scene import Scene, cached_scene
from artiskill.sensors.observations.sampling import make_sampler
from artiskill.sim.simulation import BareEngine, Simulation
from artiskill.sim.states import InitialState
from artiskill.tasks.levels import RngStream, level_generator
from artiskill.tasks.task import Task

_EPISODE = 100  # steps; then all begin the next levels
_WARM_UP = 3  # steps, which compile kernels and fill caches
_BLOCK_S = 0.05  # what one turn of either should last
_LONGEST_BLOCK = 25
_RESETS, _RESET_SHARE = 5, 0.15  # at least so many timed resets, or this share of the case's time
_FIRST_LEVEL = 0
_METHOD = "maniskill"


@dataclass
class _Clock:
    """Seconds per environment step of all environments together, by block, and what all blocks took."""

    envs: list[float] = field(default_factory=list)
    engine: list[float] = field(default_factory=list)
    steps: int = 0
    spent_s: float = 0.0

    def note(self, env_s: float, engine_s: float, steps: int) -> None:
        self.envs.append(env_s / steps)
        self.engine.append(engine_s / steps)
        self.steps += steps
        self.spent_s += env_s + engine_s


class BenchEnv(Protocol):
    """What is timed: a single environment or a vector of them."""

    task: Task
    action_size: int

    def start(self, levels: np.ndarray) -> None:
        """Begin episodes of all environments, (B,) levels."""

    def step(self, actions: np.ndarray) -> bool:
        """Take one environment step with actions (B, A); return whether any episode is over."""

    def restart(self, envs: np.ndarray, levels: np.ndarray) -> None:
        """Begin episodes in some environments: K sorted indices, K levels."""


def make_bench_env(case: Case) -> BenchEnv:
    """Make the environments of a case."""
    return SingleBenchEnv(case) if case.num_envs == 1 else VectorBenchEnv(case)


class SingleBenchEnv:
    """A `ManipulationEnv`, without `gym.make`'s wrappers."""

    def __init__(self, case: Case) -> None:
        env = ManipulationEnv(case.task, list(case.objects), obs_mode=case.obs_mode)
        self.task, self.action_size = env.task, env.control.size
        self._env: gym.Env[Any, Any] = env
        if case.points is not None:
            self._env = PointCloudDownsample(env, _METHOD, case.points, **case.sampling)

    def start(self, levels: np.ndarray) -> None:
        """See `BenchEnv`."""
        self._env.reset(seed=int(levels[0]))

    def step(self, actions: np.ndarray) -> bool:
        """See `BenchEnv`."""
        _, _, terminated, truncated, _ = self._env.step(actions[0])
        return terminated or truncated

    def restart(self, envs: np.ndarray, levels: np.ndarray) -> None:
        """See `BenchEnv`."""
        self.start(levels)


class VectorBenchEnv:
    """A `ManipulationVectorEnv`, its observations in reused arrays."""

    def __init__(self, case: Case) -> None:
        env = ManipulationVectorEnv(
            case.num_envs,
            case.task,
            list(case.objects),
            obs_mode=case.obs_mode,
            num_threads=case.num_threads,
            copy=False,
        )
        if case.points is not None:
            sampler = make_sampler(_METHOD, case.points, case.sampling)
            env.observe_with(lambda task: PointCloudObserver(task, sampler, "world"))
        self.task, self.action_size, self._env = env.task, env.control.size, env

    def start(self, levels: np.ndarray) -> None:
        """See `BenchEnv`."""
        self._env.reset(seed=levels.tolist())

    def step(self, actions: np.ndarray) -> bool:
        """See `BenchEnv`."""
        _, _, terminated, truncated, _ = self._env.step(actions)
        return bool((terminated | truncated).any())

    def restart(self, envs: np.ndarray, levels: np.ndarray) -> None:
        """See `BenchEnv`."""
        mask, seeds = np.zeros(self._env.num_envs, dtype=bool), [0] * self._env.num_envs
        mask[envs] = True
        for env, level in zip(envs.tolist(), levels.tolist(), strict=True):
            seeds[env] = level
        self._env.reset(seed=seeds, options={"reset_mask": mask})


class EngineBaseline:
    """The bare engine on the same episodes: one batch for each layout, as the vector has.

    Args:
        task: of the episodes.
        objects: what their levels draw from.
        num_threads: threads that step.
    """

    def __init__(self, task: Task, objects: Sequence[str], num_threads: int) -> None:
        self._task, self._num_threads = task, num_threads
        self._casting = EpisodeSampler(task, list(objects))
        self._control = Control(task.robot, JOINT)
        self._groups: list[tuple[np.ndarray, BareEngine]] = []

    def start(self, levels: np.ndarray) -> None:
        """Make models and states as the environments have them at the start of these levels, (B,)."""
        self._groups = []  # the memory first
        arriving: dict[SceneLayout, list[tuple[int, Scene, InitialState]]] = {}
        for env, level in enumerate(levels.tolist()):
            obj, _ = self._casting.draw(level)
            scene = cached_scene(self._task.robot, obj, self._task.physics, self._task.props)
            state = self._task.sample_initial_state(obj, level_generator(level, RngStream.INITIAL_STATE))
            arriving.setdefault(scene.layout, []).append((env, scene, state))
        for group in arriving.values():
            simulation = Simulation(group[0][1], len(group), min(self._num_threads, len(group)))
            simulation.reset([state for *_, state in group], scenes=[scene for _, scene, _ in group])
            self._groups.append((np.array([env for env, *_ in group]), BareEngine(simulation)))

    def targets(self, actions: np.ndarray) -> list[np.ndarray]:
        """Return the drive targets of actions (B, A), for each batch."""
        values = self._control.joint_scale.to_targets(actions.astype(float))
        return [values[envs] for envs, _ in self._groups]

    def step(self, targets: Sequence[np.ndarray]) -> None:
        """Take one environment step in all batches."""
        for (_, engine), values in zip(self._groups, targets, strict=True):
            engine.step(values)

    def states(self) -> dict[int, np.ndarray]:
        """Return the engine's state of each environment."""
        return {
            env: row for envs, engine in self._groups for env, row in zip(envs.tolist(), engine.state, strict=True)
        }


def measure_alone(case: Case) -> Measurement:
    """Measure one case in a process of its own, so that its memory is its own.

    Raises:
        ArtiSkillError: what `measure_case` raised.
        PolicyError: the process ended unexpectedly: memory ran out.
    """
    return run_jobs(measure_case, [case], workers=1, isolated=True)[0]


def measure_case(case: Case, send: Send | None = None) -> Measurement:
    """Measure one case, in this process; `run_jobs` calls this with `send` in another one."""
    rng = np.random.default_rng(0)
    bench_env = make_bench_env(case)
    levels = _FIRST_LEVEL + np.arange(case.num_envs)
    step_s = _warm_up(bench_env, levels, rng)
    memory = resident_mb()
    baseline = EngineBaseline(bench_env.task, case.objects, case.num_threads)
    block = int(np.clip(_BLOCK_S / step_s, 1, _LONGEST_BLOCK))
    clock = _Clock()
    while clock.spent_s < case.seconds:
        bench_env.start(levels)
        baseline.start(levels)
        _time_episode(bench_env, baseline, clock, block, case, rng)
        levels = levels + case.num_envs
    reset_s = _time_resets(bench_env, levels - case.num_envs, case, rng)
    return _summary(case, bench_env, clock, reset_s, memory)


def _warm_up(bench_env: BenchEnv, levels: np.ndarray, rng: np.random.Generator) -> float:
    """Take a few steps; return the seconds that the last one took."""
    bench_env.start(levels)
    for _ in range(_WARM_UP):
        start = time.perf_counter()
        bench_env.step(_actions(bench_env, len(levels), 1, rng)[0])
    return time.perf_counter() - start


def _actions(bench_env: BenchEnv, num_envs: int, steps: int, rng: np.random.Generator) -> np.ndarray:
    """Return random actions, (T, B, A) float32."""
    return rng.uniform(-1, 1, (steps, num_envs, bench_env.action_size)).astype(np.float32)


def _time_episode(
    bench_env: BenchEnv, baseline: EngineBaseline, clock: _Clock, block: int, case: Case, rng: np.random.Generator
) -> None:
    """Time blocks of an episode until the case's time is up; which goes first changes from block to block."""
    for number in range(_EPISODE // block):
        actions = _actions(bench_env, case.num_envs, block, rng)
        targets = [baseline.targets(values) for values in actions]
        over = False

        def run_envs(actions: np.ndarray = actions) -> None:
            nonlocal over
            for values in actions:
                over |= bench_env.step(values)

        def run_engine(targets: list[list[np.ndarray]] = targets) -> None:
            for values in targets:
                baseline.step(values)

        if number % 2:
            engine_s, env_s = _seconds(run_engine, case), _seconds(run_envs, case)
        else:
            env_s, engine_s = _seconds(run_envs, case), _seconds(run_engine, case)
        if over:  # from here on the two would not do the same physics
            return
        clock.note(env_s, engine_s, block)
        if clock.spent_s >= case.seconds:
            return


def _time_resets(bench_env: BenchEnv, levels: np.ndarray, case: Case, rng: np.random.Generator) -> float:
    """Return the seconds of one environment's reset, to levels whose objects are known to the process."""
    at_once = max(1, round(len(levels) / bench_env.task.episode_steps))
    spent: list[float] = []
    while len(spent) < _RESETS or sum(spent) < _RESET_SHARE * case.seconds:
        envs = np.sort(rng.choice(len(levels), at_once, replace=False))
        new = rng.choice(levels, at_once)
        spent.append(_seconds(partial(bench_env.restart, envs, new), case))
    return float(np.median(spent)) / at_once


def _seconds(work: Callable[[], None], case: Case) -> float:
    clock = time.process_time if case.num_threads == 1 else time.perf_counter
    start = clock()
    work()
    return clock() - start


def _summary(case: Case, bench_env: BenchEnv, clock: _Clock, reset_s: float, memory: float | None) -> Measurement:
    task, envs, engine = bench_env.task, np.array(clock.envs), np.array(clock.engine)
    ratios = engine / envs
    rate = case.num_envs / float(np.median(envs))
    low, high = np.quantile(ratios, (0.25, 0.75)).tolist()
    return Measurement(
        case=case,
        steps=clock.steps * case.num_envs,
        steps_per_s=rate,
        engine_steps_per_s=case.num_envs / float(np.median(engine)),
        ratio=float(np.median(ratios)),
        ratio_quartiles=(low, high),
        reset_ms=1e3 * reset_s,
        steps_with_resets_per_s=1 / (1 / rate + reset_s / task.episode_steps),
        physics_steps_per_s=rate * task.physics.physics_steps_per_step,
        memory_mb=memory,
    )

"""Times environments and bare engine in turn, block by block: other work on the machine hits both alike.

With one thread, time is the process's CPU time, which other work hardly touches; with more, it is the clock's.
"""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any

import numpy as np

from artiskill.bench.cases import Case
from artiskill.bench.machine import resident_mb
from artiskill.bench.subjects import Ceiling, Subject, make_subject

_EPISODE = 100  # steps; then all begin the next levels
_WARM_UP = 3  # steps, which compile kernels and fill caches
_BLOCK_S = 0.05  # what one turn of either should last
_LONGEST_BLOCK = 25
_RESETS, _RESET_SHARE = 5, 0.15  # at least so many timed resets, or this share of the case's time
_FIRST_LEVEL = 0


@dataclass(frozen=True)
class Measurement:
    """What came out of a case.

    Attributes:
        case: what was measured.
        steps: timed environment steps, each environment's counted.
        steps_per_s: median over blocks, without resets.
        engine_steps_per_s: likewise of the bare engine, on the same models with the same drive targets.
        ratio: median of the blocks' ratios of the two.
        ratio_quartiles: of the same.
        reset_ms: of one auto-reset, as many at a time as an average step of the vector has.
        steps_with_resets_per_s: with one reset for each `episode_steps` steps.
        physics_steps_per_s: `steps_per_s` times the physics steps of one.
        memory_mb: resident memory of a process with nothing but these environments; None where unknown.
    """

    case: Case
    steps: int
    steps_per_s: float
    engine_steps_per_s: float
    ratio: float
    ratio_quartiles: tuple[float, float]
    reset_ms: float
    steps_with_resets_per_s: float
    physics_steps_per_s: float
    memory_mb: float | None

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, for JSON; the case's stand beside the figures."""
        values = asdict(self)
        return values.pop("case") | values


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


def measure_case(case: Case, tell: Callable[[Any], None] | None = None) -> Measurement:
    """Measure one case, in this process. `tell` is for `run_jobs`, which calls this in another one."""
    rng = np.random.default_rng(0)
    subject = make_subject(case)
    levels = _FIRST_LEVEL + np.arange(case.num_envs)
    step_s = _warm_up(subject, levels, rng)
    memory = resident_mb()
    ceiling = Ceiling(subject.task, case.objects, case.num_threads)
    block = int(np.clip(_BLOCK_S / step_s, 1, _LONGEST_BLOCK))
    clock = _Clock()
    while clock.spent_s < case.seconds:
        subject.start(levels)
        ceiling.start(levels)
        _time_episode(subject, ceiling, clock, block, case, rng)
        levels = levels + case.num_envs
    reset_s = _time_resets(subject, levels - case.num_envs, case, rng)
    return _summary(case, subject, clock, reset_s, memory)


def _warm_up(subject: Subject, levels: np.ndarray, rng: np.random.Generator) -> float:
    """A few steps; seconds that the last one took."""
    subject.start(levels)
    for _ in range(_WARM_UP):
        start = time.perf_counter()
        subject.step(_actions(subject, len(levels), 1, rng)[0])
    return time.perf_counter() - start


def _actions(subject: Subject, num_envs: int, steps: int, rng: np.random.Generator) -> np.ndarray:
    """Random ones, (T, B, A) float32."""
    return rng.uniform(-1, 1, (steps, num_envs, subject.action_size)).astype(np.float32)


def _time_episode(
    subject: Subject, ceiling: Ceiling, clock: _Clock, block: int, case: Case, rng: np.random.Generator
) -> None:
    """Blocks of an episode, until the case's time is up; who goes first changes from block to block."""
    for number in range(_EPISODE // block):
        actions = _actions(subject, case.num_envs, block, rng)
        targets = [ceiling.targets(values) for values in actions]
        over = False

        def run_envs(actions: np.ndarray = actions) -> None:
            nonlocal over
            for values in actions:
                over |= subject.step(values)

        def run_engine(targets: list[list[np.ndarray]] = targets) -> None:
            for values in targets:
                ceiling.step(values)

        if number % 2:
            engine_s, env_s = _seconds(run_engine, case), _seconds(run_envs, case)
        else:
            env_s, engine_s = _seconds(run_envs, case), _seconds(run_engine, case)
        if over:  # from here on the two would not do the same physics
            return
        clock.note(env_s, engine_s, block)
        if clock.spent_s >= case.seconds:
            return


def _time_resets(subject: Subject, levels: np.ndarray, case: Case, rng: np.random.Generator) -> float:
    """Seconds for one environment's reset, to levels whose objects are known to the process."""
    at_once = max(1, round(len(levels) / subject.task.episode_steps))
    spent: list[float] = []
    while len(spent) < _RESETS or sum(spent) < _RESET_SHARE * case.seconds:
        envs = np.sort(rng.choice(len(levels), at_once, replace=False))
        new = rng.choice(levels, at_once)
        spent.append(_seconds(partial(subject.restart, envs, new), case))
    return float(np.median(spent)) / at_once


def _seconds(work: Callable[[], None], case: Case) -> float:
    clock = time.process_time if case.num_threads == 1 else time.perf_counter
    start = clock()
    work()
    return clock() - start


def _summary(case: Case, subject: Subject, clock: _Clock, reset_s: float, memory: float | None) -> Measurement:
    task, envs, engine = subject.task, np.array(clock.envs), np.array(clock.engine)
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

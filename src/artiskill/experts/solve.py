"""Can a level be solved from the dense reward alone? The planner of `mpc.py` in the episode."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from artiskill.envs.control import JOINT
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError, shown
from artiskill.experts.mpc import MpcConfig, Planner
from artiskill.tasks.levels import RngStream, level_generator


@dataclass(frozen=True)
class Attempt:
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
) -> Attempt:
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
    return Attempt(object_id, target, level, terminated, len(actions), total, seconds, np.stack(actions))

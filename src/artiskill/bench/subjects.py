"""What is timed: environments of one or many, and the bare engine beside them on the same episodes."""

from collections.abc import Sequence
from typing import Any, Protocol

import gymnasium as gym
import numpy as np

from artiskill.bench.cases import Case
from artiskill.envs.control import JOINT, Control
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.sampling import EpisodeSampler
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.envs.vision import PointCloudObserver
from artiskill.envs.wrappers import PointCloudDownsample
from artiskill.scene.layout import SceneLayout
from artiskill.scene.scene import Scene, cached_scene
from artiskill.sensors.observations.sampling import make_sampler
from artiskill.sim.simulation import BareEngine, Simulation
from artiskill.sim.states import InitialState
from artiskill.tasks.levels import RngStream, level_generator
from artiskill.tasks.task import Task

_METHOD = "maniskill"


class Subject(Protocol):
    """Environments, be they one or many."""

    task: Task
    action_size: int

    def start(self, levels: np.ndarray) -> None:
        """Begin episodes of all environments, (B,) levels."""

    def step(self, actions: np.ndarray) -> bool:
        """One environment step, (B, A); whether any episode is over."""

    def restart(self, envs: np.ndarray, levels: np.ndarray) -> None:
        """Begin episodes in some environments: K sorted indices, K levels."""


def make_subject(case: Case) -> Subject:
    """The environments of a case, which have no episodes yet."""
    return SingleSubject(case) if case.num_envs == 1 else VectorSubject(case)


class SingleSubject:
    """A `ManipulationEnv`, without `gym.make`'s wrappers."""

    def __init__(self, case: Case) -> None:
        env = ManipulationEnv(case.task, list(case.objects), obs_mode=case.obs_mode)
        self.task, self.action_size = env.task, env.control.size
        self._env: gym.Env[Any, Any] = env
        if case.points is not None:
            self._env = PointCloudDownsample(env, _METHOD, case.points, **case.sampling)

    def start(self, levels: np.ndarray) -> None:
        """See `Subject`."""
        self._env.reset(seed=int(levels[0]))

    def step(self, actions: np.ndarray) -> bool:
        """See `Subject`."""
        _, _, terminated, truncated, _ = self._env.step(actions[0])
        return terminated or truncated

    def restart(self, envs: np.ndarray, levels: np.ndarray) -> None:
        """See `Subject`."""
        self.start(levels)


class VectorSubject:
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
        """See `Subject`."""
        self._env.reset(seed=levels.tolist())

    def step(self, actions: np.ndarray) -> bool:
        """See `Subject`."""
        _, _, terminated, truncated, _ = self._env.step(actions)
        return bool((terminated | truncated).any())

    def restart(self, envs: np.ndarray, levels: np.ndarray) -> None:
        """See `Subject`."""
        mask, seeds = np.zeros(self._env.num_envs, dtype=bool), [0] * self._env.num_envs
        mask[envs] = True
        for env, level in zip(envs.tolist(), levels.tolist(), strict=True):
            seeds[env] = level
        self._env.reset(seed=seeds, options={"reset_mask": mask})


class Ceiling:
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
        """Drive targets of actions (B, A), for each batch."""
        values = self._control.joint_scale.to_targets(actions.astype(float))
        return [values[envs] for envs, _ in self._groups]

    def step(self, targets: Sequence[np.ndarray]) -> None:
        """One environment step of all batches."""
        for (_, engine), values in zip(self._groups, targets, strict=True):
            engine.step(values)

    def states(self) -> dict[int, np.ndarray]:
        """The engine's state of each environment."""
        return {
            env: row for envs, engine in self._groups for env, row in zip(envs.tolist(), engine.state, strict=True)
        }

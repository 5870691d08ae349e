"""Experts as demonstrators: their actions as they are stored, and their attempts at a level."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import object_id_of, object_of
from artiskill.config import merge_overrides
from artiskill.demos.recording import Actor, Recording, record, rounded
from artiskill.demos.settings import Agent, Settings, load_demos_config
from artiskill.envs.core import StateObserver
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ArtiSkillError, DivergedError, PolicyError
from artiskill.experts.registry import Expert, make_expert
from artiskill.experts.variation import Disturbance, load_variation, varied
from artiskill.tasks.levels import RngStream, level_generator
from artiskill.tasks.registry import make_task
from artiskill.tasks.task import Task

_STYLE, _PUSHES = 0, 1  # parts of the random stream
# what becomes of single episodes; anything else is a fault of the program, and ends the collection
FAULTS = (DivergedError, ArithmeticError, np.linalg.LinAlgError)


class Demonstrator:
    """Acts as the task's expert, in a style of its own in every episode, and disturbed now and then.

    Level, object and target determine style and disturbances. Every episode has an expert of its own, for no
    episode may depend on the one before.

    Args:
        env: in which it acts.
        variety: without it the expert acts in its usual style, undisturbed.
        action_bits: actions are multiples of 2**-action_bits; by default as `demos.yaml` says.

    Attributes:
        disturbed: whether the last action was another than the expert had wanted.

    Raises:
        PolicyError: the task has no expert.
    """

    def __init__(self, env: ManipulationEnv, variety: bool = True, action_bits: int | None = None) -> None:
        self._config = make_expert(env.task.name, env.task.robot).config  # read from its file only once
        self._variation = load_variation(env.task.name) if variety else None
        self._action_bits = load_demos_config().store.action_bits if action_bits is None else action_bits
        self._expert: Expert | None = None
        self._disturbance: Disturbance | None = None
        self.disturbed = False

    def begin(self, env: ManipulationEnv) -> None:
        """Begin an episode at its first state."""
        config, self._disturbance = self._config, None
        if self._variation is not None:
            state = env.save_state()
            style, pushes = (
                level_generator(state.level, RngStream.DEMONSTRATING, part, of=(state.object, state.target))
                for part in (_STYLE, _PUSHES)
            )
            config = varied(config, self._variation.ranges, style)
            self._disturbance = Disturbance(
                self._variation.disturbance,
                env.control.joint_scale.half_range,
                len(env.task.robot.mounts),
                env.task.physics.step_s,
                pushes,
            )
        self._expert = make_expert(env.task.name, env.task.robot, config)
        self._expert.reset(env.snapshot, env.goal)
        self.disturbed = False

    def act(self, env: ManipulationEnv) -> np.ndarray:
        """Return the next action, (A,) float32.

        Raises:
            FloatingPointError: the expert's action is not finite.
        """
        assert self._expert is not None
        wanted = self._expert.act(env.snapshot, env.goal)
        if not np.isfinite(wanted).all():
            raise FloatingPointError(f"the expert's action is not finite: {wanted.tolist()}")
        action = self._stored(wanted, env)
        offset = None if self._disturbance is None else self._disturbance.next(wanted)
        if offset is None:
            self.disturbed = False
            return action
        pushed = self._stored(wanted + offset, env)
        self.disturbed = bool((pushed != action).any())
        return pushed

    def _stored(self, action: np.ndarray, env: ManipulationEnv) -> np.ndarray:
        """Return a joint action (R,) in the environment's control mode, clipped and rounded as it is stored."""
        action = env.control.of_joint_action(action, env.snapshot)
        return rounded(np.clip(action, -1.0, 1.0), self._action_bits)


class AgentDemonstrator:
    """Acts as a trained policy that sees the state.

    Args:
        env: in which it acts.
        policy: with `reset` and `act`.
        action_bits: actions are multiples of 2**-action_bits.

    Attributes:
        disturbed: never.
    """

    disturbed = False

    def __init__(self, env: ManipulationEnv, policy: Any, action_bits: int) -> None:
        self._policy, self._action_bits = policy, action_bits
        self._observer = StateObserver(_seen_task(env.task, policy.observation_config))

    def begin(self, env: ManipulationEnv) -> None:
        """Begin an episode at its first state."""
        self._policy.reset(self._observe(env), {})

    def act(self, env: ManipulationEnv) -> np.ndarray:
        """Return the next action, (A,) float32.

        Raises:
            FloatingPointError: the policy's action is not finite.
        """
        action = np.asarray(self._policy.act(self._observe(env)))
        if not np.isfinite(action).all():
            raise FloatingPointError(f"the policy's action is not finite: {action.tolist()}")
        return rounded(np.clip(action, -1.0, 1.0), self._action_bits)

    def _observe(self, env: ManipulationEnv) -> np.ndarray:
        values = np.empty((1, *self._observer.space.shape), np.float32)
        self._observer.observe_all(env.snapshot, env.goal, values)
        found: np.ndarray = values[0]
        return found


def _seen_task(task: Task, observation_config: Mapping[str, Any]) -> Task:
    """Return the task as a policy sees it, whose state may say more than that of the demonstrations."""
    if not observation_config:
        return task
    return make_task(task.name, merge_overrides(task.overrides, observation_config))


class RecordedActions:
    """Acts as it was recorded.

    Args:
        actions: (T, A).
        disturbed: (T,) which of them are not what was wanted; by default none.

    Attributes:
        disturbed: whether the last action was one of these.
    """

    def __init__(self, actions: np.ndarray, disturbed: np.ndarray | None = None) -> None:
        self._actions, self._step, self.disturbed = actions, 0, False
        self._disturbed = np.zeros(len(actions), dtype=np.bool_) if disturbed is None else disturbed

    def begin(self, env: ManipulationEnv) -> None:
        """Begin at the first action."""
        self._step = 0

    def act(self, env: ManipulationEnv) -> np.ndarray | None:
        """Return the next action; None if there are no more."""
        if self._step == len(self._actions):
            return None
        self._step += 1
        self.disturbed = bool(self._disturbed[self._step - 1])
        action: np.ndarray = self._actions[self._step - 1]
        return action


@dataclass(frozen=True, eq=False)
class DemoAttempt:
    """What came of one episode."""

    object: str  # id
    target: str  # link
    level: int  # of the episode
    success: bool  # whether it was solved
    steps: int  # how many it took
    fault: str  # what ended the episode before its end, as `fault_text` says it; else empty
    recording: Recording | None  # None of a failed attempt, unless failures are kept


@dataclass(frozen=True, eq=False)
class CollectJob:
    """Levels that one worker plays."""

    settings: Settings  # of the collection
    object: str | ArticulatedObject  # an id, or the object itself where no id leads to it
    target: str  # link
    levels: tuple[int, ...]  # of the episodes
    agent: Agent | None = None  # who demonstrates instead of the expert

    @property
    def label(self) -> str:
        """The job's name in errors."""
        return f"object {object_id_of(self.object)}, target {self.target}, levels from {self.levels[0]}"


def run_collect_job(job: CollectJob, send: Callable[[DemoAttempt], None]) -> None:
    """Make the attempts of a job, and send each."""
    obj = object_of(job.object)
    env = job.settings.make_env([obj])
    bits = job.settings.store.action_bits
    demonstrator = (
        Demonstrator(env, job.settings.variety, bits)
        if job.agent is None
        else AgentDemonstrator(env, job.agent.load(), bits)
    )
    for level in job.levels:
        send(_make_attempt(env, obj, demonstrator, job, level))


def _make_attempt(
    env: ManipulationEnv, obj: ArticulatedObject, demonstrator: Actor, job: CollectJob, level: int
) -> DemoAttempt:
    """Play one level.

    Raises:
        PolicyError: what cannot be an episode's fault; it names the episode.
    """
    settings, name = job.settings, obj.id
    episode = f"object {name}, target {job.target}, level {level}"
    try:
        recording = record(env, obj, level, job.target, demonstrator, settings.store)
    except FAULTS as error:
        return DemoAttempt(name, job.target, level, False, 0, fault_text(error), None)
    except ArtiSkillError as error:
        raise PolicyError(f"{episode}: {error}") from error
    except Exception as error:
        error.add_note(episode)
        raise
    kept = recording if recording.success or settings.keep_failures else None
    return DemoAttempt(name, job.target, level, recording.success, len(recording.actions), "", kept)


def fault_text(error: BaseException) -> str:
    """Return what ended an episode as reports and tables of attempts have it; it begins with the kind."""
    return f"{type(error).__name__}: {error}"


def fault_kind(text: str) -> str:
    """Return the kind of a fault, `DivergedError`, say; empty where there is none."""
    return text.partition(":")[0]

"""Policies as evaluation sees them, and those that come with the package."""

import hashlib
import math
import os
import random
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from artiskill.demos.demonstrator import Demonstrator
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.wrappers import Sampling
from artiskill.errors import ConfigError, PolicyError, RunError, UnknownNameError, shown
from artiskill.evaluation.remote import RemoteActor, as_remote, ask_metadata
from artiskill.evaluation.sandbox import Confinement, SandboxConfig
from artiskill.evaluation.solution import FileSolution, ObjectSolution, Solution
from artiskill.experts.registry import Expert, make_expert
from artiskill.files import is_folder
from artiskill.jobs.worker import NO_DEADLINE, Deadline, Send
from artiskill.learning.array_policy import ArrayPolicy, pretrained_file
from artiskill.learning.run import load_run, read_info, run_folder, weights_digest, weights_file
from artiskill.tasks.levels import RngStream, level_generator
from artiskill.tasks.registry import task_names, task_spec

LOAD_TIMEOUT_S = 120.0  # to run a solution file and construct its policy: weights may be large


class Actor(Protocol):
    """A policy as evaluation sees it, privileged or not.

    Only privileged policies may look at `env` beyond what `observation` and `info` say.

    Attributes:
        name: how reports and errors call it.
        obs_mode: the observation mode that it needs; None if any will do.
        control_mode: the control mode that its actions are of; None if it can act in any.
        sampling: of the clouds that it sees; None for the full ones.
        observation_config: values of `cameras`, `render` and `state` that it needs; None for the task's.
        from_chunk: whether the last action was of an earlier answer, so that nobody was asked.
        confinement: of its process; None if it has none of its own.
    """

    name: str
    obs_mode: str | None = None
    control_mode: str | None = None
    sampling: Sampling | None = None
    observation_config: Mapping[str, Any] | None = None
    from_chunk: bool = False
    confinement: Confinement | None = None

    def reset(self, env: ManipulationEnv, observation: Any, info: dict[str, Any]) -> None:
        """Begin an episode, whose first observation and info these are."""

    def act(self, env: ManipulationEnv, observation: Any) -> Any:
        """Return the next action, (A,) in [-1, 1]."""

    def close(self) -> None:
        """End what belongs to it: a solution's process, say."""


class ExpertActor(Actor):
    """The task's privileged controller: it reads `env.snapshot` and `env.goal`, not the observation."""

    name = "expert"

    def __init__(self) -> None:
        self._expert: Expert | None = None

    def reset(self, env: ManipulationEnv, observation: Any, info: dict[str, Any]) -> None:
        """Begin an episode.

        Raises:
            PolicyError: the task has no expert.
        """
        self._expert = make_expert(env.task.name, env.task.robot)
        self._expert.reset(env.snapshot, env.goal)

    def act(self, env: ManipulationEnv, observation: Any) -> np.ndarray:
        """Return the expert's action in the environment's control mode, (A,)."""
        assert self._expert is not None
        return env.control.of_joint_action(self._expert.act(env.snapshot, env.goal), env.snapshot)


class DemonstratorActor(Actor):
    """The expert as it demonstrates: its manner differs by level, and it is disturbed now and then."""

    name = "demonstrator"

    def __init__(self) -> None:
        self._demonstrator: Demonstrator | None = None

    def reset(self, env: ManipulationEnv, observation: Any, info: dict[str, Any]) -> None:
        """Begin an episode.

        Raises:
            PolicyError: the task has no expert.
        """
        if self._demonstrator is None:
            self._demonstrator = Demonstrator(env)
        self._demonstrator.begin(env)

    def act(self, env: ManipulationEnv, observation: Any) -> np.ndarray:
        """Return the action that a collection would store, (A,)."""
        assert self._demonstrator is not None
        return self._demonstrator.act(env)


class RandomActor(Actor):
    """Uniform actions, fixed by level and object."""

    name = "random"

    def __init__(self) -> None:
        self._generator = np.random.default_rng(0)

    def reset(self, env: ManipulationEnv, observation: Any, info: dict[str, Any]) -> None:
        """Begin an episode with a generator of its own."""
        self._generator = level_generator(info["level"], RngStream.RANDOM_ACTIONS, of=(info["object"],))

    def act(self, env: ManipulationEnv, observation: Any) -> np.ndarray:
        """Return a uniform action in [-1, 1], (A,)."""
        return self._generator.uniform(-1.0, 1.0, env.action_space.shape or ())


class StillActor(Actor):
    """Action zero in every step: no velocities, fingers half open."""

    name = "still"

    def act(self, env: ManipulationEnv, observation: Any) -> np.ndarray:
        """Return zeros, (A,)."""
        return np.zeros(env.action_space.shape or ())


class SolutionActor(Actor):
    """A participant's function or `Policy` object: sees observation and info only, and answers for its errors.

    Args:
        solution: it, which others may call, too.
    """

    def __init__(self, solution: Solution) -> None:
        self.solution = solution
        self.name, self.obs_mode, self.control_mode = solution.name, solution.obs_mode, solution.control_mode
        self.sampling, self.observation_config = solution.sampling, solution.observation_config
        self.confinement = solution.confinement

    def reset(self, env: ManipulationEnv, observation: Any, info: dict[str, Any]) -> None:
        """Begin an episode.

        Raises:
            PolicyError: the policy raises.
        """
        self.solution.reset(observation, info)

    def act(self, env: ManipulationEnv, observation: Any) -> np.ndarray:
        """Return the policy's action, (A,) and finite.

        Raises:
            PolicyError: the policy raises or returns no legal action.
        """
        return self.solution.act(observation, env.action_space.shape or ())

    def close(self) -> None:
        """End the solution's process, if it has one."""
        self.solution.close()


class TimedActor(Actor):
    """An actor that sends a deadline for each action; the parent process ends this one if it is missed.

    No code of the same process could stop a policy.

    Args:
        actor: who acts.
        limit_s: for each `reset` and each `act`.
        send: of a job that has a process of its own, see `run_jobs`.
    """

    def __init__(self, actor: Actor, limit_s: float, send: Send) -> None:
        self._actor, self._limit_s, self._send = actor, limit_s, send
        self.name, self.obs_mode, self.control_mode = actor.name, actor.obs_mode, actor.control_mode
        self._where, self._step = "", 0

    def reset(self, env: ManipulationEnv, observation: Any, info: dict[str, Any]) -> None:
        """Begin an episode."""
        self._where, self._step = f"object {info['object']}, level {info['level']}", 0
        self._begin("reset() has not ended", self._where)
        self._actor.reset(env, observation, info)
        self._send(NO_DEADLINE)

    def act(self, env: ManipulationEnv, observation: Any) -> Any:
        """Return the actor's action."""
        self._begin("no action", f"{self._where}, step {self._step}")
        self._step += 1
        action = self._actor.act(env, observation)
        self._send(NO_DEADLINE)
        return action

    def close(self) -> None:
        """End what belongs to the actor."""
        self._actor.close()

    def _begin(self, what: str, where: str) -> None:
        self._send(Deadline(f"{self.name}: {what} within {self._limit_s:g} s ({where})", self._limit_s))


CHECKPOINT, ARRAYS = ".pt", ".npz"
_ACTORS: Mapping[str, Callable[[], Actor]] = {
    "expert": ExpertActor,
    "demonstrator": DemonstratorActor,
    "random": RandomActor,
    "still": StillActor,
}
PRETRAINED = "pretrained"  # which policy that is depends on the task
POLICY_NAMES = (*_ACTORS, PRETRAINED)
PRIVILEGED_POLICIES = ("expert", "demonstrator")  # they read the simulation's state


def policy_of_task(policy: Any, task: str) -> Any:
    """Return the path of the task's own policy for `pretrained`, any other policy as it is.

    Raises:
        PolicyError: no policy comes with the package for the task.
    """
    return str(pretrained_file(task)) if policy == PRETRAINED else policy


def load_policy(policy: Any, task: str | None = None, sandbox: SandboxConfig | None = None) -> Actor:
    """Return the actor of a name, of a file or folder, of a server, or of a function or `Policy` object.

    Args:
        policy: one of `POLICY_NAMES` but `pretrained`, the path of a Python file (see docs/evaluation.md), of the
            folder of a training run or of a file exported from it, the address `ws://host:port` of a server (or a
            `RemotePolicy`), a function (observation) -> action, or an object with `obs_mode`, `reset`, `act` and
            perhaps `control_mode` and `sampling`.
        task: name of the task, which a `UserPolicy` of 2021 is told.
        sandbox: how the process of a solution file is confined; by default as well as can be.

    Raises:
        UnknownNameError: text that is neither a policy's name nor looks like a Python file or a run's folder.
        PolicyError: a solution file, run, function or object that cannot be used.
        MissingExtraError: a run without torch.
    """
    remote = as_remote(policy)
    if remote is not None:
        return RemoteActor(remote)
    path = solution_path(policy)
    if path is not None:
        return SolutionActor(FileSolution(path, task, sandbox))
    if is_run(policy):
        path = Path(policy)
        learned = ArrayPolicy(path) if path.suffix == ARRAYS else load_run(path)
        return SolutionActor(ObjectSolution(learned, str(policy)))
    return _ACTORS[str(policy)]() if isinstance(policy, str | Path) else SolutionActor(ObjectSolution(policy))


def solution_path(policy: Any) -> Path | None:
    """Return the file of a policy that is a solution file; None for any other policy.

    Raises:
        UnknownNameError: text that is neither a policy's name nor looks like a Python file or a run's folder.
    """
    if not _is_path(policy) or is_run(policy):
        return None
    path = Path(policy)
    if path.suffix != ".py" and not os.path.exists(path):
        hint = (
            "Also legal: the path of a file solution.py, a training run's folder, an exported .npz, or ws://host."
        )
        raise UnknownNameError("policy", str(policy), POLICY_NAMES, hint)
    return path


def is_run(policy: Any) -> bool:
    """Whether a policy is the folder of a training run, a checkpoint in it, or a file exported from it."""
    is_path = _is_path(policy) and str(policy) != PRETRAINED
    return is_path and (is_folder(policy) or Path(policy).suffix in (CHECKPOINT, ARRAYS))


def _is_path(policy: Any) -> bool:
    """Whether a policy is text that is neither a server's address nor a policy's name; or `pretrained`."""
    is_text = isinstance(policy, str | Path) and str(policy) not in _ACTORS
    return is_text and as_remote(policy) is None


def trained_task(policy: Any) -> str | None:
    """Return the name of the task that a trained policy learned, or a server says; None for any other policy.

    Raises:
        PolicyError: there is no such run, file or server, or it is damaged.
    """
    remote = as_remote(policy)
    if remote is not None:
        return ask_metadata(remote).task
    if not is_run(policy):
        return None
    path = Path(policy)
    if path.suffix == ARRAYS:
        return ArrayPolicy(path).header.task
    weights_file(path)
    try:
        return read_info(run_folder(path)).task
    except RunError as error:
        raise PolicyError(str(error)) from error


def task_notes(policy: Any, task: str) -> tuple[str, ...]:
    """Return a note if a trained policy learned another task than it is to be played on.

    Raises:
        PolicyError: it learned a task of other objects, so it can see and move nothing there.
    """
    if isinstance(policy, ArrayPolicy):
        name, learned = "the policy", policy.header.task
    elif is_run(policy):
        name, learned = str(policy), trained_task(policy) or task
    else:
        return ()
    if learned == task or learned not in task_names():
        return ()
    theirs, ours = task_spec(learned).category, task_spec(task).category
    if theirs != ours:
        raise PolicyError(f"{name} learned {learned}, with a {theirs}; {task} has a {ours}")
    return (f"{name} learned {learned}, and is played on {task}",)


def policy_digest(policy: Any) -> str | None:
    """Return the SHA-256 of a solution file, or of a run's weights; None for other policies."""
    if is_run(policy):
        return weights_digest(Path(policy))
    path = solution_path(policy)
    return None if path is None else hashlib.sha256(path.read_bytes()).hexdigest()


def load_within(
    policy: Any, limit_s: float, send: Send, task: str | None = None, sandbox: SandboxConfig | None = None
) -> Actor:
    """Load a policy in a process of its own, which is ended if it takes too long.

    Python's and NumPy's global generators start from the same numbers, whatever the process did before.

    Args:
        policy: as `load_policy` takes it.
        limit_s: in seconds.
        send: of a job that has a process of its own, see `run_jobs`.
        task: as `load_policy` takes it.
        sandbox: likewise.

    Raises:
        UnknownNameError, PolicyError, ConfigError: as of `load_policy`.
    """
    send(Deadline(f"{policy}: not loaded within {limit_s:g} s", limit_s))
    random.seed(0)
    np.random.seed(0)  # noqa: NPY002 - for solutions that draw from it
    actor = load_policy(policy, task, sandbox)
    send(NO_DEADLINE)
    return actor


def check_time_limit(limit_s: object, what: str = "per step") -> None:
    """Raise `ConfigError` unless it is a positive, finite number of seconds."""
    is_number = isinstance(limit_s, int | float) and not isinstance(limit_s, bool)
    if not is_number or not 0 < limit_s < math.inf:  # type: ignore[operator]
        raise ConfigError(f"the time limit {what} must be a positive number of seconds, not {shown(limit_s)}")

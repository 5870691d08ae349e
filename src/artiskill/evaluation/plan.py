"""What is to be evaluated, checked before the first step is simulated."""

import json
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import checked_hash, object_id_of, object_of, resolve_objects
from artiskill.config import check_line, from_mapping, merge_overrides, to_mapping
from artiskill.envs.control import JOINT
from artiskill.envs.manipulation import ManipulationEnv, ObjectChoice
from artiskill.envs.wrappers import Sampling
from artiskill.errors import ConfigError, PolicyError, shown
from artiskill.evaluation.policies import (
    LOAD_TIMEOUT_S,
    PRETRAINED,
    PRIVILEGED_POLICIES,
    Actor,
    check_time_limit,
    load_policy,
    load_within,
    policy_digest,
    policy_of_task,
    solution_path,
    task_notes,
)
from artiskill.evaluation.protocols import (
    ANY_TARGET,
    Protocol,
    checked_track,
    fresh_levels,
    name_protocol,
    protocol_digest,
)
from artiskill.evaluation.remote import RemotePolicy, as_remote, plan_remote
from artiskill.evaluation.sandbox import Confinement, SandboxConfig
from artiskill.jobs.parallel import run_jobs
from artiskill.jobs.worker import Send
from artiskill.tasks.levels import check_level
from artiskill.tasks.registry import make_task
from artiskill.tasks.task import Task

ALL_TARGETS = "all"
WORKER_HINT = "the policy ended it, or memory ran out; try fewer workers"
_DEFAULT_OBS_MODE = "state"


@dataclass(frozen=True, eq=False)
class EpisodeBatch:
    """Episodes on one object: the unit of work, and one row of a report.

    Attributes:
        task: name of the task.
        overrides: changed values of its configuration.
        object: an id, or the object itself where no id leads to it.
        target: the target link; None if the level draws one.
        levels: of the episodes.
        policy: as `load_policy` takes it.
        obs_mode: of the environment.
        control_mode: of the environment.
        content_hash: of the object.
        sampling: of the clouds that the policy sees; None for the full ones, and in other modes.
    """

    task: str
    overrides: Mapping[str, Any]
    object: str | ArticulatedObject
    target: str | None
    levels: tuple[int, ...]
    policy: Any
    obs_mode: str
    control_mode: str
    content_hash: str
    sampling: Sampling | None = None

    @property
    def label(self) -> str:
        """Policy, object and, if it is fixed, target, as errors name them."""
        target = f", target {self.target}" if self.target else ""
        return f"{self.policy}, object {object_id_of(self.object)}{target}"

    @property
    def row(self) -> tuple[str, str]:
        """Object and target as a report names them."""
        return object_id_of(self.object), self.target or ANY_TARGET

    def make_env(self, render_mode: str | None = None) -> ManipulationEnv:
        """Make its environment."""
        env = ManipulationEnv(
            task=self.task,
            objects=[self.object],
            target=self.target,
            obs_mode=self.obs_mode,
            control_mode=self.control_mode,
            render_mode=render_mode,
            config=self.overrides,
        )
        if self.sampling is not None:  # the wrapper changes the environment itself, and is not needed afterwards
            self.sampling.wrap(env)
        return env


@dataclass(frozen=True, eq=False)
class EvaluationPlan:
    """An evaluation that is ready to run.

    Attributes:
        task: with its resolved configuration.
        policy_name: as reports call the policy.
        policy: as `load_policy` takes it.
        policy_sha256: of a solution file's bytes, or of a run's weights; else None.
        obs_mode: of the environments.
        control_mode: of the environments.
        batches: one per row of the report.
        protocol: what its numbers compare with.
        salt: of fresh levels; None for those that count up.
        track: what the policy was made from, as its author says.
        load_timeout_s: the time in which a solution file must be loaded.
        notes: what is done otherwise than the policy's server says, or than a trained policy learned.
        replan_steps: actions taken of each answer of a server; None for all of them, and for other policies.
        sandbox: how the processes of a solution file are confined; None for other policies.
        confinement: what was found to hold of the first of them; the others find out for themselves.
    """

    task: Task
    policy_name: str
    policy: Any
    policy_sha256: str | None
    obs_mode: str
    control_mode: str
    batches: tuple[EpisodeBatch, ...]
    protocol: Protocol
    salt: str | None = None
    track: str | None = None
    load_timeout_s: float = LOAD_TIMEOUT_S
    notes: tuple[str, ...] = ()
    replan_steps: int | None = None
    sandbox: SandboxConfig | None = None
    confinement: Confinement | None = None

    def within(self, step_timeout_s: float | None) -> "EvaluationPlan":
        """Return the same with another time for each action of a solution file; None leaves it as it is."""
        if step_timeout_s is None or self.sandbox is None or self.confinement is None:
            return self
        sandbox = replace(self.sandbox, step_timeout_s=step_timeout_s)
        return replace(self, sandbox=sandbox, confinement=self.confinement.within(step_timeout_s))

    @property
    def num_episodes(self) -> int:
        """Episodes in all."""
        return sum(len(batch.levels) for batch in self.batches)

    @property
    def is_portable(self) -> bool:
        """Whether another process can load the policy: by its name, path or address."""
        return isinstance(self.policy, str | RemotePolicy)

    @property
    def is_remote(self) -> bool:
        """Whether the policy acts behind a WebSocket."""
        return isinstance(self.policy, RemotePolicy)

    @property
    def is_solution(self) -> bool:
        """Whether the policy is a solution file: code that may do anything to its process."""
        return solution_path(self.policy) is not None


def plan_evaluation(
    task: str,
    policy: Any,
    objects: ObjectChoice = "test",
    episodes: int = 10,
    first_level: int = 0,
    target: str | None = None,
    obs_mode: str | None = None,
    control_mode: str | None = None,
    config: Mapping[str, Any] | None = None,
    load_timeout_s: float = LOAD_TIMEOUT_S,
    salt: str | None = None,
    track: str | None = None,
    sandbox: SandboxConfig | str | None = None,
) -> EvaluationPlan:
    """Check everything before the first episode; the arguments are those of `evaluate`.

    A solution file is run in a process of its own, to see what it needs.

    Raises:
        UnknownNameError: an unknown task, object, split, target link, observation or control mode, or policy.
        ConfigError: an illegal number of episodes or level, or an unknown or illegal configuration value.
        AssetError: an object that the task cannot use, or that differs from the catalogue's of that id.
        PolicyError: a policy that cannot be loaded or reached, or needs another mode.
    """
    levels = _levels(episodes, first_level)
    target = None if target == ANY_TARGET else target
    make_task(task, config)  # before any policy is loaded
    if salt is not None and first_level != 0:
        raise ConfigError(f"fresh levels have no first one: leave first_level at 0, not {shown(first_level)}")
    check_time_limit(load_timeout_s, "for loading a policy")
    name = PRETRAINED if policy == PRETRAINED else None
    policy = policy_of_task(policy, task)
    wanted = sandbox if isinstance(sandbox, SandboxConfig) else SandboxConfig(sandbox)
    other_task = task_notes(policy, task)
    policy, actor, notes = inspect_any(policy, task, obs_mode, control_mode, load_timeout_s, wanted)
    overrides = merge_overrides(actor.observation_config or {}, config or {})
    try:
        resolved = make_task(task, overrides)
    except ConfigError as error:  # which is not of `config`, as that alone is legal
        raise PolicyError(f"{actor.name}: its observation_config does not fit {task}: {error}") from error
    modes = (
        _mode("obs_mode", obs_mode, actor) or _DEFAULT_OBS_MODE,
        _mode("control_mode", control_mode, actor) or JOINT,
    )
    batches = tuple(
        EpisodeBatch(task, overrides, item, link, levels, policy, *modes, content_hash, actor.sampling)
        for item, content_hash in [(o, checked_hash(o)) for o in resolve_objects(objects, task=task)]
        for link in _targets(resolved, item, target)
    )
    for batch in batches[: len(batches) if target else 1]:  # a given target must exist on every object
        batch.make_env()
    batches, protocol = name_batches(resolved, batches, salt)
    track = checked_track(track, isinstance(policy, str) and policy in PRIVILEGED_POLICIES, modes[0])
    called, held = (name or actor.name, policy, policy_digest(policy)), actor.confinement
    check_line("a report cannot name the policy:", called[0])
    return EvaluationPlan(
        *(resolved, *called, *modes, batches, protocol, salt, track, load_timeout_s, (*other_task, *notes)),
        replan_steps=policy.steps_of_answer if isinstance(policy, RemotePolicy) else None,
        sandbox=None if held is None else replace(wanted, kind=held.sandbox),
        confinement=held,
    )


def name_batches(
    task: Task, batches: tuple[EpisodeBatch, ...], salt: str | None
) -> tuple[tuple[EpisodeBatch, ...], Protocol]:
    """Return the batches, with fresh levels if there is a salt, and their protocol.

    Args:
        task: of all of them.
        batches: with levels that count up.
        salt: see `fresh_levels`.

    Raises:
        ConfigError: an illegal salt.
    """
    first = batches[0]
    rows, modes = [(*batch.row, batch.content_hash) for batch in batches], (first.obs_mode, first.control_mode)
    protocol = name_protocol(task, rows, first.levels, *modes)
    if salt is None:
        return batches, protocol
    levels = fresh_levels(salt, protocol.id, len(first.levels))
    fresh = tuple(replace(batch, levels=levels) for batch in batches)
    return fresh, Protocol(f"{protocol.id}/fresh-{salt}", protocol_digest(task, rows, levels, *modes))


@dataclass(frozen=True)
class PolicySpec:
    """What a policy declares: as of `Actor`."""

    name: str
    obs_mode: str | None
    control_mode: str | None
    sampling: Sampling | None = None
    observation_config: dict[str, Any] | None = None
    confinement: Confinement | None = None


def inspect_any(
    policy: Any,
    task: str,
    obs_mode: str | None,
    control_mode: str | None,
    load_timeout_s: float = LOAD_TIMEOUT_S,
    sandbox: SandboxConfig | None = None,
) -> tuple[Any, PolicySpec, tuple[str, ...]]:
    """Return a policy as batches hold it, what it needs, and what is done otherwise than its server says.

    Args:
        policy: as `load_policy` takes it.
        task: name of the task.
        obs_mode: what a server is asked for; None for what it says.
        control_mode: likewise.
        load_timeout_s: see `evaluate`.
        sandbox: of a solution file.

    Raises:
        PolicyError: as `inspect_policy` and `plan_remote`.
    """
    remote = as_remote(policy)
    if remote is None:
        found = inspect_policy(policy, task, load_timeout_s, sandbox)
        return policy if callable(policy) or hasattr(policy, "act") else str(policy), found, ()
    plan = plan_remote(replace(remote, connect_timeout_s=load_timeout_s), obs_mode, control_mode)
    needs = plan.obs_mode, plan.control_mode, plan.sampling, plan.config
    return plan.policy, PolicySpec(str(remote), *needs), plan.notes


def inspect_policy(
    policy: Any,
    task: str | None = None,
    load_timeout_s: float = LOAD_TIMEOUT_S,
    sandbox: SandboxConfig | None = None,
) -> PolicySpec:
    """Load a policy to see what it declares; the code of a solution file never runs in this process.

    Raises:
        UnknownNameError: text that is neither a policy's name nor looks like a Python file.
        PolicyError: it cannot be loaded in time, or not at all, or declares what is not legal.
        ConfigError: the confinement that was asked for does not hold here.
    """
    path = solution_path(policy)
    if path is None:
        with closing(load_policy(policy, task)) as actor:
            return _spec_of(actor)
    inspect = partial(_inspect, limit_s=load_timeout_s, task=task, sandbox=sandbox)
    said = run_jobs(inspect, [str(path)], 1, describe=str, isolated=True, hint=WORKER_HINT)[0]
    return from_mapping(PolicySpec, json.loads(said))


def _inspect(path: str, send: Send, limit_s: float, task: str | None, sandbox: SandboxConfig | None) -> str:
    """Return what a solution file declares as plain text, which any process can read."""
    with closing(load_within(path, limit_s, send, task, sandbox)) as actor:
        return json.dumps(to_mapping(_spec_of(actor)))


def _spec_of(actor: Actor) -> PolicySpec:
    asked = None if actor.observation_config is None else dict(actor.observation_config)
    return PolicySpec(actor.name, actor.obs_mode, actor.control_mode, actor.sampling, asked, actor.confinement)


def _mode(kind: str, asked: str | None, actor: PolicySpec) -> str | None:
    """Return the mode that was asked for, else the one that the policy needs."""
    needed: str | None = getattr(actor, kind)
    if asked is not None and needed not in (None, asked):
        raise PolicyError(f"{actor.name} needs {kind} {needed!r}, but {asked!r} was asked for")
    return asked or needed


def _levels(episodes: object, first_level: object) -> tuple[int, ...]:
    if isinstance(episodes, bool) or not isinstance(episodes, int) or episodes < 1:
        raise ConfigError(f"episodes must be a whole number of at least 1, not {shown(episodes)}")
    first = check_level(first_level)
    check_level(first + episodes - 1)
    return tuple(range(first, first + episodes))


def _targets(task: Task, item: str | ArticulatedObject, target: str | None) -> tuple[str | None, ...]:
    if target != ALL_TARGETS:
        return (target,)
    return task.targets(object_of(item))

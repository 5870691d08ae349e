"""Evaluation: a policy acts in episodes on many objects and levels, and a `Report` counts its successes."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.demos.demonstrator import FAULTS, fault_text
from artiskill.envs.manipulation import ManipulationEnv, ObjectChoice
from artiskill.errors import ConfigError
from artiskill.evaluation.action_replay import final_digest
from artiskill.evaluation.plan import WORKER_HINT, EpisodeBatch, EvaluationPlan, plan_evaluation
from artiskill.evaluation.policies import (
    LOAD_TIMEOUT_S,
    Actor,
    TimedActor,
    check_time_limit,
    is_run,
    load_policy,
    load_within,
)
from artiskill.evaluation.remote import RemoteActor, RemotePolicy
from artiskill.evaluation.report import Report, make_report
from artiskill.evaluation.sandbox import SandboxConfig
from artiskill.evaluation.statistics import EpisodeResult
from artiskill.geometry.arrays import clip
from artiskill.jobs.fork_server import fork_server
from artiskill.jobs.parallel import check_workers, run_jobs
from artiskill.jobs.worker import Send

if TYPE_CHECKING:  # torch takes seconds to import
    from artiskill.learning.run import RunInfo
    from artiskill.learning.stopping import StopSignal
    from artiskill.learning.train_config import TrainConfig
    from artiskill.learning.trainer import Develop

OnStep = Callable[[ManipulationEnv, int, bool], None]
Result = TypeVar("Result")


def evaluate(
    task: str,
    policy: Any,
    objects: ObjectChoice = "test",
    episodes: int = 10,
    first_level: int = 0,
    *,
    target: str | None = None,
    obs_mode: str | None = None,
    control_mode: str | None = None,
    config: Mapping[str, Any] | None = None,
    workers: int = 1,
    on_episode: Callable[[EpisodeResult], None] | None = None,
    step_timeout_s: float | None = None,
    load_timeout_s: float = LOAD_TIMEOUT_S,
    salt: str | None = None,
    track: str | None = None,
    sandbox: SandboxConfig | str | None = None,
) -> Report:
    """Play the levels `first_level` to `first_level + episodes - 1` on every object and count.

    The same arguments give the same report, up to its `timing`, for any number of workers. A solution file never
    runs in this process, but, for every object, in a new one.

    Args:
        task: name of the task.
        policy: `expert`, `demonstrator`, `random`, `still`, `pretrained`, path of a solution file, run or exported
            file, address `ws://host:port` of a policy's server or a `RemotePolicy`, function (observation) ->
            action, or object with `obs_mode`, `reset(observation, info)` and `act(observation)`, and with
            `control_mode` unless that is `joint`.
        objects: a split, an id, a list of ids, or `ArticulatedObject`s.
        episodes: per object.
        first_level: of each object.
        target: a link's name, or `all` for one row per object and target; by default each level draws a target.
        obs_mode: by default what the policy asks for, else `state`.
        control_mode: by default what the policy asks for, else `joint`.
        config: values of the task's YAML to change, `{"episode_steps": 100}`; keys may be dotted.
        workers: processes; a function or an object is evaluated in this one.
        on_episode: called after every episode, in no fixed order if there are several workers.
        step_timeout_s: the time in which each action, and each `reset` of the policy, must come; None for any, but
            60 s of a solution file or a server. The policy then never runs in this process, so that it must be
            given by name or path.
        load_timeout_s: the time in which a solution file must have been run and its policy constructed, or a
            server must answer.
        salt: play `episodes` fresh levels instead, hashes of this text, see `protocols.fresh_levels`.
        track: one of `protocols.TRACKS`, what the policy was made from, for the report.
        sandbox: one of `sandbox.SANDBOXES`, or a `SandboxConfig`: how the processes of a solution file are
            confined; by default by the best kind that holds here.

    Raises:
        UnknownNameError: an unknown task, object, split, target link, mode, policy, track or sandbox.
        ConfigError: an illegal number, an unknown or illegal configuration value, or a sandbox that does not hold
            here.
        AssetError: an object that cannot be used, or that differs from the catalogue's of that id.
        PolicyError: a policy that cannot be loaded or reached, raises, returns no legal action, takes too long, or
            ends its process.
    """
    plan = plan_evaluation(
        task,
        policy,
        objects,
        episodes,
        first_level,
        target,
        obs_mode,
        control_mode,
        config,
        load_timeout_s,
        salt,
        track,
        sandbox,
    )
    return run_evaluation(plan, workers, on_episode, step_timeout_s)


def run_evaluation(
    plan: EvaluationPlan,
    workers: int = 1,
    on_episode: Callable[[EpisodeResult], None] | None = None,
    step_timeout_s: float | None = None,
) -> Report:
    """Run a checked evaluation; see `evaluate`.

    Raises:
        ConfigError: an illegal number of workers or time limit, or a policy that lives in this process only where
            it must run in another.
        PolicyError: the policy raises, returns no legal action, takes too long, or ends its process.
    """
    check_plan_workers(plan, workers, step_timeout_s)
    plan, start = plan.within(step_timeout_s), time.perf_counter()
    results = run_batches(run_batch, plan, plan.batches, workers, on_episode, step_timeout_s)
    return make_report(plan, results, seconds=time.perf_counter() - start, workers=workers)


def run_batches(
    function: Callable[["BatchJob", Send], Result],
    plan: EvaluationPlan,
    batches: Sequence[EpisodeBatch],
    workers: int,
    on_message: Send | None = None,
    step_timeout_s: float | None = None,
) -> list[Result]:
    """Have something done with batches of a plan.

    Policies that come with the package, and those given as objects, may act in this process if there is one worker
    and no time limit. Everything else happens in processes of its own, one for each batch.

    Raises:
        PolicyError: as of `run_evaluation`.
    """
    has_limit = step_timeout_s is not None and not plan.is_remote  # which keeps its time itself
    isolated = plan.is_solution or has_limit or min(workers, len(batches)) > 1
    if isolated:
        prepare_workers(batches[0])
        if is_run(plan.policy):  # torch takes seconds to import
            fork_server().prepare(partial(import_module, "artiskill.learning.policy"))
    load_timeout_s = plan.load_timeout_s if isolated else None
    sandbox = plan.within(step_timeout_s).sandbox
    jobs = [BatchJob(batch, load_timeout_s, step_timeout_s, sandbox) for batch in batches]
    return run_jobs(
        function, jobs, workers, on_message, lambda job: job.batch.label, isolated=isolated, hint=WORKER_HINT
    )


def check_plan_workers(plan: EvaluationPlan, workers: int, step_timeout_s: object = None) -> None:
    """Raise `ConfigError` unless so many processes can work on the plan, under that limit per step."""
    check_workers(workers)
    if step_timeout_s is not None:
        check_time_limit(step_timeout_s)
    if workers > 1 and not plan.is_portable:
        raise ConfigError("only a policy given by name or path can be evaluated by several workers; use workers=1")
    if step_timeout_s is not None and not plan.is_portable:
        raise ConfigError("only a policy given by name or path can be evaluated under a time limit per step")


@dataclass(frozen=True, eq=False)
class BatchJob:
    """A batch that is to be played, and in which times; those in this process have no limits.

    Attributes:
        batch: of episodes.
        load_timeout_s: for the policy.
        step_timeout_s: for each action.
        sandbox: for a solution file, whose time it limits.
    """

    batch: EpisodeBatch
    load_timeout_s: float | None
    step_timeout_s: float | None
    sandbox: SandboxConfig | None = None

    def load_policy(self, send: Send) -> Actor:
        """Load the policy, within its time limit."""
        if isinstance(self.batch.policy, RemotePolicy):
            limit_s = self.step_timeout_s or self.batch.policy.step_timeout_s
            return RemoteActor(replace(self.batch.policy, step_timeout_s=limit_s))
        if self.load_timeout_s is None:
            return load_policy(self.batch.policy, self.batch.task)
        actor = load_within(self.batch.policy, self.load_timeout_s, send, self.batch.task, self.sandbox)
        if self.step_timeout_s is None or self.sandbox is not None:  # which keeps its time itself
            return actor
        return TimedActor(actor, self.step_timeout_s, send)


def run_episode(
    env: ManipulationEnv,
    actor: Actor,
    level: int,
    on_step: OnStep = lambda env, steps, done: None,
) -> EpisodeResult:
    """Run one episode to its end.

    An episode that a fault ends (`FAULTS`: the physics diverges, or an expert's numbers do) counts as failed.

    Args:
        env: of one object; its target is fixed or drawn by the level.
        actor: who acts.
        level: which episode.
        on_step: called with (env, steps so far, is this the end) at the first state and after each step.

    Raises:
        PolicyError: the policy raises or returns no legal action.
    """
    observation, info = env.reset(options={"level": level})
    steps, done, fault, reward_sum = 0, False, "", 0.0
    actions: list[np.ndarray] = []
    act_s: list[float] = []
    try:
        actor.reset(env, observation, info)
        on_step(env, steps, done)
        while not done:
            start = time.perf_counter()
            action = actor.act(env, observation)
            act_s.append(math.nan if actor.from_chunk else time.perf_counter() - start)
            actions.append(np.array(action, np.float64))  # its own: a policy may write into the same array again
            observation, reward, terminated, truncated, info = env.step(action)
            steps, done, reward_sum = steps + 1, terminated or truncated, reward_sum + reward
            on_step(env, steps, done)
    except FAULTS as error:
        fault = fault_text(error)
        on_step(env, steps, True)
    return replace(_outcome(env, info, actions, steps, reward_sum, fault), act_s=np.array(act_s))


def _outcome(
    env: ManipulationEnv,
    info: Mapping[str, Any],
    actions: Sequence[np.ndarray],
    steps: int,
    reward_sum: float,
    fault: str,
) -> EpisodeResult:
    """Return the outcome of an episode that has just ended; `info` is the last one."""
    return EpisodeResult(
        info["object"],
        info["target"],
        info["level"],
        success=info["success"],  # which ends an episode: one that a fault ends has not come to it
        length=steps,
        flags=dict.fromkeys(info["flags"], False) if fault else dict(info["flags"]),
        fault=fault,
        reward_sum=reward_sum,
        digest="" if fault else final_digest(env.save_state()),
        actions=clip(np.array(actions).reshape(-1, env.control.size), -1.0, 1.0),
    )


def run_batch(job: BatchJob, send: Send) -> list[EpisodeResult]:
    """Play a batch in a new environment with a new policy, so that no object's episodes depend on another's."""
    env, results = job.batch.make_env(), []
    with closing(job.load_policy(send)) as actor:
        for level in job.batch.levels:
            results.append(run_episode(env, actor, level))
            send(results[-1])
    return results


def prepare_workers(batch: EpisodeBatch) -> None:
    """Have worker processes begin with all that a batch needs, but for its policy; returns at once."""
    fork_server().prepare(partial(_warm_up, replace(batch, policy="still")))


def _warm_up(batch: EpisodeBatch) -> None:
    """Load what every batch needs, compiled code above all, before any process is forked."""
    env = batch.make_env()
    env.reset(options={"level": batch.levels[0]})
    env.step(np.zeros(env.action_space.shape or (), np.float32))


def make_develop(
    config: "TrainConfig", objects: Sequence[str | ArticulatedObject], workers: int, info: "RunInfo"
) -> "Develop":
    """Return what measures a checkpoint's success on development objects.

    Args:
        config: of the run.
        objects: see `check_development`.
        workers: processes.
        info: of the run.
    """
    wanted = config.development

    def develop(weights: Path, stop: "StopSignal") -> list[tuple[str, int, int]]:
        def on_episode(result: EpisodeResult) -> None:
            stop.check()

        report = evaluate(
            config.task,
            str(weights),
            list(objects),
            wanted.episodes,
            wanted.first_level,
            config=info.overrides,
            workers=workers,
            on_episode=on_episode,
        )
        return [(row.object, row.stats.episodes, row.stats.successes) for row in report.rows]

    return develop

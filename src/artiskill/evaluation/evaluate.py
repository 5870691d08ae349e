"""`evaluate`: a policy's success on many objects and levels, as a `Report`."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np

from artiskill.envs.manipulation import ObjectChoice
from artiskill.errors import ConfigError, shown
from artiskill.evaluation.episodes import EpisodeResult, run_episode
from artiskill.evaluation.plan import WORKER_HINT, EpisodeBatch, Plan, make_plan
from artiskill.evaluation.policies import Actor, load_policy
from artiskill.evaluation.report import Report, make_report
from artiskill.evaluation.time_limit import LOAD_TIMEOUT_S, TimedActor, check_limit, load_within
from artiskill.jobs.fork_server import fork_server
from artiskill.jobs.parallel import run_jobs

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
) -> Report:
    """Play the levels `first_level` to `first_level + episodes - 1` on every object and count.

    The same arguments give the same report, up to its `timing`, for any number of workers. A solution file never
    runs in this process, but, for every object, in a new one.

    Args:
        task: name of the task.
        policy: `expert`, `random`, path of a solution file, function (observation) -> action, or object with
            `obs_mode`, `reset(observation, info)` and `act(observation)`, and with `control_mode` unless that is
            `joint`.
        objects: a split, an id, a list of ids, or `ArticulatedObject`s.
        episodes: per object.
        first_level: of each object.
        target: a link's name, or `all` for one row per object and target; by default each level draws a target.
        obs_mode: by default what the policy asks for, else `state`.
        control_mode: by default what the policy asks for, else `joint`.
        config: values of the task's YAML to change, `{"episode_steps": 100}`; keys may be dotted.
        workers: processes; a function or an object is evaluated in this one.
        on_episode: called after every episode, in no fixed order if there are several workers.
        step_timeout_s: the time in which each action, and each `reset` of the policy, must come; None for any. The
            policy then never runs in this process, so that it must be given by name or path.
        load_timeout_s: the time in which a solution file must have been run and its policy constructed.

    Raises:
        UnknownNameError: an unknown task, object, split, target link, observation or control mode, or policy.
        ConfigError: an illegal number, or an unknown or illegal configuration value.
        AssetError: an object that cannot be used, or that differs from the catalogue's of that id.
        PolicyError: a policy that cannot be loaded, raises, returns no legal action, takes too long, or ends its
            process.
    """
    plan = make_plan(
        task, policy, objects, episodes, first_level, target, obs_mode, control_mode, config, load_timeout_s
    )
    return run_plan(plan, workers, on_episode, step_timeout_s)


def run_plan(
    plan: Plan,
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
    check_workers(plan, workers, step_timeout_s)
    start = time.perf_counter()
    results = run_batches(_run_batch, plan, plan.batches, workers, on_episode, step_timeout_s)
    return make_report(plan, results, seconds=time.perf_counter() - start, workers=workers)


def run_batches(
    function: Callable[["BatchJob", Callable[[Any], None]], Result],
    plan: Plan,
    batches: Sequence[EpisodeBatch],
    workers: int,
    on_message: Callable[[Any], None] | None = None,
    step_timeout_s: float | None = None,
) -> list[Result]:
    """Have something done with batches of a plan.

    Policies that come with the package, and those given as objects, may act in this process if there is one worker
    and no time limit. Everything else happens in processes of its own, one for each batch.

    Raises:
        PolicyError: as of `run_plan`.
    """
    isolated = plan.is_foreign or step_timeout_s is not None or min(workers, len(batches)) > 1
    if isolated:
        fork_server().prepare(partial(_warm_up, replace(batches[0], policy="still")))
    load_timeout_s = plan.load_timeout_s if isolated else None
    jobs = [BatchJob(batch, load_timeout_s, step_timeout_s) for batch in batches]
    return run_jobs(
        function, jobs, workers, on_message, lambda job: job.batch.label, isolated=isolated, hint=WORKER_HINT
    )


def check_workers(plan: Plan, workers: object, step_timeout_s: object = None) -> None:
    """Raise `ConfigError` unless so many processes can work on the plan, under that limit per step."""
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise ConfigError(f"workers must be a whole number of at least 1, not {shown(workers)}")
    if step_timeout_s is not None:
        check_limit(step_timeout_s)
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
    """

    batch: EpisodeBatch
    load_timeout_s: float | None
    step_timeout_s: float | None

    def load_policy(self, tell: Callable[[Any], None]) -> Actor:
        """The one that acts."""
        if self.load_timeout_s is None:
            return load_policy(self.batch.policy)
        actor = load_within(self.batch.policy, self.load_timeout_s, tell)
        return actor if self.step_timeout_s is None else TimedActor(actor, self.step_timeout_s, tell)


def _run_batch(job: BatchJob, tell: Callable[[Any], None]) -> list[EpisodeResult]:
    """Environment and policy are made anew for every batch: no object's episodes know of another's."""
    env, actor = job.batch.make_env(), job.load_policy(tell)
    results = []
    for level in job.batch.levels:
        results.append(run_episode(env, actor, level))
        tell(results[-1])
    return results


def _warm_up(batch: EpisodeBatch) -> None:
    """Load what every batch needs, compiled code above all, before any process is forked."""
    env = batch.make_env()
    env.reset(options={"level": batch.levels[0]})
    env.step(np.zeros(env.action_space.shape or (), np.float32))

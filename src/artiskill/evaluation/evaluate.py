"""`evaluate`: a policy's success on many objects and levels, as a `Report`."""

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from artiskill.envs.manipulation import ObjectChoice
from artiskill.errors import ConfigError, shown
from artiskill.evaluation.episodes import EpisodeResult, run_episode
from artiskill.evaluation.plan import EpisodeBatch, Plan, make_plan
from artiskill.evaluation.policies import load_policy
from artiskill.evaluation.report import Report, make_report
from artiskill.evaluation.time_limit import TimedActor, check_limit
from artiskill.jobs.parallel import run_jobs


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
) -> Report:
    """Play the levels `first_level` to `first_level + episodes - 1` on every object and count.

    The same arguments give the same report, up to its `timing`, for any number of workers. More than one worker
    needs a script that keeps its own work under `if __name__ == "__main__":`, as Python's multiprocessing does.

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

    Raises:
        UnknownNameError: an unknown task, object, split, target link, observation or control mode, or policy.
        ConfigError: an illegal number, or an unknown or illegal configuration value.
        AssetError: an object that cannot be used, or that differs from the catalogue's of that id.
        PolicyError: a policy that cannot be loaded, raises, returns no legal action, takes too long, or ends its
            process.
    """
    plan = make_plan(task, policy, objects, episodes, first_level, target, obs_mode, control_mode, config)
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
    results = run_jobs(
        partial(_run_batch, limit_s=step_timeout_s),
        plan.batches,
        workers,
        on_episode,
        describe=lambda batch: batch.label,
        own_process=step_timeout_s is not None,
    )
    return make_report(plan, results, seconds=time.perf_counter() - start, workers=workers)


def check_workers(plan: Plan, workers: object, step_timeout_s: object = None) -> None:
    """Raise `ConfigError` unless so many processes can work on the plan, under that limit per step."""
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise ConfigError(f"workers must be a whole number of at least 1, not {shown(workers)}")
    check_limit(step_timeout_s)
    if workers > 1 and not plan.is_portable:
        raise ConfigError("only a policy given by name or path can be evaluated by several workers; use workers=1")
    if step_timeout_s is not None and not plan.is_portable:
        raise ConfigError("only a policy given by name or path can be evaluated under a time limit per step")


def _run_batch(
    batch: EpisodeBatch, tell: Callable[[Any], None], limit_s: float | None = None
) -> list[EpisodeResult]:
    """Environment and policy are made anew for every batch: no object's episodes know of another's."""
    env, actor = batch.make_env(), load_policy(batch.policy)
    if limit_s is not None:
        actor = TimedActor(actor, limit_s, tell)
    results = []
    for level in batch.levels:
        results.append(run_episode(env, actor, level))
        tell(results[-1])
    return results

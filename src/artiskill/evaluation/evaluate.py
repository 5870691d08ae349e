"""`evaluate`: a policy's success on many objects and levels, as a `Report`."""

import time
from collections.abc import Callable, Mapping
from typing import Any

from artiskill.envs.manipulation import ObjectChoice
from artiskill.errors import ConfigError
from artiskill.evaluation.episodes import EpisodeResult, run_episode
from artiskill.evaluation.parallel import run_jobs
from artiskill.evaluation.plan import EpisodeBatch, Plan, make_plan
from artiskill.evaluation.policies import load_policy
from artiskill.evaluation.report import Report, make_report


def evaluate(
    task: str,
    policy: Any,
    objects: ObjectChoice = "test",
    episodes: int = 10,
    first_level: int = 0,
    *,
    target: str | None = None,
    obs_mode: str | None = None,
    config: Mapping[str, Any] | None = None,
    workers: int = 1,
    on_episode: Callable[[EpisodeResult], None] | None = None,
) -> Report:
    """Play the levels `first_level` to `first_level + episodes - 1` on every object and count.

    The same arguments give the same report, up to its `timing`, for any number of workers. More than one worker
    needs a script that keeps its own work under `if __name__ == "__main__":`, as Python's multiprocessing does.

    Args:
        task: name of the task.
        policy: `expert`, `random`, path of a solution file, function (observation) -> action, or object with
            `obs_mode`, `reset(observation, info)` and `act(observation)`.
        objects: a split, an id, a list of ids, or `ArticulatedObject`s.
        episodes: per object.
        first_level: of each object.
        target: a link's name, or `all` for one row per object and target; by default each level draws a target.
        obs_mode: by default what the policy asks for, else `state`.
        config: values of the task's YAML to change, `{"episode_steps": 100}`; keys may be dotted.
        workers: processes; a function or an object is evaluated in this one.
        on_episode: called after every episode, in no fixed order if there are several workers.

    Raises:
        UnknownNameError: an unknown task, object, split, target link, observation mode or policy.
        ConfigError: an illegal number, or an unknown or illegal configuration value.
        AssetError: an object that cannot be used.
        PolicyError: a policy that cannot be loaded, raises, or returns no legal action.
    """
    plan = make_plan(task, policy, objects, episodes, first_level, target, obs_mode, config)
    return run_plan(plan, workers, on_episode)


def run_plan(plan: Plan, workers: int = 1, on_episode: Callable[[EpisodeResult], None] | None = None) -> Report:
    """Run a checked evaluation; see `evaluate`.

    Raises:
        ConfigError: an illegal number of workers, or several for a policy that lives in this process only.
        PolicyError: the policy raises or returns no legal action.
    """
    check_workers(plan, workers)
    start = time.perf_counter()
    results = run_jobs(_run_batch, plan.batches, workers, on_episode)
    return make_report(plan, results, seconds=time.perf_counter() - start, workers=workers)


def check_workers(plan: Plan, workers: object) -> None:
    """Raise `ConfigError` unless so many processes can work on the plan."""
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise ConfigError(f"workers must be a whole number of at least 1, not {workers!r}")
    if workers > 1 and not plan.is_portable:
        raise ConfigError("only a policy given by name or path can be evaluated by several workers; use workers=1")


def _run_batch(batch: EpisodeBatch, tell: Callable[[EpisodeResult], None]) -> list[EpisodeResult]:
    """Environment and policy are made anew for every batch: no object's episodes know of another's."""
    env, actor = batch.make_env(), load_policy(batch.policy)
    results = []
    for level in batch.levels:
        results.append(run_episode(env, actor, level))
        tell(results[-1])
    return results

"""One episode: a policy acts in an environment, and what came of it."""

from collections.abc import Callable
from dataclasses import dataclass

from artiskill.demos.attempts import FAULTS, fault_text
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError
from artiskill.evaluation.policies import Actor


@dataclass(frozen=True)
class EpisodeResult:
    """What came of one episode.

    Attributes:
        object: id of the object.
        target: name of the target link.
        level: of the episode.
        success: whether the task was solved.
        length: environment steps until it was solved or cut off.
        flags: condition -> did it hold, long enough, at the end; none of one that a fault ended.
        fault: what ended it, where that was not the episode's end, physics that ran away say: a text that begins
            with the kind; else empty.
    """

    object: str
    target: str
    level: int
    success: bool
    length: int
    flags: dict[str, bool]
    fault: str = ""


def run_episode(
    env: ManipulationEnv,
    actor: Actor,
    level: int,
    watch: Callable[[ManipulationEnv, int, bool], None] | None = None,
) -> EpisodeResult:
    """Play a level to its end.

    Args:
        env: of one object; its target is fixed or drawn by the level.
        actor: who acts.
        level: which episode.
        watch: called with (env, steps so far, is this the end) at the first state and after each step.

    An episode that a fault ends (`FAULTS`: the physics runs away, or an expert's numbers do) counts as failed.

    Raises:
        PolicyError: the policy raises or returns no legal action.
    """
    watch = watch or _look_away
    observation, info = env.reset(options={"level": level})
    steps, done, fault = 0, False, ""
    try:
        actor.reset(env, observation, info)
        watch(env, steps, done)
        while not done:
            observation, _, terminated, truncated, info = env.step(actor.act(env, observation))
            steps, done = steps + 1, terminated or truncated
            watch(env, steps, done)
    except FAULTS as error:
        fault = fault_text(error)
        watch(env, steps, True)
    return EpisodeResult(
        object=info["object"],
        target=info["target"],
        level=level,
        success=info["success"],  # which ends an episode: one that a fault ends has not come to it
        length=steps,
        flags=dict.fromkeys(info["flags"], False) if fault else dict(info["flags"]),
        fault=fault,
    )


def _look_away(env: ManipulationEnv, steps: int, done: bool) -> None:
    pass


def play_steps(env: ManipulationEnv, actor: Actor | None, level: int, steps: int) -> None:
    """Play a level's first steps; the environment is left there.

    Args:
        env: as in `run_episode`.
        actor: who acts; None where nobody does, for 0 steps.
        level: which episode.
        steps: how many.

    Raises:
        ConfigError: a negative number, or the episode is over before.
        PolicyError: the policy raises or returns no legal action.
    """
    if steps < 0:
        raise ConfigError(f"the number of steps must not be negative, not {steps}")
    observation, info = env.reset(options={"level": level})
    if steps == 0 or actor is None:
        return
    actor.reset(env, observation, info)
    for step in range(1, steps + 1):
        observation, _, terminated, truncated, info = env.step(actor.act(env, observation))
        if (terminated or truncated) and step < steps:
            how = "solved" if info["success"] else "cut off"
            raise ConfigError(f"step {steps} does not exist: the episode is {how} after {step} steps")

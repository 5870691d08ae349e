"""One episode: a policy acts in an environment, and what came of it."""

from collections.abc import Callable
from dataclasses import dataclass

from artiskill.envs.manipulation import ManipulationEnv
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
        flags: condition -> did it hold, long enough, at the end.
    """

    object: str
    target: str
    level: int
    success: bool
    length: int
    flags: dict[str, bool]


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

    Raises:
        PolicyError: the policy raises or returns no legal action.
    """
    observation, info = env.reset(options={"level": level})
    actor.reset(env, observation, info)
    steps, done = 0, False
    if watch is not None:
        watch(env, steps, done)
    while not done:
        observation, _, terminated, truncated, info = env.step(actor.act(env, observation))
        steps, done = steps + 1, terminated or truncated
        if watch is not None:
            watch(env, steps, done)
    return EpisodeResult(
        object=info["object"],
        target=info["target"],
        level=level,
        success=info["success"],
        length=steps,
        flags=dict(info["flags"]),
    )

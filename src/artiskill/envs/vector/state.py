"""Saved instants of single environments of a vector: the same as those of `ManipulationEnv`."""

from collections.abc import Mapping, Sequence
from typing import Any

from artiskill.envs.state import EnvState, check_episode
from artiskill.envs.vector.episodes import Episodes
from artiskill.errors import DivergedError, ResetNeededError
from artiskill.sim.states import check_state


def save_env(episodes: Episodes, env: int) -> EnvState:
    """The instant of one environment.

    Raises:
        ResetNeededError: it has no episode yet.
    """
    if episodes.objects[env] is None:
        raise ResetNeededError("call reset() before save_state()")
    squad, slot = episodes.fleet.squad_of(env), int(episodes.fleet.slot[env])
    return EnvState(
        task=episodes.task.name,
        object=episodes.objects[env],
        target=episodes.targets[env],
        level=int(episodes.levels[env]),
        simulation=squad.simulation.save([slot]),
        elapsed=int(episodes.progress.elapsed[env]),
        streaks=episodes.progress.streaks[env].copy(),
    )


def restore_env(episodes: Episodes, env: int, state: EnvState) -> None:
    """Take back an instant into one environment.

    Raises:
        StateError: the state is of another task, object, robot, physics configuration or props, or damaged.
        UnknownNameError: there is no such object or target link.
        ResetNeededError: no episode has begun yet.
    """
    check_episode(state, episodes.task.name, len(episodes.task.flag_names))
    if episodes.objects[env] is None:
        raise ResetNeededError("call reset() before restore_state()")
    obj = episodes.find(env, state.object, state.target)
    check_state(state.simulation, [episodes.scene_for(obj)])  # from here on nothing fails
    episodes.start([env], [state.level], [obj], [state.target])
    squad, slot = episodes.fleet.squad_of(env), int(episodes.fleet.slot[env])
    squad.simulation.restore(state.simulation, [slot], is_checked=True)
    squad.look()
    episodes.progress.elapsed[env] = state.elapsed
    episodes.progress.streaks[env] = state.streaks
    episodes.evaluate()


def save_all(episodes: Episodes) -> dict[str, Any]:
    """Where all environments are, and what their next episodes are drawn from; detached from them.

    Raises:
        DivergedError: the physics of some ran away: there is no state to go on from.
    """
    if causes := episodes.fleet.diverged():
        raise DivergedError(causes)
    envs = range(len(episodes.levels)) if episodes.begun else ()
    return {
        "generators": episodes.generators,
        "handed_in": [casting.handed_in for casting in episodes.castings],
        "states": [save_env(episodes, env) for env in envs],
    }


def restore_all(episodes: Episodes, saved: Mapping[str, Any]) -> range:
    """Take back what `save_all` told, into new episodes; the environments that have another state now."""
    episodes.generators = list(saved["generators"])
    for casting, objects in zip(episodes.castings, saved["handed_in"], strict=True):
        for obj in objects:
            casting.remember(obj)
    states: Sequence[EnvState] = saved["states"]
    envs = range(len(states))
    episodes.start(envs, *([getattr(s, name) for s in states] for name in ("level", "object", "target")))
    for env, state in zip(envs, states, strict=True):
        restore_env(episodes, env, state)
    return envs

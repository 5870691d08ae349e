"""Saved instants of single environments of a vector: the same as those of `ManipulationEnv`."""

from collections.abc import Mapping, Sequence
from typing import Any

from artiskill.envs.state import EnvState, check_progress
from artiskill.envs.vector.episodes import Episodes
from artiskill.errors import DivergedError, ResetNeededError, StateError
from artiskill.sim.simulation import Simulation


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
        StateError: the state is of another task, object or physics configuration, or damaged.
        ResetNeededError: no episode has begun yet.
    """
    if not isinstance(state, EnvState) or state.task != episodes.task.name:
        given = state.task if isinstance(state, EnvState) else type(state).__name__
        raise StateError(f"cannot restore a state of {given!r} into {episodes.task.name!r}")
    if episodes.objects[env] is None:
        raise ResetNeededError("call reset() before restore_state()")
    check_progress(state, len(episodes.task.flag_names))
    obj = episodes.find(env, state.object, state.target)
    Simulation(episodes.scene_for(obj)).check_state(state.simulation)  # from here on nothing fails
    episodes.start([env], [state.level], [obj], [state.target])
    squad, slot = episodes.fleet.squad_of(env), int(episodes.fleet.slot[env])
    squad.simulation.restore(state.simulation, [slot])
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

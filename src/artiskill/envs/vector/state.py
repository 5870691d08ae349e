"""Saved instants of single environments of a vector: the same as those of `ManipulationEnv`."""

from artiskill.envs.state import EnvState, check_episode
from artiskill.envs.vector.episodes import Episodes
from artiskill.errors import ResetNeededError
from artiskill.sim.state_checks import check_state


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

"""`EnvState`: a saved state of an episode, which episodes are saved to and restored from."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from artiskill.envs.core import Episodes
from artiskill.errors import Cause, DivergedError, StateError, shown
from artiskill.sim.states import SimulationState, check_state
from artiskill.tasks.levels import check_level

_MOST_STEPS = 2**31 - 1  # of an episode: nobody plays so long, and counting on from there cannot overflow


@dataclass(frozen=True, eq=False)
class EnvState:
    """A saved state of an episode; `ManipulationEnv.restore_state` restores it.

    Attributes:
        task: name of the task.
        object: id of the object.
        target: name of the target link.
        level: of the episode.
        simulation: physical state.
        elapsed: environment steps so far.
        streaks: (F,) consecutive steps that each flag has held.
    """

    task: str
    object: str
    target: str
    level: int
    simulation: SimulationState
    elapsed: int
    streaks: np.ndarray


def save_episode(episodes: Episodes, env: int) -> EnvState:
    """Return the state of one episode.

    Raises:
        ResetNeededError: before the first reset.
    """
    episodes.check_begun("save_state()")
    batch, slot = episodes.group.batch_of(env), int(episodes.group.slot[env])
    return EnvState(
        task=episodes.task.name,
        object=episodes.objects[env],
        target=episodes.targets[env],
        level=int(episodes.levels[env]),
        simulation=batch.simulation.save([slot]),
        elapsed=int(episodes.elapsed[env]),
        streaks=episodes.streaks[env].copy(),
    )


def restore_episodes(episodes: Episodes, envs: Sequence[int], states: Sequence[EnvState]) -> list[int]:
    """Restore saved episodes; nothing has changed if it raises.

    Returns:
        The environments whose scene or target has changed.

    Raises:
        StateError: a state is of another task, object, robot, physics configuration or props, or damaged.
        UnknownNameError: there is no such object or target link.
    """
    scenes = []
    for env, state in zip(envs, states, strict=True):
        check_episode(state, episodes.task.name, len(episodes.task.flag_names))
        obj = episodes.samplers[env].find(state.object)
        episodes.samplers[env].check_target(obj, state.target)
        scene = episodes.scene_with(obj, env)
        check_state(state.simulation, [scene])
        scenes.append(scene)
    levels, targets = [state.level for state in states], [state.target for state in states]
    placed, changed = episodes.place(envs, levels, scenes, targets)
    for batch, indices, slots in placed:
        for k, slot in zip(indices, slots, strict=True):
            batch.simulation.restore(states[k].simulation, [slot], [scenes[k]], is_checked=True)
        batch.refresh()
    for env, state in zip(envs, states, strict=True):
        episodes.elapsed[env], episodes.streaks[env] = state.elapsed, state.streaks
    return changed


def save_all(episodes: Episodes) -> list[EnvState]:
    """Return the states of all episodes; none before the first reset.

    Raises:
        DivergedError: the physics of some diverged: there is no state to go on from.
    """
    causes: dict[int, Cause] = {}
    for batch in episodes.group.batches:
        found = batch.simulation.diverged(batch.taken)
        causes |= {int(batch.members[slot]): cause for slot, cause in found.items()}
    if causes:
        raise DivergedError(causes)
    return [save_episode(episodes, env) for env in range(episodes.count if episodes.begun else 0)]


def check_episode(state: EnvState, task: str, flags: int) -> None:
    """Check the episode's part of a state: that it belongs to a task and is not damaged.

    Args:
        state: all but its physical part is looked at.
        task: name of the task.
        flags: how many conditions of success it has.

    Raises:
        StateError: it is of another task, or its object, target, steps or streaks make no sense.
        ConfigError: its level does not.
    """
    if not isinstance(state, EnvState) or not isinstance(state.task, str) or state.task != task:
        given = shown(state.task) if isinstance(state, EnvState) else repr(type(state).__name__)
        raise StateError(f"cannot restore a state of {given} into {task!r}")
    for name in ("object", "target"):
        if not isinstance(getattr(state, name), str):
            raise StateError(f"this state's {name} is damaged: a name is text, not {shown(getattr(state, name))}")
    if not isinstance(state.simulation, SimulationState):
        raise StateError(f"this state's simulation is damaged: it is a {type(state.simulation).__name__}")
    check_level(state.level)
    if not _is_count(state.elapsed) or not _are_counts(state.streaks, flags):
        raise StateError(
            f"this state's progress is damaged: elapsed {shown(state.elapsed)}, streaks {shown(state.streaks)}; "
            f"legal are whole numbers from 0 to {_MOST_STEPS}, {flags} of them for the streaks"
        )


def _is_count(value: object) -> bool:
    is_whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    return is_whole and 0 <= value <= _MOST_STEPS  # type: ignore[operator]


def _are_counts(values: object, count: int) -> bool:
    try:
        found = np.asarray(values)
    except ValueError:  # rows of different lengths
        return False
    is_whole = found.shape == (count,) and found.dtype.kind == "i"
    return is_whole and bool(((found >= 0) & (found <= _MOST_STEPS)).all())

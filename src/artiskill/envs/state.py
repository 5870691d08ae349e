"""`EnvState`: a saved instant of an episode."""

from dataclasses import dataclass

import numpy as np

from artiskill.errors import StateError, shown
from artiskill.sim.states import SimulationState
from artiskill.tasks.levels import check_level

_MOST_STEPS = 2**31 - 1  # of an episode: nobody plays so long, and counting on from there cannot overflow


@dataclass(frozen=True, eq=False)
class EnvState:
    """A saved instant of an episode; `ManipulationEnv.restore_state` takes it back.

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


def check_episode(state: EnvState, task: str, flags: int) -> None:
    """See whether the episode's part of a state makes sense, and belongs to a task.

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

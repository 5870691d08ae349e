"""`EnvState`: a saved instant of an episode."""

from dataclasses import dataclass

import numpy as np

from artiskill.errors import StateError
from artiskill.sim.states import SimulationState
from artiskill.tasks.levels import check_level


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


def check_progress(state: EnvState, flags: int) -> None:
    """See whether the episode's part of a state makes sense, and whether there is a physical part.

    Raises:
        StateError: its steps or streaks do not, or there is none.
        ConfigError: its level does not.
    """
    if not isinstance(state.simulation, SimulationState):
        raise StateError(f"this state's simulation is damaged: it is a {type(state.simulation).__name__}")
    check_level(state.level)
    steps_are_legal = isinstance(state.elapsed, int | np.integer) and state.elapsed >= 0
    streaks = np.asarray(state.streaks)
    if not steps_are_legal or streaks.shape != (flags,) or streaks.dtype.kind != "i" or (streaks < 0).any():
        raise StateError(
            f"this state's progress is damaged: elapsed {state.elapsed!r}, streaks {state.streaks!r}; "
            f"legal are whole numbers from 0 on, {flags} of them for the streaks"
        )

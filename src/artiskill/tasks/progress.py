"""What an episode remembers besides the physical state: its steps, and for how long each flag has held."""

from collections.abc import Mapping, Sequence

import numpy as np

from artiskill.geometry.arrays import columns


class Progress:
    """Elapsed steps and flag streaks of B episodes.

    A flag counts once it has held for `hold_steps` consecutive steps; an episode is solved in the step in which
    all flags count at the same time.

    Attributes:
        elapsed: (B,) environment steps since the episode's first state.
        streaks: (B, F) consecutive steps that each flag has held up to now.
    """

    def __init__(self, num_envs: int, flag_names: Sequence[str], hold_steps: int) -> None:
        self.flag_names = tuple(flag_names)
        self.hold_steps = hold_steps
        self.elapsed = np.zeros(num_envs, dtype=np.int64)
        self.streaks = np.zeros((num_envs, len(self.flag_names)), dtype=np.int64)

    def restart(self) -> None:
        """A new episode everywhere."""
        self.elapsed[:] = 0
        self.streaks[:] = 0

    def advance(self, flags: Mapping[str, np.ndarray]) -> None:
        """Count one environment step with these flags, each (B,) bool."""
        self.streaks += 1
        self.streaks *= columns([flags[name] for name in self.flag_names])
        self.elapsed += 1

    @property
    def counted(self) -> np.ndarray:
        """Which flags count, (B, F) bool."""
        return self.streaks >= self.hold_steps

    @property
    def success(self) -> np.ndarray:
        """Which episodes are solved at this instant, (B,) bool."""
        return np.asarray(self.counted.all(axis=-1))

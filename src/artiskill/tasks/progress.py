"""What an episode remembers besides the physical state: its steps, and for how long each flag has held."""

from collections.abc import Mapping, Sequence

import numpy as np

from artiskill.geometry.arrays import columns


class EpisodeProgress:
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

    def restart(self, envs: Sequence[int] | None = None) -> None:
        """Return a new episode everywhere, or in some environments."""
        rows = slice(None) if envs is None else envs
        self.elapsed[rows] = 0
        self.streaks[rows] = 0

    def advance(self, flags: Mapping[str, np.ndarray], active: np.ndarray | None = None) -> None:
        """Count one environment step with these flags, each (B,) bool; of the active environments, (B,) bool."""
        held = columns([flags[name] for name in self.flag_names])
        if active is None:
            self.elapsed += 1
            self.streaks += 1
            self.streaks *= held
        else:
            self.elapsed += active
            self.streaks += active[:, None]
            self.streaks *= held | ~active[:, None]

    @property
    def counted(self) -> np.ndarray:
        """Which flags count, (B, F) bool."""
        return self.streaks >= self.hold_steps

    @property
    def success(self) -> np.ndarray:
        """Which episodes are solved at this instant, (B,) bool."""
        return np.asarray(self.counted.all(axis=-1))

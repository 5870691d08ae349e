"""What the environments of a vector see, and the arrays in which they tell it."""

from typing import Any

import numpy as np

from artiskill.envs.observation import empty_observation
from artiskill.envs.vector.episodes import Episodes
from artiskill.envs.vector.info import ObjectArray, stacked
from artiskill.envs.vector.observation import VectorObserver, copied, row_of
from artiskill.errors import ConfigError


class Sight:
    """Observations of all episodes.

    Args:
        episodes: that are observed.
        observer: how.
        gives_copies: whether `arrays` are the caller's to keep; else each call writes into the same ones.

    Attributes:
        arrays: the observations of the last call, with batch (B,).
        stale: (B,) bool, whose part of `arrays` does not say how things are now: all, once `arrays` are new.
    """

    def __init__(self, episodes: Episodes, observer: VectorObserver, gives_copies: bool) -> None:
        self._episodes, self._observer, self._gives_copies = episodes, observer, gives_copies
        self._count, self.is_closed = len(episodes.levels), False
        self.arrays = empty_observation(observer.space, (self._count,))
        self.stale = np.ones(self._count, dtype=bool)
        for env in range(self._count if episodes.begun else 0):
            self.enter(env)

    def enter(self, env: int) -> None:
        """An environment has another scene, target link or state."""
        self.stale[env] = True
        self._observer.enter(env, self._episodes.fleet.scene_of(env), self._episodes.targets[env])

    def renew(self) -> None:
        """Begin a call's observations: what the caller has got of the last one stays as it is."""
        if self._gives_copies:
            self.arrays = empty_observation(self._observer.space, (self._count,))
            self.stale[:] = True

    def look(self, envs: np.ndarray | None = None, told: np.ndarray | None = None) -> dict[str, Any]:
        """Observe.

        Args:
            envs: (B,) bool, who looks; None for all.
            told: (B,) bool, of whom the observer's own infos are wanted; None for all that look.

        Returns:
            Infos, as arrays (B, ...).
        """
        episodes, chosen = self._episodes, np.arange(self._count) if envs is None else np.flatnonzero(envs)
        added = self._observer.observe(
            episodes.fleet, chosen, episodes.levels, episodes.progress.elapsed, self.arrays
        )
        self.stale[chosen] = False
        wanted = {env: info for env, info in added.items() if told is None or told[env]}
        return episodes.info() | stacked(wanted, self._count)

    def close(self) -> None:
        """Stop the observer's threads."""
        self.is_closed = True
        self._observer.close()

    def check_open(self) -> None:
        """See that it has not been closed.

        Raises:
            ConfigError: it has.
        """
        if self.is_closed:
            raise ConfigError("this vector environment was closed: make another one")

    def last_of(self, envs: np.ndarray) -> ObjectArray:
        """(B,) of objects: copies of the observations of some environments, given as (B,) bool, else None."""
        found = np.full(self._count, None, dtype=object)
        for env in np.flatnonzero(envs).tolist():
            found[env] = copied(row_of(self.arrays, env))
        return found.view(ObjectArray)

"""What a policy that gives commands does where it stands still, in front of a part of a new kind, say.

A policy that remembers nothing stays where its likeliest command moves nothing. It also gives commands of other
kinds (`artiskill.learning.commands`), less likely ones: those of another phase, or with the hand rolled otherwise.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from artiskill.config import check_positive, check_value


@dataclass(frozen=True)
class RecoveryConfig:
    """When a policy stands still, and what it does then.

    Chosen on drawers of cabinets on their side, which no policy trains on; docs/recipes.md has the numbers.
    """

    window_steps: int = 15  # it stands still if hands and base are where they were so many steps ago
    distance_m: float = 0.01  # or nearer to that, along each axis
    recovery_steps: int = 5  # of a command of another kind
    kinds: int = 4  # the second likeliest at first, then the third, and so on, so many; then the second again

    def __post_init__(self) -> None:
        check_positive(self, "window_steps", "distance_m", "recovery_steps", "kinds")
        check_value(self, "window_steps", self.window_steps <= 10_000, "must be at most 10000")


class Recovery:
    """The memory of one episode that recovering needs.

    Args:
        config: when and how.
    """

    def __init__(self, config: RecoveryConfig) -> None:
        self._config = config
        self._places: deque[np.ndarray] = deque(maxlen=config.window_steps + 1)
        self.reset()

    def reset(self) -> None:
        """Begin an episode."""
        self._places.clear()
        self._times = self._left = self._kind = 0

    def choose(self, logits: np.ndarray, place_w: np.ndarray) -> int:
        """Return the kind of command for this step.

        Args:
            logits: (K,) how likely each kind is.
            place_w: (P,) m, coordinates of hands and base in the world.
        """
        self._places.append(place_w)
        if self._left:
            self._left -= 1
            return self._kind
        order = np.argsort(-logits, kind="stable")
        others = min(self._config.kinds, len(order) - 1)
        if not others or not self._stands_still():
            return int(order[0])
        self._kind = int(order[1 + self._times % others])
        self._times += 1
        self._left = self._config.recovery_steps - 1
        self._places.clear()
        return self._kind

    def _stands_still(self) -> bool:
        if len(self._places) <= self._config.window_steps:
            return False
        return bool(np.abs(self._places[-1] - self._places[0]).max() < self._config.distance_m)

"""How demonstrations are collected and stored."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from artiskill.config import CONFIG_DIR, check_value, load_config

_MOST_BITS = 40  # float32 keeps fewer anyway
_MOST_COMPRESSION = 9  # of gzip


@dataclass(frozen=True)
class PatienceConfig:
    """When a target is given up.

    Attributes:
        attempts: not before so many.
        least_rate: from then on, as soon as the share of solved attempts is below this.
    """

    attempts: int
    least_rate: float

    def __post_init__(self) -> None:
        check_value(self, "attempts", self.attempts >= 1, "must be at least 1")
        check_value(self, "least_rate", 0 < self.least_rate <= 1, "must lie above 0, and at most at 1")

    def gives_up(self, attempts: int, successes: int) -> bool:
        """Whether the target is given up after so many."""
        return attempts >= self.attempts and successes < self.least_rate * attempts


@dataclass(frozen=True)
class StoreConfig:
    """What is kept of a trajectory.

    Attributes:
        key_frame_steps: the engine's exact state is kept every so many steps, and at the end.
        position_bits: positions of every step are rounded to 2 to the power of minus this (m or rad).
        velocity_bits: likewise velocities (m/s or rad/s).
        action_bits: actions are rounded likewise, before they are played.
        compression: level of gzip.
    """

    key_frame_steps: int
    position_bits: int
    velocity_bits: int
    action_bits: int
    compression: int

    def __post_init__(self) -> None:
        check_value(self, "key_frame_steps", self.key_frame_steps >= 1, "must be at least 1")
        for name in ("position_bits", "velocity_bits", "action_bits"):
            check_value(self, name, 0 <= getattr(self, name) <= _MOST_BITS, f"must lie in [0, {_MOST_BITS}]")
        check_value(
            self,
            "compression",
            0 <= self.compression <= _MOST_COMPRESSION,
            f"must lie in [0, {_MOST_COMPRESSION}]",
        )


@dataclass(frozen=True)
class DemosConfig:
    """All values.

    Attributes:
        block_levels: attempts that a worker makes at a stretch; the result does not depend on it.
        patience: when a target is given up.
        store: what is kept of a trajectory.
    """

    block_levels: int
    patience: PatienceConfig
    store: StoreConfig

    def __post_init__(self) -> None:
        check_value(self, "block_levels", self.block_levels >= 1, "must be at least 1")


def load_demos_config(overrides: Mapping[str, Any] | None = None) -> DemosConfig:
    """The package's values, some of them changed."""
    return load_config(DemosConfig, CONFIG_DIR / "demos.yaml", overrides)

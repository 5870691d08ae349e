"""When a door or drawer counts as open and still."""

from dataclasses import dataclass

from artiskill.config import check_not_negative, check_positive, check_value
from artiskill.geometry.arrays import Array
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.open_cabinet.goal import OpenGoal

FLAG_NAMES = ("open_enough", "cabinet_static")


@dataclass(frozen=True)
class SuccessConfig:
    """Thresholds of the two conditions.

    Attributes:
        open_fraction: of the joint's range.
        max_speed_m_s: of the target link's frame, for it to count as still.
        max_angular_speed_rad_s: likewise.
        hold_s: how long each condition must hold before it counts.
    """

    open_fraction: float
    max_speed_m_s: float
    max_angular_speed_rad_s: float
    hold_s: float

    def __post_init__(self) -> None:
        check_value(self, "open_fraction", 0 < self.open_fraction <= 1, "must lie in (0, 1]")
        check_positive(self, "max_speed_m_s", "max_angular_speed_rad_s")
        check_not_negative(self, "hold_s")


def open_flags(snapshot: Snapshot, goal: OpenGoal, config: SuccessConfig) -> dict[str, Array]:
    """The conditions of `FLAG_NAMES`, each (B,) bool, at this instant."""
    row, link = goal.row, goal.link
    slow = snapshot.link_speed_m_s[row, link] <= config.max_speed_m_s
    turning_slowly = snapshot.link_angular_speed_rad_s[row, link] <= config.max_angular_speed_rad_s
    return {
        "open_enough": snapshot.object_qpos[row, goal.joint] >= goal.open_qpos,
        "cabinet_static": slow & turning_slowly,
    }

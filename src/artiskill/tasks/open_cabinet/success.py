"""When a door or drawer counts as open and still."""

from dataclasses import dataclass

from array_api_compat import array_namespace

from artiskill.config import check
from artiskill.geometry.rotations import Array, quat_angle
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.open_cabinet.goal import OpenGoal


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
        check(0 < self.open_fraction <= 1, f"success.open_fraction must lie in (0, 1], not {self.open_fraction}")
        check(self.hold_s >= 0, f"success.hold_s must not be negative, not {self.hold_s}")


def open_flags(snapshot: Snapshot, goal: OpenGoal, config: SuccessConfig) -> dict[str, Array]:
    """`open_enough` and `cabinet_static`, each (B,) bool, at this instant."""
    speed, angular_speed = target_speed(snapshot, goal)
    return {
        "open_enough": pick(snapshot.object_qpos, goal.joint) >= goal.open_qpos,
        "cabinet_static": (speed <= config.max_speed_m_s) & (angular_speed <= config.max_angular_speed_rad_s),
    }


def target_speed(snapshot: Snapshot, goal: OpenGoal) -> tuple[Array, Array]:
    """Speed (m/s) and angular speed (rad/s) of the target link over the last environment step, (B,) each."""
    xp = array_namespace(snapshot.link_position_w)
    moved = pick(snapshot.link_position_w, goal.link) - pick(snapshot.previous_link_position_w, goal.link)
    turned = quat_angle(
        pick(snapshot.previous_link_quaternion_w, goal.link), pick(snapshot.link_quaternion_w, goal.link)
    )
    return xp.sqrt(xp.sum(moved * moved, axis=-1)) / snapshot.step_s, turned / snapshot.step_s


def pick(values: Array, index: Array) -> Array:
    """`values[b, index[b]]` for every b: (B, K, ...) and (B,) -> (B, ...)."""
    xp = array_namespace(values)
    return values[xp.arange(values.shape[0]), index]

"""Dense reward of the cabinet tasks: named terms, four stages.

Stages: 0 approach, 1 close to the handle, 2 open enough, 3 open enough and still. With the weights that come with
the package, any state of a later stage earns more than any state of an earlier one: a term that a later stage no
longer asks for takes its best value there.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from artiskill.config import check
from artiskill.geometry.arrays import Array, clamp, namespace
from artiskill.geometry.hulls import depth_inside
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.open_cabinet.goal import OpenGoal
from artiskill.tasks.open_cabinet.success import SuccessConfig, flags_of, target_speed

_STAGES = 4
_LINE_SAMPLES = (0.0, 0.25, 0.5, 0.75, 1.0)  # along the fingers' mid-line, for its depth in the handle's hull
_FAR_M = 2.0  # distances saturate here, so that the term is bounded
_ENCLOSED_M = (-0.01, 0.014)  # depth at which the enclosure term starts to rise, and over which it rises by 1
_OPENING_SPEED = (-0.1, 0.6)  # likewise for the joint's velocity, m/s or rad/s
TERM_NAMES = ("hand_angle", "handle_distance", "enclosure", "stage", "opening_speed", "opening", "link_speed")


@dataclass(frozen=True)
class RewardConfig:
    """Weights and stage values.

    Attributes:
        close_distance_m: the hand is close where both finger lines are this near to the handle, and the handle
            lies between them.
        stage_bonus: value of the `stage` term in each of the four stages, rising.
        weights: term name -> weight; a term that is missing is reported with weight 0.
    """

    close_distance_m: float
    stage_bonus: tuple[float, ...]
    weights: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check(
            len(self.stage_bonus) == _STAGES and list(self.stage_bonus) == sorted(set(self.stage_bonus)),
            f"reward.stage_bonus needs {_STAGES} rising numbers, not {list(self.stage_bonus)}",
        )
        unknown = set(self.weights) - set(TERM_NAMES)
        check(not unknown, f"reward.weights: unknown terms {sorted(unknown)}; legal: {', '.join(TERM_NAMES)}")


def open_reward_terms(
    snapshot: Snapshot, goal: OpenGoal, config: RewardConfig, success: SuccessConfig
) -> dict[str, Array]:
    """Unweighted terms, each (B,); see the task's page for their ranges."""
    xp = namespace(snapshot.object_qpos)
    distance, depth = handle_proximity(snapshot, goal)
    speed, angular_speed = target_speed(snapshot, goal)
    flags = flags_of(snapshot, goal, success, speed, angular_speed)
    is_open = flags["open_enough"]
    is_close = xp.all(distance <= config.close_distance_m, axis=-1) & (depth > 0)
    still_closed = ~is_open
    stage = xp.where(is_open, xp.where(flags["cabinet_static"], 3, 2), xp.where(is_close, 1, 0))
    qpos, qvel = snapshot.object_qpos[goal.row, goal.joint], snapshot.object_qvel[goal.row, goal.joint]
    progress = clamp((qpos - goal.lower) / (goal.open_qpos - goal.lower), 0.0, 1.0)
    pulling = is_close & still_closed
    return {
        "hand_angle": hand_angle(snapshot, goal) * (still_closed & ~is_close),
        "handle_distance": clamp(xp.mean(distance, axis=-1), 0.0, _FAR_M) * still_closed,
        "enclosure": (_ramp(depth, *_ENCLOSED_M) - 1.0) * still_closed,
        "stage": xp.take(xp.asarray(config.stage_bonus, dtype=qpos.dtype), stage),
        "opening_speed": _ramp(qvel, *_OPENING_SPEED) * pulling,
        "opening": xp.where(is_open, 1.0, progress * pulling),
        "link_speed": clamp(speed + 0.5 * angular_speed, 0.0, 1.0) * is_open,
    }


def handle_proximity(snapshot: Snapshot, goal: OpenGoal) -> tuple[Array, Array]:
    """How the first arm's fingers lie around the handle.

    Returns:
        (B, 2) least distance of each finger's line to the handle's points, and (B,) greatest depth of the fingers'
        mid-line in the handle's hull (positive inside), both in metres.
    """
    xp = namespace(snapshot.link_position_w)
    rotation = snapshot.link_rotation_w[goal.row, goal.link]  # (B, 3, 3)
    origin = snapshot.link_position_w[goal.row, goal.link][:, None, :]
    start = (snapshot.finger_line_start_w[:, :2] - origin) @ rotation  # (B, 2, 3), in the link's frame
    tip = (snapshot.fingertip_position_w[:, :2] - origin) @ rotation
    line = (tip - start)[:, :, :, None]  # (B, 2, 3, 1)
    to_points = goal.handle_points[:, None, :, :] - start[:, :, None, :]  # (B, 2, P, 3)
    along = clamp(to_points @ line / (xp.matrix_transpose(line) @ line), 0.0, 1.0)  # (B, 2, P, 1)
    gap = to_points - along * line[:, :, None, :, 0]
    distance = xp.sqrt(xp.min(xp.sum(gap * gap, axis=-1), axis=-1))
    middle_start, middle_tip = 0.5 * (start[:, :1] + start[:, 1:]), 0.5 * (tip[:, :1] + tip[:, 1:])
    fractions = xp.asarray(_LINE_SAMPLES, dtype=start.dtype)[None, :, None]
    samples = middle_start + fractions * (middle_tip - middle_start)  # (B, 5, 3)
    return distance, xp.max(depth_inside(goal.handle_planes, samples), axis=-1)


def hand_angle(snapshot: Snapshot, goal: OpenGoal) -> Array:
    """Angle between the hand and the nearest of the handle's grasp poses, over pi: (B,) in [0, 1]."""
    xp = namespace(snapshot.tool_rotation_w)
    rotation = snapshot.link_rotation_w[goal.row, goal.link]
    hand = xp.matrix_transpose(rotation) @ snapshot.tool_rotation_w[:, 0]  # in the link's frame
    trace = xp.sum(hand[:, None] * goal.grasp_rotations, axis=(-2, -1))  # (B, G)
    return xp.acos(clamp((xp.max(trace, axis=-1) - 1.0) / 2.0, -1.0, 1.0)) / xp.pi


def _ramp(value: Array, start: float, width: float) -> Array:
    """0 up to `start`, rising to 1 at `start + width`."""
    return clamp((value - start) / width, 0.0, 1.0)

"""Dense reward of the cabinet tasks: what is measured, the terms, four stages."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from artiskill.config import check_positive
from artiskill.geometry.arrays import Array, columns, namespace
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.open_cabinet.goal import OpenGoal
from artiskill.tasks.open_cabinet.hand_pose import hand_angle
from artiskill.tasks.open_cabinet.proximity import handle_proximity
from artiskill.tasks.open_cabinet.success import SuccessConfig
from artiskill.tasks.staged_reward import Ramp, Stage, StageTable

# Measures, in the order of `_measure`:
#   hand_angle        angle to the nearest grasp pose, over pi
#   handle_distance   mean distance of the two fingers' lines to the handle, m
#   finger_gap        the greater of the two distances, over what counts as close
#   depth             of the fingers' mid-line in the handle's hull, m, positive inside
#   opening_speed     velocity of the joint, m/s or rad/s
#   opening           how far it is open: 0 closed, 1 open enough
#   speed             of the target link, over what counts as still
#   angular_speed     likewise
MEASURES = (
    *("hand_angle", "handle_distance", "finger_gap", "depth"),
    *("opening_speed", "opening", "speed", "angular_speed"),
)
# The last stage begins a little further than open enough: a link that is opened slowly, and so counts as still,
# would otherwise skip the stage before it.
_SAFELY_OPEN = 1.02
TERMS = {
    "hand_angle": Ramp("hand_angle", 1.0, 0.0),
    "handle_distance": Ramp("handle_distance", 2.0, 0.0),
    "enclosure": Ramp("depth", -0.01, 0.004),
    "opening_speed": Ramp("opening_speed", -0.1, 0.5),
    "opening": Ramp("opening", 0.0, 1.0),
    "slow": Ramp("speed", 10.0, 0.0),
}
STAGES = (
    Stage(
        "approach",
        asks=("hand_angle", "handle_distance", "enclosure"),
        leaves=(Ramp("finger_gap", 3.0, 1.0), Ramp("depth", -0.01, 0.0)),
    ),
    Stage(
        "close to the handle",
        asks=("opening_speed", "opening"),
        enters=(Ramp("finger_gap", 1.0, 0.8), Ramp("depth", 0.0, 0.002)),
        leaves=(Ramp("opening", 0.8, 1.0),),
    ),
    Stage(
        "open enough",
        asks=("slow",),
        enters=(Ramp("opening", 1.0, _SAFELY_OPEN),),
        leaves=(Ramp("speed", 3.0, 1.0), Ramp("angular_speed", 3.0, 1.0), Ramp("opening", 1.0, _SAFELY_OPEN)),
    ),
    Stage(
        "open enough and still",
        asks=("slow",),
        enters=(Ramp("speed", 1.0, 0.8), Ramp("angular_speed", 1.0, 0.8), Ramp("opening", _SAFELY_OPEN, 1.04)),
    ),
)
TABLE = StageTable(TERMS, STAGES)
_ORDER = tuple(MEASURES.index(name) for name in TABLE.measures)


@dataclass(frozen=True)
class RewardConfig:
    """Weights and stage values.

    Attributes:
        close_distance_m: the hand is close where both finger lines are this near to the handle, and the handle
            lies between them.
        stage_bonus: least reward of each of the four stages, so low that no state earns more than 0.
        weights: term name -> weight; a term that is missing is reported with weight 0.
    """

    close_distance_m: float
    stage_bonus: tuple[float, ...]
    weights: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_positive(self, "close_distance_m")
        TABLE.check_weights(self.stage_bonus, self.weights)


def open_reward_terms(
    snapshot: Snapshot, goal: OpenGoal, flags: Mapping[str, Array], config: RewardConfig, success: SuccessConfig
) -> dict[str, Array]:
    """Unweighted terms, each (B,), as `STAGES` has them; `flags` is what `open_flags` says of this instant."""
    xp = namespace(snapshot.object_qpos)
    row, link, joint = goal.row, goal.link, goal.joint
    distance, depth = handle_proximity(snapshot, goal)
    gap = xp.maximum(distance[:, 0], distance[:, 1]) / config.close_distance_m
    opening = (snapshot.object_qpos[row, joint] - goal.lower) / (goal.open_qpos - goal.lower)
    still = flags["cabinet_static"] & (opening >= _SAFELY_OPEN)
    stage = xp.where(flags["open_enough"], 2 + still, (gap <= 1.0) & (depth > 0))  # (B,) 0 to 3
    measured = (
        hand_angle(snapshot, goal),
        0.5 * (distance[:, 0] + distance[:, 1]),
        gap,
        depth,
        snapshot.object_qvel[row, joint],
        opening,
        snapshot.link_speed_m_s[row, link] / success.max_speed_m_s,
        snapshot.link_angular_speed_rad_s[row, link] / success.max_angular_speed_rad_s,
    )
    return TABLE.evaluate(columns([measured[i] for i in _ORDER]), stage, config.stage_bonus)

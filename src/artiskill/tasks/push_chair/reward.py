"""Dense reward of PushChair: what is measured, the terms, four stages."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from artiskill.config import check_positive
from artiskill.geometry.arrays import Array, columns, namespace
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.push_chair.goal import PushGoal
from artiskill.tasks.staged_reward import Ramp, Stage, StageTable
from artiskill.tasks.standing import ARRIVAL, SAFELY_NEAR, Stand, StandingConfig, arrival_stages
from artiskill.tasks.surface import fingertip_distance

# Measures, in the order of `push_reward_terms`:
#   hand_distance     mean distance of the fingertips to the chair's surface, m
#   hand_gap          the same, over what counts as close
#   tilt              of the chair, over what counts as tipping
#   target_distance   of the chair's root from the target, in the plane, m
#   approach_speed    of the chair's root towards the target, m/s
#   and how it arrives, `standing.ARRIVAL`
MEASURES = (
    *("hand_distance", "hand_gap", "tilt", "target_distance", "approach_speed"),
    *ARRIVAL,
)
TERMS = {
    "hand_distance": Ramp("hand_distance", 2.0, 0.0),
    "upright": Ramp("tilt", 1.0, 0.0),
    "target_distance": Ramp("target_distance", 2.0, 0.0),
    "approach_speed": Ramp("approach_speed", -0.2, 0.4),
    "slow": Ramp("speed", 5.0, 0.0),
}
STAGES = (
    Stage(
        "approach the chair",
        asks=("hand_distance", "upright"),
        leaves=(Ramp("hand_gap", 2.0, 1.0), Ramp("tilt", 1.2, 1.0)),
    ),
    Stage(
        "push it",
        asks=("target_distance", "approach_speed", "upright"),
        enters=(Ramp("hand_gap", 1.0, 0.8), Ramp("tilt", 1.0, 0.8)),
        leaves=(Ramp("near", 1.5, 1.0),),
    ),
    *arrival_stages("brake it", "near, standing and still", asks=("slow", "upright")),
)
TABLE = StageTable(TERMS, STAGES)
_ORDER = tuple(MEASURES.index(name) for name in TABLE.measures)


@dataclass(frozen=True)
class RewardConfig:
    """Weights and stage values.

    Attributes:
        close_distance_m: the hands are close where their fingertips' mean distance to the chair is below this.
        tipping_rad: a chair that leans by more than this must be left alone until it stands again.
        stage_bonus: least reward of each of the four stages, so low that no state earns more than 0.
        weights: term name -> weight; a term that is missing is reported with weight 0.
    """

    close_distance_m: float
    tipping_rad: float
    stage_bonus: tuple[float, ...]
    weights: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_positive(self, "close_distance_m", "tipping_rad")
        TABLE.check_weights(self.stage_bonus, self.weights)


def push_reward_terms(
    snapshot: Snapshot, goal: PushGoal, flags: Mapping[str, Array], config: RewardConfig, success: StandingConfig
) -> dict[str, Array]:
    """Unweighted terms, each (B,), as `STAGES` has them; `flags` is what `push_flags` says of this instant."""
    xp = namespace(snapshot.object_qpos)
    stand = Stand(snapshot)
    hands = fingertip_distance(snapshot, goal.row, goal.points, goal.point_link)
    tilt, arrival = stand.tilt_rad / config.tipping_rad, stand.arrival(success)
    solved = flags["chair_standing"] & flags["chair_static"] & (arrival[0] <= SAFELY_NEAR)
    pushing = (hands <= config.close_distance_m) & (tilt <= 1.0)
    stage = xp.where(flags["chair_close_to_target"] & (tilt <= 1.0), 2 + solved, pushing)  # (B,) 0 to 3
    measured = (
        hands,
        hands / config.close_distance_m,
        tilt,
        stand.distance_m,
        stand.approach_speed_m_s,
        *arrival,
    )
    return TABLE.evaluate(columns([measured[i] for i in _ORDER]), stage, config.stage_bonus)

"""Dense reward of MoveBucket: what is measured, the terms, five stages."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from artiskill.config import check_positive
from artiskill.geometry.arrays import Array, columns, dot, namespace, norm
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.move_bucket.goal import BucketGoal, bucket_centre_w
from artiskill.tasks.move_bucket.success import ball_depth_m
from artiskill.tasks.staged_reward import Ramp, Stage, StageTable
from artiskill.tasks.standing import ARRIVAL, SAFELY_NEAR, Stand, StandingConfig, arrival_stages
from artiskill.tasks.surface import fingertip_distance

# Measures, in the order of `bucket_reward_terms`:
#   hand_distance     mean distance of the fingertips to the bucket's surface, m
#   hand_gap          the same, over what counts as close
#   opposite          cosine of the angle between the two hands, seen from the bucket's axis: -1 on opposite sides
#   hand_level        difference of the two hands' heights in the bucket's frame, m
#   tilt              of the bucket, over what counts as tipping
#   rise              of the bucket's middle above where it started, over what counts as lifted
#   rising_speed      of the bucket's root, m/s upwards
#   ball_depth        of the ball's centre in the box around the bucket's body, m; negative outside
#   target_distance   of the bucket's root from the platform's centre, in the plane, m
#   approach_speed    of the bucket's root towards it, m/s
#   and how it arrives, `standing.ARRIVAL`
MEASURES = (
    *("hand_distance", "hand_gap", "opposite", "hand_level", "tilt", "rise", "rising_speed"),
    *("ball_depth", "target_distance", "approach_speed", *ARRIVAL),
)
TERMS = {
    "hand_distance": Ramp("hand_distance", 2.0, 0.0),
    "opposite": Ramp("opposite", 1.0, -1.0),
    "hand_level": Ramp("hand_level", 0.2, 0.0),
    "upright": Ramp("tilt", 1.0, 0.0),
    "rise": Ramp("rise", 0.0, 1.0),
    "rising_speed": Ramp("rising_speed", -0.1, 0.3),
    "target_distance": Ramp("target_distance", 2.0, 0.0),
    "approach_speed": Ramp("approach_speed", -0.2, 0.4),
    "slow": Ramp("speed", 5.0, 0.0),
}
STAGES = (
    Stage(
        "approach the bucket",
        asks=("hand_distance", "opposite", "hand_level", "upright"),
        leaves=(Ramp("hand_gap", 2.0, 1.0), Ramp("tilt", 1.2, 1.0), Ramp("ball_depth", -0.1, 0.0)),
    ),
    Stage(
        "lift it",
        asks=("opposite", "hand_level", "upright", "rise", "rising_speed"),
        enters=(Ramp("hand_gap", 1.0, 0.8), Ramp("tilt", 1.0, 0.8), Ramp("ball_depth", 0.0, 0.03)),
        leaves=(Ramp("rise", 0.8, 1.0),),
    ),
    Stage(
        "carry it",
        asks=("opposite", "upright", "target_distance", "approach_speed"),
        enters=(Ramp("rise", 1.0, 1.1),),
        leaves=(Ramp("near", 1.3, 1.0),),
    ),
    *arrival_stages("hold it above the platform", "above it, upright and still", asks=("slow", "upright")),
)
TABLE = StageTable(TERMS, STAGES)
_ORDER = tuple(MEASURES.index(name) for name in TABLE.measures)


@dataclass(frozen=True)
class RewardConfig:
    """Weights and stage values.

    Attributes:
        close_distance_m: the hands are close where their fingertips' mean distance to the bucket is below this.
        tipping_rad: a bucket that leans by more than this counts as in the first stage.
        lifted_m: how far its middle must rise to count as lifted.
        stage_bonus: least reward of each of the five stages, so low that no state earns more than 0.
        weights: term name -> weight; a term that is missing is reported with weight 0.
    """

    close_distance_m: float
    tipping_rad: float
    lifted_m: float
    stage_bonus: tuple[float, ...]
    weights: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_positive(self, "close_distance_m", "tipping_rad", "lifted_m")
        TABLE.check_weights(self.stage_bonus, self.weights)


def bucket_reward_terms(
    snapshot: Snapshot, goal: BucketGoal, flags: Mapping[str, Array], config: RewardConfig, success: StandingConfig
) -> dict[str, Array]:
    """Unweighted terms, each (B,), as `STAGES` has them; `flags` is what `bucket_flags` says of this instant.

    Without the ball, or tipped over, a bucket is in the first stage wherever it is.
    """
    xp = namespace(snapshot.object_qpos)
    stand = Stand(snapshot)
    centre = bucket_centre_w(snapshot, goal)
    hands = fingertip_distance(snapshot, goal.row, goal.points, goal.point_link)
    opposite, level = hand_places(snapshot, centre)
    tilt, arrival = stand.tilt_rad / config.tipping_rad, stand.arrival(success)
    rise = (centre[:, 2] - goal.start_height) / config.lifted_m
    measured = (
        hands,
        hands / config.close_distance_m,
        opposite,
        level,
        tilt,
        rise,
        snapshot.root_velocity_w[:, 2],
        ball_depth_m(snapshot, goal),
        stand.distance_m,
        stand.approach_speed_m_s,
        *arrival,
    )
    solved = flags["bucket_standing"] & flags["bucket_static"] & (arrival[0] <= SAFELY_NEAR)
    held = (hands <= config.close_distance_m) * (1 + (rise >= 1.0))  # (B,) 0 to 2
    stage = xp.where(flags["bucket_above_platform"], 3 + solved, held)
    stage = xp.where(flags["balls_in_bucket"] & (tilt <= 1.0), stage, xp.zeros_like(stage))
    return TABLE.evaluate(columns([measured[i] for i in _ORDER]), stage, config.stage_bonus)


def hand_places(snapshot: Snapshot, centre_w: Array) -> tuple[Array, Array]:
    """How the two hands lie about the bucket's middle.

    Returns:
        (B,) cosine of the angle between them, seen from the middle in the plane, and (B,) difference of their
        heights in the bucket's frame, in metres.
    """
    xp = namespace(centre_w)
    from_centre = snapshot.tool_position_w - centre_w[:, None]  # (B, 2, 3)
    plane = from_centre[..., :2]
    lengths = norm(plane)  # (B, 2)
    least_length = xp.asarray(1e-6, dtype=lengths.dtype)
    cosine = dot(plane[:, 0], plane[:, 1]) / xp.maximum(lengths[:, 0] * lengths[:, 1], least_length)
    up = snapshot.link_rotation_w[:, 0, :, 2]
    return cosine, xp.abs(dot(from_centre[:, 0] - from_centre[:, 1], up))

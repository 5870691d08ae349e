"""When the bucket counts as moved."""

from artiskill.geometry.arrays import Array, amin, namespace, rotate
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.move_bucket.goal import BucketGoal
from artiskill.tasks.standing import Stand, StandingConfig

FLAG_NAMES = ("balls_in_bucket", "bucket_above_platform", "bucket_standing", "bucket_static")


def ball_depth_m(snapshot: Snapshot, goal: BucketGoal) -> Array:
    """How deep the centres of all free props lie in the box around the bucket's body, (B,).

    Of the ball nearest to getting out, distance to the nearest side of the box; negative outside, where it is how
    far the ball is beyond the side that it is furthest beyond.
    """
    xp = namespace(snapshot.prop_position_w)
    from_root = snapshot.prop_position_w - snapshot.link_position_w[:, :1]
    local = rotate(
        xp.matrix_transpose(snapshot.link_rotation_w[:, :1]), from_root
    )  # (B, K, 3) in the root's frame
    return amin(amin(xp.minimum(local - goal.box[:, :1], goal.box[:, 1:] - local)))


def balls_in_bucket(snapshot: Snapshot, goal: BucketGoal) -> Array:
    """Whether the centres of all free props lie in the box around the bucket's body, (B,) bool."""
    return ball_depth_m(snapshot, goal) >= 0.0


def bucket_flags(snapshot: Snapshot, goal: BucketGoal, config: StandingConfig) -> dict[str, Array]:
    """The conditions of `FLAG_NAMES`, each (B,) bool, at this instant.

    A bucket that is held in the air above the platform counts, as one that stands on it does.
    """
    stand = Stand(snapshot)
    values = (balls_in_bucket(snapshot, goal), stand.near(config), stand.upright(config), stand.still(config))
    return dict(zip(FLAG_NAMES, values, strict=True))

"""MoveBucket: lift a bucket with a ball in it with two hands, carry it over a platform, hold it still."""

from artiskill.tasks.move_bucket.task import MoveBucketConfig, make_move_bucket

__all__ = ["MoveBucketConfig", "make_move_bucket"]

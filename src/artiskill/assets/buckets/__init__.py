"""Parametric buckets: `sample_bucket` draws a complete specification, `build_bucket` makes the object."""

from artiskill.assets.buckets.build import build_bucket
from artiskill.assets.buckets.config import BucketConfig, default_bucket_config
from artiskill.assets.buckets.sample import sample_bucket
from artiskill.assets.buckets.spec import BucketSpec
from artiskill.assets.generators import Generator

__all__ = ["GENERATOR", "BucketConfig", "BucketSpec", "build_bucket", "default_bucket_config", "sample_bucket"]

GENERATOR = Generator(default_bucket_config, sample_bucket, build_bucket)

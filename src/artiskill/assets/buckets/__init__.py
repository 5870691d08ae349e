"""Parametric buckets: `sample_bucket` draws a complete specification, `build_bucket` makes the object."""

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.buckets.build import build_bucket
from artiskill.assets.buckets.config import BucketConfig, default_bucket_config
from artiskill.assets.buckets.sample import sample_bucket
from artiskill.assets.buckets.spec import BucketSpec
from artiskill.assets.draws import form_and_detail

__all__ = [
    "BucketConfig",
    "BucketSpec",
    "build_bucket",
    "default_bucket_config",
    "generate_bucket",
    "sample_bucket",
]


def generate_bucket(seed: int, object_id: str, held_out: bool = False, fresh: bool = False) -> ArticulatedObject:
    """The bucket of a seed, with the default config.

    Args:
        seed: at least 0; the same seed, the same bucket.
        object_id: its name.
        held_out: whether it is of a held-out family.
        fresh: whether it is one of the `generated:` objects, which are not those of the catalogue.
    """
    form, detail = form_and_detail(seed, fresh)
    return build_bucket(sample_bucket(form, default_bucket_config(), held_out), object_id, detail)

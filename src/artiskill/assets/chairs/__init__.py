"""Parametric swivel chairs: `sample_chair` draws a complete specification, `build_chair` makes the object."""

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.chairs.build import build_chair
from artiskill.assets.chairs.config import ChairConfig, default_chair_config
from artiskill.assets.chairs.sample import sample_chair
from artiskill.assets.chairs.spec import ChairSpec

__all__ = ["ChairConfig", "ChairSpec", "build_chair", "default_chair_config", "generate_chair", "sample_chair"]


def generate_chair(seed: int, object_id: str, held_out: bool = False) -> ArticulatedObject:
    """The chair of a seed, with the default configuration.

    Args:
        seed: at least 0; the same seed, the same chair, on any machine.
        object_id: its name.
        held_out: whether it is of a family that training and test objects never are of.
    """
    form, detail = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(2))
    return build_chair(sample_chair(form, default_chair_config(), held_out), object_id, detail)

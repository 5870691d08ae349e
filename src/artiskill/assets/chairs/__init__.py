"""Parametric swivel chairs: `sample_chair` draws a complete specification, `build_chair` makes the object."""

from artiskill.assets.chairs.build import build_chair
from artiskill.assets.chairs.config import ChairConfig, default_chair_config
from artiskill.assets.chairs.sample import sample_chair
from artiskill.assets.chairs.spec import ChairSpec
from artiskill.assets.generators import Generator

__all__ = ["GENERATOR", "ChairConfig", "ChairSpec", "build_chair", "default_chair_config", "sample_chair"]

GENERATOR = Generator(default_chair_config, sample_chair, build_chair)

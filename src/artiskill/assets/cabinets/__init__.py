"""Parametric cabinets: `sample_cabinet` draws a complete specification, `build_cabinet` makes the object."""

from artiskill.assets.cabinets.build import build_cabinet
from artiskill.assets.cabinets.config import CabinetConfig, default_cabinet_config
from artiskill.assets.cabinets.sample import sample_cabinet
from artiskill.assets.cabinets.spec import CabinetSpec
from artiskill.assets.generators import Generator

__all__ = [
    "GENERATOR",
    "CabinetConfig",
    "CabinetSpec",
    "build_cabinet",
    "default_cabinet_config",
    "sample_cabinet",
]

GENERATOR = Generator(default_cabinet_config, sample_cabinet, build_cabinet)

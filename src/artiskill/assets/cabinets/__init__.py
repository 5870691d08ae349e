"""Parametric cabinets: `sample_cabinet` draws a complete specification, `build_cabinet` makes the object."""

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.cabinets.build import build_cabinet
from artiskill.assets.cabinets.config import CabinetConfig, default_cabinet_config
from artiskill.assets.cabinets.sample import sample_cabinet
from artiskill.assets.cabinets.spec import CabinetSpec
from artiskill.assets.draws import form_and_detail

__all__ = [
    "CabinetConfig",
    "CabinetSpec",
    "build_cabinet",
    "default_cabinet_config",
    "generate_cabinet",
    "sample_cabinet",
]


def generate_cabinet(seed: int, object_id: str, held_out: bool = False, fresh: bool = False) -> ArticulatedObject:
    """The cabinet of a seed, with the default config.

    Args:
        seed: at least 0; one stream of random numbers draws the form, another the details.
        object_id: its name.
        held_out: whether it is of a family that training and test objects never are of.
        fresh: whether it is one of the `generated:` objects, which are not those of the catalogue.
    """
    form, detail = form_and_detail(seed, fresh)
    return build_cabinet(sample_cabinet(form, default_cabinet_config(), held_out), object_id, detail)

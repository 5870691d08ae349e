"""Parametric swivel chairs: `sample_chair` draws a complete specification, `build_chair` makes the object."""

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.chairs.build import build_chair
from artiskill.assets.chairs.config import ChairConfig, default_chair_config
from artiskill.assets.chairs.sample import sample_chair
from artiskill.assets.chairs.spec import ChairSpec
from artiskill.assets.draws import form_and_detail

__all__ = ["ChairConfig", "ChairSpec", "build_chair", "default_chair_config", "generate_chair", "sample_chair"]


def generate_chair(seed: int, object_id: str, held_out: bool = False, fresh: bool = False) -> ArticulatedObject:
    """The chair of a seed, with the default configuration.

    Args:
        seed: at least 0; the same seed, the same chair, bit for bit.
        object_id: its name.
        held_out: whether it is of a family that training and test objects never are of.
        fresh: whether it is one of the `generated:` objects, which are not those of the catalogue.
    """
    form, detail = form_and_detail(seed, fresh)
    return build_chair(sample_chair(form, default_chair_config(), held_out), object_id, detail)

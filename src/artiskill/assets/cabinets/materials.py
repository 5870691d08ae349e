"""The materials of one cabinet, made once and shared by its parts."""

from dataclasses import dataclass

from artiskill.assets.articulated_object import Material
from artiskill.assets.cabinets.appearance import CabinetAppearance
from artiskill.assets.finishes import make_materials


@dataclass(frozen=True, eq=False)
class Materials:
    """One material per surface of `CabinetAppearance`; equal surfaces share one."""

    carcass: Material
    front: Material
    top: Material
    interior: Material
    support: Material
    handle: Material
    runner: Material
    glass: Material
    tyre: Material


def make_cabinet_materials(appearance: CabinetAppearance) -> Materials:
    """Build the materials, textures included."""
    return Materials(**make_materials(appearance))

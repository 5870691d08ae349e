"""The materials of one cabinet, made once and shared by its parts."""

from dataclasses import dataclass, fields

from artiskill.assets.appearance import CabinetAppearance, Surface, make_material
from artiskill.assets.articulated_object import Material


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


def make_materials(appearance: CabinetAppearance) -> Materials:
    """Build the materials, textures included."""
    made: dict[Surface, Material] = {}
    chosen: dict[str, Material] = {}
    for field in fields(appearance):
        surface = getattr(appearance, field.name)
        if surface not in made:
            made[surface] = make_material(surface)
        chosen[field.name] = made[surface]
    return Materials(**chosen)

"""Surfaces of a cabinet's parts: finishes that go together, drawn per object."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from artiskill.assets.finishes import Finish, Surface, sample_surface
from artiskill.assets.generators import pick

# Finishes of carcass, fronts and top, and how often.
SCHEMES: dict[str, tuple[float, tuple[Finish, Finish, Finish]]] = {
    "wood": (0.35, ("wood", "wood", "wood")),
    "paint": (0.25, ("paint", "paint", "paint")),
    "paint_wood_top": (0.15, ("paint", "paint", "wood")),
    "wood_paint_front": (0.15, ("wood", "paint", "wood")),
    "paint_wood_front": (0.10, ("paint", "wood", "wood")),
}
_QUIET_PAINTS = ("white", "cream", "light_grey", "stone", "anthracite", "black")
# Frosted panes: what lies behind is not seen through them.
_GLASS = (("frosted", (206, 219, 224)), ("smoked", (150, 160, 164)), ("reeded", (190, 208, 206)))


@dataclass(frozen=True)
class CabinetAppearance:
    """The surfaces of one cabinet."""

    carcass: Surface
    front: Surface
    top: Surface
    interior: Surface
    support: Surface
    handle: Surface
    runner: Surface
    glass: Surface
    tyre: Surface


def sample_cabinet_appearance(
    rng: np.random.Generator, schemes: Mapping[str, float] | None = None
) -> CabinetAppearance:
    """Draw surfaces that go together: parts of one finish share one wood or one paint, or are two-toned.

    Args:
        rng: draws.
        schemes: weights of the keys of `SCHEMES`; by default those that stand there.
    """
    weights = {k: schemes.get(k, 0.0) if schemes else weight for k, (weight, _) in SCHEMES.items()}
    carcass_finish, front_finish, top_finish = SCHEMES[pick(rng, weights)][1]
    carcass = sample_surface(rng, carcass_finish)
    two_toned = carcass_finish != front_finish or rng.random() < 0.15
    front = sample_surface(rng, front_finish, _beside(carcass, front_finish)) if two_toned else carcass
    own_top = top_finish != carcass_finish or rng.random() < 0.25
    top = sample_surface(rng, top_finish, _beside(carcass, top_finish)) if own_top else carcass
    interior = (
        sample_surface(rng, "wood", ("birch", "beech", "pine"))
        if rng.random() < 0.6
        else sample_surface(rng, "paint", ("white",))
    )
    support = (
        carcass if rng.random() < 0.6 else sample_surface(rng, "metal", ("brushed_steel", "black_iron", "brass"))
    )
    pane, srgb = _GLASS[int(rng.integers(len(_GLASS)))]
    return CabinetAppearance(
        carcass,
        front,
        top,
        interior,
        support,
        _handle(rng),
        sample_surface(rng, "metal", ("brushed_steel",)),
        Surface("plastic", pane, srgb, 0, 0.7),
        sample_surface(rng, "plastic", ("black", "grey", "light_grey")),
    )


def _beside(other: Surface, finish: Finish) -> tuple[str, ...]:
    """Return names of surfaces that go with another one; beside a paint only quiet paints do."""
    return _QUIET_PAINTS if finish == other.finish == "paint" else ()


def _handle(rng: np.random.Generator) -> Surface:
    which = rng.random()
    if which < 0.75:
        return sample_surface(rng, "metal")
    if which < 0.88:
        return sample_surface(rng, "wood", ("beech", "oak", "walnut", "teak"))
    return sample_surface(rng, "paint", ("white", "black", "cream", "navy"))

"""Ranges and weights from which cabinets are drawn; values: `configs/catalog/cabinet_generator.yaml`."""

from dataclasses import dataclass, fields
from pathlib import Path

from artiskill.config import CONFIG_DIR, check, load_config

GENERATOR_YAML: Path = CONFIG_DIR / "catalog" / "cabinet_generator.yaml"

Range = tuple[float, float]  # smallest and largest, both possible

LAYOUTS = ("columns", "stack", "drawers", "door", "open", "blind")
STACK_TOPS = ("drawers", "open", "blind")
SUPPORTS = ("plinth", "legs", "floor")


@dataclass(frozen=True)
class FamilyConfig:
    """One kind of furniture: its outer sizes and what its front is made of.

    Attributes:
        name: goes into the object's metadata.
        weight: how often it is drawn, relative to the other families.
        width_m: outer width of the carcass, along y.
        depth_m: outer depth of the carcass, along x, without overlay fronts.
        height_m: from the ground to the top, support included.
        supports: weights of `plinth`, `legs`, `floor`.
        layouts: weights of what a region of the front becomes: `columns` and `stack` split it again.
        overhang_probability: how often the top stands over the front and the sides.
        inset_probability: how often fronts lie within the carcass instead of over its edges.
        shaker_probability: how often fronts are framed.
    """

    name: str
    weight: float
    width_m: Range
    depth_m: Range
    height_m: Range
    supports: dict[str, float]
    layouts: dict[str, float]
    overhang_probability: float
    inset_probability: float
    shaker_probability: float

    def __post_init__(self) -> None:
        where = f"family {self.name!r}"
        check(self.weight >= 0, f"{where}: weight must be at least 0, not {self.weight!r}")
        _check_ranges(self, where)
        _check_weights(self.supports, SUPPORTS, f"{where}: supports")
        _check_weights(self.layouts, LAYOUTS, f"{where}: layouts")


@dataclass(frozen=True)
class HandleConfig:
    """Bar handles.

    Attributes:
        centres_m: distances of the two screws: multiples of 32 mm, as in the European cabinet system
            ("System 32") and makers' catalogues.
        diameter_m: of a round bar, side of a square one.
        projection_m: from the front's face to the bar's outermost surface.
        clearance_m: at least this much room between the front's face and the bar: a finger must fit behind.
        square_probability: how often the bar's section is square.
        edge_m: least distance of a vertical bar's axis from the door's free edge.
        height_m: least and largest height of a handle's centre above the ground.
    """

    centres_m: tuple[float, ...]
    diameter_m: Range
    projection_m: Range
    clearance_m: float
    square_probability: float
    edge_m: float
    height_m: Range

    def __post_init__(self) -> None:
        _check_ranges(self, "handle")
        check(len(self.centres_m) > 0, "handle: centres_m must name at least one distance")
        least = self.diameter_m[1] + self.clearance_m
        check(least <= self.projection_m[1], f"handle: projection_m must reach {least:g} (diameter and clearance)")


@dataclass(frozen=True)
class CabinetConfig:
    """How cabinets are drawn.

    Attributes:
        families: kinds of furniture.
        panel_m: thickness of carcass panels and dividers.
        back_m: thickness of the back panel.
        front_m: thickness of doors and drawer fronts.
        gap_m: width of the slits around fronts.
        plinth_height_m: a plinth's height.
        leg_height_m: a leg's height.
        drawer_height_m: height of a drawer's opening.
        drawer_width_m: width of a drawer's opening.
        door_width_m: width of a door's opening.
        door_height_m: height of a door's opening.
        door_limit_deg: how far doors open.
        travel_fraction: how far drawers open, relative to the depth of their boxes.
        travel_m: how far drawers open, which narrows `travel_fraction` where both cannot hold.
        stack_tops: weights of what stands above a stacked region: `drawers` (one row), `open`, `blind`.
        max_moving: most doors and drawers of one cabinet.
        max_collisions: most collision shapes of one cabinet.
        handle: see there.
    """

    families: tuple[FamilyConfig, ...]
    panel_m: Range
    back_m: Range
    front_m: Range
    gap_m: Range
    plinth_height_m: Range
    leg_height_m: Range
    drawer_height_m: Range
    drawer_width_m: Range
    door_width_m: Range
    door_height_m: Range
    door_limit_deg: Range
    travel_fraction: Range
    travel_m: Range
    stack_tops: dict[str, float]
    max_moving: int
    max_collisions: int
    handle: HandleConfig

    def __post_init__(self) -> None:
        _check_ranges(self, "cabinet")
        _check_weights(self.stack_tops, STACK_TOPS, "stack_tops")
        check(sum(f.weight for f in self.families) > 0, "families: at least one weight must be above 0")
        check(self.gap_m[0] >= 0.002, f"gap_m must be at least 0.002, not {self.gap_m[0]!r}: fronts would touch")
        check(self.door_limit_deg[1] <= 175, f"door_limit_deg must stay below 175, not {self.door_limit_deg[1]!r}")
        check(self.travel_fraction[1] <= 1, f"travel_fraction must stay within 1, not {self.travel_fraction[1]!r}")


def default_cabinet_config() -> CabinetConfig:
    """The config from which the catalogue and `generated:<seed>` are made."""
    return load_config(CabinetConfig, GENERATOR_YAML)


def _check_ranges(config: object, where: str) -> None:
    """Every field of type Range must be positive and ordered."""
    for field in fields(config):  # type: ignore[arg-type]
        if field.type is Range or field.type == "Range":
            low, high = getattr(config, field.name)
            text = f"{where}: {field.name} must be two numbers above 0, the smaller first, not {[low, high]}"
            check(0 < low <= high, text)


def _check_weights(weights: dict[str, float], legal: tuple[str, ...], where: str) -> None:
    for name, weight in weights.items():
        check(name in legal, f"{where}: unknown name {name!r}; legal: {', '.join(legal)}")
        check(weight >= 0, f"{where}: the weight of {name!r} must be at least 0, not {weight!r}")
    check(sum(weights.values()) > 0, f"{where}: at least one weight must be above 0")

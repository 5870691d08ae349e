"""Layouts: sizes that scenes of different objects are padded to, so that they step together in one batch.

The engine steps models side by side that agree in the sizes of all its arrays, whatever the values in them. A
layout of `configs/layouts` says what an object of a category may take up; `scene/padding.py` fills the rest.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.config import CONFIG_DIR, check_not_negative, check_positive, from_mapping, load_yaml

LAYOUT_DIR = CONFIG_DIR / "layouts"
FREE_ROOT_DOF = 6


@dataclass(frozen=True)
class LayoutConfig:
    """What the padded object takes up in a scene.

    Attributes:
        links: bodies: the object's own, a wall that it hangs on too, and one for each joint that it lacks.
        joints: joints of one degree of freedom.
        inertia: sum over the joints of the degrees of freedom from the world up to and including each: the entries
            that they have in the sparse inertia matrix.
        geoms: collision shapes.
        volumes: nodes of the engine's trees of bounding volumes, over links and their meshes.
    """

    links: int
    joints: int
    inertia: int
    geoms: int
    volumes: int

    def __post_init__(self) -> None:
        check_positive(self, "links", "geoms", "volumes")
        check_not_negative(self, "joints", "inertia")


@dataclass(frozen=True)
class Layout:
    """Sizes that two scenes must share to step in one batch: the engine's arrays have them as shapes.

    Attributes:
        links: places for links in `Snapshot`; an object's own come first, then inert ones.
        joints: places for the object's joints, likewise.
        engine: sizes of the engine's arrays, by their names in `mujoco.MjModel`.
    """

    links: int
    joints: int
    engine: tuple[tuple[str, int], ...]


_ENGINE_SIZES = (
    *("nq", "nv", "nu", "na", "nbody", "njnt", "ngeom", "nsite", "ntree", "neq"),
    *("nC", "nD", "nJmom", "nbvh", "nbvhdynamic", "nsensordata", "nmocap", "narena"),
)


def layout_of(model: Any, links: int, joints: int) -> Layout:
    """The layout of a compiled model whose object takes `links` bodies and `joints` joints."""
    return Layout(links, joints, tuple((name, int(getattr(model, name))) for name in _ENGINE_SIZES))


@cache
def category_layouts(category: str) -> tuple[LayoutConfig, ...]:
    """The layouts of a category, smallest first."""
    path = LAYOUT_DIR / f"{category}.yaml"
    return tuple(from_mapping(LayoutConfig, entry, path.name) for entry in load_yaml(path)["layouts"])


def inertia_entries(obj: ArticulatedObject, free_root: bool) -> int:
    """`LayoutConfig.inertia` of an object."""
    above: list[int] = []
    total = 0
    for link in obj.links:
        dof = above[link.parent] if link.parent >= 0 else FREE_ROOT_DOF * free_root
        if link.joint is not None:
            dof += 1
            total += dof
        above.append(dof)
    return total

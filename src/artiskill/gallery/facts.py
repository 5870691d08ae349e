"""What is told about an object: plain values for tables, filters and statistics."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Joint
from artiskill.assets.catalog import read_catalog
from artiskill.assets.kinematics import shapes_volume_m3

OWN, GENERATED, IMPORTED = "own", "generated", "imported"  # splits of objects that the catalogue does not list
_SHOWN_ELSEWHERE = {"width_m", "depth_m", "height_m", "mass_kg", "handles", "tags", "family", "joints", "held_out"}
_DIGITS = 4


@dataclass(frozen=True)
class JointFacts:
    """One joint: what moves, how, and how far (degrees or metres; None where it turns without end)."""

    name: str
    link: str
    kind: str
    range: float | None
    spring: bool


@dataclass(frozen=True)
class ObjectFacts:
    """One object.

    Attributes:
        id: its name.
        category: `cabinet`, `chair` or `bucket`.
        split: of the catalogue, else `generated`, `imported` or `own`.
        family: what kind of cabinet, chair or bucket; its source where it has none.
        size_m: extent along x (depth), y (width) and z (height) at rest.
        mass_kg: of all links; a wall that it hangs on is none of its own, but counts below.
        joints: every one.
        handles: kinds, sorted, each as often as it occurs.
        tags: what filters may ask for.
        triangles: drawn.
        shapes: that touch.
        content_hash: `ArticulatedObject.content_hash`.
        more: what else its metadata tells, as text.
    """

    id: str
    category: str
    split: str
    family: str
    size_m: tuple[float, float, float]
    mass_kg: float
    joints: tuple[JointFacts, ...]
    handles: tuple[str, ...]
    tags: tuple[str, ...]
    triangles: int
    shapes: int
    content_hash: str
    more: tuple[tuple[str, str], ...]


def object_facts(obj: ArticulatedObject) -> ObjectFacts:
    """Collect them from the object itself, and its split from the catalogue."""
    meta = obj.metadata
    depth, width, height = (round(float(v), _DIGITS) for v in np.ptp(obj.bounds, axis=0))
    return ObjectFacts(
        id=obj.id,
        category=obj.category,
        split=split_of(obj),
        family=str(meta.get("family", meta.get("model_category", meta.get("source", "unknown")))),
        size_m=(depth, width, height),
        mass_kg=round(object_mass_kg(obj), 3),
        joints=tuple(_joint_facts(link.joint, link.name) for link in obj.links if link.joint is not None),
        handles=tuple(sorted(handle.kind for handle in obj.handles)),
        tags=tuple(str(tag) for tag in meta.get("tags", ())),
        triangles=sum(len(visual.mesh.faces) for link in obj.links for visual in link.visuals),
        shapes=sum(len(link.collisions) for link in obj.links),
        content_hash=obj.content_hash,
        more=tuple((key, _text(value)) for key, value in meta.items() if key not in _SHOWN_ELSEWHERE),
    )


def object_mass_kg(obj: ArticulatedObject) -> float:
    """Mass of the object itself, from densities and collision shapes."""
    own = (obj.links[i] for i in obj.own_links)
    return sum(link.density_kg_m3 * shapes_volume_m3(link.collisions) for link in own)


def split_of(obj: ArticulatedObject) -> str:
    """The catalogue's split of a generated object that it lists, else where the object comes from."""
    source = {"generated": GENERATED, "PartNet-Mobility": IMPORTED}.get(str(obj.metadata.get("source")), OWN)
    entry = read_catalog().get(obj.id)
    return entry[1].split if entry is not None and source == GENERATED else source


def _joint_facts(joint: Joint, link: str) -> JointFacts:
    lower, upper = joint.limits
    extent: float | None = None
    if math.isfinite(upper - lower):
        extent = round(upper - lower if joint.kind == "prismatic" else math.degrees(upper - lower), _DIGITS)
    return JointFacts(joint.name, link, joint.kind, extent, bool(joint.stiffness > 0))


def _text(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Iterable):
        return ", ".join(map(_text, value)) or "none"
    return str(value)

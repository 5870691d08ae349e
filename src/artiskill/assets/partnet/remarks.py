"""What a user should know about an imported object: its measures, and `metadata["warnings"]`."""

from collections.abc import Sequence

import numpy as np

from artiskill.assets.articulated_object import Category, Handle, Link
from artiskill.assets.kinematics import shapes_volume_m3
from artiskill.assets.partnet.drawn import DrawnMesh
from artiskill.assets.partnet.overlaps import find_overlaps
from artiskill.assets.partnet.part_names import WHEEL
from artiskill.assets.partnet.semantics import UNKNOWN
from artiskill.geometry.arrays import total


def part_names(drawn: Sequence[Sequence[DrawnMesh]]) -> dict[str, str]:
    """The data set's names of all parts, and what each is called here; a name may stand for several parts."""
    found: dict[str, set[str]] = {}
    for meshes in drawn:
        for mesh in meshes:
            found.setdefault(mesh.label.name, set()).add(mesh.label.part)
    return {name: ", ".join(sorted(found[name])) for name in sorted(found)}


def measures(links: Sequence[Link], handles: Sequence[Handle], bounds: np.ndarray) -> dict[str, object]:
    """Size at rest, mass, number of joints, kinds of handles: under the same names as of generated objects."""
    depth, width, height = (round(float(v), 4) for v in np.ptp(bounds, axis=0))
    mass = total(link.density_kg_m3 * shapes_volume_m3(link.collisions) for link in links)
    return {
        "width_m": width,
        "depth_m": depth,
        "height_m": height,
        "mass_kg": round(float(mass), 3),
        "joints": sum(link.joint is not None for link in links),
        "handles": sorted({handle.kind for handle in handles}),
    }


def find_remarks(links: tuple[Link, ...], handles: tuple[Handle, ...], category: Category) -> list[str]:
    """What a user should know about the finished object."""
    remarks = []
    unnamed = [link.name for link in links if any(v.part == UNKNOWN for v in link.visuals)]
    if unnamed:
        remarks.append(f"meshes without a part name, in the URDF and in result.json, on: {', '.join(unnamed)}")
    remarks += [
        f"link {link.name!r} has no mesh: a joint in a chain, with neither surface nor mass of its own"
        for link in links[1:]
        if not link.collisions
    ]
    if category == "chair" and not any(shape.part == WHEEL for link in links for shape in link.collisions):
        remarks.append("no part is named wheel: the chair slides, it does not roll")
    if category == "bucket" and not handles:
        remarks.append("no movable link has a part named handle: the bucket has no bail")
    if category == "cabinet" and not handles:
        remarks.append("no movable link has a part named handle or knob: the object has no target links")
    return remarks + (find_overlaps(links) if category == "cabinet" else [])

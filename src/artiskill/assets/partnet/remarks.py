"""What a user should know about an imported object that is no error: `metadata["warnings"]`."""

from collections.abc import Sequence

from artiskill.assets.articulated_object import Category, Handle, Link
from artiskill.assets.partnet.drawn import DrawnMesh
from artiskill.assets.partnet.overlaps import find_overlaps
from artiskill.assets.partnet.part_names import WHEEL
from artiskill.assets.partnet.semantics import UNKNOWN


def part_names(drawn: Sequence[Sequence[DrawnMesh]]) -> dict[str, str]:
    """The data set's names of all parts, and what each is called here; a name may stand for several parts."""
    found: dict[str, set[str]] = {}
    for meshes in drawn:
        for mesh in meshes:
            found.setdefault(mesh.label.name, set()).add(mesh.label.part)
    return {name: ", ".join(sorted(found[name])) for name in sorted(found)}


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

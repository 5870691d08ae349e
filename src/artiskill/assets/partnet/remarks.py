"""What a user should know about an imported object that is no error: `metadata["warnings"]`."""

from artiskill.assets.articulated_object import Category, Handle, Link
from artiskill.assets.partnet.overlaps import find_overlaps
from artiskill.assets.partnet.semantics import UNKNOWN


def find_remarks(links: tuple[Link, ...], handles: tuple[Handle, ...], category: Category) -> list[str]:
    """What a user should know about the finished object."""
    remarks = []
    unnamed = [link.name for link in links if any(v.part == UNKNOWN for v in link.visuals)]
    if unnamed:
        remarks.append(f"meshes without a part name, in the URDF and in result.json, on: {', '.join(unnamed)}")
    remarks += [
        f"link {link.name!r} has no mesh: it has a joint but neither surface nor mass"
        for link in links[1:]
        if not link.collisions
    ]
    if category == "cabinet" and not handles:
        remarks.append("no movable link has a part named handle or knob: the object has no target links")
    return remarks + (find_overlaps(links) if category == "cabinet" else [])

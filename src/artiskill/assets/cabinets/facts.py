"""What a cabinet's metadata says: plain facts for people and filters."""

from collections.abc import Sequence

from artiskill.assets.articulated_object import Handle, Link
from artiskill.assets.cabinets.spec import CabinetSpec
from artiskill.assets.kinematics import shapes_volume_m3
from artiskill.geometry.arrays import total


def cabinet_facts(spec: CabinetSpec, links: Sequence[Link], handles: Sequence[Handle]) -> dict[str, object]:
    """Metadata of a built cabinet."""
    mass = total(link.density_kg_m3 * shapes_volume_m3(link.collisions) for link in links)
    kinds = sorted({handle.kind for handle in handles})
    faces: list[str] = sorted({cell.face for cell in spec.cells if cell.kind != "open"})
    flaps = len([cell for cell in spec.cells if cell.hinge in ("top", "bottom")])
    return {
        "source": "generated",
        "family": spec.family,
        "held_out": spec.held_out,
        "width_m": spec.width_m,
        "depth_m": spec.depth_m,
        "height_m": spec.height_m,
        "mass_kg": round(mass, 2),
        "joints": len(links) - 1,
        "handles": kinds,
        "tags": _tags(spec, kinds, faces, flaps),
        "finish": f"{spec.appearance.carcass.name}, {spec.appearance.front.name}",
        "support": spec.support.kind,
        "mount": spec.front.mount,
        "fronts": faces,
        "drawers": spec.count("drawer"),
        "doors": spec.count("door"),
        "flaps": flaps,
    }


def _tags(spec: CabinetSpec, kinds: list[str], faces: list[str], flaps: int) -> list[str]:
    tags = {spec.family, spec.support.kind, spec.front.mount, *kinds, *faces}
    tags |= {kind for kind in ("drawer", "door", "open", "blind") if spec.count(kind) > 0}
    tags |= {name for name, true in (("flap", flaps), ("bowed", spec.front.bow_m > 0)) if true}
    if spec.top.steps > 1:
        tags.add("cornice")
    if spec.support.kind == "legs":
        tags.add(f"{spec.support.leg_shape} legs")
    return sorted(tags)

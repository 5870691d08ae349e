"""Objects of another size: the same shapes, joints and materials, larger or smaller."""

import numbers
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape, Handle, Joint, Link
from artiskill.errors import AssetError, shown

FACTORS = (0.01, 100.0)  # legal ones

_LENGTHS, _VOLUMES = ("_m",), ("_l", "_kg")  # how facts that grow with the size end
_ID = re.compile(r"scaled-(.+)-[\d.]+")
_OF_THE_FILE = ("partnet_id",)  # facts that name where an object can be loaded, which a scaled one cannot


def scaled(obj: ArticulatedObject, factor: float) -> ArticulatedObject:
    """Return an object that is larger or smaller by a factor, about its origin.

    Densities stay, so its mass grows with the cube of the factor, and springs carry it as they did. A wall that it
    hangs on grows, too, and with it the height at which it hangs. A handle stays hookable or not, though a finger
    needs as much room as before, and may become too wide for the gripper.

    Args:
        obj: any object.
        factor: by which lengths are multiplied, 0.01 to 100.

    Returns:
        The object. Its id ends with the factor in per cent, `metadata["scaled_from"]` is the id of what is scaled,
        and `metadata["scale"]` the product of all factors, that of an import included.

    Raises:
        AssetError: another factor.
    """
    is_number = isinstance(factor, numbers.Real) and not isinstance(factor, bool)
    if not is_number or not FACTORS[0] <= factor <= FACTORS[1]:
        raise AssetError(
            f"the factor of an object's size must be a number from {FACTORS[0]:g} to {FACTORS[1]:g}, "
            f"not {shown(factor)}"
        )
    size = float(factor)
    facts = {
        **_facts(obj.metadata, size),
        "scale": size * float(obj.metadata.get("scale", 1.0)),
        "scaled_from": str(obj.metadata.get("scaled_from", obj.id)),
    }
    return ArticulatedObject(
        id=f"scaled-{obj.id}-{100 * size:.6g}",
        category=obj.category,
        links=tuple(_link(link, size) for link in obj.links),
        handles=tuple(_handle(handle, size) for handle in obj.handles),
        bounds=obj.bounds * size,
        metadata=facts,
    )


def original_id(item: str | ArticulatedObject) -> str:
    """Return the id of what was scaled: by what the object says of itself, or by its id, as `scaled` makes it."""
    name = item if isinstance(item, str) else str(item.metadata.get("scaled_from", item.id))
    found = _ID.fullmatch(name)
    return original_id(found[1]) if found else name


def _facts(metadata: Mapping[str, Any], size: float) -> dict[str, Any]:
    """Return what is known of an object, with lengths, volumes and masses of the new size."""
    found = {name: value for name, value in metadata.items() if name not in _OF_THE_FILE}
    for name, value in found.items():
        growth = size if name.endswith(_LENGTHS) else size * size * size if name.endswith(_VOLUMES) else 1.0
        if growth != 1.0 and isinstance(value, tuple | list):
            found[name] = type(value)(round(float(one) * growth, 4) for one in value)
        elif growth != 1.0 and isinstance(value, numbers.Real):
            found[name] = round(float(value) * growth, 4)
    return found


def _link(link: Link, size: float) -> Link:
    return replace(
        link,
        position=link.position * size,
        joint=None if link.joint is None else _joint(link.joint, size),
        visuals=tuple(replace(one, mesh=one.mesh.scaled(size)) for one in link.visuals),
        collisions=tuple(_shape(one, size) for one in link.collisions),
        surface_points=link.surface_points * size,
    )


def _joint(joint: Joint, size: float) -> Joint:
    """A joint whose spring gives way by the same angle, or by as much of the object's size, under its weight."""
    slides, square = joint.kind == "prismatic", size * size
    length = size if slides else 1.0
    return replace(
        joint,
        origin=joint.origin * size,
        limits=(joint.limits[0] * length, joint.limits[1] * length),
        stiffness=joint.stiffness * (square if slides else square * square),
        spring_reference=joint.spring_reference * length,
    )


def _shape(shape: CollisionShape, size: float) -> CollisionShape:
    vertices = None if shape.vertices is None else shape.vertices * size
    return replace(
        shape, size=tuple(one * size for one in shape.size), position=shape.position * size, vertices=vertices
    )


def _handle(handle: Handle, size: float) -> Handle:
    planes = handle.planes.copy()
    planes[:, 3] *= size  # a plane is its unit normal and how far it is from the origin
    return replace(
        handle,
        points=handle.points * size,
        planes=planes,
        grasp_positions=handle.grasp_positions * size,
        grasp_width_m=handle.grasp_width_m * size,
    )

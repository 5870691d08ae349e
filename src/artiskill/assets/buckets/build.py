"""From a `BucketSpec` to an `ArticulatedObject`: the body, and a bail that turns on its ears."""

import math

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Handle, Joint, Link
from artiskill.assets.buckets.appearance import make_bucket_materials
from artiskill.assets.buckets.bail import add_bail
from artiskill.assets.buckets.body import add_collisions, add_ears, add_visuals
from artiskill.assets.buckets.shape import half_width, outline, polygon_area
from artiskill.assets.buckets.spec import BucketSpec
from artiskill.assets.kinematics import density_for_mass
from artiskill.assets.parts import IDENTITY, LinkParts
from artiskill.geometry.rotations import quat_from_axis_angle, transform_points

_LITRES_PER_M3 = 1000.0
_BAIL_AXIS = np.array((0.0, 1.0, 0.0))


def build_bucket(spec: BucketSpec, object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """Build a bucket.

    Link frames are parallel to the object frame at joint value 0: the base's lies at the object's origin, the
    bail's in the middle between its pivots, upright. At its lower limit the bail lies at the front, -x.

    Args:
        spec: the bucket.
        object_id: name in catalogues and results.
        rng: draws surface samples and where in its texture each stave lies.
    """
    materials = make_bucket_materials(spec.appearance)
    base = LinkParts((0.0, 0.0, 0.0), rng)
    add_visuals(base, spec, materials, rng)
    add_collisions(base, spec)
    handles: list[Handle] = add_ears(base, spec, materials["ear"], rng)
    links = [base.link("base", -1, None, density_for_mass(spec.body_kg, base.collisions))]
    if spec.bail is not None:
        name = "link_0"
        parts = LinkParts((0.0, 0.0, spec.bail.pivot_z), rng)
        handles.append(add_bail(parts, spec.bail, materials, name, rng))
        limits = (-spec.bail.limit_rad, spec.bail.limit_rad)
        joint = Joint(f"{name}_bail", "revolute", _BAIL_AXIS.copy(), np.zeros(3), limits)
        links.append(parts.link(name, 0, joint, density_for_mass(spec.bail_kg, parts.collisions)))
    facts = _metadata(spec, links, handles)
    return ArticulatedObject(object_id, "bucket", tuple(links), tuple(handles), _bounds(links), facts)


def _bounds(links: list[Link]) -> np.ndarray:
    """Return bounds of everything drawn, at rest."""
    points = []
    for link in links:
        turn = IDENTITY if link.joint is None else quat_from_axis_angle(link.joint.axis, link.joint.rest)
        points += [transform_points(link.position, turn, visual.mesh.vertices) for visual in link.visuals]
    drawn = np.concatenate(points)
    return np.stack((drawn.min(axis=0), drawn.max(axis=0)))


def _volume_l(spec: BucketSpec) -> float:
    """Return what it holds when full to the rim, litres."""
    z = np.linspace(spec.floor_z, spec.height_m, 50)
    areas = polygon_area(outline(spec.section)) * (half_width(spec.profile, z) - spec.wall_m) ** 2
    return _LITRES_PER_M3 * float(areas.mean()) * (spec.height_m - spec.floor_z)


def _metadata(spec: BucketSpec, links: list[Link], handles: list[Handle]) -> dict[str, object]:
    bail, shape = spec.bail, spec.appearance
    tags = [spec.section.kind, spec.profile.kind, spec.material, f"{spec.foot.kind} foot", f"{spec.lip.kind} lip"]
    tags += [f"{spec.ear.kind} ears", "no bail" if bail is None else f"{bail.kind} bail"]
    tags += ["spout"] if spec.spout_m > 0 else []
    return {
        "source": "generated",
        "family": spec.family,
        "held_out": spec.held_out,
        "width_m": round(2 * spec.top_m, 4),
        "depth_m": round(2 * spec.top_m * spec.section.aspect, 4),
        "height_m": spec.height_m,
        "volume_l": round(_volume_l(spec), 1),
        "mass_kg": round(spec.body_kg + spec.bail_kg, 3),
        "mass_note": "that of a real bucket of this material, not of the 1000 kg/m3 of the first release",
        "joints": len(links) - 1,
        "handles": [handle.kind for handle in handles],
        "tags": tags,
        "finish": f"{shape.wall.finish} {shape.wall.name}",
        "material": spec.material,
        "section": spec.section.kind,
        "profile": spec.profile.kind,
        "bail": "none" if bail is None else f"{bail.kind}, {bail.grip.kind} grip",
        "bail_limit_deg": 0.0 if bail is None else round(math.degrees(bail.limit_rad), 1),
    }

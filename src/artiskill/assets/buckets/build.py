"""From a `BucketSpec` to an `ArticulatedObject`: the body, its ears, and a bail that turns on them.

A thin wall is seen from both sides. The outer faces of the collision prisms hug it; they are thicker than it,
inwards, so that pads close on a slab and a ball that moves several millimetres per physics step never meets a thin
sheet.
"""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape, Handle, Joint, Link, Material
from artiskill.assets.buckets.appearance import SPANGLE_TILE_M, make_bucket_materials
from artiskill.assets.buckets.bail import TO_Y, add_bail, rod
from artiskill.assets.buckets.shape import (
    SPOUT_DEPTH,
    coarse_outline,
    half_width,
    outline,
    polygon_area,
    spout_bulge,
)
from artiskill.assets.buckets.spec import BucketSpec, Profile, Section
from artiskill.assets.handles import handle_from_mesh
from artiskill.assets.kinematics import density_for_mass
from artiskill.assets.parts import IDENTITY, LinkParts, panel_mesh, standing_disc
from artiskill.geometry.arrays import arctan2, norm
from artiskill.geometry.meshes import TriMesh, convex_hull
from artiskill.geometry.primitives import cylinder, loft, path_sweep, ring_sweep, tube
from artiskill.geometry.rotations import quat_from_axis_angle, transform_points

_LITRES_PER_M3 = 1000.0
_BAIL_AXIS = np.array((0.0, 1.0, 0.0))

_BEAD_POINTS = 8
_SPOUT_LEVELS = 5
_SPOUT_APART = 0.03  # of the height: no level so near to a knot
_BEVEL_M = 0.0008
_SHEET_M = 0.002  # thickness of a collar
_HOOP_M = (0.0004, 0.0022)  # a hoop reaches so far into the wall and beyond it
_FOOT_M = 0.003  # thickness of a foot's ring
_STAVE_GAP = 0.998  # of a stave's width: neighbours do not quite meet, and their bevels make the groove
_WALL_M = 0.007
_FLOOR_M = 0.006
# A lip that stands out farther gets prisms of its own.
_WIDE_LIP_M = 0.0075
_ABOVE_GROUND_M = 0.002  # only the floor and the foot's disc touch the ground
_OVAL_ANGLES = np.radians((27.0, 63.0))
_ROUND = np.stack([f(np.arange(16) * np.pi / 8) for f in (np.cos, np.sin)], axis=-1)
_TAB_FOOT_M = 0.038  # how far a tab reaches below the lip
_RIVET_M = (0.004, 0.0016)  # radius and height
_SUNK_M = 0.001  # a boss or a rod ends so deep in the wall
_LOOP_CORNER = 0.55  # of how far it stands out


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
    _add_visuals(base, spec, materials, rng)
    _add_collisions(base, spec)
    handles: list[Handle] = _add_ears(base, spec, materials["ear"], rng)
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


def _add_visuals(
    parts: LinkParts, spec: BucketSpec, materials: dict[str, Material], rng: np.random.Generator
) -> None:
    """Add the visuals of the body but the ears."""
    if spec.staves:
        _add_staves(parts, spec, materials["wall"], rng)
    else:
        _add_wall(parts, spec, materials)
        parts.add_visual(_swept(spec, _lip_loop(spec)), materials["lip"], "lip")
    _add_floor(parts, spec, materials["inside"])
    if spec.foot.kind == "ring":
        outer = float(half_width(spec.profile, spec.foot.height_m)) - spec.foot.inset_m
        parts.add_visual(
            _swept(spec, _rectangle(outer - _FOOT_M, outer, 0.0, spec.foot.height_m)), materials["wall"], "foot"
        )
    for hoop in spec.hoops:
        low, high = (float(half_width(spec.profile, z)) for z in (hoop.z0, hoop.z1))
        into, out = _HOOP_M
        loop = [(low + out, hoop.z0), (high + out, hoop.z1), (high - into, hoop.z1), (low - into, hoop.z0)]
        parts.add_visual(_swept(spec, np.array(loop)), materials["ear"], "wall")


def _add_wall(parts: LinkParts, spec: BucketSpec, materials: dict[str, Material]) -> None:
    """Add one skin; or two, back to back, where inside and outside have different colours."""
    heights = _heights(spec)
    outer = half_width(spec.profile, heights)

    def skin(outside: np.ndarray, inside: np.ndarray) -> TriMesh:
        up, down = np.stack((outside, heights), axis=-1), np.stack((inside, heights), axis=-1)
        return _swept(spec, np.concatenate((up, down[::-1])))

    if materials["wall"] is materials["inside"]:
        parts.add_visual(skin(outer, outer - spec.wall_m), materials["wall"], "wall")
        return
    parts.add_visual(skin(outer, outer - spec.wall_m / 2), materials["wall"], "wall")
    parts.add_visual(skin(outer - spec.wall_m / 2, outer - spec.wall_m), materials["inside"], "wall")


def _heights(spec: BucketSpec) -> np.ndarray:
    """Return the heights of the knots, and more where a spout bends the wall."""
    knots = [z for z, _ in spec.profile.knots]
    if spec.spout_m > 0:
        bends = np.linspace((1 - SPOUT_DEPTH) * spec.height_m, spec.height_m, _SPOUT_LEVELS).tolist()
        near = _SPOUT_APART * spec.height_m
        knots += [z for z in bends if min(abs(z - knot) for knot in knots) > near]
    return np.unique(np.round(knots, 6))


def _swept(spec: BucketSpec, loop: np.ndarray) -> TriMesh:
    """Sweep a loop of (half width, height) around the section, drawn out at the spout."""
    around = outline(spec.section)
    tile = SPANGLE_TILE_M if spec.material == "galvanised" else 0.0
    if spec.spout_m <= 0:
        return ring_sweep(around, loop, tile)
    angles = arctan2(around[:, 1], around[:, 0])
    bulge = spout_bulge(angles[:, None], loop[None, :, 1], spec.height_m, spec.spout_m)
    loops = np.broadcast_to(loop, (len(around), *loop.shape)).copy()
    loops[:, :, 0] += bulge / norm(around)[:, None]
    return ring_sweep(around, loops, tile)


def _lip_loop(spec: BucketSpec) -> np.ndarray:
    """Return the section of the lip, counter-clockwise in (half width, height)."""
    outer, top = spec.top_m + spec.lip.overhang_m, spec.height_m
    inner, low = spec.top_m - spec.wall_m - 0.0003, top - spec.lip.height_m
    if spec.lip.kind == "rolled":
        angles = (np.arange(_BEAD_POINTS) + 0.5) * (2 * np.pi / _BEAD_POINTS)
        radii, middle = ((outer - inner) / 2, (top - low) / 2), ((outer + inner) / 2, (top + low) / 2)
        bead = np.stack((np.cos(angles), np.sin(angles)), axis=-1) / np.cos(np.pi / _BEAD_POINTS)
        return bead * radii + middle
    if spec.lip.kind == "flange":
        return _rectangle(inner, outer, low, top)
    below, back = top - 1.5 * _SHEET_M, outer - _SHEET_M
    points = [(outer, low), (outer, top - _BEVEL_M), (outer - _BEVEL_M, top), (inner, top)]
    return np.array([*points, (inner, below), (back, below), (back, low)])


def _rectangle(inner: float, outer: float, low: float, top: float) -> np.ndarray:
    """Return a bevelled rectangle, counter-clockwise."""
    b = min(_BEVEL_M, 0.3 * (top - low), 0.3 * (outer - inner))
    right = [(outer - b, low), (outer, low + b), (outer, top - b), (outer - b, top)]
    return np.array([*right, (inner + b, top), (inner, top - b), (inner, low + b), (inner + b, low)])


def _add_floor(parts: LinkParts, spec: BucketSpec, material: Material) -> None:
    around, rings = outline(spec.section), []
    for z in (spec.foot.height_m, spec.floor_z):
        scale = float(half_width(spec.profile, z)) - spec.wall_m / 2
        rings.append(np.column_stack((scale * around, np.full(len(around), z))))
    parts.add_visual(loft(np.array(rings)), material, "floor")


def _add_staves(parts: LinkParts, spec: BucketSpec, material: Material, rng: np.random.Generator) -> None:
    """Add upright boards, each a bevelled box bent into its place."""
    low, top = spec.profile.knots[0][0], spec.height_m
    step = 2 * np.pi / spec.staves
    half = np.array((spec.wall_m, spec.top_m * step, top - low)) / 2
    for k in range(spec.staves):
        board = panel_mesh(np.zeros(3), half, 2, rng)
        depth, across, along = board.vertices.T
        angle = (k + 0.5 * _STAVE_GAP * across / half[1]) * step
        z = along + (low + top) / 2
        # corners as far outside the circle as the middle of a face is inside
        radius = half_width(spec.profile, z) * 2 / (1 + np.cos(step / 2)) + depth - half[0]
        vertices = np.stack((radius * np.cos(angle), radius * np.sin(angle), z), axis=-1)
        parts.add_visual(TriMesh(vertices, board.faces, board.uvs), material, "wall")


def _add_collisions(parts: LinkParts, spec: BucketSpec) -> None:
    """Add the collision shapes of the body but the ears."""
    _add_floor_collisions(parts, spec)
    levels = [max(spec.profile.levels[0], _ABOVE_GROUND_M), *spec.profile.levels[1:]]
    thickness = max(_WALL_M, spec.wall_m)
    for low, high in pairwise(levels):
        rows = [(float(half_width(spec.profile, z)), z) for z in (low, high)]
        _add_prisms(parts, spec, rows, thickness, "wall")
    if spec.lip.overhang_m > _WIDE_LIP_M:
        outer, height = spec.top_m + spec.lip.overhang_m, max(spec.lip.height_m, 0.005)
        rows = [(outer, spec.height_m - height), (outer, spec.height_m)]
        _add_prisms(parts, spec, rows, spec.lip.overhang_m + _WALL_M / 2, "lip")


def _add_prisms(
    parts: LinkParts, spec: BucketSpec, rows: list[tuple[float, float]], thickness_m: float, part: str
) -> None:
    """Add one prism per side of the coarse outline, between two heights given as (half width, height)."""
    polygon = coarse_outline(spec.section)
    for start, end in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        edge = np.array((start, end))
        corners = np.concatenate(
            [
                np.column_stack((scale * edge, (z, z)))
                for width, z in rows
                for scale in (width, width - thickness_m)
            ]
        )
        centre = corners.mean(axis=0)
        parts.add_collision(CollisionShape("hull", (), centre, IDENTITY, corners - centre, part))


def _add_floor_collisions(parts: LinkParts, spec: BucketSpec) -> None:
    """Add a slab from the ground to the floor's upper face: foot and floor in one."""
    high = max(spec.floor_z, _FLOOR_M)
    radius = float(half_width(spec.profile, spec.foot.height_m)) - spec.foot.inset_m
    centre = np.array((0.0, 0.0, high / 2))
    if spec.section.kind == "oval":
        for angle in _OVAL_ANGLES:
            half = radius * spec.section.aspect * np.cos(angle), radius * np.sin(angle), high / 2
            parts.add_collision(CollisionShape("box", tuple(map(float, half)), centre, IDENTITY, part="floor"))
    elif spec.section.kind == "square":
        parts.add_collision(CollisionShape("box", (radius, radius, high / 2), centre, IDENTITY, part="floor"))
    else:
        parts.add_collision(standing_disc(radius, 0.0, high, "floor"))


def _add_ears(parts: LinkParts, spec: BucketSpec, material: Material, rng: np.random.Generator) -> list[Handle]:
    """Add both ears to the root link; return the handles, which loops are."""
    build = _BUILDERS[spec.ear.kind]
    handles = []
    for side in (-1.0, 1.0):
        mesh = build(parts, spec, side, material)
        if spec.ear.kind == "loop":
            outward = np.array((0.0, side, 0.0))
            handles.append(handle_from_mesh("base", "ear", mesh, outward, rng, hookable=True))
    return handles


def _add_boss(parts: LinkParts, spec: BucketSpec, side: float, material: Material) -> TriMesh:
    """Add a moulded block, round at its end and wider where it meets the wall."""
    ear = spec.ear
    tip = ear.radius_m * _ROUND
    base = tip * (1.35, 1.15) + (0.0, -0.35 * ear.radius_m)
    on_wall = _side_y(spec.section, spec.profile, base[:, 0], ear.z + base[:, 1]) - _SUNK_M
    foot = float(on_wall.min())
    rings = [
        np.stack((xz[:, 0], np.broadcast_to(side * y, len(xz)), ear.z + xz[:, 1]), axis=-1)
        for xz, y in ((base, on_wall), (tip, ear.reach_m - 0.0015), (tip - 0.0015 * _ROUND, ear.reach_m))
    ]
    mesh = convex_hull(np.concatenate(rings)).mesh
    parts.add_visual(mesh, material, "ear")
    half = (1.05 * ear.radius_m, (ear.reach_m - foot) / 2, ear.radius_m)
    centre = np.array((0.0, side * (ear.reach_m + foot) / 2, ear.z))
    parts.add_collision(CollisionShape("box", half, centre, IDENTITY, part="ear"))
    return mesh


def _side_y(section: Section, profile: Profile, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return how far from the axis the wall's outer face is, along y, near the middle of its side."""
    widths = half_width(profile, z)
    if section.kind not in ("round", "oval"):
        return widths
    return widths * np.sqrt(np.maximum(1.0 - (x / (widths * section.aspect)) ** 2, 0.0))


def _add_tab(parts: LinkParts, spec: BucketSpec, side: float, material: Material) -> TriMesh:
    """Add a plate riveted to the wall that passes the lip and ends round about the pivot."""
    ear, lip_low = spec.ear, spec.height_m - spec.lip.height_m
    plate = ear.reach_m - ear.radius_m
    foot_z = lip_low - _TAB_FOOT_M
    foot, knee = (float(half_width(spec.profile, z)) + ear.radius_m for z in (foot_z, lip_low - 0.006))
    path = [(foot, foot_z), (knee, lip_low - 0.006), (plate, lip_low), (plate, ear.z)]
    half_x, half_y = ear.half_width_m, ear.radius_m
    section = [(half_x, -half_y), (half_x, half_y), (-half_x, half_y), (-half_x, -half_y)]
    mesh = path_sweep([(0.0, side * y, z) for y, z in path], section, (1.0, 0.0, 0.0))
    parts.add_visual(mesh, material, "ear")
    # a little wider than the plate: no edge in common, and the skin of the whole stays closed
    disc = cylinder(1.01 * half_x, half_y, 18).transformed((0.0, side * plate, ear.z), TO_Y)
    parts.add_visual(disc, material, "ear")
    for x, z in ((-0.5 * half_x, foot_z + 0.009), (0.5 * half_x, foot_z + 0.009), (0.0, foot_z + 0.024)):
        y = float(half_width(spec.profile, z)) + 2 * half_y
        parts.add_visual(cylinder(*_RIVET_M, 8).transformed((x, side * y, z), TO_Y), material, "ear")
    low, high = (foot_z + lip_low) / 2, ear.z + 0.5 * half_x
    size = (half_x, max(half_y, 0.002), (high - low) / 2)
    centre = np.array((0.0, side * plate, (low + high) / 2))
    parts.add_collision(CollisionShape("box", size, centre, IDENTITY, part="ear"))
    return mesh


def _add_loop(parts: LinkParts, spec: BucketSpec, side: float, material: Material) -> TriMesh:
    """Add a rod bent to a handle, level, its ends in the wall."""
    ear = spec.ear
    wall = float(half_width(spec.profile, ear.z))
    foot = float(np.sqrt(max(wall**2 - ear.half_width_m**2, 0.0))) - _SUNK_M
    corner = _LOOP_CORNER * (ear.reach_m - wall)
    angles = np.linspace(0.0, np.pi / 2, 5)
    x = ear.half_width_m - corner + corner * np.cos(angles)
    y = ear.reach_m - ear.radius_m - corner + corner * np.sin(angles)
    right = np.concatenate(([(ear.half_width_m, foot)], np.stack((x, y), axis=-1)))
    flat = np.concatenate((right, right[::-1] * (-1.0, 1.0)))
    path = np.column_stack((flat[:, 0], side * flat[:, 1], np.full(len(flat), ear.z)))
    mesh = tube(path, ear.radius_m, 10)
    parts.add_visual(mesh, material, "ear")
    bends = path[[0, 3, 8, 11]]
    for start, end in pairwise(bends):
        parts.add_collision(rod(start, end, ear.radius_m, "ear"))
    return tube(path[1:-1], ear.radius_m, 10)


_BUILDERS: dict[str, Callable[[LinkParts, BucketSpec, float, Material], TriMesh]] = {
    "boss": _add_boss,
    "tab": _add_tab,
    "loop": _add_loop,
}

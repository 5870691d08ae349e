"""The fittings at both sides: bosses and tabs that carry the bail, loops to lift by."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from artiskill.assets.articulated_object import CollisionShape, Handle, Material
from artiskill.assets.buckets.rods import rod, turn_to
from artiskill.assets.buckets.spec import BucketSpec
from artiskill.assets.buckets.surface import half_width, side_y
from artiskill.assets.handles import handle_from_mesh
from artiskill.assets.parts import IDENTITY, LinkParts
from artiskill.geometry.meshes import TriMesh, convex_hull
from artiskill.geometry.primitives import cylinder, path_sweep, tube

_ROUND = np.stack([f(np.arange(16) * np.pi / 8) for f in (np.cos, np.sin)], axis=-1)
_TAB_FOOT_M = 0.038  # how far a tab reaches below the lip
_RIVET_M = (0.004, 0.0016)  # radius and height
_SUNK_M = 0.001  # a boss or a rod ends so deep in the wall
_LOOP_CORNER = 0.55  # of how far it stands out


def add_ears(parts: LinkParts, spec: BucketSpec, material: Material, rng: np.random.Generator) -> list[Handle]:
    """Draw and touch both ears, all of the root link; loops are handles too."""
    build = _BUILDERS[spec.ear.kind]
    handles = []
    for side in (-1.0, 1.0):
        mesh = build(parts, spec, side, material)
        if spec.ear.kind == "loop":
            outward = np.array((0.0, side, 0.0))
            handles.append(handle_from_mesh("base", "ear", mesh, outward, rng, hookable=True))
    return handles


def _add_boss(parts: LinkParts, spec: BucketSpec, side: float, material: Material) -> TriMesh:
    """A moulded block, round at its end and wider where it meets the wall."""
    ear = spec.ear
    tip = ear.radius_m * _ROUND
    base = tip * (1.35, 1.15) + (0.0, -0.35 * ear.radius_m)
    on_wall = side_y(spec.section, spec.profile, base[:, 0], ear.z + base[:, 1]) - _SUNK_M
    foot = float(on_wall.min())
    rings = [
        np.stack((xz[:, 0], np.broadcast_to(side * y, len(xz)), ear.z + xz[:, 1]), axis=-1)
        for xz, y in ((base, on_wall), (tip, ear.reach_m - 0.0015), (tip - 0.0015 * _ROUND, ear.reach_m))
    ]
    mesh = convex_hull(np.concatenate(rings)).mesh
    parts.add_visual(mesh, material, "ear")
    half = (1.05 * ear.radius_m, (ear.reach_m - foot) / 2, ear.radius_m)
    centre = parts.local((0.0, side * (ear.reach_m + foot) / 2, ear.z))
    parts.add_collision(CollisionShape("box", half, centre, IDENTITY, part="ear"))
    return mesh


def _add_tab(parts: LinkParts, spec: BucketSpec, side: float, material: Material) -> TriMesh:
    """A plate riveted to the wall that passes the lip and ends round about the pivot."""
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
    disc = cylinder(1.01 * half_x, half_y, 18).transformed((0.0, side * plate, ear.z), turn_to("y"))
    parts.add_visual(disc, material, "ear")
    for x, z in ((-0.5 * half_x, foot_z + 0.009), (0.5 * half_x, foot_z + 0.009), (0.0, foot_z + 0.024)):
        y = float(half_width(spec.profile, z)) + 2 * half_y
        parts.add_visual(cylinder(*_RIVET_M, 8).transformed((x, side * y, z), turn_to("y")), material, "ear")
    low, high = (foot_z + lip_low) / 2, ear.z + 0.5 * half_x
    size = (half_x, max(half_y, 0.002), (high - low) / 2)
    parts.add_collision(
        CollisionShape("box", size, parts.local((0.0, side * plate, (low + high) / 2)), IDENTITY, part="ear")
    )
    return mesh


def _add_loop(parts: LinkParts, spec: BucketSpec, side: float, material: Material) -> TriMesh:
    """A rod bent to a handle, level, its ends in the wall."""
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
        parts.add_collision(rod(parts.local(start), parts.local(end), ear.radius_m, "ear"))
    return tube(path[1:-1], ear.radius_m, 10)


_BUILDERS: dict[str, Callable[[LinkParts, BucketSpec, float, Material], TriMesh]] = {
    "boss": _add_boss,
    "tab": _add_tab,
    "loop": _add_loop,
}

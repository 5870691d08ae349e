"""What a chair stands on: a star of legs, a disc, or a frame of bent tubes; and the column up to the mechanism."""

import math
from itertools import pairwise

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.chairs.link_builder import Beam, LinkBuilder, Tube, loop_mesh
from artiskill.assets.chairs.pads import hull_shape
from artiskill.assets.chairs.spec import DISC_M, ChairSpec, Column
from artiskill.assets.parts import IDENTITY, standing_disc
from artiskill.geometry.primitives import cylinder, lathe, rounded_box

_NOSE_M = 0.007  # rounded end of a leg
_TIP_M = 0.018  # how far a leg reaches beyond its caster's stem
_ARCH_SHARE = 0.62  # where an arched leg bends, from hub to tip
_SEGMENTS = 24
_LAP_M = 0.003
_CONE_SIDES = 14
_OUTSIDE = 1.012  # corners as far outside of a circle as the sides are inside
_TOP_SHARE = 0.62  # half length of a sled's top, relative to that of its runners
_PLATE_M = (0.09, 0.010)  # half length and thickness of the plate that bears the seat
_BOSS_M = 0.018  # height of the swivel between plate and mechanism
_FILLET_M = 0.055
_CHAMFER_M = 0.04
_KNEE_LEAN_M = 0.02  # how far behind the runners' front the knees of a cantilever are
_KNEE_DROP_M = 0.045  # its hinge lies so far below the seat's rails
_SLEEVE_M = (0.002, 0.016)  # thickness and half length of the sleeves below its hinges
_GAP_M = 0.001  # between shapes of links that move against one another
_BEHIND_PIVOT_M = 0.012  # how far the mechanism reaches behind the tilt axis
_RING_TUBE_M = 0.010
_RING_CHORDS = 12
_LEVER_M = 0.005


def add_star(link: LinkBuilder, spec: ChairSpec) -> None:
    """Add legs and hub."""
    assert spec.casters is not None, "a star has casters"
    base = spec.base
    tip = spec.casters.stem_height_m + base.leg_height_m[1] / 2
    middle = spec.hub_middle_m
    reach = base.radius_m + _TIP_M
    start = 0.78 * base.hub_radius_m
    stations = [(start, middle, 0.0), (reach, tip, 1.0)]
    if base.arched:
        bend = start + _ARCH_SHARE * (reach - start)
        stations.insert(1, (bend, tip + 0.8 * (middle - tip), _ARCH_SHARE))
    shares = np.array([s for _, _, s in stations])
    width = base.leg_width_m[0] + shares * (base.leg_width_m[1] - base.leg_width_m[0])
    height = base.leg_height_m[0] + shares * (base.leg_height_m[1] - base.leg_height_m[0])
    for k in range(base.legs):
        angle = base.turn_rad + 2 * math.pi * k / base.legs
        out = np.array((math.cos(angle), math.sin(angle), 0.0))
        path = [rho * out + (0.0, 0.0, z) for rho, z, _ in stations]
        leg = Beam(path, width, height, (-out[1], out[0], 0.0), base.round, nose_m=_NOSE_M)
        link.add_bar(leg, "base", "base", 0.06, 10)
    low, high = middle - base.leg_height_m[0] / 2 - 0.006, spec.hub_top_m
    r = base.hub_radius_m
    profile = [(0.0, low), (0.86 * r, low), (r, low + 0.008)]
    profile += [(0.92 * r, high - 0.012), (0.78 * r, high), (0.0, high)]
    link.add_visual(lathe(profile, _SEGMENTS), "base", "base")
    link.add_collision(_upright(0.94 * r, low, high, "base"))


def add_disc(link: LinkBuilder, spec: ChairSpec) -> None:
    """Add a flat disc that rises to the column."""
    radius, top, tube = spec.base.radius_m, spec.hub_top_m, spec.base.hub_radius_m
    rise = top - DISC_M
    profile = [(0.0, 0.0), (radius - 0.002, 0.0), (radius, 0.002), (radius, 0.007), (radius - 0.006, DISC_M)]
    shares = ((0.5, 0.07), (0.26, 0.22), (0.1, 0.55), (0.0, 1.0))
    profile += [(tube + s * (radius - tube), DISC_M + h * rise) for s, h in shares]
    profile += [(0.0, top)]
    link.add_visual(lathe(profile, 36), "base", "base")
    link.add_collision(standing_disc(radius, 0.0, DISC_M, "base"))
    rings = [(tube + s * (radius - tube), DISC_M + h * rise) for s, h in shares]
    around = np.arange(_CONE_SIDES) * (2 * math.pi / _CONE_SIDES)
    circle = np.stack((np.cos(around), np.sin(around)), axis=1) * _OUTSIDE
    rings[0] = (rings[0][0], DISC_M / 2)  # from within the disc
    for lower, upper in pairwise(rings):
        high = (upper[0], upper[1] + _LAP_M)  # a little into the next one
        corners = [np.column_stack((r * circle, np.full(_CONE_SIDES, z))) for r, z in (lower, high)]
        link.add_collision(hull_shape(np.round(np.concatenate(corners), 6), "base"))


def add_sled(link: LinkBuilder, spec: ChairSpec) -> None:
    """Add two closed side frames, two tubes across, and a plate with the swivel's lower half."""
    radius, half_y = spec.base.leg_height_m[0] / 2, spec.base.leg_width_m[0] / 2
    plate_top = spec.mechanism_bottom_m - _BOSS_M
    top = plate_top - _PLATE_M[1] - radius
    long = spec.base.radius_m
    short = _TOP_SHARE * long
    for y in (-half_y, half_y):
        corners = [(0, top), (short, top), (long, radius), (-long, radius), (-short, top), (0, top)]
        tube = Tube([(x, y, z) for x, z in corners], radius)
        link.add_visual(tube.mesh(8, _FILLET_M), "base", "base")
        link.add_collision(*tube.shapes("base", _CHAMFER_M))
    reach = _PLATE_M[0] - 0.02
    for x in (-reach, reach):
        link.add_bar(Tube([(x, -half_y, top), (x, half_y, top)], radius), "base", "base")
    half = (_PLATE_M[0], 0.06, _PLATE_M[1] / 2)
    centre = np.array((0.0, 0.0, plate_top - half[2]))
    link.add_visual(rounded_box(half, 0.015, 3, 0.002).transformed(centre), "base", "base")
    link.add_collision(CollisionShape("box", half, centre, IDENTITY, part="base"))
    boss = (0.03, (_BOSS_M - 2 * _GAP_M) / 2)
    middle = np.array((0.0, 0.0, plate_top + _BOSS_M / 2))
    link.add_visual(cylinder(boss[0], _BOSS_M / 2, 18).transformed(middle), "tube", "column")
    link.add_collision(CollisionShape("cylinder", boss, middle, IDENTITY, part="column"))


def knee(spec: ChairSpec) -> np.ndarray:
    """Return a point on the axis about which a cantilever's seat gives way, (3,)."""
    return np.array((-spec.base.radius_m + _KNEE_LEAN_M, 0.0, _rail_height(spec) - _KNEE_DROP_M))


def add_runners(link: LinkBuilder, spec: ChairSpec) -> None:
    """Add the lower half of a cantilever: a loop on the ground, up to the knees."""
    radius, half_y, long = spec.base.leg_height_m[0] / 2, spec.base.leg_width_m[0] / 2, spec.base.radius_m
    x, _, z = knee(spec)
    side = [(x, z - radius - _GAP_M), (-long, radius), (long, radius)]
    path = [(a, -half_y, b) for a, b in side] + [(a, half_y, b) for a, b in reversed(side)]
    link.add_collision(*Tube(path, radius).shapes("base", _CHAMFER_M))
    path[0], path[-1] = (x, -half_y, z), (x, half_y, z)  # drawn up to the hinge, in a sleeve
    link.add_visual(Tube(path, radius).mesh(10, _FILLET_M), "base", "base")
    for y in (-half_y, half_y):
        sleeve = cylinder(radius + _SLEEVE_M[0], _SLEEVE_M[1], 12, 0.002)
        link.add_visual(sleeve.transformed((x, y, z - _SLEEVE_M[1])), "tube", "base")


def rail_path(spec: ChairSpec) -> np.ndarray:
    """Return x and z of the upper half's tube: knee, bend, and the seat's rear. (3, 2)."""
    x, _, z = knee(spec)
    height = _rail_height(spec)
    return np.array(((x, z), (x + 0.012, height), (spec.seat.depth_m / 2, height)))


def _rail_height(spec: ChairSpec) -> float:
    return spec.seat_bottom_m - spec.base.leg_height_m[0] / 2


def add_tube(link: LinkBuilder, spec: ChairSpec) -> None:
    """Add the outer tube on the base, its cover, and the ring for the feet."""
    column = spec.column
    assert column is not None, "only a column has a tube"
    low, high = spec.hub_top_m - 0.004, spec.tube_top_m
    if column.cover:
        middle = (low + high) / 2
        wide, narrow = column.tube_m + 0.008, column.tube_m + 0.003
        profile = [(0.0, low), (wide, low), (wide, middle - 0.003), (narrow, middle), (narrow, high), (0.0, high)]
        link.add_visual(lathe(profile, 18), "tube", "column")
    else:
        tube = cylinder(column.tube_m, (high - low) / 2, 18, 0.002).transformed((0, 0, (low + high) / 2))
        link.add_visual(tube, "tube", "column")
    radius = column.tube_m + (0.005 if column.cover else 0.0)
    link.add_collision(_upright(radius, low, high, "column"))
    if column.footrest_m > 0:
        _add_ring(link, column)


def add_piston(link: LinkBuilder, spec: ChairSpec) -> None:
    """Add the inner tube, from within the outer one up to the mechanism."""
    column = spec.column
    assert column is not None, "only a column has a piston"
    low, high = spec.tube_top_m, spec.mechanism_bottom_m
    hidden = low - min(column.travel_m + 0.01 if column.travel_m > 0 else _GAP_M, low - 0.03)
    mesh = cylinder(column.piston_m, (high - hidden) / 2, 14).transformed((0, 0, (high + hidden) / 2))
    link.add_visual(mesh, "piston", "column")
    link.add_collision(_upright(column.piston_m, low + _GAP_M, high - _GAP_M, "column"))


def pivot(spec: ChairSpec) -> np.ndarray:
    """Return a point on the axis about which the seat leans back, (3,)."""
    height = spec.mechanism_top_m - spec.mechanism.height_m / 2
    return np.array((spec.mechanism.pivot_m, 0.0, height))


def add_mechanism(link: LinkBuilder, spec: ChairSpec) -> None:
    """Add the box under the seat, and its lever."""
    box = spec.mechanism
    rear = box.pivot_m + _BEHIND_PIVOT_M
    half = (box.length_m / 2, box.width_m / 2, box.height_m / 2)
    centre = np.array((rear - half[0], 0.0, spec.mechanism_top_m - half[2]))
    link.add_visual(rounded_box(half, 0.02, 3, 0.006).transformed(centre), "tube", "seat")
    link.add_collision(CollisionShape("box", half, centre, IDENTITY, part="seat"))
    if box.lever:
        x, z = centre[0] + 0.02, centre[2] - 0.2 * box.height_m
        end = spec.seat.width_m / 2 - 0.01
        link.add_bar(Tube([(x, half[1] - 0.005, z), (x, end, z)], _LEVER_M), "piston", "seat")
        paddle = rounded_box((0.014, 0.030, 0.005), 0.01, 3, 0.002).transformed((x, end, z))
        link.add_visual(paddle, "tube", "seat")


def _add_ring(link: LinkBuilder, column: Column) -> None:
    """Add a ring on spokes around the outer tube."""
    angles = np.arange(_RING_CHORDS * 3) * (2 * math.pi / (_RING_CHORDS * 3))
    circle = np.stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)), axis=1)
    height = np.array((0.0, 0.0, column.footrest_height_m))
    link.add_visual(loop_mesh(column.footrest_m * circle + height, _RING_TUBE_M), "piston", "footrest")
    # chords that lie as far within the ring at their middle as beyond it at their ends
    reach = column.footrest_m * (1 + (1 - math.cos(math.pi / _RING_CHORDS)) / 2)
    corners = reach * circle[::3] + height
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        link.add_collision(*Tube([start, end], _RING_TUBE_M).shapes("footrest"))
    for k in range(3):
        out = circle[k * _RING_CHORDS]
        start, end = height + (column.tube_m - 0.004) * out, height + column.footrest_m * out
        link.add_bar(Beam([start, end], 0.018, 0.008, (-out[1], out[0], 0.0)), "piston", "footrest")
    collar = cylinder(column.tube_m + 0.007, 0.014, 18, 0.003).transformed(height)
    link.add_visual(collar, "piston", "footrest")


def _upright(radius: float, low: float, high: float, part: str) -> CollisionShape:
    centre = np.array((0.0, 0.0, (low + high) / 2))
    return CollisionShape("cylinder", (radius, (high - low) / 2), centre, IDENTITY, part=part)

"""Frames of bent tubes that slide on the ground: a sled with two runners, and a cantilever without rear legs."""

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.chairs.appearance import Skins
from artiskill.assets.chairs.beams import Tube
from artiskill.assets.chairs.pen import Pen
from artiskill.assets.chairs.spec import ChairSpec
from artiskill.assets.parts import IDENTITY
from artiskill.geometry.primitives import cylinder, rounded_box

_TOP_SHARE = 0.62  # half length of a sled's top, relative to that of its runners
_PLATE_M = (0.09, 0.010)  # half length and thickness of the plate that bears the seat
_BOSS_M = 0.018  # height of the swivel between plate and mechanism
_FILLET_M = 0.055
_CHAMFER_M = 0.04
_KNEE_LEAN_M = 0.02  # how far behind the runners' front the knees of a cantilever are
_KNEE_DROP_M = 0.045  # its hinge lies so far below the seat's rails
_GAP_M = 0.001
_SLEEVE_M = (0.002, 0.016)  # thickness and half length of the sleeves below its hinges


def add_sled(pen: Pen, spec: ChairSpec, skins: Skins) -> None:
    """Two closed side frames, two tubes across, and a plate with the swivel's lower half."""
    radius, half_y = spec.base.leg_height_m[0] / 2, spec.base.leg_width_m[0] / 2
    plate_top = spec.mechanism_bottom_m - _BOSS_M
    top = plate_top - _PLATE_M[1] - radius
    long = spec.base.radius_m
    short = _TOP_SHARE * long
    for y in (-half_y, half_y):
        corners = [(0, top), (short, top), (long, radius), (-long, radius), (-short, top), (0, top)]
        tube = Tube([(x, y, z) for x, z in corners], radius)
        pen.mesh(tube.mesh(8, _FILLET_M), skins.base, "base")
        for shape in tube.shapes("base", _CHAMFER_M):
            pen.shape(shape)
    reach = _PLATE_M[0] - 0.02
    for x in (-reach, reach):
        pen.bar(Tube([(x, -half_y, top), (x, half_y, top)], radius), skins.base, "base")
    half = (_PLATE_M[0], 0.06, _PLATE_M[1] / 2)
    centre = np.array((0.0, 0.0, plate_top - half[2]))
    pen.mesh(rounded_box(half, 0.015, 3, 0.002).transformed(centre), skins.base, "base")
    pen.shape(CollisionShape("box", half, centre, IDENTITY, part="base"))
    boss = (0.03, (_BOSS_M - 2 * _GAP_M) / 2)
    middle = np.array((0.0, 0.0, plate_top + _BOSS_M / 2))
    pen.mesh(cylinder(boss[0], _BOSS_M / 2, 18).transformed(middle), skins.tube, "column")
    pen.shape(CollisionShape("cylinder", boss, middle, IDENTITY, part="column"))


def knee(spec: ChairSpec) -> np.ndarray:
    """(3,) a point on the axis about which a cantilever's seat gives way."""
    return np.array((-spec.base.radius_m + _KNEE_LEAN_M, 0.0, _rail_height(spec) - _KNEE_DROP_M))


def add_runners(pen: Pen, spec: ChairSpec, skins: Skins) -> None:
    """The lower half of a cantilever: a loop on the ground, up to the knees."""
    radius, half_y, long = spec.base.leg_height_m[0] / 2, spec.base.leg_width_m[0] / 2, spec.base.radius_m
    x, _, z = knee(spec)
    side = [(x, z - radius - _GAP_M), (-long, radius), (long, radius)]
    path = [(a, -half_y, b) for a, b in side] + [(a, half_y, b) for a, b in reversed(side)]
    for shape in Tube(path, radius).shapes("base", _CHAMFER_M):
        pen.shape(shape)
    path[0], path[-1] = (x, -half_y, z), (x, half_y, z)  # drawn up to the hinge, in a sleeve
    pen.mesh(Tube(path, radius).mesh(10, _FILLET_M), skins.base, "base")
    for y in (-half_y, half_y):
        sleeve = cylinder(radius + _SLEEVE_M[0], _SLEEVE_M[1], 12, 0.002)
        pen.mesh(sleeve.transformed((x, y, z - _SLEEVE_M[1])), skins.tube, "base")


def rail_path(spec: ChairSpec) -> np.ndarray:
    """(3, 2) x and z of the upper half's tube: knee, bend, and the seat's rear."""
    x, _, z = knee(spec)
    height = _rail_height(spec)
    return np.array(((x, z), (x + 0.012, height), (spec.seat.depth_m / 2, height)))


def _rail_height(spec: ChairSpec) -> float:
    return spec.seat_bottom_m - spec.base.leg_height_m[0] / 2

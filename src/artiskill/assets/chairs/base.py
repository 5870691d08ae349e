"""What a chair stands on: a star of legs, or a disc. Frames of tubes are in `frames`."""

import math
from itertools import pairwise

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.chairs.appearance import Skins
from artiskill.assets.chairs.beams import Beam
from artiskill.assets.chairs.casters import CasterPlace, stem_height_m
from artiskill.assets.chairs.pads import hull_shape
from artiskill.assets.chairs.pen import Pen
from artiskill.assets.chairs.spec import ChairSpec
from artiskill.assets.parts import IDENTITY, standing_disc
from artiskill.geometry.primitives import lathe

_NOSE_M = 0.007  # rounded end of a leg
TIP_M = 0.018  # how far a leg reaches beyond its caster's stem
_ARCH_SHARE = 0.62  # where an arched leg bends, from hub to tip
_HUB_RIM_M = 0.012
_SEGMENTS = 24
_LAP_M = 0.003
_CONE_SIDES = 14
_OUTSIDE = 1.012  # corners as far outside of a circle as the sides are inside
DISC_M = 0.010  # thickness of a disc at its rim


def caster_places(spec: ChairSpec) -> list[CasterPlace]:
    """Where the casters of a star base are."""
    if spec.casters is None:
        return []
    places = []
    for k, yaw in enumerate(spec.casters.yaws_rad):
        angle = spec.base.turn_rad + 2 * math.pi * k / spec.base.legs
        places.append(CasterPlace(spec.base.radius_m * math.cos(angle), spec.base.radius_m * math.sin(angle), yaw))
    return places


def hub_top_m(spec: ChairSpec) -> float:
    """Height at which the column comes out of a star's hub or a disc's cone."""
    base = spec.base
    if base.kind == "disc":
        return DISC_M + base.rise_m
    assert spec.casters is not None, "a star has casters"
    return _hub_middle(spec) + base.leg_height_m[0] / 2 + _HUB_RIM_M


def add_star(pen: Pen, spec: ChairSpec, skins: Skins) -> None:
    """Legs and hub."""
    assert spec.casters is not None, "a star has casters"
    base = spec.base
    tip = stem_height_m(spec.casters) + base.leg_height_m[1] / 2
    middle = _hub_middle(spec)
    reach = base.radius_m + TIP_M
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
        pen.bar(leg, skins.base, "base", 0.06, 10)
    low, high = middle - base.leg_height_m[0] / 2 - 0.006, hub_top_m(spec)
    r = base.hub_radius_m
    profile = [
        (0.0, low),
        (0.86 * r, low),
        (r, low + 0.008),
        (0.92 * r, high - 0.012),
        (0.78 * r, high),
        (0.0, high),
    ]
    pen.mesh(lathe(profile, _SEGMENTS), skins.base, "base")
    size = (0.94 * r, (high - low) / 2)
    pen.shape(CollisionShape("cylinder", size, np.array((0, 0, (low + high) / 2)), IDENTITY, part="base"))


def add_disc(pen: Pen, spec: ChairSpec, skins: Skins) -> None:
    """A flat disc that rises to the column."""
    radius, top, tube = spec.base.radius_m, hub_top_m(spec), spec.base.hub_radius_m
    rise = top - DISC_M
    profile = [(0.0, 0.0), (radius - 0.002, 0.0), (radius, 0.002), (radius, 0.007), (radius - 0.006, DISC_M)]
    shares = ((0.5, 0.07), (0.26, 0.22), (0.1, 0.55), (0.0, 1.0))
    profile += [(tube + s * (radius - tube), DISC_M + h * rise) for s, h in shares]
    profile += [(0.0, top)]
    pen.mesh(lathe(profile, 36), skins.base, "base")
    pen.shape(standing_disc(radius, 0.0, DISC_M, "base"))
    rings = [(tube + s * (radius - tube), DISC_M + h * rise) for s, h in shares]
    around = np.arange(_CONE_SIDES) * (2 * math.pi / _CONE_SIDES)
    circle = np.stack((np.cos(around), np.sin(around)), axis=1) * _OUTSIDE
    rings[0] = (rings[0][0], DISC_M / 2)  # from within the disc
    for lower, upper in pairwise(rings):
        high = (upper[0], upper[1] + _LAP_M)  # a little into the next one
        corners = [np.column_stack((r * circle, np.full(_CONE_SIDES, z))) for r, z in (lower, high)]
        pen.shape(hull_shape(np.round(np.concatenate(corners), 6), "base"))


def _hub_middle(spec: ChairSpec) -> float:
    assert spec.casters is not None
    return stem_height_m(spec.casters) + spec.base.leg_height_m[1] / 2 + spec.base.rise_m

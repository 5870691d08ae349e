"""What a cabinet stands on: plinths, kick boards, legs of several forms, casters; or nothing, on a wall."""

from collections.abc import Iterator

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.cabinets.boards import Boards
from artiskill.assets.cabinets.materials import Materials
from artiskill.assets.cabinets.spec import CabinetSpec
from artiskill.assets.parts import IDENTITY
from artiskill.geometry.primitives import cylinder, lathe, loft
from artiskill.geometry.rotations import quat_from_axis_angle

_SEGMENTS = 14
_TAPER = 0.62  # a round leg's foot, relative to its top
_SPLAY = 0.28  # how far a splayed leg's foot stands outside its top, relative to its height
_BUN = ((0.55, 0.0), (0.85, 0.12), (1.0, 0.4), (0.9, 0.68), (0.55, 0.86), (0.7, 0.9), (0.7, 1.0))  # radius, height
_PLATE_M = 0.004  # of a caster
_SHAPES = {"plinth": 1, "sides": 1, "legs": 4, "casters": 4, "floor": 0, "wall": 1, "sled": 6}
_TO_Y = quat_from_axis_angle((1, 0, 0), np.pi / 2)


def support_shapes(spec: CabinetSpec) -> int:
    """How many shapes of the support are touched, the wall's included."""
    kind = spec.support.kind
    return _SHAPES["sled" if kind == "legs" and spec.support.leg_shape == "sled" else kind]


def add_support(parts: Boards, spec: CabinetSpec, materials: Materials) -> None:
    """Add what is below the carcass."""
    support = spec.support
    if support.kind == "plinth":
        _add_plinth(parts, spec, materials)
    elif support.kind == "sides":
        _add_kick_board(parts, spec, materials)
    elif support.kind == "casters":
        for x, y in _corners(spec):
            _add_caster(parts, spec, materials, x, y)
    elif support.kind == "legs" and support.leg_shape == "sled":
        _add_sled(parts, spec, materials)
    elif support.kind == "legs":
        for x, y in _corners(spec):
            _add_leg(parts, spec, materials, x, y)


def _corners(spec: CabinetSpec) -> Iterator[tuple[float, float]]:
    """Where legs stand."""
    inset = spec.support.setback_m + spec.support.leg_m / 2
    for sx in (-1, 1):
        for sy in (-1, 1):
            yield sx * (spec.depth_m / 2 - inset), sy * (spec.width_m / 2 - inset)


def _add_plinth(parts: Boards, spec: CabinetSpec, materials: Materials) -> None:
    """A closed ring of boards, set back at the front so that toes fit under; seen and touched as a block."""
    x0 = -spec.depth_m / 2 + spec.support.setback_m
    half_y = spec.width_m / 2
    parts.panel((x0, -half_y, 0.0), (spec.depth_m / 2, half_y, spec.support.height_m), materials.support, "plinth")


def _add_kick_board(parts: Boards, spec: CabinetSpec, materials: Materials) -> None:
    x0, inside = -spec.depth_m / 2 + spec.support.setback_m, spec.width_m / 2 - spec.panel_m
    low, high = (x0, -inside, 0.0), (x0 + spec.panel_m, inside, spec.support.height_m)
    parts.panel(low, high, materials.support, "plinth", grain=1)


def _add_leg(parts: Boards, spec: CabinetSpec, materials: Materials, x: float, y: float) -> None:
    support = spec.support
    radius, height = support.leg_m / 2, support.height_m
    if support.leg_shape == "square":
        low, high = (x - radius, y - radius, 0.0), (x + radius, y + radius, height)
        parts.panel(low, high, materials.support, "leg")
        return
    if support.leg_shape == "splayed":
        _add_splayed_leg(parts, materials, (x, y), radius, height)
        return
    if support.leg_shape == "bun":
        profile = [(0.0, 0.0), *((r * radius, z * height) for r, z in _BUN), (0.0, height)]
        size = (0.9 * radius, height / 2)
    else:
        foot = _TAPER * radius
        profile = [(0.0, 0.0), (foot, 0.0), (radius, height), (0.0, height)]
        size = ((radius + foot) / 2, height / 2)
    parts.add_visual(lathe(profile, _SEGMENTS).transformed(parts.local((x, y, 0.0))), materials.support, "leg")
    parts.add_collision(CollisionShape("cylinder", size, parts.local((x, y, height / 2)), IDENTITY, part="leg"))


def _add_splayed_leg(
    parts: Boards, materials: Materials, top: tuple[float, float], radius: float, height: float
) -> None:
    """Round and tapered, leaning out to the corner, its foot flat on the ground."""
    angles = np.arange(_SEGMENTS) * (2 * np.pi / _SEGMENTS)
    circle = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    out = np.sign(top) * _SPLAY * height / np.sqrt(2)
    rings = [
        np.column_stack((np.asarray(top) + out + _TAPER * radius * circle, np.zeros(_SEGMENTS))),
        np.column_stack((np.asarray(top) + radius * circle, np.full(_SEGMENTS, height))),
    ]
    parts.add_visual(loft(rings).transformed(parts.local((0.0, 0.0, 0.0))), materials.support, "leg")
    corners = np.concatenate([ring[::2] for ring in rings])
    centre = corners.mean(axis=0)
    parts.add_collision(CollisionShape("hull", (), parts.local(centre), IDENTITY, corners - centre, "leg"))


def _add_sled(parts: Boards, spec: CabinetSpec, materials: Materials) -> None:
    """Two frames of square tube, one under each side."""
    s = spec.support
    x0, x1 = -spec.depth_m / 2 + s.setback_m, spec.depth_m / 2 - s.setback_m
    for sign in (-1, 1):
        y = sign * (spec.width_m / 2 - s.setback_m - s.leg_m / 2)
        low, high = y - s.leg_m / 2, y + s.leg_m / 2
        parts.panel((x0, low, 0.0), (x1, high, s.leg_m), materials.support, "leg")
        parts.panel((x0, low, s.leg_m), (x0 + s.leg_m, high, s.height_m), materials.support, "leg")
        parts.panel((x1 - s.leg_m, low, s.leg_m), (x1, high, s.height_m), materials.support, "leg")


def _add_caster(parts: Boards, spec: CabinetSpec, materials: Materials, x: float, y: float) -> None:
    """A small wheel in a fork under a plate; it does not turn."""
    radius, height = spec.support.leg_m / 2, spec.support.height_m
    half = 0.38 * radius
    wheel = cylinder(radius, half, 16, 0.15 * radius).transformed(parts.local((x, y, radius)), _TO_Y)
    parts.add_visual(wheel, materials.tyre, "caster")
    fork, above = half + 0.004, height - _PLATE_M
    for inner, outer in ((-fork, -half), (half, fork)):
        cheek = (x - 0.5 * radius, y + inner, 0.9 * radius), (x + 0.5 * radius, y + outer, above)
        parts.panel(*cheek, materials.runner, "caster", collide=False)
    plate = min(1.1 * radius, spec.support.setback_m + radius)
    corners = (x - plate, y - plate, above), (x + plate, y + plate, height)
    parts.panel(*corners, materials.runner, "caster", collide=False)
    parts.add_collision_box((x - 0.85 * radius, y - fork, 0.0), (x + 0.85 * radius, y + fork, height), "caster")

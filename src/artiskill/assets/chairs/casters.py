"""Casters: a link that swivels about its stem and carries one wheel, or two.

Each is built in a frame of its own: its stem on the z axis above the ground, its wheel towards +x, and then turned
to where it stands at joint value 0.
"""

import math
from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.chairs.appearance import Skins
from artiskill.assets.chairs.beams import Beam
from artiskill.assets.chairs.pads import hull_shape
from artiskill.assets.chairs.pen import Pen
from artiskill.assets.chairs.spec import CROWN_GAP_M, CROWN_M, STEM_GAP_M, Casters
from artiskill.assets.parts import LinkParts
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import cylinder, lathe
from artiskill.geometry.rotations import quat_from_axis_angle, quat_multiply, quat_rotate

# Wheels that turn separately lean, as real ones do: each stands on its inner rim, and the pair turns on the spot.
CAMBER_RAD = math.radians(2.0)
_WEB_M = 0.008  # between the two wheels of a twin caster
_CHEEK_M, _CHEEK_GAP_M = 0.004, 0.0025  # a fork's sides, and their distance from the wheel
_BARREL_M = 0.0105  # its radius
_CROWN_SHARE = 0.40  # half width of a hood, relative to the width over the wheels
_ROUND = 0.75  # width of the same over a ball, whose cap is round
_BARREL_SHARE = 1.6  # height of the foot of a stem's barrel, relative to the wheel's radius
_SEGMENTS = 12
_TO_Y = quat_from_axis_angle((1, 0, 0), -math.pi / 2)  # turns z onto y
_Y = np.array((0.0, 1.0, 0.0))


@dataclass(frozen=True)
class CasterPlace:
    """Where one caster is: its stem's foot on the ground, and its yaw at joint value 0."""

    x_m: float
    y_m: float
    yaw_rad: float

    @property
    def turn(self) -> np.ndarray:
        """(4,) from the caster's frame to the object's."""
        return quat_from_axis_angle((0, 0, 1), self.yaw_rad)

    def point(self, local: tuple[float, float, float]) -> np.ndarray:
        """A point of the caster's frame in the object frame."""
        return quat_rotate(self.turn, np.array(local)) + np.array((self.x_m, self.y_m, 0.0))


def wheel_top_m(casters: Casters) -> float:
    """Height of a wheel's uppermost point."""
    return 2 * axle_height_m(casters)


def axle_height_m(casters: Casters) -> float:
    """Height of a wheel's middle when it stands on the ground."""
    radius = casters.diameter_m / 2
    if not casters.split:
        return radius
    return radius * math.cos(CAMBER_RAD) + _split_half(casters) * math.sin(CAMBER_RAD)


def stem_height_m(casters: Casters) -> float:
    """Height of the underside of what a caster is plugged into."""
    return wheel_top_m(casters) + CROWN_GAP_M + CROWN_M + STEM_GAP_M


def wheel_sides(casters: Casters) -> tuple[int, ...]:
    """One entry per wheel link: 0 for a wheel or a pair in the middle, -1 and 1 for two that turn separately."""
    return (-1, 1) if casters.split else (0,)


def wheel_centre(casters: Casters, side: int) -> tuple[float, float, float]:
    """A wheel link's origin in the caster's frame."""
    return (casters.trail_m, side * (_WEB_M / 2 + _split_half(casters)), axle_height_m(casters))


def wheel_axis(casters: Casters, side: int) -> np.ndarray:
    """A wheel's axis in the caster's frame."""
    lean = side * CAMBER_RAD if casters.split else 0.0
    return np.array((0.0, math.cos(lean), math.sin(lean)))


def add_caster(parts: LinkParts, casters: Casters, place: CasterPlace, skins: Skins) -> None:
    """The swivelling part: stem, crown, and a hood, a cap or a fork."""
    top = wheel_top_m(casters) + CROWN_GAP_M
    height = top + CROWN_M + STEM_GAP_M
    radius = casters.diameter_m / 2
    draw = Pen(parts, place.point((0.0, 0.0, 0.0)), place.turn)
    draw.mesh(cylinder(0.0055, 0.005, 8).transformed((0, 0, height - 0.002)), skins.piston, "caster")
    foot = _BARREL_SHARE * radius
    barrel, half = (foot + height - STEM_GAP_M) / 2, (height - STEM_GAP_M - foot) / 2
    if casters.kind != "single":
        draw.mesh(cylinder(_BARREL_M, half, 10).transformed((0, 0, barrel)), skins.caster, "caster")
    if casters.kind == "single":
        _add_fork(draw, casters, top, skins)
        return
    draw.shape(_crown(casters, top))
    if casters.kind == "twin":
        _add_hood(draw, casters, skins)
    else:
        _add_cap(draw, casters, skins)


def _crown(casters: Casters, top: float) -> CollisionShape:
    """What is touched of barrel and hood: a plate over the wheel, narrow at the stem."""
    radius, trail = casters.diameter_m / 2, casters.trail_m
    wide = _CROWN_SHARE * casters.width_m * (1.0 if casters.kind == "twin" else _ROUND)
    outline = [(-_BARREL_M, _BARREL_M), (_BARREL_M, _BARREL_M), (trail - 0.4 * radius, wide), (trail, wide)]
    outline += [(trail + 0.5 * radius, 0.9 * wide)]
    corners = [(x, s * y, z) for x, y in outline for s in (-1, 1) for z in (top, top + CROWN_M)]
    return hull_shape(np.round(np.array(corners), 6), "caster")


def add_wheel(parts: LinkParts, casters: Casters, place: CasterPlace, side: int, skins: Skins) -> None:
    """A wheel link: one wheel, or both wheels of a twin caster that turn together."""
    radius, half = casters.diameter_m / 2, casters.width_m / 2
    draw = Pen(parts, place.point((0.0, 0.0, 0.0)), place.turn)
    centre = np.array(wheel_centre(casters, side))
    if casters.kind == "ball":
        draw.mesh(_turned(_ball(radius), centre, _TO_Y), skins.wheel, "wheel")
        # as good as a ball, but it stands on two points: it does not creep on the spot
        draw.shape(CollisionShape("capsule", (radius, 0.003), centre, _TO_Y, part="wheel"))
        return
    if casters.kind == "single":
        tread, hub = _tyre(radius, half)
        draw.mesh(_turned(tread, centre, _TO_Y), skins.wheel, "wheel")
        draw.mesh(_turned(hub, centre, _TO_Y), skins.caster, "wheel")
        draw.shape(CollisionShape("cylinder", (radius, half), centre, _TO_Y, part="wheel"))
        return
    if not side:
        draw.mesh(_turned(_pair(radius, half), centre, _TO_Y), skins.wheel, "wheel")
        reach = max(0.0015, half - radius + 0.0085)
        draw.shape(CollisionShape("capsule", (radius, reach), centre, _TO_Y, part="wheel"))
        return
    wide = _split_half(casters)
    wheel = _dome(radius, wide) if side > 0 else _dome(radius, wide).scaled((1, 1, -1))
    lean = quat_multiply(quat_from_axis_angle((1, 0, 0), side * CAMBER_RAD), _TO_Y)
    draw.mesh(_turned(wheel, centre, lean), skins.wheel, "wheel")
    draw.shape(CollisionShape("cylinder", (radius, wide), centre, lean, part="wheel"))


def _split_half(casters: Casters) -> float:
    return (casters.width_m - _WEB_M) / 4


def _add_hood(draw: Pen, casters: Casters, skins: Skins) -> None:
    """A band over the two wheels, from behind the stem to the front."""
    middle = wheel_top_m(casters) / 2
    reach = middle + CROWN_GAP_M + 0.0015
    angles = np.radians((-44, -23, -2, 18, 38))
    path = [(casters.trail_m + reach * math.sin(a), 0.0, middle + reach * math.cos(a)) for a in angles]
    draw.mesh(Beam(path, 2 * _CROWN_SHARE * casters.width_m, 0.003, _Y).mesh(8), skins.caster, "caster")


def _add_cap(draw: Pen, casters: Casters, skins: Skins) -> None:
    """A dome over a ball, and its rim."""
    radius = casters.diameter_m / 2
    inner, outer = radius + 0.001, radius + 0.0035
    angles = np.radians((90, 62, 38, 16))
    loop = [(inner * math.cos(a), inner * math.sin(a)) for a in angles]
    loop += [(outer * math.cos(a), outer * math.sin(a)) for a in angles[::-1]]
    loop[0], loop[-1] = (0.0, inner), (0.0, outer)
    cap = lathe(loop, _SEGMENTS)
    lean = quat_from_axis_angle((0, 1, 0), -0.35)  # lower towards the stem
    draw.mesh(_turned(cap, np.array((casters.trail_m, 0.0, radius)), lean), skins.caster, "caster")


def _add_fork(draw: Pen, casters: Casters, top: float, skins: Skins) -> None:
    """A crown plate and two cheeks."""
    radius, trail = casters.diameter_m / 2, casters.trail_m
    high = trail + 0.25 * radius
    across = casters.width_m / 2 + _CHEEK_GAP_M + _CHEEK_M
    plate = Beam([(-0.012, 0, top + CROWN_M / 2), (high, 0, top + CROWN_M / 2)], 2 * across, CROWN_M, _Y)
    draw.bar(plate, skins.caster, "caster")
    draw.mesh(cylinder(0.011, 0.004, 10).transformed((0, 0, top + 0.7 * CROWN_M)), skins.caster, "caster")
    for s in (-1, 1):
        y = s * (across - _CHEEK_M / 2)
        ends = [(0.45 * trail, y, top + CROWN_M), (trail, y, radius - 0.006)]
        cheek = Beam(ends, _CHEEK_M, 0.019, _Y)
        draw.bar(cheek, skins.caster, "caster")
    axle = cylinder(0.006, across + 0.002, 8)
    draw.mesh(_turned(axle, np.array((trail, 0.0, radius)), _TO_Y), skins.piston, "caster")


def _dome(radius: float, half: float) -> TriMesh:
    """A wheel along z: flat inside (-z), its outer face a shallow dome with a hollow rim."""
    return lathe([(0.0, -half), (radius, -half), *_outer_face(radius, -0.6 * half, half)], _SEGMENTS)


def _pair(radius: float, half: float) -> TriMesh:
    """Two wheels along z as one body, a groove between them."""
    web, floor = _WEB_M / 2, 0.78 * radius
    upper = [(floor, web), (radius, web), *_outer_face(radius, web, half)]
    return lathe([(r, -z) for r, z in reversed(upper)] + upper, _SEGMENTS)


def _outer_face(radius: float, inner: float, outer: float) -> list[tuple[float, float]]:
    """Profile from the tread over the rim to the axle."""
    wide = outer - inner
    return [(radius, inner + 0.45 * wide), (0.76 * radius, outer), (0.0, outer - 0.14 * wide)]


def _tyre(radius: float, half: float) -> tuple[TriMesh, TriMesh]:
    """A tread with rounded shoulders, and the hub within it, along z."""
    shoulder = min(0.35 * half, 0.004)
    profile = [(0.0, -0.85 * half), (0.72 * radius, -half), (radius - shoulder, -half), (radius, -half + shoulder)]
    profile += [(r, -z) for r, z in reversed(profile)]
    return lathe(profile, _SEGMENTS + 2), cylinder(0.55 * radius, 0.96 * half, 12)


def _ball(radius: float) -> TriMesh:
    """A sphere along z."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, 8)
    profile = [(radius * math.cos(a), radius * math.sin(a)) for a in angles]
    profile[0], profile[-1] = (0.0, -radius), (0.0, radius)
    return lathe(profile, _SEGMENTS)


def _turned(mesh: TriMesh, centre: np.ndarray, quaternion: np.ndarray) -> TriMesh:
    return mesh.transformed(centre, quaternion)

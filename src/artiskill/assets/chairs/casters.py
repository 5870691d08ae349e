"""Casters: a link that swivels about its stem and carries one wheel, or two.

Each is built in a frame of its own: its stem on the z axis above the ground, its wheel towards +x, and then turned
to where it stands at joint value 0.
"""

import math
from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import CollisionShape, ShapeKind
from artiskill.assets.chairs.link_builder import Beam, LinkBuilder
from artiskill.assets.chairs.pads import hull_shape
from artiskill.assets.chairs.spec import CAMBER_RAD, CROWN_GAP_M, CROWN_M, STEM_GAP_M, WEB_M, Casters, ChairSpec
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import cylinder, lathe
from artiskill.geometry.rotations import quat_from_axis_angle, quat_multiply, quat_rotate

_CHEEK_M, _CHEEK_GAP_M = 0.004, 0.0025  # a fork's sides, and their distance from the wheel
_BARREL_M = 0.0105  # its radius
_CROWN_SHARE = 0.40  # half width of a hood, relative to the width over the wheels
_ROUND = 0.75  # width of the same over a ball, whose cap is round
_BARREL_SHARE = 1.6  # height of the foot of a stem's barrel, relative to the wheel's radius
_SEGMENTS = 12
_Z_TO_Y = quat_from_axis_angle((1, 0, 0), -math.pi / 2)  # turns z onto y
_Y = np.array((0.0, 1.0, 0.0))


@dataclass(frozen=True)
class CasterPose:
    """Where one caster is: its stem's foot on the ground, and its yaw at joint value 0."""

    x_m: float
    y_m: float
    yaw_rad: float

    @property
    def rotation(self) -> np.ndarray:
        """(4,) from the caster's frame to the object's."""
        return quat_from_axis_angle((0, 0, 1), self.yaw_rad)

    def point(self, local: tuple[float, float, float]) -> np.ndarray:
        """Return a point of the caster's frame in the object frame."""
        return quat_rotate(self.rotation, np.array(local)) + np.array((self.x_m, self.y_m, 0.0))


def caster_poses(spec: ChairSpec) -> list[CasterPose]:
    """Return where the casters of a star base are."""
    if spec.casters is None:
        return []
    poses = []
    for k, yaw in enumerate(spec.casters.yaws_rad):
        angle = spec.base.turn_rad + 2 * math.pi * k / spec.base.legs
        poses.append(CasterPose(spec.base.radius_m * math.cos(angle), spec.base.radius_m * math.sin(angle), yaw))
    return poses


def wheel_centre(casters: Casters, side: int) -> tuple[float, float, float]:
    """Return a wheel link's origin in the caster's frame."""
    return (casters.trail_m, side * (WEB_M / 2 + casters.split_half_m), casters.axle_height_m)


def wheel_axis(casters: Casters, side: int) -> np.ndarray:
    """Return a wheel's axis in the caster's frame."""
    lean = side * CAMBER_RAD if casters.split else 0.0
    return np.array((0.0, math.cos(lean), math.sin(lean)))


def add_caster(link: LinkBuilder, casters: Casters) -> None:
    """Add the swivelling part in the caster's frame: stem, crown, and a hood, a cap or a fork."""
    top = casters.wheel_top_m + CROWN_GAP_M
    height = top + CROWN_M + STEM_GAP_M
    link.add_visual(cylinder(0.0055, 0.005, 8).transformed((0, 0, height - 0.002)), "piston", "caster")
    if casters.kind == "single":
        _add_fork(link, casters, top)
        return
    foot = _BARREL_SHARE * casters.diameter_m / 2
    barrel, half = (foot + height - STEM_GAP_M) / 2, (height - STEM_GAP_M - foot) / 2
    link.add_visual(cylinder(_BARREL_M, half, 10).transformed((0, 0, barrel)), "caster", "caster")
    link.add_collision(_crown(casters, top))
    if casters.kind == "twin":
        _add_hood(link, casters)
    else:
        _add_cap(link, casters)


def add_wheel(link: LinkBuilder, casters: Casters, side: int) -> None:
    """Add a wheel link in the caster's frame: one wheel, or both wheels of a twin caster that turn together."""
    radius, half = casters.diameter_m / 2, casters.width_m / 2
    centre, rotation = np.array(wheel_centre(casters, side)), _Z_TO_Y
    kind: ShapeKind = "capsule"
    if casters.kind == "ball":
        meshes = {"wheel": _ball(radius)}
        size = (radius, 0.003)  # as good as a ball, but it stands on two points: it does not creep on the spot
    elif casters.kind == "single":
        tread, hub = _tyre(radius, half)
        meshes = {"wheel": tread, "caster": hub}
        kind, size = "cylinder", (radius, half)
    elif not side:
        meshes = {"wheel": _pair(radius, half)}
        size = (radius, max(0.0015, half - radius + 0.0085))
    else:
        wide = casters.split_half_m
        meshes = {"wheel": _dome(radius, wide) if side > 0 else _dome(radius, wide).scaled((1, 1, -1))}
        rotation = quat_multiply(quat_from_axis_angle((1, 0, 0), side * CAMBER_RAD), _Z_TO_Y)
        kind, size = "cylinder", (radius, wide)
    for surface, mesh in meshes.items():
        link.add_visual(mesh.transformed(centre, rotation), surface, "wheel")
    link.add_collision(CollisionShape(kind, size, centre, rotation, part="wheel"))


def _crown(casters: Casters, top: float) -> CollisionShape:
    """Return the collision shape of barrel and hood: a plate over the wheel, narrow at the stem."""
    radius, trail = casters.diameter_m / 2, casters.trail_m
    wide = _CROWN_SHARE * casters.width_m * (1.0 if casters.kind == "twin" else _ROUND)
    outline = [(-_BARREL_M, _BARREL_M), (_BARREL_M, _BARREL_M), (trail - 0.4 * radius, wide), (trail, wide)]
    outline += [(trail + 0.5 * radius, 0.9 * wide)]
    corners = [(x, s * y, z) for x, y in outline for s in (-1, 1) for z in (top, top + CROWN_M)]
    return hull_shape(np.round(np.array(corners), 6), "caster")


def _add_hood(link: LinkBuilder, casters: Casters) -> None:
    """Add a band over the two wheels, from behind the stem to the front."""
    middle = casters.wheel_top_m / 2
    reach = middle + CROWN_GAP_M + 0.0015
    angles = np.radians((-44, -23, -2, 18, 38))
    path = [(casters.trail_m + reach * math.sin(a), 0.0, middle + reach * math.cos(a)) for a in angles]
    link.add_visual(Beam(path, 2 * _CROWN_SHARE * casters.width_m, 0.003, _Y).mesh(8), "caster", "caster")


def _add_cap(link: LinkBuilder, casters: Casters) -> None:
    """Add a dome over a ball, and its rim."""
    radius = casters.diameter_m / 2
    inner, outer = radius + 0.001, radius + 0.0035
    angles = np.radians((90, 62, 38, 16))
    loop = [(inner * math.cos(a), inner * math.sin(a)) for a in angles]
    loop += [(outer * math.cos(a), outer * math.sin(a)) for a in angles[::-1]]
    loop[0], loop[-1] = (0.0, inner), (0.0, outer)
    cap = lathe(loop, _SEGMENTS)
    lean = quat_from_axis_angle((0, 1, 0), -0.35)  # lower towards the stem
    link.add_visual(cap.transformed((casters.trail_m, 0.0, radius), lean), "caster", "caster")


def _add_fork(link: LinkBuilder, casters: Casters, top: float) -> None:
    """Add a crown plate and two cheeks."""
    radius, trail = casters.diameter_m / 2, casters.trail_m
    high = trail + 0.25 * radius
    across = casters.width_m / 2 + _CHEEK_GAP_M + _CHEEK_M
    plate = Beam([(-0.012, 0, top + CROWN_M / 2), (high, 0, top + CROWN_M / 2)], 2 * across, CROWN_M, _Y)
    link.add_bar(plate, "caster", "caster")
    link.add_visual(cylinder(0.011, 0.004, 10).transformed((0, 0, top + 0.7 * CROWN_M)), "caster", "caster")
    for s in (-1, 1):
        y = s * (across - _CHEEK_M / 2)
        ends = [(0.45 * trail, y, top + CROWN_M), (trail, y, radius - 0.006)]
        link.add_bar(Beam(ends, _CHEEK_M, 0.019, _Y), "caster", "caster")
    axle = cylinder(0.006, across + 0.002, 8)
    link.add_visual(axle.transformed((trail, 0.0, radius), _Z_TO_Y), "piston", "caster")


def _dome(radius: float, half: float) -> TriMesh:
    """Return a wheel along z: flat inside (-z), its outer face a shallow dome with a hollow rim."""
    return lathe([(0.0, -half), (radius, -half), *_outer_face(radius, -0.6 * half, half)], _SEGMENTS)


def _pair(radius: float, half: float) -> TriMesh:
    """Return two wheels along z as one body, a groove between them."""
    web, floor = WEB_M / 2, 0.78 * radius
    upper = [(floor, web), (radius, web), *_outer_face(radius, web, half)]
    return lathe([(r, -z) for r, z in reversed(upper)] + upper, _SEGMENTS)


def _outer_face(radius: float, inner: float, outer: float) -> list[tuple[float, float]]:
    """Return the profile from the tread over the rim to the axle."""
    wide = outer - inner
    return [(radius, inner + 0.45 * wide), (0.76 * radius, outer), (0.0, outer - 0.14 * wide)]


def _tyre(radius: float, half: float) -> tuple[TriMesh, TriMesh]:
    """Return a tread with rounded shoulders, and the hub within it, along z."""
    shoulder = min(0.35 * half, 0.004)
    profile = [(0.0, -0.85 * half), (0.72 * radius, -half), (radius - shoulder, -half), (radius, -half + shoulder)]
    profile += [(r, -z) for r, z in reversed(profile)]
    return lathe(profile, _SEGMENTS + 2), cylinder(0.55 * radius, 0.96 * half, 12)


def _ball(radius: float) -> TriMesh:
    """Return a sphere along z."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, 8)
    profile = [(radius * math.cos(a), radius * math.sin(a)) for a in angles]
    profile[0], profile[-1] = (0.0, -radius), (0.0, radius)
    return lathe(profile, _SEGMENTS)

"""The bail: drawing one that fits, and building its wire, bow or strap, its grip and its handle."""

import math
from itertools import pairwise
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import CollisionShape, Handle, Material
from artiskill.assets.buckets.config import BailConfig
from artiskill.assets.buckets.shape import Rim, clearance_m
from artiskill.assets.buckets.spec import Bail, BailGrip, Ear
from artiskill.assets.generators import within
from artiskill.assets.handles import handle_from_mesh
from artiskill.assets.parts import LinkParts
from artiskill.geometry.arrays import norm
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import cylinder, lathe, path_sweep, superellipse, tube
from artiskill.geometry.rotations import quat_from_axis_angle, quat_from_matrix

TO_Y = quat_from_axis_angle((1, 0, 0), -np.pi / 2)  # turns z onto y
_X, _UP = np.array((1.0, 0.0, 0.0)), np.array((0.0, 0.0, 1.0))
_LONGER_M = 0.005
_MAX_LONGER = 12
_ANGLE_STEP_RAD = math.radians(2.0)
_PATH_POINTS = 48
_LEAST_HEIGHT_M = 0.025  # of a hanging grip above the ground
_BEND_CHORDS = 8  # as drawn
_COLLISION_CHORDS = 3
_WIRE_SIDES = 8
_PIN_M = 0.009  # how far a wire's bent end reaches into its ear
_IN_GRIP_M = 0.004  # how far a wire is seen to reach into the grip
_HOOK_M = 0.004  # radius of that bend


def draw_bail(
    rng: np.random.Generator, config: BailConfig, kind: Any, grip_kind: Any, rim: Rim, ear: Ear
) -> Bail | None:
    """Draw a bail, long enough to swing over the rim and hang down beside the wall; None where no length is.

    Args:
        rng: random generator.
        config: ranges.
        kind: as in `Bail`.
        grip_kind: as in `BailGrip`.
        rim: what it must clear.
        ear: where its pivots lie.
    """
    section, profile, lip, spout = rim
    width, thickness = _draw_halves(rng, config, kind)
    wanted = math.radians(rng.uniform(*config.limit_deg))
    radius = within(rng, config.grip_radius_m)
    grip = BailGrip(grip_kind, within(rng, config.grip_length_m), radius)
    outside = profile.knots[-1][1] + lip.overhang_m + config.gap_m + thickness + 0.001
    span = round(outside + (2 * ear.radius_m if ear.kind == "tab" else 0.0), 4)
    roundness = rng.uniform(0.55, 0.75) * section.corner if section.kind == "square" else 1.0
    least_corner = min(0.03, span / 4)
    corner = round(min(max(roundness * span, least_corner), span - grip.length_m / 2 - 0.004), 4)
    depth = span * section.aspect + spout
    reach = max(depth + within(rng, (0.004, 0.02)), corner + 0.01)
    for _ in range(_MAX_LONGER):
        bail = Bail(kind, ear.z, span, round(reach, 4), corner, width, thickness, wanted, grip)
        limit = min(wanted, _swing_rad(bail, rim, config.gap_m))
        if limit <= 0:  # upright already too near: a longer one is, too
            return None
        lowest = ear.z + bail.reach_m * math.cos(limit) - grip.radius_m
        if limit >= math.radians(config.least_limit_deg) and lowest > _LEAST_HEIGHT_M:
            return Bail(kind, ear.z, span, round(reach, 4), corner, width, thickness, round(limit, 4), grip)
        reach += _LONGER_M
    return None


def _swing_rad(bail: Bail, rim: Rim, gap_m: float) -> float:
    """Return how far the bail turns from upright before it comes nearer than a gap to wall or lip."""
    middle = _dense(_bail_path(bail, 10))[:, 1:]  # (P, 2): y, height above the pivot
    angles = np.arange(0.0, math.pi, _ANGLE_STEP_RAD)
    held = (np.abs(middle[:, 0]) <= bail.grip.length_m / 2) & (bail.grip.kind != "bare")
    margin = np.where(held, bail.grip.radius_m, bail.half_thickness_m) + gap_m
    sine, cosine = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    edges = np.array((-1.0, 0.0, 1.0)) * bail.half_width_m  # across the bail's plane
    height = middle[None, :, None, 1]
    x = -sine * height + cosine * edges
    z = bail.pivot_z + cosine * height + sine * edges
    y = np.broadcast_to(middle[None, :, None, 0], x.shape)
    away = clearance_m(rim, np.stack((x, y, z), axis=-1), float(np.max(margin)))
    free = (away >= np.reshape(margin, (1, -1, 1))).all(axis=(1, 2))
    return float(angles[int(np.argmin(free))] - 2 * _ANGLE_STEP_RAD) if not free.all() else math.pi


def _dense(path: np.ndarray) -> np.ndarray:
    """Return points at equal distances along a path."""
    at = np.concatenate(([0.0], np.cumsum(norm(np.diff(path, axis=0)))))
    places = np.linspace(0.0, at[-1], _PATH_POINTS)
    return np.stack([np.interp(places, at, path[:, k]) for k in range(3)], axis=-1)


def _draw_halves(rng: np.random.Generator, config: BailConfig, kind: str) -> tuple[float, float]:
    """Draw half width along x and half thickness."""
    if kind == "wire":
        radius = within(rng, config.wire_radius_m)
        return radius, radius
    width, thickness = config.moulded_half_m if kind == "moulded" else config.strap_half_m
    return within(rng, width), within(rng, thickness)


def _bail_path(bail: Bail, arc: int) -> np.ndarray:
    """Return the middle line from the pivot at +y to that at -y, relative to the pivots' middle, upright.

    (P, 3) metres in the plane x = 0, with P even: the middle chord carries the grip. `arc` is the number of chords
    of each bend.
    """
    c = bail.corner_m
    angles = np.linspace(0.0, np.pi / 2, arc + 1)
    y = bail.half_span_m - c + c * np.cos(angles)
    z = bail.reach_m - c + c * np.sin(angles)
    points = np.stack((np.zeros_like(y), y, z), axis=-1)
    if z[0] > 1e-3:
        points = np.concatenate(([(0.0, bail.half_span_m, 0.0)], points))
    return np.concatenate((points, points[::-1] * (1.0, -1.0, 1.0)))


def add_bail(
    parts: LinkParts, bail: Bail, materials: dict[str, Material], name: str, rng: np.random.Generator
) -> Handle:
    """Add the bail to its link, upright about the pivots, and return the handle of that name."""
    path = _bail_path(bail, _BEND_CHORDS)
    if bail.kind == "wire":
        for wire in _wires(bail, path):
            parts.add_visual(tube(wire, bail.half_width_m, _WIRE_SIDES), materials["bail"], "handle")
    else:
        _add_band(parts, bail, path, materials)
    for start, end in pairwise(_bail_path(bail, _COLLISION_CHORDS)):
        if bail.kind == "wire":
            parts.add_collision(rod(start, end, bail.half_width_m, "handle"))
        else:
            parts.add_collision(_slab(start, end, bail.half_width_m, bail.half_thickness_m, "handle"))
    grip = _grip_mesh(bail)
    if bail.grip.kind != "bare":
        parts.add_visual(grip, materials["grip"], "handle")
        half = np.array((0.0, bail.grip.length_m / 2 - bail.grip.radius_m, 0.0))
        top = np.array((0.0, 0.0, bail.reach_m))
        parts.add_collision(rod(top - half, top + half, bail.grip.radius_m, "handle"))
    return handle_from_mesh(name, "bail", grip, _UP, rng, hookable=True)


def _wires(bail: Bail, path: np.ndarray) -> list[np.ndarray]:
    """Return the wire as seen: in one piece, or in two that end in the grip."""
    hooked = _hooked(path)
    if bail.grip.kind == "bare":
        return [hooked]
    end = np.array((0.0, bail.grip.length_m / 2 - _IN_GRIP_M, bail.reach_m))
    one = np.concatenate((hooked[: len(hooked) // 2], end[None]))
    return [one, one * (1.0, -1.0, 1.0)]


def _hooked(path: np.ndarray) -> np.ndarray:
    """Return the wire's path with its ends bent inwards, through the ears."""
    span = path[0, 1]
    start = [(0.0, span - _PIN_M, 0.0), (0.0, span - _HOOK_M, 0.0), (0.0, span - 0.3 * _HOOK_M, 0.3 * _HOOK_M)]
    first = np.array([*start, (0.0, span, _HOOK_M)])
    return np.concatenate((first, path[1:-1], first[::-1] * (1.0, -1.0, 1.0)))


def _add_band(parts: LinkParts, bail: Bail, path: np.ndarray, materials: dict[str, Material]) -> None:
    """Add a flat bow with round ends, each on a pin."""
    section = superellipse(bail.half_width_m, bail.half_thickness_m, 5.0, 12)
    parts.add_visual(path_sweep(path, section, (1.0, 0.0, 0.0)), materials["bail"], "handle")
    for side in (-1.0, 1.0):
        eye = cylinder(1.1 * bail.half_width_m, bail.half_thickness_m, 16, 0.0008)
        parts.add_visual(eye.transformed((0.0, side * bail.half_span_m, 0.0), TO_Y), materials["bail"], "handle")
        pin = cylinder(0.5 * bail.half_width_m, bail.half_thickness_m + 0.004, 10, 0.0005)
        parts.add_visual(pin.transformed((0.0, side * bail.half_span_m, 0.0), TO_Y), materials["bail"], "handle")


def _grip_mesh(bail: Bail) -> TriMesh:
    """Return what the hand closes on, at the top of the upright bail."""
    half, radius = bail.grip.length_m / 2, bail.grip.radius_m
    if bail.grip.kind == "barrel":  # turned wood, thickest in the middle
        shares = (1.0, 0.94, 0.6, 0.0)
        swell = [(radius * (1 - 0.3 * s**2), half * s) for s in shares]
        profile = [(0.0, -half), *((r, -z) for r, z in swell), *reversed(swell[:-1]), (0.0, half)]
        mesh = lathe(profile, 14)
    elif bail.grip.kind == "sleeve":  # a tube with a collar at either end
        waist, collar = 0.86 * radius, 0.004
        side = [(waist, half - collar - 0.002), (radius, half - collar), (radius, half)]
        profile = [(0.0, -half), *((r, -z) for r, z in reversed(side)), *side, (0.0, half)]
        mesh = lathe(profile, 14)
    elif bail.kind == "wire":
        mesh = cylinder(bail.half_width_m, half, _WIRE_SIDES)
    else:
        line = np.array([(0.0, half, 0.0), (0.0, -half, 0.0)])
        band = superellipse(bail.half_width_m, bail.half_thickness_m, 5.0, 12)
        return path_sweep(line, band, (1.0, 0.0, 0.0)).transformed((0.0, 0.0, bail.reach_m))
    return mesh.transformed((0.0, 0.0, bail.reach_m), TO_Y)


def rod(start: np.ndarray, end: np.ndarray, radius_m: float, part: str) -> CollisionShape:
    """Return a capsule whose ends' centres are two points."""
    along = end - start
    length = float(norm(along))
    return CollisionShape("capsule", (radius_m, length / 2), (start + end) / 2, _turn(along), part=part)


def _slab(start: np.ndarray, end: np.ndarray, half_x_m: float, half_m: float, part: str) -> CollisionShape:
    """Return a flat bar between two points of the plane x = 0, so wide along x and so thick across it."""
    along = end - start
    size = (half_x_m, half_m, float(norm(along)) / 2)
    return CollisionShape("box", size, (start + end) / 2, _turn(along), part=part)


def _turn(along: np.ndarray) -> np.ndarray:
    """Return a rotation that brings z onto a direction, and keeps x where it can."""
    z = along / norm(along)
    helper = _X if abs(z[0]) < 0.9 else np.array((0.0, 1.0, 0.0))
    y = np.cross(z, helper)
    y /= norm(y)
    return quat_from_matrix(np.stack((np.cross(y, z), y, z), axis=1))

"""Drawing a bail that fits: long enough to swing over the rim and hang down beside the wall."""

import math
from typing import Any

import numpy as np

from artiskill.assets.buckets.bail_path import bail_path
from artiskill.assets.buckets.config import BailConfig
from artiskill.assets.buckets.spec import Bail, BailGrip, Ear, Lip, Profile, Section
from artiskill.assets.buckets.surface import clearance_m
from artiskill.assets.generators import Range
from artiskill.geometry.arrays import norm

Rim = tuple[Section, Profile, Lip, float]  # what a bail must clear; the last is the spout

_LONGER_M = 0.005
_MAX_LONGER = 12
_ANGLE_STEP_RAD = math.radians(2.0)
_PATH_POINTS = 48
_LEAST_HEIGHT_M = 0.025  # of a hanging grip above the ground


def draw_bail(
    rng: np.random.Generator, config: BailConfig, kind: Any, grip_kind: Any, rim: Rim, ear: Ear
) -> Bail | None:
    """Draw a bail and lengthen it until it turns as far as it should; None where no length does.

    Args:
        rng: random generator.
        config: ranges.
        kind: as in `Bail`.
        grip_kind: as in `BailGrip`.
        rim: section, profile, lip and spout.
        ear: where its pivots lie.
    """
    section, profile, lip, spout = rim
    width, thickness = _draw_halves(rng, config, kind)
    wanted = math.radians(rng.uniform(*config.limit_deg))
    radius = float(rng.uniform(*config.grip_radius_m))
    grip = BailGrip(grip_kind, _round(rng.uniform(*config.grip_length_m)), _round(radius))
    outside = profile.knots[-1][1] + lip.overhang_m + config.gap_m + thickness + 0.001
    span = _round(outside + (2 * ear.radius_m if ear.kind == "tab" else 0.0))
    roundness = rng.uniform(0.55, 0.75) * section.corner if section.kind == "square" else 1.0
    least_corner = min(0.03, span / 4)
    corner = _round(min(max(roundness * span, least_corner), span - grip.length_m / 2 - 0.004))
    depth = span * section.aspect + spout
    reach = max(depth + _within(rng, (0.004, 0.02)), corner + 0.01)
    for _ in range(_MAX_LONGER):
        bail = Bail(kind, ear.z, span, _round(reach), corner, width, thickness, wanted, grip)
        limit = min(wanted, swing_rad(bail, rim, config.gap_m))
        if limit <= 0:  # upright already too near: a longer one is, too
            return None
        lowest = ear.z + bail.reach_m * math.cos(limit) - grip.radius_m
        if limit >= math.radians(config.least_limit_deg) and lowest > _LEAST_HEIGHT_M:
            return Bail(kind, ear.z, span, _round(reach), corner, width, thickness, round(limit, 4), grip)
        reach += _LONGER_M
    return None


def swing_rad(bail: Bail, rim: Rim, gap_m: float) -> float:
    """How far the bail turns from upright before it comes nearer than a gap to wall or lip."""
    section, profile, lip, spout = rim
    middle = _dense(bail_path(bail, 10))[:, 1:]  # (P, 2): y, height above the pivot
    angles = np.arange(0.0, math.pi, _ANGLE_STEP_RAD)
    held = (np.abs(middle[:, 0]) <= bail.grip.length_m / 2) & (bail.grip.kind != "bare")
    margin = np.where(held, bail.grip.radius_m, bail.half_thickness_m) + gap_m
    sine, cosine = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    edges = np.array((-1.0, 0.0, 1.0)) * bail.half_width_m  # across the bail's plane
    height = middle[None, :, None, 1]
    x = -sine * height + cosine * edges
    z = bail.pivot_z + cosine * height + sine * edges
    y = np.broadcast_to(middle[None, :, None, 0], x.shape)
    away = clearance_m(section, profile, lip, spout, np.stack((x, y, z), axis=-1), float(np.max(margin)))
    free = (away >= np.reshape(margin, (1, -1, 1))).all(axis=(1, 2))
    return float(angles[int(np.argmin(free))] - 2 * _ANGLE_STEP_RAD) if not free.all() else math.pi


def _dense(path: np.ndarray) -> np.ndarray:
    """Points at equal distances along a path."""
    at = np.concatenate(([0.0], np.cumsum(norm(np.diff(path, axis=0)))))
    places = np.linspace(0.0, at[-1], _PATH_POINTS)
    return np.stack([np.interp(places, at, path[:, k]) for k in range(3)], axis=-1)


def _draw_halves(rng: np.random.Generator, config: BailConfig, kind: str) -> tuple[float, float]:
    """Half width along x and half thickness."""
    if kind == "wire":
        radius = _within(rng, config.wire_radius_m)
        return radius, radius
    width, thickness = config.moulded_half_m if kind == "moulded" else config.strap_half_m
    return _within(rng, width), _within(rng, thickness)


def _round(value: float) -> float:
    return round(float(value), 4)


def _within(rng: np.random.Generator, limits: Range) -> float:
    """Uniform, to a tenth of a millimetre."""
    return _round(rng.uniform(*limits))

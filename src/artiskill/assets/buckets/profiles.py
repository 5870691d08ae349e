"""Profiles of buckets: the outer face of the wall as heights and half widths."""

from typing import Any

import numpy as np

from artiskill.assets.buckets.spec import Profile
from artiskill.geometry.arrays import power

_CURVE_KNOTS = 9
_EDGE_M = 0.004  # the rounding between wall and floor
_Span = tuple[float, float]
_Knots = list[tuple[float, float]]


def draw_profile(rng: np.random.Generator, kind: Any, z: _Span, half: _Span, lip_m: float) -> Profile:
    """Draw the numbers of a profile.

    Args:
        rng: random generator.
        kind: as in `Profile`.
        z: heights of the lower edge and the rim.
        half: half widths there.
        lip_m: height of the lip; steps and ribs keep below it.
    """
    if kind in ("bellied", "flared"):
        knots, levels = _curve(rng, kind, z, half)
    elif kind == "stepped":
        knots, levels = _steps(rng, z, half, lip_m)
    elif kind == "ribbed":
        knots, levels = _ribs(rng, z, half, lip_m)
    else:
        knots, levels = [(z[0], half[0]), (z[1], half[1])], [z[0], z[1]]
    if kind != "ribbed":
        low, width = knots[0]
        first = float(np.interp(low + _EDGE_M, *np.array(knots).T))
        knots = [(low, width - 0.6 * _EDGE_M), (low + _EDGE_M, first), *knots[1:]]
    rounded = tuple((round(float(h), 5), round(float(w), 5)) for h, w in knots)
    return Profile(kind, rounded, tuple(round(float(level), 5) for level in levels))


def _curve(rng: np.random.Generator, kind: str, z: _Span, half: _Span) -> tuple[_Knots, list[float]]:
    """A belly below the middle, or a rim that curves outwards."""
    share = np.linspace(0.0, 1.0, _CURVE_KNOTS)
    straight = half[0] + share * (half[1] - half[0])
    if kind == "bellied":
        bulge = rng.uniform(0.05, 0.10) * half[1]
        widths, breaks = straight + bulge * np.sin(np.pi * power(share, 0.9)), (0.45,)
    else:
        flare, bend = rng.uniform(0.3, 0.7) * (half[1] - half[0]), rng.uniform(3.0, 5.0)
        widths, breaks = straight - flare * (share - power(share, bend)), (0.6,)
    heights = z[0] + share * (z[1] - z[0])
    return list(zip(heights, widths, strict=True)), [z[0], *(z[0] + b * (z[1] - z[0]) for b in breaks), z[1]]


def _steps(rng: np.random.Generator, z: _Span, half: _Span, lip_m: float) -> tuple[_Knots, list[float]]:
    """One or two ledges, on which nested buckets rest; the wall between them leans less."""
    count = int(rng.integers(1, 3))
    lean = half[1] - half[0]
    step = min(float(rng.uniform(0.003, 0.006)), 0.8 * lean / count)
    last = float(rng.uniform(0.66, 0.86))
    shares = [last] if count == 1 else [float(rng.uniform(0.25, 0.45)), last]
    slope = (lean - count * step) / (z[1] - z[0])
    top = z[1] - lip_m - 0.015
    knots, risen = [(z[0], half[0])], 0.0
    for share in shares:
        at = min(z[0] + share * (z[1] - z[0]), top)
        width = half[0] + slope * (at - z[0]) + risen
        knots += [(at - 0.0015, width), (at + 0.0015, width + step)]
        risen += step
    return [*knots, (z[1], half[1])], [z[0], z[1]]


def _ribs(rng: np.random.Generator, z: _Span, half: _Span, lip_m: float) -> tuple[_Knots, list[float]]:
    """Beads rolled into sheet metal: rings that stand out by two millimetres."""
    height = float(rng.uniform(0.0015, 0.0025))
    groups = ((0.3,), (0.72,), (0.28, 0.74), (0.3, 0.36), (0.68, 0.75))
    chosen = groups[int(rng.integers(len(groups)))]

    def on_line(at: float) -> float:
        return half[0] + (half[1] - half[0]) * (at - z[0]) / (z[1] - z[0])

    knots: _Knots = [(z[0], half[0])]
    for share in chosen:
        at = min(z[0] + share * (z[1] - z[0]), z[1] - lip_m - 0.02)
        knots += [
            (at + offset, on_line(at + offset) + rise * height)
            for offset, rise in ((-0.005, 0.0), (-0.0017, 1.0), (0.0017, 1.0), (0.005, 0.0))
        ]
    return [*knots, (z[1], half[1])], [z[0], z[1]]

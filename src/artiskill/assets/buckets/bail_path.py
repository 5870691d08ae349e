"""The middle line of a bail: up from one pivot, round a bend, along the grip, and down to the other pivot."""

import numpy as np

from artiskill.assets.buckets.spec import Bail


def bail_path(bail: Bail, arc: int) -> np.ndarray:
    """The middle line from the pivot at +y to that at -y, relative to the pivots' middle, upright.

    Args:
        bail: the bail.
        arc: number of chords of each bend.

    Returns:
        (P, 3) metres in the plane x = 0, with P even: the middle chord carries the grip.
    """
    c = bail.corner_m
    angles = np.linspace(0.0, np.pi / 2, arc + 1)
    y = bail.half_span_m - c + c * np.cos(angles)
    z = bail.reach_m - c + c * np.sin(angles)
    points = np.stack((np.zeros_like(y), y, z), axis=-1)
    if z[0] > 1e-3:
        points = np.concatenate(([(0.0, bail.half_span_m, 0.0)], points))
    return np.concatenate((points, points[::-1] * (1.0, -1.0, 1.0)))

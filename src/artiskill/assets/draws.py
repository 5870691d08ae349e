"""Small draws that all generators use."""

from collections.abc import Mapping

import numpy as np

from artiskill.assets.ranges import Range


def pick(rng: np.random.Generator, weights: Mapping[str, float]) -> str:
    """One key, by its weight."""
    names = list(weights)
    p = np.array([weights[n] for n in names], dtype=float)
    return names[int(rng.choice(len(names), p=p / p.sum()))]


def within(rng: np.random.Generator, limits: Range, digits: int = 4) -> float:
    """Uniform, rounded: by default to a tenth of a millimetre."""
    return round(float(rng.uniform(*limits)), digits)


def chance(rng: np.random.Generator, probability: float) -> bool:
    """Whether something happens."""
    return bool(rng.random() < probability)

"""The streams of random numbers behind a seed, and small draws that all generators use."""

from collections.abc import Mapping

import numpy as np

from artiskill.assets.ranges import Range

# `SeedSequence.spawn` extends this key: of the catalogue's streams, whose key is empty, it can give none
_FRESH_KEY = (2,)


def form_and_detail(seed: int, fresh: bool = False) -> tuple[np.random.Generator, np.random.Generator]:
    """The two streams from which an object is made: one for its form, one for details such as surface samples.

    Args:
        seed: at least 0.
        fresh: whether these are the streams of `generated:` objects; else those of the catalogue. Equal seeds of
            the two have nothing in common.
    """
    sequence = np.random.SeedSequence(seed, spawn_key=_FRESH_KEY if fresh else ())
    form, detail = (np.random.default_rng(child) for child in sequence.spawn(2))
    return form, detail


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

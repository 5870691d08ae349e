"""From a category and a seed to an object, and what all generators share: random streams, draws, ranges, families.

Each category has a package (`cabinets`, `chairs`, `buckets`) that exports a `Generator`. Its families stand in
`configs/catalog/<category>_generator.yaml`, one entry each; the entry's keys are the fields of the package's
`<Category>FamilyConfig`.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import lru_cache
from importlib import import_module
from typing import Any, Protocol, TypeVar

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Category
from artiskill.config import check, check_inside
from artiskill.errors import shown

_CACHED_OBJECTS = 256
# `SeedSequence.spawn` extends this key. The catalogue's streams have an empty key, so none of them is a fresh one.
_FRESH_KEY = (2,)

Range = tuple[float, float]  # smallest and largest value, both included


@dataclass(frozen=True)
class Generator:
    """How the objects of a category are made.

    Attributes:
        default_config: reads the config from which the catalogue is made.
        sample: draws a complete specification; takes a random generator, a config, and whether to draw from the
            held-out families.
        build: makes the object; takes the specification, an id, and a random generator for details such as
            surface samples.
    """

    default_config: Callable[[], Any]
    sample: Callable[[np.random.Generator, Any, bool], Any]
    build: Callable[[Any, str, np.random.Generator], ArticulatedObject]

    def make(
        self, seed: int, object_id: str, held_out: bool = False, fresh: bool = False, config: Any = None
    ) -> ArticulatedObject:
        """Make the object of a seed, as `generate` does, from the default config or one of your own."""
        form, detail = form_and_detail(seed, fresh)
        spec = self.sample(form, self.default_config() if config is None else config, held_out)
        return self.build(spec, object_id, detail)


# Packages that export `GENERATOR`. They are imported when first needed: listing the catalogue needs none of them.
GENERATORS: dict[Category, str] = {
    "cabinet": "artiskill.assets.cabinets",
    "chair": "artiskill.assets.chairs",
    "bucket": "artiskill.assets.buckets",
}


@lru_cache(maxsize=_CACHED_OBJECTS)
def generate(
    category: Category, seed: int, object_id: str, held_out: bool = False, fresh: bool = False
) -> ArticulatedObject:
    """Return the object of a seed, with the category's default config.

    It is kept in a bounded cache of the process, as objects are read-only.

    Args:
        category: which generator.
        seed: at least 0; the same seed gives the same object, bit for bit.
        object_id: its name.
        held_out: whether to draw from the held-out families, which training and test objects never are of.
        fresh: whether to use random streams that the catalogue never uses, as `generated:` objects do.
    """
    generator: Generator = import_module(GENERATORS[category]).GENERATOR
    return generator.make(seed, object_id, held_out, fresh)


def form_and_detail(seed: int, fresh: bool = False) -> tuple[np.random.Generator, np.random.Generator]:
    """Return the two random streams of an object: one for its form, one for details such as surface samples.

    Args:
        seed: at least 0.
        fresh: whether these are the streams of `generated:` objects or those of the catalogue; equal seeds of
            the two are independent.
    """
    sequence = np.random.SeedSequence(seed, spawn_key=_FRESH_KEY if fresh else ())
    form, detail = (np.random.default_rng(child) for child in sequence.spawn(2))
    return form, detail


def pick(rng: np.random.Generator, weights: Mapping[str, float]) -> str:
    """Draw a key by its weight."""
    names = list(weights)
    p = np.array([weights[n] for n in names], dtype=float)
    return names[int(rng.choice(len(names), p=p / p.sum()))]


def within(rng: np.random.Generator, limits: Range, digits: int = 4) -> float:
    """Draw uniformly from a range, rounded: by default to a tenth of a millimetre."""
    return round(float(rng.uniform(*limits)), digits)


def chance(rng: np.random.Generator, probability: float) -> bool:
    """Draw whether something with this probability happens."""
    return bool(rng.random() < probability)


class FamilyConfig(Protocol):
    """What the families of all categories have in common."""

    @property
    def name(self) -> str:
        """The object's `metadata["family"]`."""

    @property
    def weight(self) -> float:
        """How often the family is drawn, relative to the others with the same `held_out`."""

    @property
    def held_out(self) -> bool:
        """Whether training and test objects are never of it."""


_Family = TypeVar("_Family", bound=FamilyConfig)


def pick_family(rng: np.random.Generator, families: Iterable[_Family], held_out: bool) -> _Family:
    """Draw one of the held-out families, or one of the others, by its weight.

    Raises:
        ConfigError: there is none with a weight above 0.
    """
    legal = {family.name: family for family in families if family.held_out == held_out}
    weights = {name: family.weight for name, family in legal.items()}
    check(any(weights.values()), f"families: none with a weight above 0 has held_out {held_out}")
    return legal[pick(rng, weights)]


def check_families(families: Sequence[FamilyConfig]) -> None:
    """Refuse negative weights, two families of one name, and weights of which none is above 0.

    Raises:
        ConfigError: naming the family.
    """
    names = [family.name for family in families]
    for family in families:
        where = f"family {family.name!r}"
        legal = 0 <= family.weight < math.inf
        check(legal, f"{where}: weight must be at least 0, and finite, not {shown(family.weight)}")
        check(names.count(family.name) == 1, f"{where}: two families have this name")
    check(any(family.weight for family in families), "families: at least one weight must be above 0")


def check_fields(config: Any, where: str, zero: bool = False) -> None:
    """Refuse a dataclass with a Range that is not ordered and positive, or a probability not in [0, 1].

    Args:
        config: the dataclass; a field that is None is left out.
        where: begins the message.
        zero: whether 0 is legal in a range, too.

    Raises:
        ConfigError: naming the field.
    """
    rule = "of at least 0" if zero else "above 0"
    for field in fields(config):
        value = getattr(config, field.name)
        if field.type in (Range, "Range", Range | None) and value is not None:
            low, high = value
            legal = (low >= 0 if zero else low > 0) and low <= high < math.inf
            text = f"{where}: {field.name} must be two numbers {rule}, the smaller first, not {[low, high]}"
            check(legal, text)
        elif field.name.endswith("_probability"):
            check_inside(f"{where}: {field.name}", value, (0, 1))


def check_weights(weights: Mapping[str, float], legal: tuple[str, ...], where: str) -> None:
    """Refuse weights of unknown names, negative weights, and weights that are all 0.

    Raises:
        ConfigError: naming what is wrong.
    """
    for name, weight in weights.items():
        check(name in legal, f"{where}: unknown name {name!r}; legal: {', '.join(legal)}")
        legal_weight = 0 <= weight < math.inf
        check(legal_weight, f"{where}: the weight of {name!r} must be at least 0, and finite, not {shown(weight)}")
    check(any(weights.values()), f"{where}: at least one weight must be above 0")

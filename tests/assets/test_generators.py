"""What generators share: random streams, families, and objects of a family of one's own."""

import inspect
from dataclasses import fields, replace
from importlib import import_module

import pytest

from artiskill.assets.articulated_object import Category
from artiskill.assets.buckets import GENERATOR, BucketConfig, default_bucket_config
from artiskill.assets.buckets.config import BucketFamilyConfig
from artiskill.assets.cabinets.appearance import SCHEMES as COLOUR_SCHEMES
from artiskill.assets.catalog import resolve_objects
from artiskill.assets.generators import GENERATORS, Generator, form_and_detail, generate
from artiskill.errors import ConfigError


@pytest.fixture
def mop_pail() -> BucketFamilyConfig:
    """A family that the catalogue does not have."""
    pail = next(family for family in default_bucket_config().families if family.name == "pail")
    return replace(pail, name="mop_pail", sections={"oval": 1.0}, top_m=(0.30, 0.34))


def with_family(family: BucketFamilyConfig) -> BucketConfig:
    config = default_bucket_config()
    return replace(config, families=(*config.families, family))


def test_streams_of_fresh_and_listed_objects_differ() -> None:
    draws = {
        tuple(rng.integers(2**62, size=2))
        for fresh in (False, True)
        for seed in range(50)
        for rng in form_and_detail(seed, fresh)
    }
    assert len(draws) == 2 * 2 * 50


@pytest.mark.parametrize("category", GENERATORS)
def test_every_category_has_a_generator(category: Category) -> None:
    generator = import_module(GENERATORS[category]).GENERATOR
    assert isinstance(generator, Generator)
    made = generator.make(3, "mine", held_out=True)
    assert (made.category, made.id, made.metadata["held_out"]) == (category, "mine", True)
    assert made.content_hash == generate(category, 3, "other", held_out=True).content_hash


def test_a_family_of_ones_own_needs_no_change_of_the_package(mop_pail: BucketFamilyConfig) -> None:
    only = replace(default_bucket_config(), families=(mop_pail,))
    objects = [GENERATOR.make(seed, f"mop-pail-{seed}", config=only) for seed in range(4)]
    assert {obj.metadata["family"] for obj in objects} == {"mop_pail"}
    assert {obj.metadata["section"] for obj in objects} == {"oval"}
    assert len({obj.content_hash for obj in objects}) == 4
    assert resolve_objects(objects, "MoveBucket") == tuple(objects)


def test_a_family_of_weight_0_changes_no_object(mop_pail: BucketFamilyConfig) -> None:
    config = with_family(replace(mop_pail, weight=0.0))
    for seed in range(6):
        made = GENERATOR.make(seed, "x", config=config)
        assert made.content_hash == generate("bucket", seed, "x").content_hash


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "pail"}, "family 'pail': two families have this name"),
        ({"weight": -1.0}, "family 'mop_pail': weight must be at least 0, and finite, not -1.0"),
        ({"weight": float("inf")}, "family 'mop_pail': weight must be at least 0, and finite, not inf"),
        ({"feet": {"flat": float("inf")}}, "feet: the weight of 'flat' must be at least 0, and finite, not inf"),
        ({"spout_probability": 3.0}, r"'mop_pail': spout_probability must lie in \[0, 1\], not 3\.0"),
        (
            {"material": "gold"},
            "'mop_pail': material: unknown name 'gold'; legal: plastic, galvanised, enamel, wood",
        ),
        ({"sections": {"ovale": 1.0}}, "family 'mop_pail': sections: unknown name 'ovale'; legal: .*oval"),
    ],
)
def test_bad_families_are_named(mop_pail: BucketFamilyConfig, changes: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        with_family(replace(mop_pail, **changes))  # type: ignore[arg-type]


def test_a_list_without_held_out_families_draws_none(mop_pail: BucketFamilyConfig) -> None:
    only = replace(default_bucket_config(), families=(mop_pail,))
    with pytest.raises(ConfigError, match="families: none with a weight above 0 has held_out True"):
        GENERATOR.make(0, "x", held_out=True, config=only)


@pytest.mark.parametrize("category", GENERATORS)
def test_help_names_every_field_of_a_family_and_every_legal_form(category: Category) -> None:
    module = import_module(f"{GENERATORS[category]}.config")
    config = getattr(module, f"{category.capitalize()}FamilyConfig")
    families = import_module(GENERATORS[category]).GENERATOR.default_config().families
    told = [line for line in inspect.getdoc(config).splitlines() if line.startswith(" " * 4)]
    named = [line.split(":")[0].strip() for line in told if not line.startswith(" " * 8)]
    assert named == [field.name for field in fields(config)]
    drawn = {form for family in families for one in fields(family) for form in forms_of(getattr(family, one.name))}
    assert not [form for form in drawn - set(COLOUR_SCHEMES) if f"`{form}`" not in config.__doc__]


def forms_of(value: object) -> tuple[str, ...]:
    return tuple(value) if isinstance(value, dict) else ()

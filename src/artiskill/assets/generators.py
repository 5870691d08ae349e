"""From a category and a seed to an object: one generator per category, imported when it is first needed."""

from functools import lru_cache
from importlib import import_module

from artiskill.assets.articulated_object import ArticulatedObject, Category

_CACHED_OBJECTS = 256
# category -> (module, function(seed, object_id, held_out, fresh)); listing the catalogue needs none of them
_GENERATORS: dict[Category, tuple[str, str]] = {
    "cabinet": ("artiskill.assets.cabinets", "generate_cabinet"),
    "chair": ("artiskill.assets.chairs", "generate_chair"),
    "bucket": ("artiskill.assets.buckets", "generate_bucket"),
}


@lru_cache(maxsize=_CACHED_OBJECTS)
def generate(
    category: Category, seed: int, object_id: str, held_out: bool = False, fresh: bool = False
) -> ArticulatedObject:
    """The object of a seed, with the category's default configuration.

    Kept in a bounded cache of the process, for objects are read-only.

    Args:
        category: which generator.
        seed: at least 0; the same seed, the same object, bit for bit.
        object_id: its name.
        held_out: whether it is of a family that training and test objects never are of.
        fresh: whether it is drawn from streams that the catalogue never uses, as `generated:` objects are.
    """
    module, function = _GENERATORS[category]
    made: ArticulatedObject = getattr(import_module(module), function)(seed, object_id, held_out, fresh)
    return made

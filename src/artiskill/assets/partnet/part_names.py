"""The data set's part names to the benchmark's: `star_leg_base` to `base`, `armrest_soft_surface` to `arm`.

Tasks look for parts by name (a wheel rubs on the ground otherwise than a leg), so chairs and buckets of all
sources use the same few names. Cabinets keep the data set's, which say more.
"""

from collections.abc import Sequence

from artiskill.assets.articulated_object import Category
from artiskill.assets.handles import is_handle_part

CHAIR_PARTS = ("wheel", "caster", "base", "column", "seat", "back", "arm", "headrest", "footrest")
BUCKET_PARTS = ("wall", "floor", "lip", "handle")
WHEEL, CASTER, HANDLE, WALL = "wheel", "caster", "handle", "wall"

# The first row with a word of the part's name decides; words are what stands between underscores.
_CHAIR_WORDS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("wheel", ("wheel", "wheels")),
    ("caster", ("caster", "castor", "casters")),
    ("headrest", ("headrest", "head")),
    ("footrest", ("footrest",)),
    ("arm", ("arm", "armrest", "arms")),
    ("back", ("back", "backrest", "lumbar")),
    ("column", ("column", "central", "mechanical", "pedestal", "gas", "lever", "knob", "button")),
    ("seat", ("seat", "cushion", "pillow")),
    ("base", ("base", "leg", "legs", "foot", "feet", "runner", "rocker", "stretcher", "star")),
)
_BUCKET_WORDS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("handle", ("handle", "bail", "grip", "knob")),
    ("floor", ("floor", "bottom", "base", "foot")),
    ("lip", ("lip", "rim", "edge", "spout")),
    ("wall", ("wall", "body", "side", "container", "bucket", "frame", "pail")),
)
_WORDS = {"chair": _CHAIR_WORDS, "bucket": _BUCKET_WORDS}


def benchmark_part(category: Category, names: Sequence[str]) -> str:
    """The benchmark's name of a part.

    Args:
        category: of the object; cabinets keep the data set's names.
        names: the part's own name, then those of the groups it belongs to, inner ones first.

    Returns:
        One of `CHAIR_PARTS` or `BUCKET_PARTS`; the part's own name where none of its names says anything.
    """
    if category == "cabinet":
        return names[0]
    for name in names:
        if category == "bucket" and is_handle_part(name):
            return HANDLE
        words = name.lower().replace("-", "_").replace(" ", "_").split("_")
        # an object's top node, `chair`, says nothing, and `chair_back` no more than its last word
        words = [word for word in words if word != "chair"]
        for part, legal in _WORDS[category]:
            if not set(legal).isdisjoint(words):
                return part
    return names[0]

"""Names of objects as people write them: which form a name has, and what is nearest to a wrong one."""

import difflib
import re
from collections.abc import Iterable
from typing import cast, get_args

from artiskill.assets.articulated_object import Category
from artiskill.errors import AssetError, UnknownNameError, shown
from artiskill.files import is_folder

GENERATED = "generated"
GENERATED_CATEGORIES: tuple[str, ...] = get_args(Category)
PARTNET = "partnet"
_MOST_COMPARED = 200  # characters: comparing takes the product of two lengths
_MOST_DIGITS = 18  # of a seed: it is a part of an id, and of the names of files
_MOST_OBJECTS = 10_000  # of a range: to see what a task can be done with, all are made, in 20 ms each
_LEAST_RATIO = 0.5  # below it, two names have nothing to do with each other


class UnknownObjectError(UnknownNameError):
    """A name that is no object, and where that was possible no split either."""

    def __init__(self, name: str, ids: Iterable[str], splits: Iterable[str] = ()) -> None:
        """Build the message.

        Args:
            name: as given.
            ids: of the catalogue, in its order.
            splits: names that stand for several objects, where these are legal.
        """
        ids, splits = tuple(ids), tuple(splits)
        near = nearest_name(name, (*splits, *ids))
        message = f"unknown object {shown(name)}"
        if is_folder(name):
            message += f"; a folder has this name: write './{name}' to mean it."
        else:
            message += f"; did you mean {near!r}?" if near else "."
        legal = [f"a split ({', '.join(splits)})"] if splits else []
        legal += [
            f"one of the {len(ids)} catalogue ids ({ids[0]} to {ids[-1]}; `artiskill objects` lists them)",
            f"'{GENERATED}:<category>:<seed>'",
            f"'{PARTNET}:<id>'",
        ]
        legal.append("a path to a PartNet-Mobility folder or zip")
        legal += ["a YAML file with a list of such names"] if splits else []
        message += f" Legal: {', '.join(legal[:-1])} and {legal[-1]}."
        Exception.__init__(self, message)


def nearest_name(given: str, names: Iterable[str]) -> str | None:
    """The name that was probably meant, or None.

    First one with the same numbers, `cabinet-0005` for `cabinet-5` say; else the most similar one, of equally
    similar ones the one that shares the longest beginning.
    """
    if len(given) > _MOST_COMPARED:
        return None
    given = given.lower()
    names = tuple(names)
    for name in names:
        if _plain(name) == _plain(given):
            return name
    ranks = [(difflib.SequenceMatcher(None, given, name.lower()).ratio(), _shared(given, name)) for name in names]
    best = max(ranks, default=(0.0, 0))
    return names[ranks.index(best)] if best[0] >= _LEAST_RATIO else None


def parse_generated(name: str, category: Category = "cabinet") -> tuple[Category, range] | None:
    """What `generated:<category>:<seed>` means, or None for a name of another form.

    Args:
        name: the category may be left out; `<first>..<last>` in place of the seed means all seeds from the first
            to the last; `-` may stand for `:`, as in the ids of generated objects.
        category: meant where the name has none.

    Returns:
        The category and the seeds.

    Raises:
        UnknownNameError: another category, or a seed that is no whole number of at least 0.
        AssetError: a seed, or a range of them, that is too large.
    """
    found = re.match(rf"{GENERATED}[:-]", name)
    if found is None:
        return None
    rest = name[found.end() :]
    parts = re.match(r"([A-Za-z_]+)[:-](.*)", rest)
    kind, seeds = (category, rest) if parts is None else (parts[1], parts[2])
    numbers = re.fullmatch(r"([0-9]+)(?:\.\.([0-9]+))?", seeds)
    if kind not in GENERATED_CATEGORIES:
        raise UnknownNameError("category", kind, GENERATED_CATEGORIES, f"(in {shown(name)})")
    if numbers is None:
        hint = "The seed is a whole number of at least 0, or <first>..<last>."
        raise UnknownNameError("object", name, (f"{GENERATED}:<category>:<seed>",), hint)
    if max(map(len, filter(None, numbers.groups()))) > _MOST_DIGITS:
        raise AssetError(f"object {shown(name)}: a seed has at most {_MOST_DIGITS} digits")
    first = int(numbers[1])
    last = first if numbers[2] is None else int(numbers[2])
    if last < first:
        raise AssetError(f"object {name!r}: the last seed, {last}, comes before the first, {first}")
    if last - first >= _MOST_OBJECTS:
        raise AssetError(f"object {name!r} means {last - first + 1} objects; at most {_MOST_OBJECTS} are legal")
    return cast(Category, kind), range(first, last + 1)


def generated_id(category: Category, seed: int) -> str:
    """The id of a generated object."""
    return f"{GENERATED}-{category}-{seed}"


def partnet_id(name: str) -> str | None:
    """The id of `partnet:<id>`, else None."""
    prefix = f"{PARTNET}:"
    return name[len(prefix) :] if name.startswith(prefix) else None


def is_split_file(name: str) -> bool:
    """Whether a name is meant as a file that lists names."""
    return name.endswith((".yaml", ".yml"))


def is_path(name: str) -> bool:
    """Whether a name is meant as a path: it holds a separator or ends in `.zip`.

    What lies in the working directory plays no part: a folder there must not take a catalogue object's name.
    """
    return "/" in name or "\\" in name or name.endswith(".zip")


def _shared(first: str, second: str) -> int:
    """How many characters two names have in common at their beginning."""
    return next((i for i, (a, b) in enumerate(zip(first, second, strict=False)) if a != b), len(second))


def _plain(name: str) -> str:
    """Without leading zeros of numbers."""
    return re.sub(r"\d+", lambda digits: digits[0].lstrip("0") or "0", name)

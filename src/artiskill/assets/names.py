"""Parse the names of objects as people write them, suggest the nearest legal one, and read split files."""

import difflib
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from artiskill.assets.articulated_object import CATEGORIES, Category
from artiskill.config import from_mapping, load_yaml
from artiskill.errors import AssetError, UnknownNameError, shown
from artiskill.files import is_file, is_folder

GENERATED = "generated"
PARTNET = "partnet"
_MOST_COMPARED = 200  # characters: comparing takes the product of two lengths
_MOST_DIGITS = 18  # of a seed: it is a part of an id, and of the names of files
_MOST_OBJECTS = 10_000  # of a range: to see what a task can be done with, all are made, in 20 ms each
_LEAST_RATIO = 0.5  # below it, two names have nothing to do with each other


class UnknownObjectError(UnknownNameError):
    """Raised for a name that is neither an object nor, where splits are legal, a split."""

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
    """Return the name that was probably meant, or None.

    A name with the same numbers comes first (`cabinet-0005` for `cabinet-5`), then the most similar one. Of
    equally similar names, the one with the longest common prefix is taken.
    """
    if len(given) > _MOST_COMPARED:
        return None
    given = given.lower()
    names = tuple(names)
    for name in names:
        if _strip_zeros(name) == _strip_zeros(given):
            return name
    ranks = [
        (difflib.SequenceMatcher(None, given, name.lower()).ratio(), _common_prefix(given, name)) for name in names
    ]
    best = max(ranks, default=(0.0, 0))
    return names[ranks.index(best)] if best[0] >= _LEAST_RATIO else None


def parse_generated(name: str, category: Category = "cabinet") -> tuple[Category, range] | None:
    """Parse `generated:<category>:<seed>`; return None for a name of another form.

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
    if kind not in CATEGORIES:
        raise UnknownNameError("category", kind, CATEGORIES, f"(in {shown(name)})")
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
    """Return the id of a generated object."""
    return f"{GENERATED}-{category}-{seed}"


def partnet_id(name: str) -> str | None:
    """Return the id in `partnet:<id>`, or None for another name."""
    prefix = f"{PARTNET}:"
    return name[len(prefix) :] if name.startswith(prefix) else None


def is_split_file(name: str) -> bool:
    """Return whether a name means a file that lists names."""
    return name.endswith((".yaml", ".yml"))


def is_path(name: str) -> bool:
    """Return whether a name means a path: it holds a separator or ends in `.zip`.

    The working directory does not matter: a folder there must not take a catalogue object's name.
    """
    return "/" in name or "\\" in name or name.endswith(".zip")


@dataclass(frozen=True)
class SplitFile:
    """A user's own split: a YAML file that lists names of objects."""

    # names as `resolve_objects` takes them, other split files excepted; paths are relative to the file
    objects: tuple[str, ...]
    description: str = ""  # free text


def read_split_file(path: Path) -> tuple[str, ...]:
    """Return the names that a split file lists.

    Raises:
        AssetError: there is no such file, or it lists nothing, no list, or another split file.
        ConfigError: it has an unknown key or a value of the wrong type.
    """
    if is_folder(path):
        raise AssetError(f"split file {str(path)!r} is a folder; write {f'{path}/'!r} to mean an object in it")
    if not is_file(path):
        raise AssetError(f"split file {shown(str(path))} does not exist; it holds YAML, `objects: [names]`")
    data = load_yaml(path)
    given = data.get("objects", [])
    if not isinstance(given, list):
        example = given if isinstance(given, str) and len(given) < 100 else "cabinet-0001"
        raise AssetError(
            f"split file {str(path)!r}: `objects` must be a list of names, not {shown(given)}; for example "
            f"`objects: [{example}]`"
        )
    names = from_mapping(SplitFile, data, path.name).objects
    if not names:
        raise AssetError(f"split file {str(path)!r} lists no object under `objects`")
    nested = [name for name in names if is_split_file(name)]
    if nested:
        raise AssetError(f"split file {str(path)!r} lists another split file: {nested[0]!r}")
    # joined as text: `./mine` beside a file in the working directory must not become `mine`, which is no path
    return tuple(os.path.join(path.parent, name) if is_path(name) else name for name in names)


def _common_prefix(first: str, second: str) -> int:
    """Return the length of the common prefix of two names."""
    return next((i for i, (a, b) in enumerate(zip(first, second, strict=False)) if a != b), len(second))


def _strip_zeros(name: str) -> str:
    """Strip leading zeros of numbers."""
    return re.sub(r"\d+", lambda digits: digits[0].lstrip("0") or "0", name)

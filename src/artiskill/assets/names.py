"""Names of objects as people write them: which form a name has, and what is nearest to a wrong one."""

import difflib
import re
from collections.abc import Iterable
from pathlib import Path

from artiskill.errors import UnknownNameError

GENERATED = "generated"
PARTNET = "partnet"
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
        message = f"unknown object {name!r}"
        if Path(name).is_dir():
            message += f"; a folder has this name: write './{name}' to mean it."
        else:
            message += f"; did you mean {near!r}?" if near else "."
        legal = [f"a split ({', '.join(splits)})"] if splits else []
        legal += [
            f"one of the {len(ids)} catalogue ids ({ids[0]} to {ids[-1]}; `artiskill objects` lists them)",
            f"'{GENERATED}:<seed>'",
            f"'{PARTNET}:<id>'",
        ]
        message += f" Legal: {', '.join(legal)} and a path to a PartNet-Mobility folder or zip."
        Exception.__init__(self, message)


def nearest_name(given: str, names: Iterable[str]) -> str | None:
    """The name that was probably meant, or None.

    First one with the same numbers, `cabinet-0005` for `cabinet-5` say; else the most similar one, of equally
    similar ones the one that shares the longest beginning.
    """
    given = given.lower()
    names = tuple(names)
    for name in names:
        if _plain(name) == _plain(given):
            return name
    ranks = [(difflib.SequenceMatcher(None, given, name.lower()).ratio(), _shared(given, name)) for name in names]
    best = max(ranks, default=(0.0, 0))
    return names[ranks.index(best)] if best[0] >= _LEAST_RATIO else None


def generated_seed(name: str) -> int | None:
    """The seed of `generated:<seed>` or `generated-<seed>`, else None.

    Raises:
        UnknownNameError: the seed is no whole number of at least 0.
    """
    for separator in (":", "-"):
        prefix = GENERATED + separator
        if name.startswith(prefix):
            digits = name[len(prefix) :]
            if not (digits.isascii() and digits.isdigit()):
                hint = "The seed is a whole number of at least 0."
                raise UnknownNameError("object", name, (f"{GENERATED}:<seed>",), hint)
            return int(digits)
    return None


def partnet_id(name: str) -> str | None:
    """The id of `partnet:<id>`, else None."""
    prefix = f"{PARTNET}:"
    return name[len(prefix) :] if name.startswith(prefix) else None


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

"""What happens at a node of a Ray cluster: it shows that it would give the same bits, then does a job."""

import hashlib
import pickle
import socket
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from artiskill.jobs.workers import outcome_of
from artiskill.versions import versions

_PACKAGE = Path(__file__).parents[1]
_CODE = "code of artiskill"
_SOURCES = (".py", ".yaml")
_DIGITS = 12  # of a digest, to tell two apart

FAILED, DIFFERENT = "failed", "different"


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came of a job.

    Attributes:
        node: where it was done.
        news: that the job told, in order.
        kind: `done`, `FAILED`, or `DIFFERENT` where it was not begun.
        value: the job's result, its error and traceback, or how the node differs.
    """

    node: str
    news: list[Any]
    kind: str
    value: Any


@cache
def facts() -> dict[str, str]:
    """What a job's result depends on besides the job: versions, and the package's own code, which may be newer."""
    digest = hashlib.sha256()
    for path in sorted(_PACKAGE.rglob("*")):
        if path.suffix in _SOURCES:
            digest.update(str(path.relative_to(_PACKAGE)).encode() + b"\0" + path.read_bytes())
    return versions() | {_CODE: digest.hexdigest()[:_DIGITS]}


def pack(function: Callable[[Any, Any], Any], job: Any) -> bytes:
    """A job as it travels."""
    return pickle.dumps((function, job))


def play(packed: bytes, expected: Mapping[str, str]) -> bytes:
    """Do a job.

    Nothing of it is unpacked before it is known that this place and the one where it comes from are alike.

    Args:
        packed: see `pack`.
        expected: the `facts` of where the job comes from.

    Returns:
        A pickled `Outcome`. It holds the news, too, so that those of a node that is lost are lost with the result,
        and whoever does the job again tells none of them twice.
    """
    node, found = socket.gethostname(), facts()
    differing = [name for name in sorted({*expected, *found}) if expected.get(name) != found.get(name)]
    if differing:
        text = ", ".join(f"{name} {found.get(name)} there, {expected.get(name)} here" for name in differing)
        return pickle.dumps(Outcome(node, [], DIFFERENT, text))
    news: list[Any] = []
    kind, value = outcome_of(_unpack_and_do, packed, lambda message: news.append(message[1]))
    return pickle.dumps(Outcome(node, news, kind, value))


def _unpack_and_do(packed: bytes, tell: Callable[[Any], None]) -> Any:
    function, job = pickle.loads(packed)
    return function(job, tell)

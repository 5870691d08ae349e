"""Every error that ArtiSkill raises on purpose, under one root.

A message says what was given, what is legal and, where names are concerned, what is nearest. Each class also
derives from the built-in exception that a caller would expect, so `except ValueError` keeps working.
"""

import difflib
import reprlib
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any

_MOST_MESSAGE = 2000  # characters: longer messages are mostly a user's own input
_MOST_COMPARED = 200  # characters of a name: comparing takes the product of two lengths


class ArtiSkillError(Exception):
    """Root of all errors that ArtiSkill raises on purpose; they travel between processes."""

    def __str__(self) -> str:
        """Return the message; of a very long one, its beginning and its end."""
        message = super().__str__()
        half = _MOST_MESSAGE // 2
        return message if len(message) <= _MOST_MESSAGE else f"{message[:half]} [...] {message[-half:]}"

    def __reduce__(self) -> tuple[Callable[..., "ArtiSkillError"], tuple[type["ArtiSkillError"], str]]:
        # by message: the constructors of some take other arguments
        return _with_message, (type(self), str(self))


class UnknownNameError(ArtiSkillError, ValueError):
    """A name (task, object, mode, split, link, ...) that does not exist."""

    def __init__(self, kind: str, given: object, legal: Iterable[str], hint: str = "") -> None:
        """Build the message from the kind of thing, the given name and all legal names."""
        names = sorted(map(str, legal))
        near = closest(given, names, cutoff=0.5)
        message = f"unknown {kind} {shown(given)}"
        if near is not None:
            message += f"; did you mean {near!r}?"
        message += f" Legal: {_shorten(names)}." if near else f"; legal: {_shorten(names)}."
        super().__init__(f"{message} {hint}".rstrip())


class ConfigError(ArtiSkillError, ValueError):
    """A configuration value that is missing, unknown, of the wrong type or out of range."""


class AssetError(ArtiSkillError, ValueError):
    """An object that cannot be generated, read or used as asked."""


class ActionError(ArtiSkillError, ValueError):
    """An action of the wrong shape or with values that are not finite."""


class StateError(ArtiSkillError, ValueError):
    """A saved state that does not belong to the environment it is restored into."""


Cause = tuple[str, Collection[str]]  # of a `DivergedError`: an object, and the engine's names of its warnings


class DivergedError(ArtiSkillError, RuntimeError):
    """The physics of some environments ran away: their states are no longer meaningful.

    Attributes:
        causes: of each environment.
    """

    def __init__(self, causes: Mapping[int, Cause]) -> None:
        """Build the message."""
        self.causes = dict(causes)
        names = sorted({name for name, _ in causes.values()})
        said = sorted({kind for _, kinds in causes.values() for kind in kinds})
        super().__init__(
            f"the physics of {', '.join(names)} diverged in environments {sorted(causes)} "
            f"({', '.join(said)}); reset them before stepping on"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle it, as workers send it to their parent."""
        return type(self), (self.causes,)


class PolicyError(ArtiSkillError, RuntimeError):
    """A policy or solution file that cannot be loaded, raises, or returns no legal action."""


class DemoError(ArtiSkillError, ValueError):
    """A file or folder of demonstrations that is damaged, foreign, of another version, or does not fit."""


class RunError(ArtiSkillError, RuntimeError):
    """A training run that is damaged, of other settings or another version, or that cannot go on."""


class ClusterError(ArtiSkillError, RuntimeError):
    """Several machines that cannot be reached, break down, or would give other results than this one."""


class ResetNeededError(ArtiSkillError, RuntimeError):
    """An environment was used before its first `reset`."""


class MissingExtraError(ArtiSkillError, ImportError):
    """A feature needs an optional dependency that is not installed."""

    def __init__(self, feature: str, extra: str) -> None:
        """Name the feature and the extra that brings it."""
        super().__init__(f"{feature} needs an optional dependency: pip install 'artiskill[{extra}]'")


def check_name(kind: str, given: object, legal: Collection[str], hint: str = "") -> None:
    """Raise UnknownNameError unless a name is one of the legal ones; what is no text is none of them."""
    if not isinstance(given, str) or given not in legal:
        raise UnknownNameError(kind, given, legal, hint)


def shown(given: object) -> str:
    """Return a value as an error shows it: its `repr`, shortened if it is long or deep; it never raises."""
    try:
        text = _SHOWN.repr(given)
    except Exception as error:  # of a foreign type, anything
        return f"a {type(given).__name__} whose repr raises {type(error).__name__}"
    return text if len(text) <= _SHOWN.maxother else f"{text[: _SHOWN.maxother]}..."


def closest(given: object, legal: Iterable[str], cutoff: float = 0.6) -> str | None:
    """Return the legal name that is most like a given one, if any is."""
    if not isinstance(given, str) or len(given) > _MOST_COMPARED:
        return None
    legal = list(legal)
    longer = [name for name in legal if name.startswith(f"{given}-")]
    if longer and given[:1].isalpha():  # a command's first word, no option
        return min(longer, key=len)
    return next(iter(difflib.get_close_matches(given, legal, n=1, cutoff=cutoff)), None)


def _shortening_repr() -> reprlib.Repr:
    made = reprlib.Repr()
    made.maxlevel, made.maxstring, made.maxlong, made.maxother = 4, 300, 60, 400
    made.maxlist = made.maxtuple = made.maxdict = made.maxset = made.maxfrozenset = made.maxarray = 20
    return made


_SHOWN = _shortening_repr()


def _shorten(names: list[str], most: int = 12) -> str:
    if len(names) <= most:
        return ", ".join(names) or "(none)"
    return ", ".join(names[:most]) + f", ... ({len(names)} in all)"


def _with_message(cls: type[ArtiSkillError], message: str) -> ArtiSkillError:
    error = cls.__new__(cls)
    Exception.__init__(error, message)
    return error

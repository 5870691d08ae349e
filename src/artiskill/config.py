"""YAML files and mappings to frozen dataclasses, with errors that name the key.

A config class is a frozen dataclass whose `__post_init__` checks its own values and raises `ConfigError`. Checks
of its base classes run in any case. YAML holds values only; which keys exist, their types and their meaning stand
in the dataclass.
"""

import dataclasses
import json
import math
import re
import types
import typing
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import dacite
import yaml

from artiskill.errors import ArtiSkillError, ConfigError, closest, shown
from artiskill.files import MOST_YAML_BYTES, parse_yaml, read_text

CONFIG_DIR = Path(__file__).parent / "configs"

_MOST_DEPTH = 50  # of nested keys
_NOT_SHOWN = ("Cc", "Cf", "Cs", "Zl", "Zp")  # Unicode's categories of what is done rather than shown
_LARGEST_INT = 2**53  # beyond, floats leave whole numbers out, and arrays overflow

T = TypeVar("T")


def load_yaml(path: Path) -> dict[str, Any]:
    """Read a YAML mapping.

    Raises:
        ConfigError: the file is missing, is not YAML, or is not a mapping.
    """
    try:
        data = parse_yaml(read_text(path, MOST_YAML_BYTES))
    except OSError as error:
        raise ConfigError(f"cannot read config file {str(path)!r}: {error.strerror}") from error
    except ValueError as error:
        raise ConfigError(f"{str(path)!r} is not valid YAML: {error}") from error
    if not isinstance(data, dict):
        raise ConfigError(f"{str(path)!r} must hold a mapping of keys to values, not {type(data).__name__}")
    return data


def from_mapping(cls: type[T], data: Mapping[str, Any], source: str = "config") -> T:
    """Build the frozen dataclass `cls` from a nested mapping.

    Args:
        cls: a dataclass; nested dataclasses, tuples of them and dicts of them are followed.
        data: keys are field names; a missing key takes the field's default.
        source: what the mapping is, for error messages (a file name, say).

    Raises:
        ConfigError: an unknown key (the nearest legal one is named), a missing key, a wrong type, or whatever
            the dataclasses' own checks find.
    """
    try:
        built: T = _build(cls, data, "")
    except ConfigError as error:
        raise ConfigError(f"{source}: {error}") from error
    return built


def load_config(cls: type[T], path: Path, overrides: Mapping[str, Any] | None = None) -> T:
    """Read `cls` from a YAML file, then apply overrides such as `{"physics.timestep_s": 0.001}`."""
    values = load_yaml(path)
    return from_layers(cls, lambda given: merge_overrides(values, given), overrides, path.name)


def from_layers(
    cls: type[T],
    merge: Callable[[Mapping[str, Any]], Mapping[str, Any]],
    overrides: Mapping[str, Any] | None,
    source: str,
) -> T:
    """Build `cls` from a file's values with a caller's laid over them; an error is blamed on whose value it is.

    Args:
        cls: as in `from_mapping`.
        merge: the file's values with others laid over.
        overrides: the caller's.
        source: the file's name.

    Raises:
        ConfigError: as of `from_mapping`; its message begins with `config` where the file alone is in order.
    """
    if not overrides:
        return from_mapping(cls, merge({}), source)
    try:
        return from_mapping(cls, merge(overrides))
    except ConfigError:
        from_mapping(cls, merge({}), source)
        raise


def merge_overrides(data: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of `data` in which each dotted key, or nested mapping, of `overrides` has its new value.

    Raises:
        ConfigError: keys are nested too deeply, or hold themselves.
    """
    return _merged(data, overrides, 0)


def _merged(data: Mapping[str, Any], overrides: Mapping[str, Any], depth: int) -> dict[str, Any]:
    if depth > _MOST_DEPTH:
        raise ConfigError(f"keys are nested more than {_MOST_DEPTH} levels deep")
    merged = dict(data)
    for key, value in overrides.items():
        head, _, rest = str(key).partition(".")
        if rest:
            value = {rest: value}
        old = merged.get(head)
        if isinstance(value, Mapping) and isinstance(old, Mapping):
            value = _merged(old, value, depth + 1)
        elif isinstance(value, Mapping):
            value = _merged({}, value, depth + 1)
        merged[head] = value
    return merged


def to_mapping(config: Any) -> Any:
    """Return the plain values (dicts, lists, numbers, strings) of a config, ready for YAML or JSON."""
    if dataclasses.is_dataclass(config) and not isinstance(config, type):
        return {f.name: to_mapping(getattr(config, f.name)) for f in dataclasses.fields(config)}
    if isinstance(config, Mapping):
        return {str(k): to_mapping(v) for k, v in config.items()}
    if isinstance(config, list | tuple):
        return [to_mapping(v) for v in config]
    return config


def differing(mine: Mapping[str, Any], theirs: Mapping[str, Any], prefix: str = "") -> list[str]:
    """List the differences of two nested mappings of plain values, a text each."""
    found = []
    for key in dict.fromkeys((*mine, *theirs)):
        one, other = mine.get(key), theirs.get(key)
        if isinstance(one, Mapping) and isinstance(other, Mapping):
            found += differing(one, other, f"{prefix}{key}.")
        elif one != other:
            found.append(f"{prefix}{key} {_text(one)} there, {_text(other)} here")
    return found


def _text(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) < 60 else f"{text[:56]} ..."


def dump_yaml(config: Any) -> str:
    """Return the config as YAML, keys in the order of the dataclass, lists of plain values on one line."""
    return yaml.dump(to_mapping(config), Dumper=_Dumper, sort_keys=False, width=110)


class _Dumper(yaml.SafeDumper):
    """Writes a list of plain values as `[1, 2]`."""


def _represent_list(dumper: _Dumper, values: list[Any]) -> yaml.Node:
    is_plain = not any(isinstance(value, dict | list) for value in values)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", values, flow_style=is_plain)


_Dumper.add_representer(list, _represent_list)


def check(condition: bool, message: str) -> None:
    """Raise `ConfigError(message)` unless `condition` holds: one line for a `__post_init__` check."""
    if not condition:
        raise ConfigError(message)


def check_value(config: object, name: str, legal: bool, rule: str) -> None:
    """Raise `ConfigError` with the field, the rule and the value unless `legal`."""
    owner = getattr(config, "name", "")
    check(legal, f"{owner}{': ' if owner else ''}{name} {rule}, not {shown(getattr(config, name))}")


def check_vector(config: object, *names: str, size: int = 3) -> None:
    """Check that each field holds `size` finite numbers."""
    for name in names:
        value = getattr(config, name)
        check_value(config, name, len(value) == size and all(map(math.isfinite, value)), f"needs {size} numbers")


def check_range(config: object, *names: str, lowest: float = -math.inf) -> None:
    """Check that each field holds two finite numbers, the second higher, the first at least `lowest`."""
    for name in names:
        value = getattr(config, name)
        legal = len(value) == 2 and -math.inf < value[0] < value[1] < math.inf and value[0] >= lowest
        least = "" if lowest == -math.inf else f" of at least {lowest:g}"
        check_value(config, name, legal, f"must be a lower{least} and a higher number")


def check_positive(config: object, *names: str) -> None:
    """Check that each field is positive and finite."""
    for name in names:
        check_value(config, name, 0 < getattr(config, name) < math.inf, "must be positive and finite")


def check_not_negative(config: object, *names: str) -> None:
    """Check that each field is zero or positive, and finite."""
    for name in names:
        check_value(config, name, 0 <= getattr(config, name) < math.inf, "must be finite and at least 0")


def check_line(what: str, text: str) -> None:
    """Raise `ConfigError` if a text is not one line that a terminal shows as it is: it may have commands in it."""
    is_plain = not any(unicodedata.category(c) in _NOT_SHOWN for c in text)
    check(is_plain, f"{what} {shown(text)} is not one line of printable text")


def check_inside(what: str, value: float, limits: Sequence[float]) -> None:
    """Check that a number lies within limits."""
    check(limits[0] <= value <= limits[1], f"{what} must lie in {list(limits)}, not {shown(value)}")


def _build(cls: Any, data: Any, path: str) -> Any:
    """Build `cls` from a mapping, its own dataclasses first, so that each error can name its place.

    Args:
        cls: a dataclass.
        data: what YAML gave.
        path: the dotted way to it, empty at the top.

    Raises:
        ConfigError: as of `from_mapping`, without the source.
    """
    if not isinstance(data, Mapping):
        raise ConfigError(f"{path or 'it'} must be a mapping of keys to values, not {shown(data)}")
    hints = typing.get_type_hints(cls)
    legal = [f.name for f in dataclasses.fields(cls)]
    for key in data:
        if key not in legal:
            where = f"{path}: " if path else ""
            raise ConfigError(f"{where}unknown key {shown(key)}; {_nearest(key, legal)}Legal: {', '.join(legal)}.")
    fitted = {key: _fit(hints[key], value, _join(path, key)) for key, value in data.items()}
    try:
        built = dacite.from_dict(cls, fitted)
        _check_as_bases(built)
        return built
    except dacite.MissingValueError as error:
        raise ConfigError(f"key {_join(path, error.field_path)!r} is missing") from error
    except dacite.WrongTypeError as error:
        wanted = _wanted(error.field_type, error.value)
        raise ConfigError(f"{_join(path, error.field_path)!r} must be {wanted}") from error
    except dacite.DaciteError as error:
        raise ConfigError(f"{path}: {error}" if path else str(error)) from error
    except ArtiSkillError as error:
        raise ConfigError(_placed(path, str(error), legal)) from error
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{path or 'it'}: a value has the wrong type: {error}") from error


def _check_as_bases(config: Any) -> None:
    """Run the checks of base classes: a subclass with a `__post_init__` of its own need not call theirs."""
    checks = [vars(kind)["__post_init__"] for kind in type(config).__mro__ if "__post_init__" in vars(kind)]
    for base_check in checks[1:]:  # the first has run
        base_check(config)


def _join(path: str, key: object) -> str:
    return f"{path}.{key}" if path else str(key)


def _placed(path: str, message: str, fields: list[str]) -> str:
    """Return a dataclass's message with its place: one that begins with a field gets that field's dotted path."""
    if not path:
        return message
    message = message.removeprefix(path.rpartition(".")[2] + ".")  # some name their place themselves
    begins_with_field = re.split(r"[^A-Za-z0-9_]", message, maxsplit=1)[0] in fields
    return f"{path}{'.' if begins_with_field else ': '}{message}"


def _fit(kind: Any, value: Any, path: str) -> Any:
    """Convert `value` to the annotation `kind`: tuples for YAML's lists, floats for its integers.

    What does not fit at all is left as it is, for dacite to refuse.

    Args:
        kind: a type annotation.
        value: what YAML gave.
        path: the dotted way to the value, for error messages.

    Raises:
        ConfigError: a key, at any depth, that no field has, or text where a number belongs.
    """
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if dataclasses.is_dataclass(kind):
        return value if type(value) is kind else _build(kind, value, path)
    if kind in (float, int):
        return _fit_number(kind, value, path)
    if origin in (typing.Union, types.UnionType):
        return _fit_union(arguments, value, path)
    if origin in (tuple, list) and isinstance(value, Mapping):
        key = next(iter(value), "")
        raise ConfigError(f"{path} is a list, which is given as a whole, not by keys such as {shown(key)}")
    if origin in (tuple, list) and isinstance(value, list | tuple):
        items = arguments[:1] * len(value) if origin is list or arguments[1:] == (...,) else arguments
        if len(items) != len(value):
            raise ConfigError(f"{path} needs {len(items)} values, not {shown(value)}")
        return origin(_fit(a, v, f"{path}[{i}]") for i, (a, v) in enumerate(zip(items, value, strict=True)))
    if origin in (tuple, list):  # dacite would take a text apart
        count = "" if origin is list or arguments[1:] == (...,) else f" of {len(arguments)} values"
        raise ConfigError(f"{path} must be a list{count}, not {shown(value)}")
    if origin in (dict, Mapping) and isinstance(value, Mapping):
        return {key: _fit(arguments[1], item, _join(path, key)) for key, item in value.items()}
    return value


def _fit_union(options: tuple[Any, ...], value: Any, path: str) -> Any:
    """Fit to the first option of the value's own sort, if there is one."""
    if value is None or type(value) in options:
        return value
    for option in options:
        origin = typing.get_origin(option) or option
        is_sequence = origin in (tuple, list) and isinstance(value, list | tuple)
        is_mapping = (dataclasses.is_dataclass(origin) or origin in (dict, Mapping)) and isinstance(value, Mapping)
        is_number = origin in (float, int) and isinstance(value, int | float | str | bool)
        if is_sequence or is_mapping or is_number:
            return _fit(option, value, path)
    return value


def _fit_number(kind: type, value: Any, path: str) -> Any:
    """Convert integers to floats, and text such as `1e-3`, which PyYAML reads as text; refuse booleans."""
    if isinstance(value, bool):
        raise ConfigError(f"{path}: a number was expected, not {shown(value)}")
    if kind is int and isinstance(value, int) and abs(value) > _LARGEST_INT:
        raise ConfigError(f"{path}: a whole number of at most {_LARGEST_INT} was expected, not {shown(value)}")
    if kind is float and isinstance(value, int | str):
        try:
            value = float(value)
        except (ValueError, OverflowError) as error:
            raise ConfigError(f"{path}: a number was expected, not {shown(value)}") from error
    if isinstance(value, float) and math.isnan(value):
        raise ConfigError(f"{path}: a number was expected, not {value}")
    return value


def _wanted(kind: Any, value: object) -> str:
    """Return an annotation as a person writes it, and what was there instead."""
    if typing.get_origin(kind) is typing.Literal:
        legal = list(map(str, typing.get_args(kind)))
        near = _nearest(value, legal).rstrip()
        return f"one of {', '.join(map(repr, legal))}, not {shown(value)}{'; ' if near else ''}{near}"
    args = typing.get_args(kind)
    if (
        typing.get_origin(kind) is tuple
        and typing.get_origin(args[0]) is typing.Literal
        and isinstance(value, tuple)
    ):
        return _wanted(args[0], next((one for one in value if one not in typing.get_args(args[0])), value))
    name = kind.__name__ if isinstance(kind, type) and not typing.get_args(kind) else str(kind)
    return f"{name}, not {shown(value)}"


def _nearest(given: object, legal: list[str]) -> str:
    near = closest(given, legal)
    return "" if near is None else f"did you mean {near!r}? "

"""YAML files and mappings to frozen dataclasses, with errors that name the key.

A config class is a frozen dataclass whose `__post_init__` checks its own values and raises `ConfigError`. YAML
holds values only; which keys exist, their types and their meaning stand in the dataclass.
"""

import dataclasses
import difflib
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import dacite
import yaml

from artiskill.errors import ConfigError

CONFIG_DIR = Path(__file__).parent / "configs"

T = TypeVar("T")


def load_yaml(path: Path) -> dict[str, Any]:
    """Read a YAML mapping.

    Raises:
        ConfigError: the file is missing, is not YAML, or is not a mapping.
    """
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"cannot read config file {str(path)!r}: {error.strerror}") from error
    except yaml.YAMLError as error:
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
    _check_keys(cls, data, source)
    try:
        return dacite.from_dict(
            cls,
            data,
            config=dacite.Config(cast=[tuple], type_hooks={float: _to_float, tuple[float, ...]: _to_floats}),
        )
    except dacite.MissingValueError as error:
        raise ConfigError(f"{source}: key {error.field_path!r} is missing") from error
    except dacite.WrongTypeError as error:
        wanted = getattr(error.field_type, "__name__", str(error.field_type))
        raise ConfigError(f"{source}: {error.field_path!r} must be {wanted}, not {error.value!r}") from error
    except dacite.DaciteError as error:
        raise ConfigError(f"{source}: {error}") from error
    except ConfigError as error:
        raise ConfigError(f"{source}: {error}") from error
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{source}: a value has the wrong type: {error}") from error


def load_config(cls: type[T], path: Path, overrides: Mapping[str, Any] | None = None) -> T:
    """Read `cls` from a YAML file, then apply overrides such as `{"physics.timestep_s": 0.001}`."""
    return from_mapping(cls, merge_overrides(load_yaml(path), overrides or {}), source=path.name)


def merge_overrides(data: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """A copy of `data` in which each dotted key, or nested mapping, of `overrides` has its new value."""
    merged = dict(data)
    for key, value in overrides.items():
        head, _, rest = str(key).partition(".")
        if rest:
            value = {rest: value}
        old = merged.get(head)
        if isinstance(value, Mapping) and isinstance(old, Mapping):
            value = merge_overrides(old, value)
        elif isinstance(value, Mapping):
            value = merge_overrides({}, value)
        merged[head] = value
    return merged


def to_mapping(config: Any) -> Any:
    """The plain values (dicts, lists, numbers, strings) of a config, ready for YAML or JSON."""
    if dataclasses.is_dataclass(config) and not isinstance(config, type):
        return {f.name: to_mapping(getattr(config, f.name)) for f in dataclasses.fields(config)}
    if isinstance(config, Mapping):
        return {str(k): to_mapping(v) for k, v in config.items()}
    if isinstance(config, list | tuple):
        return [to_mapping(v) for v in config]
    return config


def dump_yaml(config: Any) -> str:
    """The resolved config as YAML text, keys in the order of the dataclass."""
    return yaml.safe_dump(to_mapping(config), sort_keys=False, width=110)


def check(condition: bool, message: str) -> None:
    """Raise `ConfigError(message)` unless `condition` holds: one line for a `__post_init__` check."""
    if not condition:
        raise ConfigError(message)


def _check_keys(cls: Any, data: Any, where: str) -> None:
    """Raise ConfigError at the first key, at any depth, that no dataclass field bears."""
    if dataclasses.is_dataclass(cls):
        _check_dataclass_keys(cls, data, where)
        return
    origin, arguments = typing.get_origin(cls), typing.get_args(cls)
    if origin in (typing.Union, types.UnionType):
        for option in arguments:
            if dataclasses.is_dataclass(option) and isinstance(data, Mapping):
                _check_keys(option, data, where)
    elif origin in (tuple, list) and isinstance(data, list | tuple):
        for i, item in enumerate(data):
            _check_keys(arguments[0], item, f"{where}[{i}]")
    elif origin is dict and isinstance(data, Mapping):
        for key, item in data.items():
            _check_keys(arguments[1], item, f"{where}: {key}")


def _check_dataclass_keys(cls: Any, data: Any, where: str) -> None:
    if not isinstance(data, Mapping):
        raise ConfigError(f"{where} must be a mapping of keys to values, not {data!r}")
    hints = typing.get_type_hints(cls)
    legal = [f.name for f in dataclasses.fields(cls)]
    for key, value in data.items():
        if key not in legal:
            near = difflib.get_close_matches(str(key), legal, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise ConfigError(f"{where}: unknown key {key!r}; {hint}Legal: {', '.join(legal)}.")
        _check_keys(hints[key], value, f"{where}: {key}")


def _to_float(value: Any) -> Any:
    """Integers are legal where floats are; PyYAML reads `1e-3` as text, which is legal too."""
    if isinstance(value, bool):
        raise ConfigError(f"a number was expected, not {value!r}")
    if isinstance(value, int | str):
        try:
            return float(value)
        except ValueError as error:
            raise ConfigError(f"a number was expected, not {value!r}") from error
    return value


def _to_floats(values: Any) -> Any:
    return tuple(_to_float(v) for v in values) if isinstance(values, list | tuple) else values

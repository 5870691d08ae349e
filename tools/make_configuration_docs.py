"""Make docs/data/configuration.csv anew: `python tools/make_configuration_docs.py`.

With `--check` it changes nothing and fails if the table is not that of the code. Meanings come from the
docstrings of the configuration classes, defaults from the tasks' YAML files.
"""

import csv
import dataclasses
import inspect
import re
import sys
import types
import typing
from collections.abc import Iterator, Mapping
from io import StringIO
from pathlib import Path
from typing import Any

from artiskill.robots.arm_config import ShapeConfig
from artiskill.robots.config import MountConfig
from artiskill.sensors.render_config import LampConfig
from artiskill.tasks.registry import make_task, task_names

PAGE = Path(__file__).resolve().parents[1] / "docs" / "data" / "configuration.csv"
HEAD = ["key", "tasks", "type", "unit", "default", "meaning"]
# lists: a prefix for the keys of an entry, and its class
ENTRIES = {"robot.mounts[].": MountConfig, "collisions[].": ShapeConfig, "render.lamps[].": LampConfig}
# endings of names, longer ones first
_UNITS = {
    **{"_kg_m3": "kg/m³", "_kgm2": "kg m²", "_m_s2": "m/s²", "_rad_s": "rad/s", "_m_s": "m/s", "_nm": "N m"},
    **{"_rad": "rad", "_deg": "°", "_hz": "Hz", "_kg": "kg", "_px": "px", "_steps": "steps"},
    **{"_m": "m", "_s": "s", "_n": "N", "_w": "m"},
}
_WORDS = {float: "number", int: "whole number", str: "text", bool: "true, false"}


@dataclasses.dataclass(frozen=True)
class Key:
    """One value that can be set: its dotted path, and what the table says of it."""

    path: str
    kind: str
    unit: str
    default: Any
    meaning: str


def main(arguments: list[str]) -> int:
    """Write, or compare; return the exit status."""
    new = table_text()
    if "--check" in arguments:
        is_new = PAGE.exists() and PAGE.read_text(encoding="utf-8") == new
        print(f"docs/data/{PAGE.name} is {'up to date' if is_new else 'old: run this tool'}")
        return int(not is_new)
    PAGE.write_text(new, encoding="utf-8")
    print(f"{PAGE}: {len(new.splitlines())} lines")
    return 0


def table_text() -> str:
    """Return the whole table as CSV."""
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEAD)
    writer.writerows(rows())
    return text.getvalue()


def rows() -> Iterator[list[str]]:
    """Yield a row per key: those of every task, those of single tasks, then those of entries of lists."""
    configs = {name: make_task(name).config for name in task_names()}
    tables = {name: {key.path: key for key in keys_of(type(config), config)} for name, config in configs.items()}
    paths = sorted(
        dict.fromkeys(path for keys in tables.values() for path in keys),
        key=lambda path: -sum(path in keys for keys in tables.values()),
    )
    for path in paths:
        having = {task: keys[path] for task, keys in tables.items() if path in keys}
        key = next(iter(having.values()))
        tasks = "all" if len(having) == len(tables) else ", ".join(having)
        defaults = {task: _shown(one.default) for task, one in having.items()}
        yield [path, tasks, key.kind, key.unit, _merged(defaults), key.meaning]
    for prefix, cls in ENTRIES.items():
        for key in keys_of(cls, None):
            yield [f"{prefix}{key.path}", "all", key.kind, key.unit, _shown(key.default), key.meaning]


def keys_of(cls: Any, config: Any, prefix: str = "") -> Iterator[Key]:
    """All keys of a configuration class, depth first, with the values of `config`, or else the class's own."""
    hints, meanings = typing.get_type_hints(cls), meanings_of(cls)
    for field in dataclasses.fields(cls):
        path, kind = f"{prefix}{field.name}", hints[field.name]
        default = field.default if config is None else getattr(config, field.name)
        default = None if default is dataclasses.MISSING else default
        if dataclasses.is_dataclass(kind):
            if prefix:
                yield Key(path, "section", "", None, meanings[field.name])
            yield from keys_of(kind, default, f"{path}.")
            continue
        bracket, meaning = re.fullmatch(r"(?:\[(.*?)\] )?(.*)", meanings[field.name]).groups()
        yield Key(path, _kind(kind), bracket or _unit(field.name), default, meaning)


def meanings_of(cls: type) -> dict[str, str]:
    """Field -> what the `Attributes:` of the class's docstring, and of its bases' docstrings, say.

    Raises:
        KeyError: they say nothing of a field.
    """
    said: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        _, _, section = (inspect.cleandoc(base.__dict__.get("__doc__") or "")).partition("Attributes:\n")
        for name, text in re.findall(r"^    (\w+): (.*(?:\n {8,}.*)*)", section, re.MULTILINE):
            said[name] = " ".join(text.split())
    silent = [field.name for field in dataclasses.fields(cls) if not said.get(field.name)]
    if silent:
        raise KeyError(f"the docstring of {cls.__name__} says nothing of {', '.join(silent)}")
    return said


def _kind(kind: Any) -> str:
    """A type as a person says it."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Literal:
        return ", ".join(str(value) for value in arguments)
    if origin in (typing.Union, types.UnionType):
        return " or ".join("nothing" if one is types.NoneType else _kind(one) for one in arguments)
    if origin is tuple:
        is_open = arguments[1:] == (...,)
        if dataclasses.is_dataclass(arguments[0]):
            return "list"
        return "numbers" if is_open else f"{len(arguments)} numbers"
    if origin is not None:
        return "numbers by name"
    return _WORDS[kind]


def _unit(name: str) -> str:
    return next((unit for ending, unit in _UNITS.items() if name.endswith(ending)), "")


def _shown(value: Any) -> str:
    """A default as it stands in a table; None is no default."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_shown(one)}" for name, one in value.items())
    if isinstance(value, tuple):
        entries = [one for one in value if dataclasses.is_dataclass(one)]
        return f"{len(entries)} of them" if entries else f"[{', '.join(map(_shown, value))}]"
    return str(value)


def _merged(defaults: Mapping[str, str]) -> str:
    """The default that most tasks have, then the tasks that have another one."""
    values = list(defaults.values())
    if len(values) > 2 and len(set(values)) == len(values):
        return "each task's own"
    usual = max(dict.fromkeys(values), key=values.count)
    others = [f"{task}: {value}" for task, value in defaults.items() if value != usual]
    return "; ".join([usual, *others])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

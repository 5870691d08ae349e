"""Make the tables of docs/configuration.md anew: `python tools/make_configuration_docs.py`.

With `--check` it changes nothing and fails if the page's tables are not those of the code. Meanings come from the
docstrings of the configuration classes, defaults from the tasks' YAML files.
"""

import dataclasses
import inspect
import re
import sys
import types
import typing
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from artiskill.gallery.tables import markdown
from artiskill.robots.arm_config import ShapeConfig
from artiskill.robots.config import MountConfig
from artiskill.sensors.render_config import LampConfig
from artiskill.tasks.registry import make_task, task_names
from artiskill.tasks.task import TaskConfig

PAGE = Path(__file__).resolve().parents[1] / "docs" / "configuration.md"
BEGIN, END = "<!-- made by tools/make_configuration_docs.py -->", "<!-- end of what was made -->"
HEAD = ["key", "type", "unit", "default", "meaning"]
# what stands in lists: a heading, and the class of one entry
ENTRIES = {
    "An entry of `robot.mounts`": MountConfig,
    "An entry of `collisions`": ShapeConfig,
    "An entry of `render.lamps`": LampConfig,
}
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
    """Write, or compare; the exit status."""
    page = PAGE.read_text(encoding="utf-8")
    before, _, rest = page.partition(BEGIN)
    new = f"{before}{BEGIN}\n\n{made_part()}\n\n{END}{rest.partition(END)[2]}"
    if "--check" in arguments:
        print(
            "docs/configuration.md is up to date" if new == page else "docs/configuration.md is old: run this tool"
        )
        return int(new != page)
    PAGE.write_text(new, encoding="utf-8")
    print(f"{PAGE}: {len(new.splitlines())} lines")
    return 0


def made_part() -> str:
    """All tables with their headings."""
    configs = {name: make_task(name).config for name in task_names()}
    tables = {name: {key.path: key for key in keys_of(type(config), config)} for name, config in configs.items()}
    shared = [field.name for field in dataclasses.fields(TaskConfig)]
    pieces = ["## Every task"]
    plain = [name for name in shared if not dataclasses.is_dataclass(getattr(next(iter(configs.values())), name))]
    pieces.append(table(tables, lambda path: path in plain))
    for section in (name for name in shared if name not in plain):
        about = summary_of(typing.get_type_hints(TaskConfig)[section])
        pieces += [f"### `{section}`", about, table(tables, lambda path, top=section: path.startswith(top + "."))]
    for title, cls in ENTRIES.items():
        pieces += [f"### {title}", entry_table(cls)]
    for cls in dict.fromkeys(map(type, configs.values())):
        own = {name: tables[name] for name, config in configs.items() if type(config) is cls}
        pieces += [f"## {' and '.join(own)}", table(own, lambda path: path.split(".")[0] not in shared)]
    return "\n\n".join(pieces)


def table(tables: Mapping[str, Mapping[str, Key]], wanted: Any) -> str:
    """Those keys of some tasks whose path is wanted, with the defaults of all of them."""
    first = next(iter(tables.values()))
    rows = []
    for path, key in first.items():
        if wanted(path):
            defaults = {task: _shown(keys[path].default) for task, keys in tables.items()}
            rows.append([f"`{path}`", key.kind, key.unit, _merged(defaults), key.meaning])
    return markdown(HEAD, rows)


def entry_table(cls: Any) -> str:
    """The keys of an entry of a list; its defaults are those of the class."""
    rows = [[f"`{key.path}`", key.kind, key.unit, _shown(key.default), key.meaning] for key in keys_of(cls, None)]
    return markdown(HEAD, rows)


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


def summary_of(cls: type) -> str:
    """The first paragraph of a class's docstring."""
    return " ".join(inspect.cleandoc(cls.__doc__ or "").split("\n\n")[0].split())


def _kind(kind: Any) -> str:
    """A type as a person says it."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Literal:
        return ", ".join(f"`{value}`" for value in arguments)
    if origin in (typing.Union, types.UnionType):
        return " or ".join("nothing" if one is types.NoneType else _kind(one) for one in arguments)
    if origin is tuple:
        is_open = arguments[1:] == (...,)
        if dataclasses.is_dataclass(arguments[0]):
            return "list, see below"
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
        return ", ".join(f"`{name}` {_shown(one)}" for name, one in value.items())
    if isinstance(value, tuple):
        entries = [one for one in value if dataclasses.is_dataclass(one)]
        return f"{len(entries)} of them" if entries else f"[{', '.join(map(_shown, value))}]"
    return f"`{value}`" if isinstance(value, str) else str(value)


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

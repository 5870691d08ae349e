"""All tasks by name: those of this package, and those that users register from packages of their own."""

import dataclasses
import json
import os
import re
import sys
import typing
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from artiskill.assets.articulated_object import CATEGORIES, Category, JointKind
from artiskill.assets.needs import TASK_NEEDS, Needs
from artiskill.errors import ConfigError, check_name, shown

if TYPE_CHECKING:  # importing it would bring the engine in
    from artiskill.tasks.task import Task

# Worker processes inherit it: the tasks of other packages, as JSON.
INHERITED = "ARTISKILL_TASKS"
# sections of a task's configuration that change what is seen, and nothing of what happens
SEEN_SECTIONS = ("cameras", "render", "state")
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9]*")
_REFERENCE = re.compile(r"\w+(\.\w+)*:\w+")
# keys of its configuration that make a task the one of its name: no override may hold them
_NAME_KEYS = ("name", "motion")
_HINT = "(a task of another package is registered when that is imported; on the command line, name it module:Task)"


@dataclasses.dataclass(frozen=True)
class TaskSpec:
    """What is known of a task before it is made: names only, so that registering stays light."""

    name: str  # as in environment ids: letters and digits
    category: Category  # of its objects
    entry_point: str  # `module:function` that makes the task from its configuration
    config_file: str  # path of the YAML file
    motion: JointKind | None = None  # of the target link; None where the task opens none
    expert: str | None = None  # `module:Class`, see `experts.registry.Expert`
    variation_file: str | None = None  # path of the YAML file of `experts.variation.VariationConfig`

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not _NAME.fullmatch(self.name):
            raise ConfigError(f"a task's name is letters and digits, such as TurnChair; not {shown(self.name)}")
        check_name("category", self.category, CATEGORIES)
        if self.motion is not None:
            check_name("motion", self.motion, typing.get_args(JointKind))
        for key in ("entry_point", "expert"):
            value = getattr(self, key)
            if value is not None and not (isinstance(value, str) and _REFERENCE.fullmatch(value)):
                raise ConfigError(f"task {self.name}: {key} must be 'module:name', not {shown(value)}")
        for key in ("config_file", "variation_file"):
            value = getattr(self, key)
            if value is not None and not Path(value).is_file():
                raise ConfigError(f"task {self.name}: {key}: there is no file {str(value)!r}")


_TASKS: dict[str, TaskSpec] = {}


def task_names() -> tuple[str, ...]:
    """Return the names of all tasks."""
    return tuple(_TASKS)


def task_spec(name: str) -> TaskSpec:
    """Return what is registered of a task.

    Raises:
        UnknownNameError: there is no such task.
    """
    if isinstance(name, str) and name not in _TASKS:
        add_inherited_tasks()
    check_name("task", name, _TASKS, _HINT)
    return _TASKS[name]


def add_task(spec: TaskSpec) -> None:
    """Make a task known by its name; adding the same one again changes nothing.

    Raises:
        ConfigError: another task has this name.
    """
    if (known := _TASKS.get(spec.name, spec)) != spec:
        raise ConfigError(f"there is a task {spec.name!r} already, of {known.entry_point}; choose another name")
    _TASKS[spec.name] = spec
    TASK_NEEDS[spec.name] = Needs(spec.name, spec.category, spec.motion)


def bequeath_task(spec: TaskSpec) -> None:
    """Let worker processes that this one starts know a task."""
    specs = json.loads(os.environ.get(INHERITED, "{}")) | {spec.name: dataclasses.asdict(spec)}
    os.environ[INHERITED] = json.dumps(specs)


def add_inherited_tasks() -> list[TaskSpec]:
    """Add the tasks that a parent process knew, and return them."""
    specs = [TaskSpec(**values) for values in json.loads(os.environ.get(INHERITED, "{}")).values()]
    for spec in specs:
        add_task(spec)
    return specs


def load_task(reference: str) -> str:
    """Return the name in a task's name or `module:Name`; the module is imported, which registers the task.

    Raises:
        ConfigError: the module cannot be imported.
        UnknownNameError: it registers no such task.
    """
    module, _, name = reference.rpartition(":")
    if module:
        if os.getcwd() not in sys.path:  # as `python -m` has it, and other programs that are given a module
            sys.path.insert(0, os.getcwd())
        _imported(module, f"task {reference!r}")
        check_name("task", name, _TASKS, f"(importing {module!r} registers no such task)")
    return name


def as_overrides(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return all values of a resolved configuration, as `make_task` takes them."""
    return {key: value for key, value in config.items() if key not in _NAME_KEYS}


def make_task(name: str, overrides: Mapping[str, Any] | None = None) -> "Task":
    """Assemble a task from its YAML.

    Args:
        name: one of `task_names()`.
        overrides: values to change, keys dotted or nested: `{"physics.timestep_s": 0.001}`.

    Raises:
        UnknownNameError: there is no such task or robot.
        ConfigError: an override is unknown or illegal, or the task cannot be imported.
    """
    spec = task_spec(name)
    if overrides is not None and not isinstance(overrides, Mapping):
        raise ConfigError(f"config must be a mapping of keys to values, not {shown(overrides)}")
    for key in [name for name in _NAME_KEYS if name in (overrides or {})]:
        raise ConfigError(
            f"{key!r} is what makes {name} this task and cannot be changed; make another task instead"
        )
    make = load_reference(spec.entry_point, f"task {name}")
    hints = [kind for key, kind in typing.get_type_hints(make).items() if key != "return"]
    tasks = import_module("artiskill.tasks.task")
    if len(hints) != 1 or not issubclass(hints[0], tasks.TaskConfig):
        raise ConfigError(f"task {name}: {spec.entry_point} must take one argument, annotated with its TaskConfig")
    task: Task = make(tasks.load_task_config(hints[0], Path(spec.config_file), overrides))
    if not isinstance(task, tasks.Task):
        raise ConfigError(f"task {name}: {spec.entry_point} must return a Task, not {shown(task)}")
    if task.name != name:
        raise ConfigError(f"task {name}: its configuration has another name, {task.name!r}, in {spec.config_file}")
    return task


def load_reference(reference: str, owner: str) -> Callable[..., Any]:
    """Return what `module:name` refers to.

    Args:
        reference: `module:name`.
        owner: what it belongs to, for messages.

    Raises:
        ConfigError: there is no such module, or no such name in it.
    """
    module_name, _, name = reference.partition(":")
    module = _imported(module_name, owner)
    if not hasattr(module, name):
        raise ConfigError(f"{owner}: module {module_name!r} has no {name!r}")
    found: Callable[..., Any] = getattr(module, name)
    return found


def _imported(module: str, owner: str) -> Any:
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{module}.".startswith(f"{error.name}."):
            raise  # the module exists, but misses another one
        raise ConfigError(f"{owner}: there is no module {module!r}") from error

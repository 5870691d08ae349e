"""All tasks by name: which configuration class and which `make` function belong to a name."""

from collections.abc import Callable, Mapping
from typing import Any

from artiskill.config import CONFIG_DIR, load_config
from artiskill.errors import UnknownNameError
from artiskill.tasks.open_cabinet import OpenCabinetConfig, make_open_cabinet
from artiskill.tasks.task import Task

# name -> (file stem of its YAML, configuration class, assembly)
_TASKS: dict[str, tuple[str, type[Any], Callable[[Any], Task]]] = {
    "OpenCabinetDrawer": ("open_cabinet_drawer", OpenCabinetConfig, make_open_cabinet),
}


def task_names() -> tuple[str, ...]:
    """Names of all tasks."""
    return tuple(_TASKS)


def make_task(name: str, overrides: Mapping[str, Any] | None = None) -> Task:
    """Assemble a task from its YAML.

    Args:
        name: one of `task_names()`.
        overrides: values to change, keys dotted or nested: `{"physics.timestep_s": 0.001}`.

    Raises:
        UnknownNameError: there is no such task.
        ConfigError: an override is unknown or illegal.
    """
    if name not in _TASKS:
        raise UnknownNameError("task", name, _TASKS)
    stem, config_class, make = _TASKS[name]
    return make(load_config(config_class, CONFIG_DIR / "tasks" / f"{stem}.yaml", overrides))

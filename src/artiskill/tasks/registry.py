"""All tasks by name: which configuration class and which `make` function belong to a name."""

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

from artiskill.config import CONFIG_DIR
from artiskill.errors import ConfigError, check_name, shown

if TYPE_CHECKING:  # importing it would bring the engine in
    from artiskill.tasks.task import Task

# name -> (file stem of its YAML, module, configuration class, assembly); imported when the task is made, because
# importing the package registers all names and should stay light
_CABINET = ("artiskill.tasks.open_cabinet", "OpenCabinetConfig", "make_open_cabinet")
_TASKS = {
    "OpenCabinetDoor": ("open_cabinet_door", *_CABINET),
    "OpenCabinetDrawer": ("open_cabinet_drawer", *_CABINET),
    "PushChair": ("push_chair", "artiskill.tasks.push_chair", "PushChairConfig", "make_push_chair"),
    "MoveBucket": ("move_bucket", "artiskill.tasks.move_bucket", "MoveBucketConfig", "make_move_bucket"),
}
# keys that make a task the one of this name
_FIXED = {"name", "motion"}


def task_names() -> tuple[str, ...]:
    """Names of all tasks."""
    return tuple(_TASKS)


def make_task(name: str, overrides: Mapping[str, Any] | None = None) -> "Task":
    """Assemble a task from its YAML.

    Args:
        name: one of `task_names()`.
        overrides: values to change, keys dotted or nested: `{"physics.timestep_s": 0.001}`.

    Raises:
        UnknownNameError: there is no such task or robot.
        ConfigError: an override is unknown or illegal.
    """
    check_name("task", name, _TASKS)
    if overrides is not None and not isinstance(overrides, Mapping):
        raise ConfigError(f"config must be a mapping of keys to values, not {shown(overrides)}")
    for key in _FIXED & set(overrides or {}):
        raise ConfigError(
            f"{key!r} is what makes {name} this task and cannot be changed; make another task instead"
        )
    stem, module_name, config_class, make = _TASKS[name]
    module, configs = import_module(module_name), import_module("artiskill.tasks.task")
    config_file = CONFIG_DIR / "tasks" / f"{stem}.yaml"
    config = configs.load_task_config(getattr(module, config_class), config_file, overrides)
    task: Task = getattr(module, make)(config)
    return task

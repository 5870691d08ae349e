"""Registering tasks: their names, and their environments' ids with Gymnasium.

These are `ArtiSkill/<Task>-v0`, `ArtiSkill/<Task>_<object>-v0` and `ArtiSkill/<Task>_<object>_link_<k>-v0`.
"""

import warnings
from dataclasses import asdict
from importlib.metadata import entry_points
from pathlib import Path

import gymnasium as gym

from artiskill.assets.articulated_object import Category, JointKind
from artiskill.assets.catalog import list_objects, read_catalog
from artiskill.config import CONFIG_DIR, check
from artiskill.tasks.registry import (
    TaskSpec,
    add_inherited_tasks,
    add_task,
    bequeath_task,
    task_names,
    task_spec,
)

NAMESPACE = "ArtiSkill"
ENTRY_POINT_GROUP = "artiskill.tasks"
_ENTRY_POINT = "artiskill.envs.manipulation:ManipulationEnv"
_VECTOR_ENTRY_POINT = "artiskill.envs.vector_env:ManipulationVectorEnv"
_OWN_TASKS: tuple[tuple[str, str, str, Category, JointKind | None], ...] = (
    # name, YAML, module, category, motion
    ("OpenCabinetDoor", "open_cabinet_door.yaml", "open_cabinet", "cabinet", "revolute"),
    ("OpenCabinetDrawer", "open_cabinet_drawer.yaml", "open_cabinet", "cabinet", "prismatic"),
    ("PushChair", "push_chair.yaml", "push_chair", "chair", None),
    ("MoveBucket", "move_bucket.yaml", "move_bucket", "bucket", None),
)


def register_task(
    name: str,
    *,
    config_file: str | Path,
    like: str | None = None,
    category: Category | None = None,
    entry_point: str | None = None,
    motion: JointKind | None = None,
    expert: str | None = None,
    variation_file: str | Path | None = None,
) -> None:
    """Register a task: for `gym.make`, `ManipulationEnv`, evaluation, collection and the command line.

    Nothing is imported before the task is used. Registering the same task again changes nothing.

    Args:
        name: letters and digits, `TurnChair`; its environment is then `ArtiSkill/TurnChair-v0`.
        config_file: the YAML file with the configuration's values.
        like: the name of a registered task, which gives what is not given below. The YAML file has a key `like` of
            its own, for its values.
        category: of its objects: `cabinet`, `chair` or `bucket`.
        entry_point: `module:function`. The function takes the task's configuration, annotated with its class (a
            subclass of `TaskConfig`), and returns the `Task`.
        motion: how the target link moves, `prismatic` or `revolute`, if the task opens one; objects without such
            a link are refused.
        expert: `module:Class` of the task's expert, if there is one; the class takes robot and configuration.
        variation_file: the YAML file with what varies between the expert's demonstrations.

    Raises:
        UnknownNameError: there is no such task, category or motion.
        ConfigError: category or entry point is missing, another task has this name, a name is illegal, or a file
            does not exist.
    """
    inherited = {} if like is None else asdict(task_spec(like))
    given = {
        "category": category,
        "entry_point": entry_point,
        "motion": motion,
        "expert": expert,
        "variation_file": None if variation_file is None else str(Path(variation_file).resolve()),
    }
    values = inherited | {key: value for key, value in given.items() if value is not None}
    for key in ("category", "entry_point"):
        check(key in values, f"task {name}: give {key}=, or the task that it is like=: {', '.join(task_names())}")
    spec = TaskSpec(**values | {"name": name, "config_file": str(Path(config_file).resolve())})
    add_task(spec)
    if CONFIG_DIR not in Path(spec.config_file).parents:  # workers know the tasks of this package anyway
        bequeath_task(spec)
    _register_envs(spec)


def register_all() -> None:
    """Register the tasks of this package, those of the parent process, and those of installed packages.

    A package announces its tasks by an entry point of the group `artiskill.tasks`: a module that registers them
    when it is imported, or a function that does so when it is called.
    """
    for name, file, module, category, motion in _OWN_TASKS:
        register_task(
            name,
            category=category,
            entry_point=f"artiskill.tasks.{module}:make_{module}",
            config_file=CONFIG_DIR / "tasks" / file,
            motion=motion,
            expert=f"artiskill.experts.{module}:{module.title().replace('_', '')}Expert",
            variation_file=CONFIG_DIR / "experts" / "variation" / file,
        )
    for spec in add_inherited_tasks():
        _register_envs(spec)
    for entry in entry_points(group=ENTRY_POINT_GROUP):
        try:
            loaded = entry.load()
            if callable(loaded):
                loaded()
        except Exception as error:  # of any kind: what is installed beside must not keep this package from working
            warnings.warn(f"the tasks of {entry.value!r} could not be registered: {error}", stacklevel=2)


def _register_envs(spec: TaskSpec) -> None:
    """Register a task's environments: of any object, of each of the catalogue, and of each target link."""
    _register(spec.name, {"task": spec.name})
    for object_id in (*list_objects(task=spec.name), *list_objects(split="ood", task=spec.name)):
        kwargs = {"task": spec.name, "objects": object_id}
        _register(f"{spec.name}_{object_id}", kwargs)
        for link in () if spec.motion is None else read_catalog()[object_id][1].targets(spec.motion):
            _register(f"{spec.name}_{object_id}_{link}", kwargs | {"target": link})


def _register(name: str, kwargs: dict[str, str]) -> None:
    env_id = f"{NAMESPACE}/{name}-v0"
    if env_id not in gym.registry:
        gym.register(id=env_id, entry_point=_ENTRY_POINT, vector_entry_point=_VECTOR_ENTRY_POINT, kwargs=kwargs)

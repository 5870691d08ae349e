"""What is to be collected, checked before the first step is simulated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object, resolve_objects
from artiskill.assets.identity import checked_hash
from artiskill.demos.config import DemosConfig, load_demos_config
from artiskill.demos.settings import CONTROLLER, ExpertInfo, Settings, mapping_hash, plain, task_hash
from artiskill.demos.streams import Stream, make_streams
from artiskill.envs.control import CONTROL_MODES, JOINT
from artiskill.envs.manipulation import ObjectChoice
from artiskill.errors import ConfigError, UnknownNameError, check_name
from artiskill.experts.registry import make_expert
from artiskill.tasks.levels import MAX_LEVEL, check_level
from artiskill.tasks.registry import make_task
from artiskill.tasks.task import Task
from artiskill.versions import versions


@dataclass(frozen=True, eq=False)
class ObjectPlan:
    """One object to demonstrate with.

    Attributes:
        item: its id, or the object itself where no id leads to it.
        id: of the object.
        content_hash: of the object.
        targets: all that the task can be done with.
        chosen: those that are demonstrated.
    """

    item: str | ArticulatedObject
    id: str
    content_hash: str
    targets: tuple[str, ...]
    chosen: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Plan:
    """A collection that is ready to run.

    Attributes:
        settings: of all its files.
        objects: to demonstrate with.
        flag_names: of the task.
        block_levels: attempts that a worker makes at a stretch.
    """

    settings: Settings
    objects: tuple[ObjectPlan, ...]
    flag_names: tuple[str, ...]
    block_levels: int

    def streams(self, one: ObjectPlan) -> list[Stream]:
        """The levels to try for an object."""
        settings = self.settings
        return make_streams(one.targets, one.chosen, settings.per_object, settings.first_level, settings.patience)


def make_plan(
    task: str,
    objects: ObjectChoice = "train",
    per_object: int = 300,
    *,
    targets: Sequence[str] | None = None,
    control_mode: str = JOINT,
    first_level: int = 0,
    keep_failures: bool = False,
    config: Mapping[str, Any] | None = None,
    demos_config: DemosConfig | None = None,
) -> Plan:
    """Check everything that can be checked beforehand.

    Args:
        task: name of the task.
        objects: a split, an id, a list of ids, or `ArticulatedObject`s.
        per_object: successful trajectories of each; its targets share them evenly.
        targets: only these links; every object must have one of them.
        control_mode: of the stored actions.
        first_level: of each object.
        keep_failures: store failed attempts, too.
        config: values of the task's YAML to change.
        demos_config: how demonstrations are stored and when a target is given up; by default the package's.

    Raises:
        UnknownNameError: an unknown task, object, split, target link or control mode.
        ConfigError: an illegal number, or an unknown or illegal configuration value.
        AssetError: an object that the task cannot use, or that differs from the catalogue's of that id.
        PolicyError: the task has no expert.
    """
    made, demos_config = make_task(task, config), demos_config or load_demos_config()
    check_name("control mode", control_mode, CONTROL_MODES)
    if isinstance(per_object, bool) or not isinstance(per_object, int) or not 1 <= per_object <= MAX_LEVEL:
        raise ConfigError(f"the trajectories per object must be a whole number of at least 1, not {per_object!r}")
    expert = make_expert(task, made.robot)
    settings = Settings(
        task=task,
        control_mode=control_mode,
        per_object=per_object,
        first_level=check_level(first_level),
        targets=None if targets is None else tuple(targets),
        keep_failures=keep_failures,
        config=plain(made.config),
        config_hash=task_hash(made),
        expert=ExpertInfo(type(expert).__name__, CONTROLLER, mapping_hash(plain(expert.config))),
        store=demos_config.store,
        patience=demos_config.patience,
        versions=versions(),
    )
    found = tuple(_plan_object(made, item, settings.targets) for item in resolve_objects(objects, task=task))
    return Plan(settings, found, made.flag_names, demos_config.block_levels)


def _plan_object(task: Task, item: str | ArticulatedObject, wanted: tuple[str, ...] | None) -> ObjectPlan:
    obj = load_object(item) if isinstance(item, str) else item
    targets = task.targets(obj)
    chosen = targets if wanted is None else tuple(name for name in targets if name in wanted)
    if not chosen:
        raise UnknownNameError(
            "target link", ", ".join(wanted or ()), targets, f"(object {obj.id!r}, {task.name})"
        )
    return ObjectPlan(item, obj.id, checked_hash(item), targets, chosen)

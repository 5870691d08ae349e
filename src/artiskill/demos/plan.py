"""What is to be collected, checked before the first step is simulated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import checked_hash, load_object, resolve_objects
from artiskill.config import check
from artiskill.demos.config import DemosConfig, load_demos_config
from artiskill.demos.settings import CONTROLLER, ExpertInfo, Settings, mapping_hash, plain, task_hash
from artiskill.demos.streams import Stream, make_streams
from artiskill.envs.control import CONTROL_MODES, JOINT
from artiskill.envs.manipulation import ObjectChoice
from artiskill.errors import ConfigError, UnknownNameError, check_name, shown
from artiskill.experts.registry import make_expert
from artiskill.experts.variation import load_variation, varied
from artiskill.tasks.levels import MAX_LEVEL, check_level
from artiskill.tasks.registry import make_task
from artiskill.tasks.task import Task
from artiskill.versions import versions

PER_OBJECT = 300  # as many as the paper has


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

    def wanted(self, one: ObjectPlan) -> int:
        """Successful trajectories of an object."""
        settings = self.settings
        return settings.per_object or (settings.per_target or 0) * len(one.chosen)

    def streams(self, one: ObjectPlan) -> list[Stream]:
        """The levels to try for an object."""
        settings = self.settings
        return make_streams(one.targets, one.chosen, self.wanted(one), settings.first_level, settings.patience)


def make_plan(
    task: str,
    objects: ObjectChoice = "train",
    per_object: int | None = None,
    *,
    per_target: int | None = None,
    targets: Sequence[str] | None = None,
    control_mode: str = JOINT,
    first_level: int = 0,
    keep_failures: bool = False,
    variety: bool = True,
    config: Mapping[str, Any] | None = None,
    demos_config: DemosConfig | None = None,
) -> Plan:
    """Check everything that can be checked beforehand.

    Args:
        task: name of the task.
        objects: a split, an id, a list of ids, or `ArticulatedObject`s.
        per_object: successful trajectories of each, which its targets share evenly; 300 unless either is given.
        per_target: successful trajectories of each target.
        targets: only these links, in whatever order; every object must have one of them.
        control_mode: of the stored actions.
        first_level: of each object.
        keep_failures: store failed attempts, too.
        variety: let the expert's manner differ from episode to episode, and disturb it now and then.
        config: values of the task's YAML to change.
        demos_config: how demonstrations are stored and when a target is given up; by default the package's.

    Raises:
        UnknownNameError: an unknown task, object, split, target link or control mode.
        ConfigError: an illegal number, or an unknown or illegal configuration value.
        AssetError: an object that the task cannot use, or that differs from the catalogue's of that id.
        PolicyError: the task has no expert.
    """
    if per_object is not None and per_target is not None:
        raise ConfigError("trajectories are wanted per object or per target, not both")
    for name, given in (("keep_failures", keep_failures), ("variety", variety)):
        check(isinstance(given, bool), f"{name} must be True or False, not {shown(given)}")
    made, demos_config = make_task(task, config), demos_config or load_demos_config()
    check_name("control mode", control_mode, CONTROL_MODES)
    if per_object is None and per_target is None:
        per_object = PER_OBJECT
    settings = Settings(
        task=task,
        control_mode=control_mode,
        per_object=_count(per_object, "object"),
        per_target=_count(per_target, "target"),
        first_level=check_level(first_level),
        targets=_links(targets),
        keep_failures=keep_failures,
        variety=variety,
        config=plain(made.config),
        config_hash=task_hash(made),
        expert=_expert_info(made, variety),
        store=demos_config.store,
        patience=demos_config.patience,
        versions=versions(),
    )
    found = tuple(_plan_object(made, item, settings.targets) for item in resolve_objects(objects, task=task))
    _check_targets(settings, found)
    plan = Plan(settings, found, made.flag_names, demos_config.block_levels)
    _check_levels(plan)
    return plan


def _check_targets(settings: Settings, objects: Sequence[ObjectPlan]) -> None:
    """See whether some object has each of the wanted targets."""
    legal = dict.fromkeys(name for one in objects for name in one.targets)
    for name in settings.targets or ():
        if name not in legal:
            raise UnknownNameError("target link", name, legal, f"(no object has it, {settings.task})")


def _check_levels(plan: Plan) -> None:
    """See whether there are as many levels as trajectories are wanted."""
    for one in plan.objects:
        for stream in plan.streams(one):
            if stream.level(stream.wanted - 1) > MAX_LEVEL:
                raise ConfigError(
                    f"{stream.wanted} trajectories of {one.id!r}, {stream.target}, need the levels "
                    f"{stream.level(0)} to {stream.level(stream.wanted - 1)}; the last one is {MAX_LEVEL}: "
                    "begin with a lower first level, or want fewer"
                )


def _count(wanted: int | None, of: str) -> int | None:
    """How many trajectories, checked."""
    if wanted is None:
        return None
    is_legal = isinstance(wanted, int) and not isinstance(wanted, bool) and 1 <= wanted <= MAX_LEVEL
    check(is_legal, f"the trajectories per {of} must be a whole number from 1 to {MAX_LEVEL}, not {shown(wanted)}")
    return wanted


def _links(targets: Sequence[str] | None) -> tuple[str, ...] | None:
    """Names of links, checked; in one order, for it means nothing."""
    if targets is None:
        return None
    is_legal = not isinstance(targets, str) and bool(targets) and all(isinstance(name, str) for name in targets)
    check(is_legal, f"targets must be a list of names of links, ['link_0'] say, not {shown(targets)}")
    return tuple(sorted(set(targets)))


def _expert_info(task: Task, variety: bool) -> ExpertInfo:
    expert = make_expert(task.name, task.robot)
    values: dict[str, Any] = {"expert": plain(expert.config), "variation": None}
    if variety:
        variation = load_variation(task.name)
        varied(expert.config, variation.ranges, np.random.default_rng(0))  # a wrong key is an error now, not later
        # values are drawn in the ranges' order
        values |= {"variation": plain(variation), "order": list(variation.ranges)}
    return ExpertInfo(type(expert).__name__, CONTROLLER, mapping_hash(values))


def _plan_object(task: Task, item: str | ArticulatedObject, wanted: tuple[str, ...] | None) -> ObjectPlan:
    obj = load_object(item) if isinstance(item, str) else item
    targets = task.targets(obj)
    chosen = targets if wanted is None else tuple(name for name in targets if name in wanted)
    if not chosen:
        raise UnknownNameError(
            "target link", ", ".join(wanted or ()), targets, f"(object {obj.id!r}, {task.name})"
        )
    return ObjectPlan(item, obj.id, checked_hash(item), targets, chosen)

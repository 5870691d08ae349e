"""What is to be collected, checked before the first step is simulated; and which levels are tried for it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import checked_hash, object_of, resolve_objects
from artiskill.config import check
from artiskill.demos.settings import (
    CONTROLLER,
    LEARNER,
    Agent,
    DemosConfig,
    ExpertInfo,
    GiveUpConfig,
    Settings,
    load_demos_config,
    mapping_hash,
    plain,
    task_hash,
)
from artiskill.envs.control import CONTROL_MODES, JOINT
from artiskill.envs.manipulation import ObjectChoice
from artiskill.errors import ConfigError, UnknownNameError, check_name, shown
from artiskill.experts.registry import make_expert
from artiskill.experts.variation import load_variation, varied
from artiskill.tasks.levels import FIRST_DEMONSTRATED, MAX_LEVEL, check_level
from artiskill.tasks.registry import make_task
from artiskill.tasks.task import Task
from artiskill.versions import versions

PER_OBJECT = 300  # as many as the paper has


@dataclass(frozen=True, kw_only=True)
class CollectionOptions:
    """How an expert demonstrates, and how much; see `make_plan`."""

    # successful trajectories of each object, shared evenly by its targets; 300 unless this or `per_target` is
    # given
    per_object: int | None = None
    per_target: int | None = None  # successful trajectories of each target
    targets: Sequence[str] | None = None  # only these links, in any order; every object must have one of them
    control_mode: str = JOINT  # of the stored actions
    first_level: int = FIRST_DEMONSTRATED  # of each object
    keep_failures: bool = False  # store failed attempts, too
    variety: bool = True  # let the expert's style differ from episode to episode, and disturb it now and then
    agent: Agent | None = None  # who demonstrates instead of the expert

    def __post_init__(self) -> None:
        if self.per_object is not None and self.per_target is not None:
            raise ConfigError("trajectories are wanted per object or per target, not both")
        for name in ("keep_failures", "variety"):
            given = getattr(self, name)
            check(isinstance(given, bool), f"{name} must be True or False, not {shown(given)}")
        check_name("control mode", self.control_mode, CONTROL_MODES)
        for kind, count in (("object", self.per_object), ("target", self.per_target)):
            is_legal = isinstance(count, int) and not isinstance(count, bool) and 1 <= count <= MAX_LEVEL
            rule = f"must be a whole number from 1 to {MAX_LEVEL}"
            check(count is None or is_legal, f"the trajectories per {kind} {rule}, not {shown(count)}")
        check_level(self.first_level)
        names = self.targets
        if names is not None:
            is_legal = not isinstance(names, str) and bool(names) and all(isinstance(name, str) for name in names)
            check(is_legal, f"targets must be a list of names of links, ['link_0'] say, not {shown(names)}")


@dataclass
class LevelQueue:
    """The levels to try for one target of one object, and what came of them; no simulation.

    Target number k of n legal ones has the levels first + k, first + k + n, first + k + 2 n, ...: no two targets
    of an object start from the same state. The first `wanted` successes in this order count, so that it does not
    matter which worker makes which attempt when. There are never more levels in progress than successes missing.
    So no attempt is in vain unless the target is given up, and every level before the last success is tried.
    """

    target: str  # link
    first: int  # its first level
    stride: int  # between its levels
    wanted: int  # successes
    patience: GiveUpConfig  # when the target is given up
    outcomes: dict[int, bool] = field(default_factory=dict)  # level -> success, of those that were tried
    in_progress: set[int] = field(default_factory=set)  # levels that workers are trying

    def level(self, number: int) -> int:
        """Return the level that is tried as the `number`-th, from 0."""
        return self.first + number * self.stride

    def owns(self, level: int) -> bool:
        """Return whether a level is one of this target's."""
        return level >= self.first and (level - self.first) % self.stride == 0

    def take(self, most: int) -> tuple[int, ...]:
        """Return levels to try next; none if those in progress may be enough."""
        if self.end is not None:
            return ()
        missing = self.wanted - self.successes - len(self.in_progress)
        levels: list[int] = []
        number = 0
        while len(levels) < min(most, missing) and (level := self.level(number)) <= MAX_LEVEL:
            if level not in self.outcomes and level not in self.in_progress:
                levels.append(level)
            number += 1
        self.in_progress.update(levels)
        return tuple(levels)

    def add_result(self, level: int, success: bool) -> None:
        """Note what came of a level."""
        self.in_progress.discard(level)
        self.outcomes[level] = success

    @property
    def successes(self) -> int:
        """Successes so far, in any order."""
        return sum(self.outcomes.values())

    @property
    def end(self) -> int | None:
        """How many attempts count, in the levels' order; None if that is not known yet.

        A target that runs out of levels is given up.
        """
        successes = attempts = 0
        while successes < self.wanted and not self.patience.gives_up(attempts, successes):
            if self.level(attempts) > MAX_LEVEL:
                break
            success = self.outcomes.get(self.level(attempts))
            if success is None:
                return None
            attempts, successes = attempts + 1, successes + success
        return attempts

    @property
    def levels(self) -> tuple[int, ...]:
        """The levels that count, in order, of a queue that has come to its end."""
        assert self.end is not None
        return tuple(self.level(number) for number in range(self.end))


@dataclass(frozen=True, eq=False)
class ObjectPlan:
    """One object to demonstrate with."""

    item: str | ArticulatedObject  # its id, or the object itself where no id leads to it
    id: str  # of the object
    content_hash: str  # of the object
    targets: tuple[str, ...]  # all that the task can be done with; they decide which target has which levels
    chosen: tuple[str, ...]  # those that are demonstrated, in the same order


@dataclass(frozen=True, eq=False)
class CollectionPlan:
    """A collection that is ready to run."""

    settings: Settings  # of all its files
    objects: tuple[ObjectPlan, ...]  # to demonstrate with
    flag_names: tuple[str, ...]  # of the task
    block_levels: int  # attempts in one job of a worker
    agent: Agent | None = None  # who demonstrates instead of the expert

    def wanted(self, one: ObjectPlan) -> int:
        """Return how many successful trajectories are wanted of an object."""
        settings = self.settings
        return settings.per_object or (settings.per_target or 0) * len(one.chosen)

    def queues(self, one: ObjectPlan) -> list[LevelQueue]:
        """Return the levels to try for an object, a queue per target.

        The targets share the trajectories evenly; the first ones take what is left over.
        """
        first_level, patience = self.settings.first_level, self.settings.patience
        share, left = divmod(self.wanted(one), len(one.chosen))
        return [
            LevelQueue(name, first_level + one.targets.index(name), len(one.targets), share + (k < left), patience)
            for k, name in enumerate(one.chosen)
        ]


def make_plan(
    task: str,
    objects: ObjectChoice = "train",
    options: CollectionOptions | None = None,
    *,
    config: Mapping[str, Any] | None = None,
    demos_config: DemosConfig | None = None,
) -> CollectionPlan:
    """Return the plan of a collection; everything that can be checked beforehand is checked here.

    Args:
        task: name of the task.
        objects: a split, an id, a list of ids, or `ArticulatedObject`s.
        options: how the task is demonstrated, and how often.
        config: values of the task's YAML to change.
        demos_config: how demonstrations are stored and when a target is given up; by default the package's.

    Raises:
        UnknownNameError: an unknown task, object, split or target link.
        ConfigError: an unknown or illegal configuration value, or more trajectories than there are levels.
        AssetError: an object that the task cannot use, or that differs from the catalogue's of that id.
        PolicyError: the task has no expert.
    """
    options, demos_config = options or CollectionOptions(), demos_config or load_demos_config()
    made = make_task(task, config)
    settings = _make_settings(made, options, demos_config)
    found = tuple(_plan_object(made, item, settings.targets) for item in resolve_objects(objects, task=task))
    legal = dict.fromkeys(name for one in found for name in one.targets)
    for name in settings.targets or ():
        check_name("target link", name, legal, f"(no object has it, {task})")
    plan = CollectionPlan(settings, found, made.flag_names, demos_config.block_levels, options.agent)
    _check_levels(plan)
    return plan


def _make_settings(task: Task, options: CollectionOptions, demos_config: DemosConfig) -> Settings:
    is_default = options.per_object is None and options.per_target is None
    targets = None if options.targets is None else tuple(sorted(set(options.targets)))  # their order means nothing
    return Settings(
        task=task.name,
        control_mode=options.control_mode,
        per_object=PER_OBJECT if is_default else options.per_object,
        per_target=options.per_target,
        first_level=options.first_level,
        targets=targets,
        keep_failures=options.keep_failures,
        variety=options.variety and options.agent is None,
        config=plain(task.config),
        config_hash=task_hash(task),
        expert=_expert_info(task, options),
        store=demos_config.store,
        patience=demos_config.patience,
        versions=versions(),
    )


def _expert_info(task: Task, options: CollectionOptions) -> ExpertInfo:
    if options.agent is not None:
        return ExpertInfo(options.agent.name, LEARNER, options.agent.digest[:16])
    expert = make_expert(task.name, task.robot)
    values: dict[str, Any] = {"expert": plain(expert.config), "variation": None}
    if options.variety:
        variation = load_variation(task.name)
        varied(expert.config, variation.ranges, np.random.default_rng(0))  # a wrong key is an error now, not later
        # values are drawn in the ranges' order
        values |= {"variation": plain(variation), "order": list(variation.ranges)}
    return ExpertInfo(type(expert).__name__, CONTROLLER, mapping_hash(values))


def _plan_object(task: Task, item: str | ArticulatedObject, wanted: tuple[str, ...] | None) -> ObjectPlan:
    obj = object_of(item)
    targets = task.targets(obj)
    chosen = targets if wanted is None else tuple(name for name in targets if name in wanted)
    if not chosen:
        hint = f"(object {obj.id!r}, {task.name})"
        raise UnknownNameError("target link", ", ".join(wanted or ()), targets, hint)
    return ObjectPlan(item, obj.id, checked_hash(item), targets, chosen)


def _check_levels(plan: CollectionPlan) -> None:
    """Raise `ConfigError` if there are fewer levels than trajectories are wanted."""
    for one in plan.objects:
        for queue in plan.queues(one):
            wanted, first, last = queue.wanted, queue.level(0), queue.level(queue.wanted - 1)
            if last > MAX_LEVEL:
                raise ConfigError(
                    f"{wanted} trajectories of {one.id!r}, {queue.target}, need the levels {first} to {last}; "
                    f"the last one is {MAX_LEVEL}: begin with a lower first level, or want fewer"
                )

"""`TrainConfig`: all values of a training run: the package's YAML files, options laid over them, then `--set`.

Importing this imports no torch. Which values an algorithm has says its own file, which `ALGORITHMS` leads to;
here they are a mapping.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import checked_hash, object_id_of, read_catalog, resolve_objects
from artiskill.assets.names import is_path, is_split_file, parse_generated, partnet_id
from artiskill.assets.scaling import original_id
from artiskill.config import (
    CONFIG_DIR,
    check,
    check_positive,
    check_value,
    differing,
    from_layers,
    from_mapping,
    load_yaml,
    merge_overrides,
    to_mapping,
)
from artiskill.errors import ConfigError, RunError, check_name
from artiskill.learning.network_config import KINEMATIC, NETWORKS, NetworkConfig, load_network_config
from artiskill.learning.run import CONFIG, FROM_STATE
from artiskill.tasks.levels import check_level
from artiskill.tasks.point_shares import point_shares
from artiskill.tasks.registry import make_task, task_spec

# name -> module:class; the class has `Config`, see `artiskill.learning.algorithm`
ALGORITHMS = {
    "bc": "artiskill.learning.bc:BC",
    "bcq": "artiskill.learning.bcq:BCQ",
    "td3bc": "artiskill.learning.td3bc:TD3BC",
    "dagger": "artiskill.learning.dagger:DAgger",
    "command_bc": "artiskill.learning.command_bc:CommandBC",
}
INTERACTIVE = ("dagger",)  # these learn from rollouts, all others from demonstrations
OF_COMMANDS = ("dagger", "command_bc")  # these learn commands, all others actions
MEASURED_SPLITS = ("test", "ood")  # what results are about: nothing is chosen by it

_FOLDER = CONFIG_DIR / "learning"
_SHARED = "train"
# seeds of generated objects, far from those that people train on; of these cabinets 10 have drawers and 17 doors
DEVELOPMENT_SEEDS = {"cabinet": "1000000..1000023", "chair": "1000000..1000011", "bucket": "1000000..1000011"}
_MOST_STEPS = 10**9
_MOST_NAMED = 5  # differences
ROLLOUT_SEEDS = {"cabinet": "0..599", "chair": "0..199", "bucket": "0..199"}
# what experts do otherwise when they teach. How far a joint goes is not seen, so a student that stops
# where the expert would may stop too early: it goes on, and the joint's limit stops it. And a student that has
# rolled its hand the wrong way takes the grasp that is nearest then. How wide a round seat is hardly shows, so a
# student that looks for its narrowest side turns to and fro before it
_TEACHING: Mapping[str, dict[str, Any]] = {
    "artiskill.experts.open_cabinet:OpenCabinetExpert": {"overshoot": 10.0, "grasp": {"roll_weight": 0.3}},
    "artiskill.experts.push_chair:PushChairExpert": {"seat": {"width_weight": 3.0}},
}
_AT_ORIGIN = ("chair", "bucket")  # whose goal is the world's origin


@dataclass(frozen=True)
class DevelopmentConfig:
    """Objects on which success is measured during training: the best checkpoint is chosen by it."""

    objects: tuple[str, ...]  # as `resolve_objects` takes them, never of a split that is measured; none: do not
    episodes: int  # on each object
    first_level: int  # of each object; far from those that are collected or evaluated
    every: int  # steps

    def __post_init__(self) -> None:
        check_positive(self, "episodes", "every")
        check_level(self.first_level)
        check_level(self.first_level + self.episodes - 1)
        given = sorted(set(self.objects) & {*MEASURED_SPLITS, "all"})
        check(not given, _refusal(f"{given[0]!r} is such a split" if given else ""))


@dataclass(frozen=True)
class TrainConfig:
    """All values of a training run; the same values and data give the same weights, bit for bit on a CPU."""

    task: str
    name: str  # of the algorithm
    steps: int
    batch_size: int  # of all processes together
    seed: int  # of initial weights, of what batches hold, and of noise
    precision: Literal["float32", "bfloat16"]  # of forward passes; weights are float32
    schedule: Literal["constant", "cosine"]  # of learning rates: to 0 in `steps` steps, by a cosine, or not
    ema: float  # act by weights that follow those that are trained, by 1 - ema in each step; 0: by the trained
    log_every: int  # steps
    checkpoint_every: int  # steps
    network: NetworkConfig
    algorithm: dict[str, Any]  # values of the algorithm, see its file
    development: DevelopmentConfig

    def __post_init__(self) -> None:
        check_name("algorithm", self.name, ALGORITHMS)
        task_spec(self.task)
        check_value(self, "steps", 1 <= self.steps <= _MOST_STEPS, f"must lie in [1, {_MOST_STEPS}]")
        check_positive(self, "batch_size", "log_every", "checkpoint_every")
        check_value(self, "seed", 0 <= self.seed < 2**32, "must lie in [0, 2^32)")
        check_value(self, "ema", 0 <= self.ema < 1, "must lie in [0, 1)")
        knows = self.name in OF_COMMANDS or not self.network.input.body
        check(knows, f"network.input.body is for {', '.join(OF_COMMANDS)}, not for {self.name}")

    def check_continues(self, other: "TrainConfig", folder: Path) -> None:
        """Raise `RunError` if a run with these values cannot go on with other ones.

        More steps are all that may change, unless learning rates or rounds depend on the number of steps. Values
        that a version before had not are as they are by default.
        """
        ours, theirs = to_mapping(_resolved(self)), to_mapping(other)
        if self.schedule == "constant" and self.name not in INTERACTIVE:  # whose rounds are shares of the steps
            theirs["steps"] = min(ours["steps"], theirs["steps"])
        check_same_values(ours, theirs, folder)


def check_same_values(ours: Mapping[str, Any], theirs: Mapping[str, Any], folder: Path) -> None:
    """Raise `RunError` if values differ from those of the run in a folder."""
    found = differing(ours, theirs)
    if found:
        more = [f"and {len(found) - _MOST_NAMED} more"] if len(found) > _MOST_NAMED else []
        raise RunError(
            f"{str(folder)!r} holds a run of other values ({'; '.join(found[:_MOST_NAMED] + more)}); "
            "choose another folder, or the values of before"
        )


def load_train_config(
    name: str,
    task: str,
    network: str | None = None,
    overrides: Mapping[str, Any] | None = None,
) -> TrainConfig:
    """Return the values of a run: of the package's files, what they say of the task, and others laid over them.

    Args:
        name: of the algorithm, one of `ALGORITHMS`.
        task: name of the task.
        network: one of `NETWORKS`, or `kinematic` with `OF_COMMANDS`; None for `small`, or the latter.
        overrides: dotted keys and other values, `{"algorithm.learning_rate": 1e-3}`.

    Raises:
        UnknownNameError: no such algorithm, task or network.
        ConfigError: an unknown key or an illegal value.
    """
    check_name("algorithm", name, (*ALGORITHMS, *FROM_STATE))
    network = network or (KINEMATIC if name in OF_COMMANDS else NETWORKS[0])
    check_name("network", network, (*NETWORKS, *[KINEMATIC] * (name in OF_COMMANDS)))
    spec = task_spec(task)
    values = file_values((_SHARED, name), task)
    own = to_mapping(load_network_config(network, values.get("network")))
    values |= {"task": task, "name": name, "network": own}
    if values["development"]["objects"] is None:
        values["development"]["objects"] = (f"generated:{spec.category}:{DEVELOPMENT_SEEDS[spec.category]}",)
    seen = values["network"]["input"]
    seen["origin"] = seen["body"] and spec.category in _AT_ORIGIN
    if name in INTERACTIVE:
        own = merge_overrides({"algorithm": {"objects": None, "expert": None}}, overrides or {})["algorithm"]
        if isinstance(own, dict):  # else refused below
            if own["objects"] is not None:  # the task's share is of the objects that it has by default
                values["algorithm"]["generated_share"] = None
            if own["expert"] == {}:
                values["algorithm"]["expert"] = {}  # no other values than those that it acts with
        _fill_rollouts(values["algorithm"], task, spec.category)
    config = from_layers(TrainConfig, lambda given: merge_overrides(values, given), overrides, f"{name}.yaml")
    return _resolved(config)


def teaching_values(task: str) -> dict[str, Any]:
    """Return the values of a task's expert that differ from its own where it teaches, see docs/experts.md.

    Raises:
        UnknownNameError: there is no such task.
    """
    return dict(_TEACHING.get(task_spec(task).expert or "", {}))


def file_values(names: Iterable[str], task: str) -> dict[str, Any]:
    """Return the values of the package's files, each laid over those before, then what they say of a task."""
    files = [load_yaml(_FOLDER / f"{name}.yaml") for name in names]
    of_task = [file.pop("tasks", {}).get(task, {}) for file in files]
    values: dict[str, Any] = {}
    for layer in (*files, *of_task):
        values = merge_overrides(values, layer)
    return values


def read_train_config(folder: Path) -> TrainConfig:
    """Read the resolved configuration of a run.

    Raises:
        RunError: it is missing or damaged.
    """
    try:
        return from_mapping(TrainConfig, load_yaml(folder / CONFIG), str(folder / CONFIG))
    except ConfigError as error:
        raise RunError(str(error)) from error


def algorithm_class(name: str) -> Any:
    """Return the class of an algorithm; this imports torch.

    Raises:
        ConfigError: it learns commands, for which the engine's packages are needed, and one is missing.
    """
    module, _, kind = ALGORITHMS[name].partition(":")
    try:
        return getattr(import_module(module), kind)
    except ImportError as error:
        if name not in OF_COMMANDS or error.name == "torch":
            raise
        raise ConfigError(f"{name} needs {error.name}, which is not installed here") from error


def algorithm_config(config: TrainConfig) -> Any:
    """Return the values of the algorithm, as its class takes them; this imports torch.

    Raises:
        ConfigError: an unknown key or an illegal value.
    """
    return from_mapping(algorithm_class(config.name).Config, config.algorithm, "algorithm")


def check_development(config: TrainConfig) -> list[str | ArticulatedObject]:
    """Return the development objects.

    Raises:
        UnknownNameError, AssetError: an object that does not exist, or that cannot be used.
        ConfigError: one is of a split that is measured.
    """
    if not config.development.objects:
        return []
    found = resolve_objects(list(config.development.objects), task=config.task)
    check_not_measured(found)
    return list(found)


def check_not_measured(objects: Iterable[str | ArticulatedObject]) -> None:
    """Raise `ConfigError` if an object is of a split that is measured, or such a one of another size."""
    found = next(measured_among(objects), "")
    check(not found, _refusal(found))


def measured_among(objects: Iterable[str | ArticulatedObject]) -> Iterator[str]:
    """Yield a few words about each object that is of a split that is measured, of whatever size."""
    catalog = read_catalog()
    for name in map(original_id, objects):
        if name in catalog and catalog[name][1].split in MEASURED_SPLITS:
            yield f"{name!r} is of {catalog[name][1].split!r}"


def objects_by_id(ids: Sequence[str], given: Sequence[str], task: str) -> dict[str, str | ArticulatedObject]:
    """Return what environments take for each id of the `given` names: whole objects of imported ones, else ids."""
    imported = [name for name in given if is_path(name) or is_split_file(name) or partnet_id(name) is not None]
    found = resolve_objects(imported, task=task) if imported else ()
    whole = {one.id: one for one in found if isinstance(one, ArticulatedObject)}
    return {name: whole.get(name, name) for name in ids}


def hash_of(items: Iterable[str | ArticulatedObject]) -> str:
    """Return a digest of objects: of catalogue and generated ones, whose names say what they are, the ids.

    Raises:
        AssetError: an imported object has the id of another one of the catalogue.
    """
    items = list(items)
    parts = [object_id_of(one) for one in items]
    parts += [checked_hash(one) for one in items if isinstance(one, ArticulatedObject)]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def kinds_of(objects: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the ids that are not of generated objects, and those that are."""
    kinds: tuple[list[str], list[str]] = ([], [])
    for name in objects:
        kinds[parse_generated(name) is not None].append(name)
    return kinds


def _fill_rollouts(algorithm: dict[str, Any], task: str, category: str) -> None:
    """Fill in what depends on the task: objects, expert, shares of points."""
    if algorithm["objects"] is None:
        algorithm["objects"] = ("train", f"generated:{category}:{ROLLOUT_SEEDS[category]}")
    if algorithm["expert"] is None:
        algorithm["expert"] = teaching_values(task)
    if algorithm["shares"] is None:
        algorithm["shares"] = point_shares(task, make_task(task).mask_names)


def _refusal(reason: str) -> str:
    splits = " and ".join(MEASURED_SPLITS)
    return (
        f"neither what is trained on nor what chooses the checkpoint may be of {splits}, by which results are "
        f"measured: {reason}; legal are generated:<category>:<seeds>, objects of train, and imported ones"
    )


def _resolved(config: TrainConfig) -> TrainConfig:
    """Return the same with all values of the algorithm, checked."""
    values = to_mapping(algorithm_config(config))
    if "expert" in values:  # its dotted keys, those of runs of a version before, too, nested
        values["expert"] = merge_overrides({}, values["expert"])
    return replace(config, algorithm=values)

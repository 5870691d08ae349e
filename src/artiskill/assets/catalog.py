"""The catalogue: names of objects, their splits, and how a name becomes an `ArticulatedObject`.

Which objects exist stands in `configs/catalog/<category>.yaml`: an id, the seed that it is generated from, its
split, its target links and the hash of its content. Beside the catalogue, `generated:<seed>` is a fresh
cabinet.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, JointKind
from artiskill.config import CONFIG_DIR, check, load_config
from artiskill.errors import AssetError, UnknownNameError

CATALOG_DIR = CONFIG_DIR / "catalog"
CATEGORIES = ("cabinet",)
SPLITS = ("train", "test")
ALL = "all"
# Tasks whose targets are the links that move by one kind of joint.
TASK_MOTIONS: dict[str, JointKind] = {"OpenCabinetDrawer": "prismatic", "OpenCabinetDoor": "revolute"}
GENERATED = "generated"
PARTNET = "partnet"
_CACHED_OBJECTS = 128
_HINT = "Also legal: 'generated:<seed>', 'partnet:<id>' and a path to a PartNet-Mobility folder or zip."


@dataclass(frozen=True)
class CatalogEntry:
    """One object of the catalogue.

    Attributes:
        id: its name.
        seed: from which it is generated.
        split: `train` or `test`.
        drawers: links that slide and carry a handle.
        doors: links that turn and carry a handle.
        content_hash: `ArticulatedObject.content_hash` of the object as it was when the catalogue was made.
    """

    id: str
    seed: int
    split: str
    drawers: tuple[str, ...]
    doors: tuple[str, ...]
    content_hash: str

    def __post_init__(self) -> None:
        check(self.split in SPLITS, f"{self.id}: split must be one of {', '.join(SPLITS)}, not {self.split!r}")

    def targets(self, motion: JointKind) -> tuple[str, ...]:
        """The links that are legal targets."""
        return self.drawers if motion == "prismatic" else self.doors


@dataclass(frozen=True)
class CatalogFile:
    """The objects of one category."""

    category: str
    objects: tuple[CatalogEntry, ...]


@cache
def read_catalog() -> dict[str, tuple[str, CatalogEntry]]:
    """All entries by id, each with its category."""
    entries: dict[str, tuple[str, CatalogEntry]] = {}
    for category in CATEGORIES:
        for entry in load_config(CatalogFile, CATALOG_DIR / f"{category}.yaml").objects:
            entries[entry.id] = (category, entry)
    return entries


def list_objects(category: str | None = None, split: str | None = None, task: str | None = None) -> list[str]:
    """Ids of the catalogue, in its order.

    Args:
        category: only this category.
        split: only `train` or only `test`; None or `all` for both.
        task: only objects with at least one target for this task.

    Raises:
        UnknownNameError: no such category, split or task.
    """
    if category is not None and category not in CATEGORIES:
        raise UnknownNameError("category", category, CATEGORIES)
    if split not in (None, ALL, *SPLITS):
        raise UnknownNameError("split", split, (*SPLITS, ALL))
    motion = None if task is None else task_motion(task)
    return [
        entry.id
        for kind, entry in read_catalog().values()
        if (category is None or kind == category)
        and (split in (None, ALL) or entry.split == split)
        and (motion is None or entry.targets(motion))
    ]


def task_motion(task: str) -> JointKind:
    """The joint kind of a task's targets; a versioned environment id such as `OpenCabinetDoor-v0` is legal too.

    Raises:
        UnknownNameError: no such task.
    """
    name = task.split("/")[-1].split("-v")[0]
    if name not in TASK_MOTIONS:
        raise UnknownNameError("task", task, TASK_MOTIONS)
    return TASK_MOTIONS[name]


def load_object(object_id: str) -> ArticulatedObject:
    """The object of a catalogue id, of `generated:<seed>` (or `generated-<seed>`, its id), or of a PartNet name.

    Objects are kept in a bounded cache of the process: they are read-only.

    Raises:
        UnknownNameError: nothing bears this name.
        AssetError: a PartNet folder is missing or unusable.
    """
    if _is_partnet(object_id):
        return _import_partnet(object_id)
    seed = _generated_seed(object_id)
    if seed is not None:
        return _generate("cabinet", seed, f"{GENERATED}-{seed}")
    if object_id not in read_catalog():
        raise UnknownNameError("object", object_id, read_catalog(), _HINT)
    category, entry = read_catalog()[object_id]
    return _generate(category, entry.seed, entry.id)


def resolve_objects(
    objects: str | Path | ArticulatedObject | Sequence[str | Path | ArticulatedObject], task: str | None = None
) -> tuple[str | ArticulatedObject, ...]:
    """What a user may pass as `objects`, as a tuple of ids for `load_object` and of ready objects.

    Args:
        objects: a split (`train`, `test`, `all`), an id, `generated:<seed>`, `partnet:<id>`, a path to a
            PartNet-Mobility folder or zip, an `ArticulatedObject`, or a sequence of these.
        task: of a split, only the objects with a target for this task are taken; any other object must have one.

    Returns:
        Catalogue and generated objects as ids, which are cheap until loaded; imported and given ones as objects.

    Raises:
        UnknownNameError: a name that is none of these.
        AssetError: an empty sequence, an object named twice or without a target, or an unusable PartNet folder.
    """
    motion = None if task is None else task_motion(task)
    if isinstance(objects, str) and objects in (ALL, *SPLITS):
        return tuple(list_objects(split=objects, task=task))
    given = (objects,) if isinstance(objects, str | Path | ArticulatedObject) else tuple(objects)
    resolved: list[str | ArticulatedObject] = []
    for item in given:
        if isinstance(item, str) and item in (ALL, *SPLITS):
            resolved += list_objects(split=item, task=task)
        else:
            resolved.append(_resolve_one(item, motion))
    _check_resolved(resolved)
    return tuple(resolved)


def object_id_of(item: str | ArticulatedObject) -> str:
    """The id of an element of `resolve_objects`' result."""
    return item if isinstance(item, str) else item.id


def _resolve_one(item: object, motion: JointKind | None) -> str | ArticulatedObject:
    if isinstance(item, ArticulatedObject):
        found, name = item, item.id
    elif isinstance(item, str | Path):
        name = str(item)
        if name in read_catalog():  # known without building it
            if motion is not None and not read_catalog()[name][1].targets(motion):
                raise _no_target(name, motion)
            return name
        found = load_object(name)
    else:
        raise AssetError(f"objects must be names or ArticulatedObjects, not {type(item).__name__}: {item!r}")
    if motion is not None and not found.target_links(motion):
        raise _no_target(name, motion)
    return found.id if isinstance(item, str) and _generated_seed(name) is not None else found


def _no_target(name: str, motion: JointKind) -> AssetError:
    task = next(t for t, m in TASK_MOTIONS.items() if m == motion)
    what = "drawer" if motion == "prismatic" else "door"
    return AssetError(
        f"object {name!r} has no {what} with a handle, so {task} has no target; "
        f"{len(list_objects(task=task))} objects of the catalogue have one, {list_objects(task=task)[0]!r} say"
    )


def _check_resolved(resolved: list[str | ArticulatedObject]) -> None:
    if not resolved:
        raise AssetError("objects must name at least one object")
    names = [object_id_of(item) for item in resolved]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise AssetError(f"objects name {', '.join(twice)} more than once")


def _generated_seed(name: str) -> int | None:
    """The seed of `generated:<seed>` or `generated-<seed>`, else None."""
    for separator in (":", "-"):
        prefix = GENERATED + separator
        if name.startswith(prefix):
            digits = name[len(prefix) :]
            if not (digits.isascii() and digits.isdigit()):
                hint = "The seed is a whole number of at least 0."
                raise UnknownNameError("object", name, (f"{GENERATED}:<seed>",), hint)
            return int(digits)
    return None


def _is_partnet(name: str) -> bool:
    return (
        name.startswith(f"{PARTNET}:")
        or "/" in name
        or "\\" in name
        or name.endswith(".zip")
        or Path(name).is_dir()
    )


def _import_partnet(name: str) -> ArticulatedObject:
    from artiskill.assets.partnet.importer import find_partnet_folder, import_partnet

    prefix = f"{PARTNET}:"
    return import_partnet(find_partnet_folder(name[len(prefix) :]) if name.startswith(prefix) else Path(name))


@lru_cache(maxsize=_CACHED_OBJECTS)
def _generate(category: str, seed: int, object_id: str) -> ArticulatedObject:
    return _GENERATORS[category](seed, object_id)


def generate_cabinet(seed: int, object_id: str) -> ArticulatedObject:
    """The cabinet of a seed, with the default config."""
    # here, not above: listing the catalogue, which importing the package does, needs no generator
    from artiskill.assets.cabinets import build_cabinet, default_cabinet_config, sample_cabinet

    form, detail = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(2))
    return build_cabinet(sample_cabinet(form, default_cabinet_config()), object_id, detail)


_GENERATORS: dict[str, Callable[[int, str], ArticulatedObject]] = {"cabinet": generate_cabinet}

"""The catalogue: names of objects, their splits, and how a name becomes an `ArticulatedObject`.

Which objects exist stands in `configs/catalog/<category>.yaml`: an id, the seed that it is generated from, its
split, its target links and the hash of its content. Beside the catalogue, `generated:<seed>` is a fresh
cabinet.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, JointKind
from artiskill.assets.names import GENERATED, UnknownObjectError, generated_seed, is_path, partnet_id
from artiskill.assets.needs import TASK_NEEDS, MovingLink, Needs
from artiskill.config import CONFIG_DIR, check, load_config
from artiskill.errors import AssetError, UnknownNameError

CATALOG_DIR = CONFIG_DIR / "catalog"
CATEGORIES = ("cabinet",)
SPLITS = ("train", "test")
ALL = "all"
TASK_MOTIONS: dict[str, JointKind] = {task: needs.motion for task, needs in TASK_NEEDS.items()}
_CACHED_OBJECTS = 128
_Given = str | Path | ArticulatedObject


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

    def moving_links(self) -> tuple[MovingLink, ...]:
        """The legal targets of any task."""
        kinds: tuple[JointKind, ...] = ("prismatic", "revolute")
        return tuple(MovingLink(name, kind, True) for kind in kinds for name in self.targets(kind))


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
    return _task_needs(task).motion


def load_object(object_id: str | Path) -> ArticulatedObject:
    """The object of a catalogue id, of `generated:<seed>` (or `generated-<seed>`, its id), or of a PartNet name.

    A catalogue id comes first. A text is a path where it holds a separator or ends in `.zip`; write `./name` for
    a folder in the working directory. Generated objects are kept in a bounded cache of the process: they are
    read-only.

    Raises:
        UnknownNameError: nothing bears this name.
        AssetError: not a name, or an empty one, or a PartNet folder that is missing or unusable.
    """
    return _load(object_id, None, ())


def resolve_objects(
    objects: _Given | Sequence[_Given], task: str | None = None
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
        AssetError: none of the legal types, an empty sequence or name, an object named twice, of another category
            than the task's or without a target, or an unusable PartNet folder.
    """
    needs = None if task is None else _task_needs(task)
    if isinstance(objects, _Given):
        objects = (objects,)
    elif not isinstance(objects, Iterable) or isinstance(objects, bytes):
        raise _not_an_object(objects)
    resolved: list[str | ArticulatedObject] = []
    for item in objects:
        if isinstance(item, str) and item in (ALL, *SPLITS):
            resolved += list_objects(split=item, task=task)
        else:
            resolved.append(_resolve_one(item, needs))
    _check_resolved(resolved)
    return tuple(resolved)


def object_id_of(item: str | ArticulatedObject) -> str:
    """The id of an element of `resolve_objects`' result."""
    return item if isinstance(item, str) else item.id


def _resolve_one(item: object, needs: Needs | None) -> str | ArticulatedObject:
    if isinstance(item, str) and item in read_catalog():  # known without building it
        if needs is not None:
            category, entry = read_catalog()[item]
            needs.check_category(item, category)
            needs.check_links(item, entry.moving_links())
        return item
    found = item if isinstance(item, ArticulatedObject) else _load(item, needs, (*SPLITS, ALL))
    if needs is not None:
        needs.check_object(found)
    return found.id if isinstance(item, str) and generated_seed(item) is not None else found


def _load(name: object, needs: Needs | None, splits: tuple[str, ...]) -> ArticulatedObject:
    """The object of a name; `splits` are legal beside it, and `needs` spare work on unusable PartNet objects."""
    if isinstance(name, Path):
        return _import_partnet(name, needs)
    if not isinstance(name, str):
        raise _not_an_object(name)
    if not name.strip():
        raise AssetError(f"an object's name must not be empty: {name!r}")
    if name in read_catalog():
        category, entry = read_catalog()[name]
        return _generate(category, entry.seed, entry.id)
    seed = generated_seed(name)
    if seed is not None:
        return _generate("cabinet", seed, f"{GENERATED}-{seed}")
    if partnet_id(name) is not None or is_path(name):
        return _import_partnet(name, needs)
    if name in (ALL, *SPLITS):
        raise AssetError(f"{name!r} is a split, not one object; list_objects(split={name!r}) names its objects")
    raise UnknownObjectError(name, read_catalog(), splits)


def _not_an_object(given: object) -> AssetError:
    return AssetError(
        "objects must be a split, an object's name, a path, an ArticulatedObject or a sequence of these, "
        f"not {type(given).__name__}: {given!r}"
    )


def _task_needs(task: str) -> Needs:
    name = task.split("/")[-1].split("-v")[0]
    if name not in TASK_NEEDS:
        raise UnknownNameError("task", task, TASK_NEEDS)
    return TASK_NEEDS[name]


def _check_resolved(resolved: list[str | ArticulatedObject]) -> None:
    if not resolved:
        raise AssetError("objects must name at least one object")
    names = [object_id_of(item) for item in resolved]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise AssetError(f"objects name {', '.join(twice)} more than once")


def _import_partnet(name: str | Path, needs: Needs | None) -> ArticulatedObject:
    from artiskill.assets.partnet.importer import find_partnet_folder, import_partnet

    number = partnet_id(name) if isinstance(name, str) else None
    return import_partnet(Path(name) if number is None else find_partnet_folder(number), needs=needs)


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

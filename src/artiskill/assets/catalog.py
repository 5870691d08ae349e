"""Which objects there are, and how a name becomes an `ArticulatedObject`.

`configs/catalog/<category>.yaml` lists the catalogue: an id, a seed, a split and a content hash per object.
Besides, `generated:<category>:<seed>` is a fresh object, and `partnet:<id>` or a path an imported one, or one that
was exported. Fresh objects are drawn from their own random streams, so none of them is in the catalogue.
"""

import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from artiskill.assets.articulated_object import CATEGORIES, ArticulatedObject, Category, JointKind
from artiskill.assets.generators import generate
from artiskill.assets.names import (
    UnknownObjectError,
    generated_id,
    is_path,
    is_split_file,
    parse_generated,
    partnet_id,
    read_split_file,
)
from artiskill.assets.needs import MovingLink, Needs, task_needs
from artiskill.config import CONFIG_DIR, check, load_config
from artiskill.errors import AssetError, check_name, shown

CATALOG_DIR = CONFIG_DIR / "catalog"
BENCHMARK_SPLITS = ("train", "test")
HELD_OUT_SPLIT = "ood"
SPLITS = (*BENCHMARK_SPLITS, HELD_OUT_SPLIT)
ALL = "all"  # the splits of the benchmark
_SPLIT_NAMES = (*SPLITS, ALL)
_Given = str | Path | ArticulatedObject


@dataclass(frozen=True)
class CatalogEntry:
    """One object of the catalogue."""

    id: str  # its name
    seed: int  # from which it is generated
    split: str  # `train`, `test`, or `ood`: of families that neither `train` nor `test` has
    family: str  # kind of cabinet, chair or bucket, as in `<category>_generator.yaml`
    content_hash: str  # `ArticulatedObject.content_hash` of the object as it was when the catalogue was made
    drawers: tuple[str, ...] = ()  # links that slide and carry a handle
    doors: tuple[str, ...] = ()  # links that turn and carry a handle

    def __post_init__(self) -> None:
        check(
            self.split in SPLITS, f"{self.id}: split must be one of {', '.join(SPLITS)}, not {shown(self.split)}"
        )

    @property
    def held_out(self) -> bool:
        """Whether the object is of a held-out family."""
        return self.split == HELD_OUT_SPLIT

    def targets(self, motion: JointKind) -> tuple[str, ...]:
        """Return the links that are legal targets."""
        return self.drawers if motion == "prismatic" else self.doors

    def moving_links(self) -> tuple[MovingLink, ...]:
        """Return the legal targets of all tasks."""
        kinds: tuple[JointKind, ...] = ("prismatic", "revolute")
        return tuple(MovingLink(name, kind, True) for kind in kinds for name in self.targets(kind))


@dataclass(frozen=True)
class CatalogFile:
    """The objects of one category."""

    category: Category
    objects: tuple[CatalogEntry, ...]


@cache
def read_catalog() -> dict[str, tuple[Category, CatalogEntry]]:
    """Read all entries, by id, each with its category."""
    entries: dict[str, tuple[Category, CatalogEntry]] = {}
    for category in CATEGORIES:
        for entry in load_config(CatalogFile, CATALOG_DIR / f"{category}.yaml").objects:
            entries[entry.id] = (category, entry)
    return entries


def list_objects(category: str | None = None, split: str | None = None, task: str | None = None) -> list[str]:
    """Return ids of the catalogue, in its order.

    Args:
        category: only `cabinet`, only `chair` or only `bucket`.
        split: only `train`, `test` or `ood`; None or `all` for the benchmark's own two, `train` and `test`.
        task: only objects that this task can be done with.

    Raises:
        UnknownNameError: no such category, split or task.
    """
    if category is not None:
        check_name("category", category, CATEGORIES)
    if split is not None:
        check_name("split", split, _SPLIT_NAMES)
    splits = BENCHMARK_SPLITS if split in (None, ALL) else (split,)
    needs = None if task is None else task_needs(task)
    return [
        entry.id
        for kind, entry in read_catalog().values()
        if entry.split in splits
        and category in (None, kind)
        and (needs is None or (kind == needs.category and (needs.motion is None or entry.targets(needs.motion))))
    ]


def load_object(object_id: str | Path) -> ArticulatedObject:
    """Return the object of a catalogue id, of `generated:<category>:<seed>`, or of a PartNet name or path.

    A catalogue id comes first. A string is a path if it holds a separator or ends in `.zip`; write `./name` for
    a folder in the working directory. The category of a generated object is `cabinet` where the name has none.
    Generated objects are kept in a bounded cache of the process: they are read-only.

    Raises:
        UnknownNameError: no object has this name.
        AssetError: it is not a name, is empty, names several objects, or is a PartNet folder that is missing or
            unusable.
    """
    return _load(object_id, None, ())


def resolve_objects(
    objects: _Given | Sequence[_Given], task: str | None = None
) -> tuple[str | ArticulatedObject, ...]:
    """Turn what a user may pass as `objects` into ids for `load_object` and ready objects.

    Args:
        objects: a split (`train`, `test`, `ood`, or `all` for the first two), a YAML file with a list of names, an
            id, `generated:<category>:<seed>`, `generated:<category>:<first>..<last>`, `partnet:<id>`, a path to a
            PartNet-Mobility folder or zip, an `ArticulatedObject`, or a sequence of these.
        task: of a split or a range of seeds, only objects that this task can be done with are taken; any other
            object must be one of these. It also sets the category of `generated:<seed>`.

    Returns:
        Ids of catalogue and generated objects, which are cheap until loaded; imported and given ones as objects.

    Raises:
        UnknownNameError: a name that is none of these.
        AssetError: none of the legal types, a set, an empty sequence or name, an object named twice, an object of
            another category than the task's or without a target, or an unusable PartNet folder or split file.
    """
    needs = None if task is None else task_needs(task)
    if isinstance(objects, _Given):
        objects = (objects,)
    elif isinstance(objects, set | frozenset):
        raise AssetError(
            "objects must have an order, for a level draws from it; a set has another one in another process. "
            "Pass sorted(objects), or a list"
        )
    elif not isinstance(objects, Iterable) or isinstance(objects, bytes):
        raise _not_an_object(objects)
    resolved = [one for item in objects for one in _resolve_item(item, needs)]
    _check_resolved(resolved)
    return tuple(resolved)


def is_nameable(name: str) -> bool:
    """Return whether a name is that of a catalogue or generated object, which needs no files."""
    return name in read_catalog() or parse_generated(name) is not None


def object_id_of(item: str | ArticulatedObject) -> str:
    """Return the id of an element of `resolve_objects`' result."""
    return item if isinstance(item, str) else item.id


def object_of(item: str | ArticulatedObject) -> ArticulatedObject:
    """Return the object of an element of `resolve_objects`' result.

    Raises:
        UnknownNameError, AssetError: as `load_object`.
    """
    return load_object(item) if isinstance(item, str) else item


def checked_hash(item: str | ArticulatedObject) -> str:
    """Return an object's content hash; an object with a catalogue id must have the catalogue's hash.

    Args:
        item: an element of `resolve_objects`' result.

    Raises:
        AssetError: it has another hash.
    """
    found = object_of(item)
    given, listed = found.content_hash, read_catalog().get(found.id)
    if listed is not None and listed[1].content_hash != given:
        raise AssetError(
            f"object {found.id!r} has the content hash {given}, but the catalogue's has {listed[1].content_hash}: "
            "its numbers could not be compared with those of others; give your own object another id"
        )
    return given


def _resolve_item(item: object, needs: Needs | None) -> Iterator[str | ArticulatedObject]:
    """Yield the objects that one item of a list means."""
    if isinstance(item, str) and item in _SPLIT_NAMES:
        yield from list_objects(split=item, task=None if needs is None else needs.task)
    elif isinstance(item, str | Path) and is_split_file(str(item)):
        for name in read_split_file(Path(item)):
            yield from _resolve_item(name, needs)
    elif isinstance(item, str) and (found := parse_generated(item, needs.category if needs else "cabinet")):
        yield from _resolve_generated(item, *found, needs)
    else:
        yield _resolve_one(item, needs)


def _resolve_generated(name: str, category: Category, seeds: range, needs: Needs | None) -> Iterator[str]:
    """Yield the single object, or of a range those that the task can be done with."""
    names = [generated_id(category, seed) for seed in seeds]
    if needs is not None and len(names) == 1:
        needs.check_object(load_object(names[0]))
    elif needs is not None:
        needs.check_category(name, category)
        names = [one for one in names if needs.suits(load_object(one))]
        if not names:
            raise AssetError(f"none of the {len(seeds)} objects of {name!r} has a target for {needs.task}")
    yield from names


def _resolve_one(item: object, needs: Needs | None) -> str | ArticulatedObject:
    if isinstance(item, str) and item in read_catalog():  # known without building it
        if needs is not None:
            category, entry = read_catalog()[item]
            needs.check_category(item, category)
            needs.check_links(item, entry.moving_links())
        return item
    found = item if isinstance(item, ArticulatedObject) else _load(item, needs, _SPLIT_NAMES)
    if needs is not None:
        needs.check_object(found)
    return item if isinstance(item, str) and parse_generated(item) is not None else found


def _load(name: object, needs: Needs | None, splits: tuple[str, ...]) -> ArticulatedObject:
    """Load the object of a name; `splits` are legal too, and `needs` saves work on unusable PartNet objects."""
    if isinstance(name, Path):
        return _load_folder(name, needs)
    if not isinstance(name, str):
        raise _not_an_object(name)
    if not name.strip():
        raise AssetError(f"an object's name must not be empty: {name!r}")
    if name in read_catalog():
        category, entry = read_catalog()[name]
        return generate(category, entry.seed, entry.id, entry.held_out)
    if (found := parse_generated(name)) is not None:
        category, seeds = found
        if len(seeds) != 1:
            raise AssetError(f"{name!r} names {len(seeds)} objects, not one")
        return generate(category, seeds[0], generated_id(category, seeds[0]), fresh=True)
    if partnet_id(name) is not None or is_path(name):
        return _load_folder(name, needs)
    if name in _SPLIT_NAMES:
        raise AssetError(f"{name!r} is a split, not one object; list_objects(split={name!r}) names its objects")
    raise UnknownObjectError(name, read_catalog(), splits)


def _not_an_object(given: object) -> AssetError:
    return AssetError(
        "objects must be a split, an object's name, a path, an ArticulatedObject or a sequence of these, "
        f"not {type(given).__name__}: {shown(given)}"
    )


def _check_resolved(resolved: list[str | ArticulatedObject]) -> None:
    if not resolved:
        raise AssetError("objects must name at least one object")
    names = [object_id_of(item) for item in resolved]
    twice = sorted(name for name, count in Counter(names).items() if count > 1)
    if twice:
        raise AssetError(f"objects name {', '.join(twice)} more than once")


def _load_folder(given: str | Path, needs: Needs | None) -> ArticulatedObject:
    """Load the object of a folder or zip: itself where an export wrote it, else what the importer makes of it."""
    from artiskill.assets.exported_folder import read_exported
    from artiskill.assets.partnet.folder import find_partnet_folder, open_object
    from artiskill.assets.partnet.importer import import_partnet

    number = partnet_id(given) if isinstance(given, str) else None
    path = Path(given) if number is None else find_partnet_folder(number)
    with open_object(path) as (folder, name):
        exported, changed = read_exported(folder)
        if exported is not None:
            return exported
        if not changed:
            return import_partnet(folder, needs=needs)
        remark = f"{shown(changed)} was changed since the export: collision shapes, masses and handles are new"
        print(f"{shown(name)}: {remark}", file=sys.stderr, flush=True)
        found = import_partnet(folder, needs=needs)
    return replace(found, metadata={**found.metadata, "warnings": (remark, *found.metadata["warnings"])})

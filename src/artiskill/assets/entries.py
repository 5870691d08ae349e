"""The entries of the catalogue, `configs/catalog/<category>.yaml`: an id, a seed, a split, a hash per object."""

from dataclasses import dataclass
from functools import cache

from artiskill.assets.articulated_object import Category, JointKind
from artiskill.assets.needs import MovingLink
from artiskill.config import CONFIG_DIR, check, load_config
from artiskill.errors import shown

CATALOG_DIR = CONFIG_DIR / "catalog"
CATEGORIES: tuple[Category, ...] = ("cabinet", "chair", "bucket")
BENCHMARK_SPLITS = ("train", "test")
HELD_OUT_SPLIT = "ood"
SPLITS = (*BENCHMARK_SPLITS, HELD_OUT_SPLIT)
ALL = "all"  # the splits of the benchmark


@dataclass(frozen=True)
class CatalogEntry:
    """One object of the catalogue.

    Attributes:
        id: its name.
        seed: from which it is generated.
        split: `train`, `test`, or `ood`: of families that neither of the two holds.
        family: what kind of cabinet, chair or bucket.
        content_hash: `ArticulatedObject.content_hash` of the object as it was when the catalogue was made.
        drawers: links that slide and carry a handle.
        doors: links that turn and carry a handle.
    """

    id: str
    seed: int
    split: str
    family: str
    content_hash: str
    drawers: tuple[str, ...] = ()
    doors: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check(
            self.split in SPLITS, f"{self.id}: split must be one of {', '.join(SPLITS)}, not {shown(self.split)}"
        )

    @property
    def held_out(self) -> bool:
        """Whether the object is of a held-out family."""
        return self.split == HELD_OUT_SPLIT

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

    category: Category
    objects: tuple[CatalogEntry, ...]


@cache
def read_catalog() -> dict[str, tuple[Category, CatalogEntry]]:
    """All entries by id, each with its category."""
    entries: dict[str, tuple[Category, CatalogEntry]] = {}
    for category in CATEGORIES:
        for entry in load_config(CatalogFile, CATALOG_DIR / f"{category}.yaml").objects:
            entries[entry.id] = (category, entry)
    return entries

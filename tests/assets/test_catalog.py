"""The catalogue: counts of the benchmark, hashes, names and their errors."""

import sys
import types
from pathlib import Path

import pytest

from artiskill.assets import catalog
from artiskill.assets.catalog import list_objects, load_object, read_catalog, resolve_objects, task_motion
from artiskill.errors import AssetError, UnknownNameError

# spec of the benchmark: objects and targets of each task and split
COUNTS = {
    ("OpenCabinetDrawer", "train"): (25, 49),
    ("OpenCabinetDrawer", "test"): (10, 21),
    ("OpenCabinetDoor", "train"): (42, 66),
    ("OpenCabinetDoor", "test"): (10, 16),
}


def assert_entry_holds(object_id: str) -> None:
    _, entry = read_catalog()[object_id]
    obj = load_object(object_id)
    assert obj.id == object_id
    assert obj.content_hash == entry.content_hash, (
        f"{object_id} has changed; if that is meant, make the catalogue anew: python -m artiskill.assets.selection"
    )
    assert obj.target_links("prismatic") == entry.drawers
    assert obj.target_links("revolute") == entry.doors


@pytest.mark.parametrize(("task", "split"), COUNTS)
def test_counts_of_objects_and_targets(task: str, split: str) -> None:
    ids = list_objects(category="cabinet", split=split, task=task)
    targets = sum(len(read_catalog()[i][1].targets(task_motion(task))) for i in ids)
    assert (len(ids), targets) == COUNTS[task, split]


def test_splits_are_disjoint_and_complete() -> None:
    train, test = list_objects(split="train"), list_objects(split="test")
    assert not set(train) & set(test)
    assert set(train) | set(test) == set(list_objects()) == set(list_objects(split="all"))
    assert len({entry.seed for _, entry in read_catalog().values()}) == len(list_objects())


@pytest.mark.parametrize("object_id", list_objects()[::8])
def test_entry_loads_and_matches_its_hash(object_id: str) -> None:
    assert_entry_holds(object_id)


@pytest.mark.slow
def test_every_entry_loads_and_matches_its_hash() -> None:
    for object_id in list_objects():
        assert_entry_holds(object_id)


@pytest.mark.slow
def test_selection_chooses_the_same_catalogue_again() -> None:
    from artiskill.assets.selection import catalog_yaml, select_cabinets

    assert catalog_yaml(select_cabinets()) == (catalog.CATALOG_DIR / "cabinet.yaml").read_text(encoding="utf-8")


def test_loading_twice_gives_the_same_object() -> None:
    assert load_object("cabinet-0001") is load_object("cabinet-0001")


def test_generated_ids_round_trip() -> None:
    obj = load_object("generated:12")
    assert obj.id == "generated-12"
    assert load_object(obj.id) is obj
    assert obj.content_hash != load_object("generated:13").content_hash


def test_resolve_splits_ids_and_objects() -> None:
    train = resolve_objects("train", "OpenCabinetDrawer")
    assert train == tuple(list_objects(split="train", task="OpenCabinetDrawer"))
    assert resolve_objects("all") == tuple(list_objects())
    assert resolve_objects("cabinet-0001") == ("cabinet-0001",)
    obj = load_object("generated:12")
    assert resolve_objects([obj, "cabinet-0002", "generated:13"]) == (obj, "cabinet-0002", "generated-13")
    assert resolve_objects(["test", train[0]], "OpenCabinetDrawer")[-1] == train[0]


@pytest.fixture
def importer(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Stands in for the PartNet importer; the list records what it was asked for."""
    asked: list[object] = []
    module = types.ModuleType("artiskill.assets.partnet.importer")
    module.find_partnet_folder = lambda name: Path("/data") / name  # type: ignore[attr-defined]

    def import_partnet(path: Path) -> object:
        asked.append(path)
        return load_object("cabinet-0001")

    module.import_partnet = import_partnet  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "artiskill.assets.partnet.importer", module)
    return asked


def test_resolve_partnet_names_and_paths(importer: list[object], tmp_path: Path) -> None:
    for name in ("partnet:40147", str(tmp_path), tmp_path, "40147.zip"):
        assert resolve_objects(name) == (load_object("cabinet-0001"),)
    assert importer == [Path("/data/40147"), tmp_path, tmp_path, Path("40147.zip")]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("cabinet-01", "unknown object 'cabinet-01'; did you mean 'cabinet-0"),
        ("trian", "unknown object 'trian'.*generated:<seed>"),
        ("generated:x", "unknown object 'generated:x'.*whole number"),
        ("generated:-1", "unknown object 'generated:-1'"),
    ],
)
def test_unknown_names(name: str, message: str) -> None:
    with pytest.raises(UnknownNameError, match=message):
        resolve_objects(name)


def test_unknown_category_split_and_task() -> None:
    with pytest.raises(UnknownNameError, match="unknown category 'cabinets'; did you mean 'cabinet'"):
        list_objects(category="cabinets")
    with pytest.raises(UnknownNameError, match="unknown split 'tran'; did you mean 'train'"):
        list_objects(split="tran")
    with pytest.raises(UnknownNameError, match="unknown task 'OpenCabinetDraw'"):
        list_objects(task="OpenCabinetDraw")
    assert task_motion("ArtiSkill/OpenCabinetDoor-v0") == "revolute"


def test_objects_without_target_are_refused() -> None:
    drawerless = next(i for i in list_objects() if read_catalog()[i][1].drawers == ())
    with pytest.raises(AssetError, match="has no drawer with a handle"):
        resolve_objects(drawerless, "OpenCabinetDrawer")
    with pytest.raises(AssetError, match="has no drawer with a handle"):
        resolve_objects(load_object(drawerless), "OpenCabinetDrawer")


def test_empty_double_and_nonsense_are_refused() -> None:
    with pytest.raises(AssetError, match="at least one"):
        resolve_objects([])
    with pytest.raises(AssetError, match="cabinet-0001 more than once"):
        resolve_objects(["cabinet-0001", "cabinet-0001"])
    with pytest.raises(AssetError, match="not int"):
        resolve_objects([3])  # type: ignore[list-item]

"""The catalogue: counts of the benchmark, hashes, names and their errors."""

import dataclasses
import pickle
import sys
import types
from pathlib import Path

import pytest

from artiskill.assets import catalog
from artiskill.assets.catalog import list_objects, load_object, read_catalog, resolve_objects, task_motion
from artiskill.assets.needs import TASK_NEEDS
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

    def import_partnet(path: Path, needs: object) -> object:
        asked.append(path if needs is None else (path, needs))
        return load_object("cabinet-0001")

    module.import_partnet = import_partnet  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "artiskill.assets.partnet.importer", module)
    return asked


def test_resolve_partnet_names_and_paths(importer: list[object], tmp_path: Path) -> None:
    for name in ("partnet:40147", str(tmp_path), tmp_path, "40147.zip"):
        assert resolve_objects(name) == (load_object("cabinet-0001"),)
    assert importer == [Path("/data/40147"), tmp_path, tmp_path, Path("40147.zip")]


def test_the_importer_knows_what_the_object_is_for(importer: list[object]) -> None:
    resolve_objects("partnet:40147", "OpenCabinetDrawer")
    assert importer == [(Path("/data/40147"), TASK_NEEDS["OpenCabinetDrawer"])]


def test_a_folder_shadows_nothing(importer: list[object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("cabinet-0005", "generated-7", "mine", "test"):
        (tmp_path / name).mkdir()
    assert load_object("cabinet-0005").id == "cabinet-0005"
    assert resolve_objects(["cabinet-0005", "generated-7"]) == ("cabinet-0005", "generated-7")
    assert resolve_objects("test") == tuple(list_objects(split="test"))
    with pytest.raises(UnknownNameError, match=r"unknown object 'mine'; a folder has this name: write './mine'"):
        resolve_objects("mine")
    assert importer == []
    resolve_objects("./mine")
    resolve_objects(Path("cabinet-0005"))  # a Path is always one
    assert importer == [Path("mine"), Path("cabinet-0005")]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("cabinet-01", "unknown object 'cabinet-01'; did you mean 'cabinet-0"),
        ("cabinet-005", "did you mean 'cabinet-0005'?"),
        ("cabinet-5", "did you mean 'cabinet-0005'?"),
        ("cabinet-00755", "did you mean 'cabinet-0075'?"),
        ("Cabinet-0007", "did you mean 'cabinet-0007'?"),
        ("trian", "unknown object 'trian'; did you mean 'train'.*split .train, test, all.*generated:<seed>"),
        ("tset", "did you mean 'test'?"),
        ("al", "did you mean 'all'?"),
        ("xyzzy", "unknown object 'xyzzy'. Legal: a split .train, test, all., one of the 75 catalogue ids"),
        ("generated:x", "unknown object 'generated:x'.*whole number"),
        ("generated:-1", "unknown object 'generated:-1'"),
    ],
)
def test_unknown_names(name: str, message: str) -> None:
    with pytest.raises(UnknownNameError, match=message):
        resolve_objects(name)


def test_one_object_is_no_split() -> None:
    with pytest.raises(AssetError, match=r"'train' is a split, not one object; list_objects\(split='train'\)"):
        load_object("train")
    with pytest.raises(UnknownNameError) as caught:
        load_object("trian")
    assert "split" not in str(caught.value)


def test_errors_of_names_travel_between_processes() -> None:
    with pytest.raises(UnknownNameError) as caught:
        resolve_objects("tset")
    again = pickle.loads(pickle.dumps(caught.value))
    assert (type(again), str(again)) == (type(caught.value), str(caught.value))


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
    with pytest.raises(AssetError, match=r"has no drawer with a handle.*it has: door link_\d \(with a handle\)"):
        resolve_objects(load_object(drawerless), "OpenCabinetDrawer")
    chair = dataclasses.replace(load_object(drawerless), id="seat", category="chair")
    with pytest.raises(AssetError, match="object 'seat' is a chair; OpenCabinetDrawer needs a cabinet"):
        resolve_objects(chair, "OpenCabinetDrawer")


def test_empty_double_and_nonsense_are_refused() -> None:
    with pytest.raises(AssetError, match="at least one"):
        resolve_objects([])
    with pytest.raises(AssetError, match="cabinet-0001 more than once"):
        resolve_objects(["cabinet-0001", "cabinet-0001"])
    for nonsense in (3, None, [3], [None], 2.5, b"cabinet-0001", [["cabinet-0001"]]):
        with pytest.raises(AssetError, match=r"objects must be a split, an object's name, a path, .*, not "):
            resolve_objects(nonsense)  # type: ignore[arg-type]
    for number in (5, None):
        with pytest.raises(AssetError, match=f"not .*: {number}"):
            load_object(number)  # type: ignore[arg-type]
    for empty in ("", " ", ["cabinet-0001", ""]):
        with pytest.raises(AssetError, match="name must not be empty"):
            resolve_objects(empty)

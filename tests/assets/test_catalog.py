"""The catalogue: counts of the benchmark, hashes, names and their errors."""

import dataclasses
import pickle
from contextlib import nullcontext
from pathlib import Path

import pytest

from artiskill.assets.articulated_object import CATEGORIES, Category
from artiskill.assets.cabinets import default_cabinet_config
from artiskill.assets.catalog import SPLITS, list_objects, load_object, read_catalog, resolve_objects
from artiskill.assets.needs import TASK_NEEDS, task_needs
from artiskill.errors import ArtiSkillError, AssetError, UnknownNameError

# spec of the benchmark: objects and targets of each task and split
COUNTS = {
    ("OpenCabinetDrawer", "train"): (25, 49),
    ("OpenCabinetDrawer", "test"): (10, 21),
    ("OpenCabinetDoor", "train"): (42, 66),
    ("OpenCabinetDoor", "test"): (10, 16),
    ("PushChair", "train"): (26, 26),
    ("PushChair", "test"): (10, 10),
    ("MoveBucket", "train"): (29, 29),
    ("MoveBucket", "test"): (10, 10),
}
HELD_OUT_OBJECTS = 12  # of each category


def test_nothing_floats() -> None:
    """What does not reach the floor hangs on a wall, and nothing else does: of all families that may hang."""
    families = {family.name for family in default_cabinet_config().families if family.supports.get("wall", 0) > 0}
    entries = [entry for category, entry in read_catalog().values() if category == "cabinet"]
    hung = 0
    for entry in entries:
        if entry.family in families:
            obj = load_object(entry.id)
            hangs = bool(obj.bounds[0, 2] > 1e-6)
            assert obj.links[-1].is_wall == hangs, entry.id
            hung += hangs
    assert hung == 20
    assert not load_object("cabinet-0001").links[-1].is_wall


def assert_entry_holds(object_id: str) -> None:
    _, entry = read_catalog()[object_id]
    obj = load_object(object_id)
    assert obj.id == object_id
    assert obj.content_hash == entry.content_hash, (
        f"{object_id} has changed; if that is meant, make the catalogue anew: python tools/select_objects.py"
    )
    assert obj.metadata["family"] == entry.family
    assert obj.metadata["held_out"] is (entry.split == "ood")
    if obj.category == "cabinet":
        assert obj.target_links("prismatic") == entry.drawers
        assert obj.target_links("revolute") == entry.doors


@pytest.mark.parametrize(("task", "split"), COUNTS)
def test_counts_of_objects_and_targets(task: str, split: str) -> None:
    needs = task_needs(task)
    ids = list_objects(category=needs.category, split=split, task=task)
    assert ids == list_objects(split=split, task=task)
    targets = sum(1 if needs.motion is None else len(read_catalog()[i][1].targets(needs.motion)) for i in ids)
    assert (len(ids), targets) == COUNTS[task, split]


def test_the_benchmark_has_162_objects() -> None:
    tasks = ("OpenCabinetDoor", "OpenCabinetDrawer", "PushChair", "MoveBucket")
    assert sum(len(list_objects(task=task)) for task in tasks) == 162


@pytest.mark.parametrize("category", CATEGORIES)
def test_held_out_families_are_in_no_other_split(category: str) -> None:
    held_out = list_objects(category, "ood")
    assert len(held_out) == HELD_OUT_OBJECTS
    assert not set(held_out) & set(list_objects(category))
    assert len({read_catalog()[i][1].family for i in held_out}) > 1


def test_splits_are_disjoint_and_complete() -> None:
    train, test = list_objects(split="train"), list_objects(split="test")
    assert not set(train) & set(test)
    assert set(train) | set(test) == set(list_objects()) == set(list_objects(split="all"))
    assert len({(kind, e.seed, e.held_out) for kind, e in read_catalog().values()}) == len(read_catalog())
    assert {e.split for _, e in read_catalog().values()} == set(SPLITS)


@pytest.mark.parametrize("object_id", list_objects()[::8])
def test_entry_loads_and_matches_its_hash(object_id: str) -> None:
    assert_entry_holds(object_id)


@pytest.mark.slow
def test_every_entry_loads_and_matches_its_hash() -> None:
    for object_id in list_objects():
        assert_entry_holds(object_id)


def test_loading_twice_gives_the_same_object() -> None:
    assert load_object("cabinet-0001") is load_object("cabinet-0001")


def test_generated_ids_round_trip() -> None:
    obj = load_object("generated:12")
    assert obj.id == "generated-cabinet-12"
    for name in (obj.id, "generated-12", "generated:cabinet:12"):
        assert load_object(name) is obj
    assert obj.content_hash != load_object("generated:13").content_hash
    for category in CATEGORIES:
        assert load_object(f"generated:{category}:3").category == category


@pytest.mark.parametrize("category", CATEGORIES)
def test_generated_objects_are_not_those_of_the_catalogue(category: Category) -> None:
    listed = {entry.content_hash for _, entry in read_catalog().values()}
    seeds = [*range(40), *(entry.seed for kind, entry in read_catalog().values() if kind == category)]
    fresh = {load_object(f"generated:{category}:{seed}").content_hash for seed in seeds}
    assert len(fresh) == len(set(seeds))
    assert not fresh & listed


def test_generated_without_task_and_category_is_a_cabinet() -> None:
    assert load_object("generated:7") is load_object("generated:cabinet:7")
    assert resolve_objects("generated:7") == ("generated-cabinet-7",)


def test_training_and_test_chairs_have_headrests_and_nets() -> None:
    for split in ("train", "test"):
        chairs = [load_object(name).metadata for name in list_objects("chair", split)]
        assert sum("headrest" in chair["tags"] for chair in chairs) >= 2
        assert sum(chair["back"] == "mesh" for chair in chairs) >= 2


def test_a_task_says_which_category_is_generated() -> None:
    assert resolve_objects("generated:3", "PushChair") == ("generated-chair-3",)
    assert resolve_objects("generated:bucket:3", "MoveBucket") == ("generated-bucket-3",)
    with pytest.raises(AssetError, match="'generated-cabinet-3' is a cabinet; PushChair needs a chair"):
        resolve_objects("generated:cabinet:3", "PushChair")


def test_a_range_of_seeds_is_as_many_objects() -> None:
    assert resolve_objects("generated:bucket:3..5") == tuple(f"generated-bucket-{k}" for k in (3, 4, 5))
    with pytest.raises(AssetError, match="the last seed, 2, comes before the first, 5"):
        resolve_objects("generated:5..2")
    with pytest.raises(AssetError, match="names 3 objects, not one"):
        load_object("generated:bucket:3..5")


def test_a_range_holds_what_the_task_can_be_done_with() -> None:
    names = resolve_objects("generated:cabinet:100..109", "OpenCabinetDrawer")
    assert 0 < len(names) < 10
    assert all(load_object(str(name)).target_links("prismatic") for name in names)
    lacking = next(f"generated-cabinet-{k}" for k in range(100, 110) if f"generated-cabinet-{k}" not in names)
    with pytest.raises(AssetError, match=f"{lacking}' has no drawer with a handle"):
        resolve_objects(lacking, "OpenCabinetDrawer")
    number = lacking.rsplit("-", 1)[1]
    following = f"generated:cabinet:{number}..{number}"
    with pytest.raises(AssetError, match="has no drawer with a handle"):
        resolve_objects(following, "OpenCabinetDrawer")
    with pytest.raises(AssetError, match="is a cabinet; PushChair needs a chair"):
        resolve_objects("generated:cabinet:3..5", "PushChair")


def test_resolve_splits_ids_and_objects() -> None:
    train = resolve_objects("train", "OpenCabinetDrawer")
    assert train == tuple(list_objects(split="train", task="OpenCabinetDrawer"))
    assert resolve_objects("all") == tuple(list_objects())
    assert resolve_objects("cabinet-0001") == ("cabinet-0001",)
    obj = load_object("generated:12")
    assert resolve_objects([obj, "cabinet-0002", "generated:13"]) == (obj, "cabinet-0002", "generated-cabinet-13")
    assert resolve_objects(["test", train[0]], "OpenCabinetDrawer")[-1] == train[0]


@pytest.fixture
def importer(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Stands in for the PartNet importer; the list records what it was asked for."""
    asked: list[object] = []

    def import_partnet(path: Path, needs: object) -> object:
        asked.append(path if needs is None else (path, needs))
        return load_object("cabinet-0001")

    monkeypatch.setattr("artiskill.assets.partnet.importer.import_partnet", import_partnet)
    monkeypatch.setattr("artiskill.assets.partnet.folder.find_partnet_folder", lambda name: Path("/data") / name)
    monkeypatch.setattr("artiskill.assets.partnet.folder.open_object", lambda path: nullcontext((path, path.name)))
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
    assert resolve_objects(["cabinet-0005", "generated-7"]) == ("cabinet-0005", "generated-cabinet-7")
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
        (
            "trian",
            "unknown object 'trian'; did you mean 'train'.*split .train, test, ood, all",
        ),
        ("tset", "did you mean 'test'?"),
        ("al", "did you mean 'all'?"),
        ("xyzzy", "unknown object 'xyzzy'. Legal: a split .train, test, ood, all., one of the \\d+ catalogue ids"),
        ("generated:x", "unknown object 'generated:x'.*whole number"),
        ("generated:-1", "unknown object 'generated:-1'"),
        ("generated:chiar:1", "unknown category 'chiar'; did you mean 'chair'"),
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
    assert task_needs("ArtiSkill/OpenCabinetDoor-v0").motion == "revolute"


def test_objects_without_target_are_refused() -> None:
    drawerless = next(i for i in list_objects("cabinet") if read_catalog()[i][1].drawers == ())
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
    for unordered in ({"cabinet-0001"}, frozenset(("cabinet-0001", "cabinet-0002"))):
        with pytest.raises(AssetError, match=r"a set has another one in another process. Pass sorted\(objects\)"):
            resolve_objects(unordered)  # type: ignore[arg-type]
    for nonsense in (3, None, [3], [None], 2.5, b"cabinet-0001", [["cabinet-0001"]]):
        with pytest.raises(AssetError, match=r"objects must be a split, an object's name, a path, .*, not "):
            resolve_objects(nonsense)  # type: ignore[arg-type]
    for number in (5, None):
        with pytest.raises(AssetError, match=f"not .*: {number}"):
            load_object(number)  # type: ignore[arg-type]
    for empty in ("", " ", ["cabinet-0001", ""]):
        with pytest.raises(AssetError, match="name must not be empty"):
            resolve_objects(empty)


def test_a_file_may_list_a_split(importer: list[object], tmp_path: Path) -> None:
    own = tmp_path / "own.yaml"
    own.write_text("description: mine\nobjects: [cabinet-0002, 'generated:cabinet:3..4', data/40147.zip]\n")
    imported = load_object("cabinet-0001")
    expected = ("cabinet-0002", "generated-cabinet-3", "generated-cabinet-4", imported)
    assert resolve_objects(str(own)) == resolve_objects(own) == expected
    assert importer == [tmp_path / "data/40147.zip"] * 2


def test_a_folder_beside_a_file_in_the_working_directory(
    importer: list[object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("own.yaml").write_text("objects: [./mine]\n")
    resolve_objects("own.yaml")
    assert [Path(str(path)) for path in importer] == [Path("mine")]


def test_a_folder_is_no_split_file(importer: list[object], tmp_path: Path) -> None:
    folder = tmp_path / "x.yaml"
    folder.mkdir()
    with pytest.raises(AssetError, match=r"x.yaml' is a folder; write '.*x.yaml/' to mean an object in it"):
        resolve_objects(str(folder))
    resolve_objects(f"{folder}/")
    assert importer == [folder]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "own.yaml' does not exist"),
        ("objects: []", "lists no object under `objects`"),
        ("objects: [other.yml]", "lists another split file: 'other.yml'"),
        ("object: [cabinet-0001]", "object.*did you mean 'objects'"),
        ("objects: 3", "`objects` must be a list of names, not 3; for example `objects: .cabinet-0001.`"),
        (
            "objects: bucket-0001",
            "must be a list of names, not 'bucket-0001'; for example `objects: .bucket-0001.`",
        ),
        ("objects: {a: b}", "`objects` must be a list of names, not {'a': 'b'}"),
        ("objects:", "`objects` must be a list of names, not None"),
        ("objects: [3]", "objects.*3"),
        ("objects: [cabinet-01]", "unknown object 'cabinet-01'"),
    ],
)
def test_split_files_that_are_none(text: str | None, message: str, tmp_path: Path) -> None:
    own = tmp_path / "own.yaml"
    if text is not None:
        own.write_text(text)
    with pytest.raises(ArtiSkillError, match=message):
        resolve_objects(own)

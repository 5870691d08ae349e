"""Cells of the tables of docs/learning.md: the commands that make them."""

from dataclasses import replace
from pathlib import Path

import pytest

from artiskill.errors import ConfigError, UnknownNameError
from learning_tables.cells import (
    METHODS,
    A,
    B,
    Cell,
    Method,
    Resources,
    Settings,
    all_cells,
    check_cells,
    collect_command,
    evaluate_command,
    place_of,
    set_command,
    train_command,
)

WORK = Path("w")
RESOURCES = Resources("cpu", "float32", workers=2)


def test_a_drawer_is_collected_once_and_measured_on_new_levels(settings: Settings) -> None:
    cell = Cell(A, Method("small", "bcq"), "30", 1)
    place = place_of(cell, WORK)
    common = cell, settings, place, RESOURCES
    assert cell.name == "a/small-bcq/30/seed-1"
    assert " ".join(collect_command(*common)) == (
        "demos collect --task OpenCabinetDrawer --objects cabinet-0002 --targets link_0 --per-target 30 "
        "--first-level 0 --out w/demos/one-drawer --workers 2"
    )
    assert " ".join(set_command(*common)) == (
        "training-set w/demos/one-drawer --out w/sets/one-drawer-30-128-points --points 128 --frame world "
        "--count 30 --workers 2"
    )
    assert " ".join(train_command(*common)) == (
        "train bcq --task OpenCabinetDrawer --data w/sets/one-drawer-30-128-points "
        "--out w/cells/a/small-bcq/30/seed-1/run --network small --steps 20 --seed 1 --batch-size 8 "
        "--dev-objects none --device cpu --precision float32"
    )
    assert " ".join(evaluate_command(cell, "new", settings, place, RESOURCES)) == (
        "evaluate --task OpenCabinetDrawer --policy w/cells/a/small-bcq/30/seed-1/run --objects cabinet-0002 "
        "--target link_0 --episodes 5 --first-level 1000000 --out w/cells/a/small-bcq/30/seed-1/new --workers 2"
    )


def test_a_task_is_trained_on_training_objects_and_measured_on_both(settings: Settings) -> None:
    cell = Cell(B, Method("pointnet_transformer", "bc"), "PushChair", 0)
    place = place_of(cell, WORK)
    common = cell, settings, place, RESOURCES
    assert collect_command(*common)[4:8] == ["--objects", "chair-0004", "--per-object", "3"]
    assert set_command(*common)[3:6] == ["w/sets/PushChair-1200-points", "--points", "1200"]
    assert "--count" not in set_command(*common)
    values = ["schedule=constant", "algorithm.learning_rate=3.0e-4", "algorithm.weight_decay=5.0e-6"]
    assert train_command(*common)[-4:] == ["--set", *values]
    train, test = (evaluate_command(cell, split, settings, place, RESOURCES) for split in ("train", "test"))
    assert train[5:11] == ["--objects", "chair-0004", "--episodes", "2", "--first-level", "1000000"]
    # where no demonstration began, with any object
    assert test[5:11] == ["--objects", "test", "--episodes", "4", "--first-level", "1000000"]
    assert cell.episodes(settings, "train") == 2
    assert cell.episodes(settings, "test") == 4 * 10


def test_policies_of_a_table_see_equal_numbers_of_samples(settings: Settings) -> None:
    cells = list(all_cells(settings, [0, 1]))
    assert len({cell.name for cell in cells}) == len(cells) == 2 * len(METHODS) * (2 + 4)
    assert {cell.steps(settings) for cell in cells if cell.table == B} == {80 // 8}
    assert {cell.steps(settings) for cell in cells if cell.column == "10"} == {10}


def test_objects_that_results_are_about_train_nothing(settings: Settings) -> None:
    drawer, chair = (Cell(table, METHODS[0], column, 0) for table, column in ((A, "10"), (B, "PushChair")))
    check_cells([drawer, chair], settings)
    test_drawer = replace(settings, drawer=("cabinet-0003", "link_0"))
    check_cells([chair], test_drawer)
    with pytest.raises(ConfigError, match="'cabinet-0003' is of 'test'"):
        check_cells([drawer], test_drawer)
    with pytest.raises(ConfigError, match="'chair-0001' is of 'test'"):
        check_cells([chair], replace(settings, train_objects=["chair-0001"]))
    with pytest.raises(UnknownNameError, match="unknown object 'chair-004'"):
        check_cells([chair], replace(settings, train_objects=["chair-004"]))

"""What finished cells of the tables say."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from learning_tables.cells import A, B, Cell, Method, Settings
from learning_tables.markdown import drawer_table, tables_text, tasks_table
from learning_tables.results import (
    CSV_HEAD,
    Measured,
    Result,
    csv_rows,
    read_csv_rows,
    read_results,
    write_rows,
)

SMALL = Method("small", "bc")


def measured(**successes: int) -> Measured:
    """Return what four episodes on each object gave."""
    return Measured(Counter(successes), Counter(dict.fromkeys(successes, 4)), 60.0)


@pytest.fixture
def results() -> list[Result]:
    trained = {"steps": 20, "samples": 160, "seconds": 90.0, "machine": "2 cores", "precision": "float32"}
    drawers = [Result(Cell(A, SMALL, "10", seed), trained, {"new": measured(one=seed)}) for seed in (1, 3)]
    both = {"train": measured(one=4, two=4), "test": measured(three=4, four=0)}
    return [*drawers, Result(Cell(B, SMALL, "PushChair", 0), trained, both)]


def rows_of(table: str) -> list[list[str]]:
    return [[cell.strip() for cell in line.strip("| ").split("|")] for line in table.splitlines()]


def test_seeds_are_added_and_missing_cells_and_the_paper_stand_beside(
    results: list[Result], settings: Settings
) -> None:
    rows = rows_of(drawer_table(results, settings))
    assert rows[0] == ["network", "algorithm", "10", "30", "minutes of training", "on"]
    # 4 of 8 episodes; rates .25 and .75 have a standard deviation of .354
    assert rows[2] == ["small", "BC", "50% (22% to 78%) ± 35%, 2 seeds", "missing", "1.5", "2 cores"]
    assert rows[3][:4] == ["small", "BCQ", "missing", "missing"]
    assert ["ManiSkill paper: PointNet", "BC", "13%", "23%"] in [row[:4] for row in rows]


def test_unseen_objects_have_an_interval_of_their_own(results: list[Result], settings: Settings) -> None:
    rows = [row for row in rows_of(tasks_table(results)) if row[0] == "PushChair"]
    assert rows[0] == [
        "PushChair",
        "small",
        "BC",
        "100% (68% to 100%)",
        "50% (22% to 78%)",
        "0% to 100%",
        "",
        "1.5",
        "2 cores",
    ]
    assert rows[1][3:6] == ["missing"] * 3
    assert ["PushChair", "PointNet+Transformer", "BCQ", *["missing"] * 3, "11% / 8%"] in [row[:7] for row in rows]
    assert [row[6] for row in rows[6:]] == ["11% / 9%", "18% / 8%", "11% / 8%", "12% / 8%"]
    text = tables_text(results, settings)
    assert "19 of 20 cells are missing" in text
    assert "39 of 40 cells are missing" in text


def test_every_finished_cell_has_a_row_for_each_object(results: list[Result], settings: Settings) -> None:
    rows = [dict(zip(CSV_HEAD, row, strict=True)) for row in csv_rows(results, settings)]
    seen = [(row["table"], row["seed"], row["measured on"]) for row in rows]
    assert list(dict.fromkeys(seen)) == [
        *(("a", "1", "new"), ("a", "3", "new")),
        *(("b", "0", "train"), ("b", "0", "test")),
    ]
    assert rows[0]["demonstrations"] == "10"
    test = [row for row in rows if row["measured on"] == "test"]
    assert [sum(int(row[name]) for row in test) for name in ("successes", "episodes")] == [4, 8]
    assert len(test) == 2
    assert test[0]["training seconds"] == "90.0"


def test_rows_are_read_as_they_were_written(results: list[Result], settings: Settings, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    results = [replace(one, trained=one.trained | {"steps": one.cell.steps(settings)}) for one in results]
    write_rows(path, [CSV_HEAD, *csv_rows(results, settings)])
    read = read_csv_rows(path, settings)
    assert [(one.cell, one.measured, one.minutes) for one in read] == [
        (one.cell, one.measured, one.minutes) for one in results
    ]
    others = replace(settings, samples=settings.samples * 2)
    assert [one.cell.table for one in read_csv_rows(path, others)] == ["a", "a"]


def test_an_empty_work_folder_has_no_results(tmp_path: Path, settings: Settings) -> None:
    assert read_results(tmp_path, settings) == []

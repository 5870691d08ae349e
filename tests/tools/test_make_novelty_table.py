"""The table of how new test objects are: nearest objects, and success by distance."""

from pathlib import Path
from typing import Any

import pytest

import make_novelty_table as script
import make_track_tables
from make_novelty_table import BEGIN, END, Novelty, measure
from make_track_tables import CSV_HEAD, TABLE

RATES = (("bucket-0004", 50, 50), ("bucket-0005", 50, 40), ("bucket-0040", 50, 10), ("bucket-0041", 50, 0))


@pytest.fixture
def page(tmp_path: Path) -> Path:
    (tmp_path / "data").mkdir()
    rows = [f"no-restrictions,MoveBucket,0,test,{name},{n},{solved}" for name, n, solved in RATES]
    (tmp_path / TABLE).write_text("\n".join([",".join(CSV_HEAD), *rows]) + "\n")
    path = tmp_path / "page.md"
    path.write_text(f"before\n{BEGIN}\n{END}\nafter\n")
    return path


def test_success_by_distance(page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known = [
        Novelty("MoveBucket", "test", name, "a", 10.0 * k + 4.0, "b", 10.0 * k + 1.0)
        for k, (name, _, _) in enumerate(RATES)
    ]
    monkeypatch.setattr(script, "measure", lambda task: iter(known if task == "MoveBucket" else []))
    assert script.main(["--page", str(page)]) == 0
    text = page.read_text()
    assert "| MoveBucket | test | 19 (4 to 34) | 1 of 4 | 16 (1 to 31) | 1 of 4 |" in text
    assert "| no-restrictions | MoveBucket | 90%, 1 to 11 mm | 10%, 21 to 31 mm | -1.00 (0.00) |" in text
    monkeypatch.setattr(script, "measure", lambda task: pytest.fail("it is in the file"))
    assert script.main(["--page", str(page)]) == 0
    assert page.read_text() == text


def test_larger_chairs_are_among_what_chairs_are_learned_from(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(script, "ROLLOUT_SEEDS", {"chair": "0..0"})
    monkeypatch.setattr(make_track_tables, "SCALED", {"train": ("chair-0004",)})
    monkeypatch.setattr(make_track_tables, "LARGER", (1.05, 1.05))
    listed = {"train": ["chair-0006"], "test": ["chair-0004"], "ood": ["chair-0038"]}
    usual = script.resolve_objects
    monkeypatch.setattr(
        script,
        "resolve_objects",
        lambda given, task: usual(listed[given[0]], task=task) if given[0] in listed else usual(given, task=task),
    )
    found, _ = measure("PushChair")
    assert (found.train, found.generated) == ("chair-0006", "scaled-chair-0004-105")


def test_the_nearest_of_what_the_task_trains_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of cabinets, each task counts those with its kind of joint only."""
    monkeypatch.setattr(script, "ROLLOUT_SEEDS", {"cabinet": "0..5"})
    names = {"train": ["cabinet-0002", "cabinet-0064"], "test": ["cabinet-0001"], "ood": ["cabinet-0083"]}
    usual = script.resolve_objects

    def resolve(given: list[str], task: str) -> list[Any]:
        listed = names.get(given[0], given)
        return [one for one in usual(listed) if not isinstance(one, str) or one in usual([given[0]], task=task)]

    monkeypatch.setattr(script, "resolve_objects", resolve)
    first, other = measure("OpenCabinetDrawer")
    assert (first.split, first.object, other.split, other.object) == (
        "test",
        "cabinet-0001",
        "ood",
        "cabinet-0083",
    )
    assert first.train == other.train == "cabinet-0002", "the other one has doors alone"
    assert first.generated.startswith("generated-cabinet-")
    assert 1 < first.train_mm < 200
    assert first.distance_mm("no-restrictions") == min(first.train_mm, first.generated_mm)
    assert first.distance_mm("interactive-expert") == first.train_mm


def test_a_page_without_marks(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page.write_text("no marks")
    (page.parent / TABLE).unlink()
    (page.parent / script.TABLE).write_text(
        ",".join(script.CSV_HEAD) + "\nMoveBucket,test,bucket-0004,a,5.0,b,1.0\n"
    )
    assert script.main(["--page", str(page)]) == 2
    assert "lacks the marks" in capsys.readouterr().err

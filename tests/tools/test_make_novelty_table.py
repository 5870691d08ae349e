"""The table of how new test objects are: nearest objects, and success by distance."""

from pathlib import Path

import pytest

import make_novelty_table as script
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
        Novelty("bucket", "test", name, "a", 10.0 * k + 4.0, "b", 10.0 * k + 1.0)
        for k, (name, _, _) in enumerate(RATES)
    ]
    monkeypatch.setattr(script, "measure", lambda category: iter(known if category == "bucket" else []))
    assert script.main(["--page", str(page)]) == 0
    text = page.read_text()
    assert "| bucket | test | 19 (4 to 34) | 1 of 4 | 16 (1 to 31) | 1 of 4 |" in text
    assert "| no-restrictions | MoveBucket | 90%, 1 to 11 mm | 10%, 21 to 31 mm | -1.00 |" in text
    monkeypatch.setattr(script, "measure", lambda category: pytest.fail("it is in the file"))
    assert script.main(["--page", str(page)]) == 0
    assert page.read_text() == text


def test_the_nearest_of_the_catalogue_and_of_generated_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(script, "ROLLOUT_SEEDS", {"bucket": "0..3"})
    names = {"train": ["bucket-0001", "bucket-0002"], "test": ["bucket-0004"], "ood": ["bucket-0040"]}
    monkeypatch.setattr(script, "list_objects", lambda split, category: names[split])
    one, other = measure("bucket")
    assert (one.split, one.object, other.split, other.object) == ("test", "bucket-0004", "ood", "bucket-0040")
    assert one.train in names["train"]
    assert one.generated.startswith("generated-bucket-")
    assert 1 < one.train_mm < 100
    assert one.distance_mm("no-restrictions") == min(one.train_mm, one.generated_mm)
    assert one.distance_mm("interactive-expert") == one.train_mm


def test_a_page_without_marks(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page.write_text("no marks")
    (page.parent / TABLE).unlink()
    (page.parent / script.TABLE).write_text(",".join(script.CSV_HEAD) + "\nbucket,test,bucket-0004,a,5.0,b,1.0\n")
    assert script.main(["--page", str(page)]) == 2
    assert "lacks the marks" in capsys.readouterr().err

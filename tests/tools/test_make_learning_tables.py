"""docs/learning.md: its tables are made by a queue of commands that goes on after any end."""

import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

LIMITED = [
    "--only",
    "a",
    "--cells",
    "a/small-bc/*",
    "--schedule",
    "10:20",
    "30:40",
    "--device",
    "cpu",
    "--workers",
    "1",
]


@pytest.fixture
def tool(load_tool: Callable[[str], ModuleType]) -> ModuleType:
    return load_tool("make_learning_tables")


@pytest.fixture
def page(tool: ModuleType, tmp_path: Path) -> Path:
    page = tmp_path / "learning.md"
    page.write_text(f"before\n{tool.BEGIN}\nof old\n{tool.END}\nafter\n")
    return page


@pytest.fixture
def main(tool: ModuleType, page: Path, tmp_path: Path) -> Callable[..., int]:
    """Call the tool with few cells and other options."""
    places = ["--work", str(tmp_path / "work"), "--page", str(page)]
    return lambda *options: tool.main([*LIMITED, *places, *options])


def test_the_page_says_what_the_reports_hold(
    tool: ModuleType, page: Path, main: Callable[..., int], called: Callable[[], list[str]]
) -> None:
    assert main() == 0
    assert sum(line.startswith("train bc") for line in called()) == 2
    text = page.read_text()
    assert text.startswith(f"before\n{tool.BEGIN}\n")
    assert text.endswith(f"{tool.END}\nafter\n")
    assert "of old" not in text
    assert "| small | BC | 75% (30% to 95%) | 75% (30% to 95%) |" in text
    assert (
        "Gradient steps of 128 samples: 20 for 10 demonstrations, 40 for 30 demonstrations (the paper's: 2,000,"
        in text
    )
    rows = (page.parent / tool.TABLE).read_text().splitlines()
    assert rows[0] == ",".join(tool.CSV_HEAD)
    assert rows[1].startswith("a,OpenCabinetDrawer,small,bc,10,0,20,2560,")
    assert len(rows) == 3  # of one object each
    assert main() == 0
    assert called() == []
    assert page.read_text() == text


@pytest.mark.usefixtures("called")
def test_steps_that_are_the_same_are_said_once(page: Path, main: Callable[..., int]) -> None:
    assert main("--schedule", "10:20", "30:20") == 0
    assert "Gradient steps of 128 samples: 20 for each number (the paper's: 2,000," in page.read_text()


def test_rows_of_another_work_folder_stay(
    page: Path, main: Callable[..., int], called: Callable[[], list[str]], tmp_path: Path
) -> None:
    assert main() == 0
    chair = (
        "--only",
        "b",
        "--cells",
        "b/small-bc/PushChair/*",
        "--train-objects",
        "chair-0004",
        "--samples",
        "1280",
    )
    called()
    assert main("--work", str(tmp_path / "other"), *chair) == 0
    assert [line.split()[0] for line in called()] == ["demos", "training-set", "train", "evaluate", "evaluate"]
    text, table = page.read_text(), (page.parent / "data" / "learning.csv").read_text()
    assert "| small | BC | 75% (30% to 95%) | 75% (30% to 95%) |" in text
    assert "20 for 10 demonstrations, 40 for 30 demonstrations" in text
    assert "| PushChair | small | BC | 75% (30% to 95%)" in text
    assert main("--work", str(tmp_path / "third"), *chair) == 0
    assert called() == []
    assert (page.read_text(), (page.parent / "data" / "learning.csv").read_text()) == (text, table)
    assert main("--work", str(tmp_path / "fourth"), "--schedule", "10:20", "30:50") == 0
    assert [line.split()[0] for line in called()].count("train") == 1  # what is of other steps is made anew


def test_a_command_without_settings_goes_on_with_those_of_the_page(
    tool: ModuleType, page: Path, main: Callable[..., int], called: Callable[[], list[str]]
) -> None:
    assert main("--episodes", "50", "--batch-size", "64") == 0
    called()
    text = page.read_text()
    places = ["--work", str(page.parent / "other"), "--page", str(page)]
    assert tool.main([*places, "--only", "a", "--cells", "a/small-bc/*"]) == 0
    assert called() == []
    assert page.read_text() == text
    assert "Success on 50 new levels" in text


def test_tables_of_other_settings_are_not_continued(
    tool: ModuleType,
    main: Callable[..., int],
    called: Callable[[], list[str]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main("--samples", "1280") == 0
    called()
    assert main("--work", str(tmp_path / "other"), "--episodes", "50") == 2
    assert "holds tables with episodes 100, not 50: choose another --page" in capsys.readouterr().err
    places = ["--work", str(tmp_path / "other"), "--page", str(tmp_path / "learning.md")]
    assert tool.main([*places, "--only", "a", "--cells", "a/small-bc/*"]) == 0  # half the steps of its schedule
    assert called() == []


def test_a_table_that_is_not_of_this_script(
    page: Path, main: Callable[..., int], called: Callable[[], list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    (page.parent / "data").mkdir()
    (page.parent / "data" / "learning.csv").write_text("table,task\na,b\n")
    assert main() == 2
    assert "is no table of this script: its columns are not table, task, network" in capsys.readouterr().err
    assert called() == []


def test_a_cell_that_fails_is_missing_and_others_go_on(
    page: Path, main: Callable[..., int], called: Callable[[], list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAILS", "evaluate")
    assert main() == 1
    assert sum(line.startswith("train bc") for line in called()) == 2
    assert "| small | BC | missing | missing |" in page.read_text()


def test_the_list_says_minutes_and_nothing_starts_late(
    main: Callable[..., int], called: Callable[[], list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main("--list") == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["a/small-bc/10/seed-0", "a/small-bc/30/seed-0", "all"]
    assert all(re.search(r"\d+\.\d min", line) for line in lines)
    assert main("--time-limit", "0.001") == 0
    assert capsys.readouterr().out.count("not started, for lack of time") == 2
    assert called() == []
    assert main() == 0
    capsys.readouterr()
    assert main("--list") == 0
    assert capsys.readouterr().out.count("finished") == 2


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (("--drawer", "cabinet-0003/link_0"), "'cabinet-0003' is of 'test'"),
        (("--drawer", "cabinet-0002"), "--drawer is OBJECT/TARGET"),
        (("--schedule", "10"), "--schedule is COUNT:STEPS, such as 10:2000, not '10'"),
        (("--samples", "5"), "--samples must be at least the batch size, 128, not 5"),
        (("--episodes", "0"), "--episodes must be at least 1, not 0"),
        (("--cells", "c/*"), "no cell is chosen"),
    ],
)
def test_what_is_not_legal_is_said_before_anything_runs(
    main: Callable[..., int],
    called: Callable[[], list[str]],
    capsys: pytest.CaptureFixture[str],
    options: tuple[str, ...],
    text: str,
) -> None:
    assert main(*options) == 2
    assert text in capsys.readouterr().err
    assert called() == []


def test_cells_of_other_settings_are_not_mixed(
    page: Path, main: Callable[..., int], called: Callable[[], list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main() == 0
    assert main("--seeds", "1") == 0
    called()
    assert main("--episodes", "50") == 2
    assert "episodes 100, not 50: choose another --work" in capsys.readouterr().err


def test_a_page_without_marks(
    page: Path, main: Callable[..., int], called: Callable[[], list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    page.write_text("no marks")
    assert main() == 2
    assert "lacks the marks" in capsys.readouterr().err
    assert called() == []


def test_each_table_has_its_own_schedule(
    page: Path, main: Callable[..., int], called: Callable[[], list[str]]
) -> None:
    assert main("--samples", "2560") == 0
    chair = "--only", "b", "--cells", "b/small-bc/PushChair/*", "--train-objects", "chair-0004"
    assert main(*chair, "--samples", "1280") == 0
    text = page.read_text()
    assert "10 for 10 demonstrations, 20 for 30 demonstrations" in text
    assert "| small | BC | 75% (30% to 95%) | 75% (30% to 95%) |" in text
    assert "Every policy saw 1,280 samples" in text
    row = "| PushChair | small | BC | 75% (30% to 95%) | 75% (30% to 95%) |  |"
    assert row in text
    assert [line.split()[0] for line in called()].count("train") == 3

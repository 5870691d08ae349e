"""Agents that demonstrate: what is run, what is taken up again, the table; commands are not the real ones."""

import itertools
import json
import shutil
from pathlib import Path
from typing import Any

import pytest

import make_agent_demos as script
from make_agent_demos import BEGIN, COST, END

COUNTED: dict[str, Any] = {  # by `artiskill demos stats`
    "trajectories": 300,
    "attempts": 310,
    "mean_length": 40.26,
    "bytes_per_trajectory": 9200.4,
    "gave_up": [],
}


@pytest.fixture
def commands(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Commands that were called; each leaves what the real one would."""
    called: list[list[str]] = []

    def call(command: list[str], environment: object) -> bool:
        called.append(command)
        options = dict(itertools.pairwise(command))
        if command[1] == "stats":
            Path(options["--json"]).write_text(json.dumps([{"objects": [COUNTED]}]))
        elif command[1] != "verify":
            out = Path(options["--out"])
            out.mkdir(parents=True)
            if command[0] == "train":
                (out / "checkpoints").mkdir()
                (out / "checkpoints" / "best.pt").write_bytes(b"weights")
                (out / "metrics.csv").write_text("step,seconds\n1000,30\n120000,300\n")
            elif command[0] == "evaluate":
                rows = [{"object": "one", "episodes": 100, "successes": 98}]
                (out / "report.json").write_text(json.dumps({"objects": rows, "timing": {"seconds": 1.0}}))
        return True

    monkeypatch.setattr("learning_tables.commands.call", call)
    return called


def run(folder: Path, *options: str) -> int:
    page = folder / "page.md"
    if not page.exists():
        page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    return script.main(["--work", str(folder / "work"), "--page", str(page), "--jobs", "1", *options])


def names(commands: list[list[str]]) -> list[str]:
    return [" ".join(command[:2]) if command[0] == "demos" else command[0] for command in commands]


def test_each_object_has_an_agent_that_demonstrates(tmp_path: Path, commands: list[list[str]]) -> None:
    assert run(tmp_path, "--objects", "2") == 0
    assert names(commands) == ["train", "evaluate", "demos collect", "demos stats", "demos verify"] * 2
    assert "algorithm.expert_share=0.25" in commands[0]
    collect = commands[2]
    assert collect[collect.index("--policy") + 1] == commands[0][commands[0].index("--out") + 1]
    assert collect[collect.index("--per-object") + 1] == "300"
    page = (tmp_path / "page.md").read_text()
    assert "| cabinet-0002 | link_0 | sac-expert | 120 | 5.0 | 98% | 300 of 310 | 40 | 9.2 | 0 |" in page
    assert "| all 2 |  | sac-expert | 240 | 10.0 | 98% | 600 of 620 | 40 | 9.2 | 0 |" in page
    assert page.startswith("before\n")
    assert page.endswith("after\n")


def test_what_is_finished_is_not_run_again(tmp_path: Path, commands: list[list[str]]) -> None:
    assert run(tmp_path, "--objects", "1") == 0
    commands.clear()
    assert run(tmp_path, "--objects", "1") == 0
    assert commands == []
    (next((tmp_path / "work").rglob(COST))).unlink()  # killed before it was verified
    assert run(tmp_path, "--objects", "1") == 0
    assert names(commands) == ["demos collect", "demos stats", "demos verify"]
    commands.clear()
    (next((tmp_path / "work").rglob("best.pt"))).write_bytes(b"others")  # trained anew
    assert run(tmp_path, "--objects", "1") == 0
    assert names(commands) == ["demos collect", "demos stats", "demos verify"]
    assert run(tmp_path, "--objects", "-1") == 2
    assert run(tmp_path, "--per-object", "0") == 2
    assert run(tmp_path, "--per-object", "7") == 2, "the table has rows of 300"
    commands.clear()
    shutil.rmtree(tmp_path / "work")
    assert run(tmp_path, "--objects", "0") == 0
    assert "cabinet-0002" in (tmp_path / "page.md").read_text()  # from the CSV file


def test_a_page_without_marks(
    tmp_path: Path, commands: list[list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "page.md").write_text("nothing")
    assert run(tmp_path) == 2
    assert "lacks the marks" in capsys.readouterr().err
    assert commands == []


@pytest.mark.parametrize("failing", ["verify", "stats", "collect"])
def test_what_fails_is_in_no_table(
    tmp_path: Path, commands: list[list[str]], monkeypatch: pytest.MonkeyPatch, failing: str
) -> None:
    fail(monkeypatch, failing)
    assert run(tmp_path, "--objects", "1") == 1
    assert "Nothing is measured yet." in (tmp_path / "page.md").read_text()


def test_an_agent_that_gives_up_is_in_the_table(
    tmp_path: Path, commands: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    fail(monkeypatch, "collect")
    for name, value in {"trajectories": 0, "attempts": 50, "gave_up": ["link_0"]}.items():
        monkeypatch.setitem(COUNTED, name, value)
    assert run(tmp_path, "--objects", "1") == 0
    row = "| cabinet-0002 | link_0 | sac-expert | 120 | 5.0 | 98% | 0 of 50 |  |  | 0 |"
    assert row in (tmp_path / "page.md").read_text()


def test_each_algorithm_has_rows_of_its_own(tmp_path: Path, commands: list[list[str]]) -> None:
    for algorithm in ("sac", "sac-expert"):
        assert run(tmp_path, "--objects", "1", "--algorithm", algorithm) == 0
        assert names(commands)[-5:] == ["train", "evaluate", "demos collect", "demos stats", "demos verify"]
    page = (tmp_path / "page.md").read_text()
    assert len(commands) == 10
    for name in ("cabinet-0002 | link_0", "all 1 | "):
        assert [f"| {name} | {algorithm} |" in page for algorithm in ("sac", "sac-expert")] == [True, True]


def test_an_agent_that_was_not_trained_has_no_row(
    tmp_path: Path, commands: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run(tmp_path, "--objects", "1", "--algorithm", "sac") == 0
    fail(monkeypatch, "sac")  # to train; with an expert, it is the same command
    assert run(tmp_path, "--objects", "1") == 1
    page = (tmp_path / "page.md").read_text()
    assert "| sac |" in page
    assert "sac-expert" not in page


def fail(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """Have a command of `artiskill demos` fail, after it has left its files."""
    call = script.commands.call
    monkeypatch.setattr(
        "learning_tables.commands.call", lambda command, env: call(command, env) and command[1] != name
    )

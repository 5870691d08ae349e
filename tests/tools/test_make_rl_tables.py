"""Queue and tables of reinforcement learning, with commands that write what real ones would."""

import csv
import json
import shutil
from pathlib import Path

import pytest
import yaml
from PIL import Image

import make_rl_tables as script
from artiskill.learning.reinforcement_config import load_reinforcement_config
from learning_tables import curves
from learning_tables.cells import TASKS
from make_rl_tables import BEGIN, END, GRADED, ONE, PAGE, Policy, values_of

DEVELOPMENT = "step,object,episodes,successes\n9,a,5,1\n9,b,5,2\n10,a,5,4\n10,b,5,5\n"
WORDS = f"before\n{BEGIN}\nold\n{END}\nafter\n"


@pytest.fixture
def commands(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Commands that were called; each leaves what the real one would."""
    called: list[list[str]] = []

    def call(command: list[str], environment: object) -> bool:
        called.append(command)
        out = Path(command[command.index("--out") + 1])
        out.mkdir(parents=True)
        if command[0] == "train":
            (out / "metrics.csv").write_text("step,seconds\n1000,30\n2000000,600\n")
            (out / "development.csv").write_text(DEVELOPMENT)
        else:
            episodes = int(command[command.index("--episodes") + 1])
            rows = [{"object": "one", "episodes": episodes, "successes": episodes // 2}]
            (out / "report.json").write_text(json.dumps({"objects": rows, "timing": {"seconds": 1.0}}))
        return "PushChair" not in command

    monkeypatch.setattr("learning_tables.commands.call", call)
    return called


def run(folder: Path, *options: str) -> int:
    page = folder / "page.md"
    if not page.exists():
        page.write_text(WORDS)
    return script.main(["--work", str(folder / "work"), "--page", str(page), "--jobs", "1", *options])


def test_finished_runs_stay_in_the_tables(tmp_path: Path, commands: list[list[str]]) -> None:
    first = ("--tables", "one", "--tasks", "OpenCabinetDrawer", "--seeds", "0", "1")
    assert run(tmp_path, *first) == 0
    assert len(commands) == 3 * 2 * 2
    commands.clear()
    assert run(tmp_path, *first) == 0
    assert commands == []
    name, target = GRADED["OpenCabinetDrawer"][0]
    assert f"| OpenCabinetDrawer | {name} | {target} | sac | 50%, 50% | 2, 2 | 10, 10 |" in _page(tmp_path)
    measured = (tmp_path / "data" / "reinforcement_curves.csv").read_text().splitlines()
    assert len(measured) == 1 + 3 * 2 * 2
    assert f"one,OpenCabinetDrawer,{name},{target},sac,,1,9,10,3" in measured
    shutil.rmtree(tmp_path / "work")
    assert run(tmp_path, "--tables", "many", "--counts", "5", "--seeds", "0") == 0
    assert len(commands) == 3
    assert len(commands[0][commands[0].index("--objects") + 1 : commands[0].index("--out")]) == 5
    assert name in _page(tmp_path)
    assert "config.state.handle=true" in commands[0]
    assert "| 5 | with the handle | sac | 50% | 50% | 82 % | 2 | 10 |" in _page(tmp_path)
    commands.clear()
    assert run(tmp_path, "--tables", "plain", "--counts", "5", "--seeds", "0") == 0
    assert "config.state.handle=false" in commands[0]
    assert "| 5 | the paper's | sac | 50% | 50% | 82 % | 2 | 10 |" in _page(tmp_path)


def test_a_page_without_marks(
    tmp_path: Path, commands: list[list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "page.md").write_text("nothing")
    assert run(tmp_path) == 2
    assert "lacks the marks" in capsys.readouterr().err
    assert commands == []


def test_runs_that_an_expert_helps_have_rows_of_their_own(tmp_path: Path, commands: list[list[str]]) -> None:
    asked = ("--tables", "one", "--tasks", "OpenCabinetDoor", "--seeds", "0")
    assert run(tmp_path, *asked) == 0
    trains = [command for command in commands if command[0] == "train"]
    assert len(trains) == 3
    assert all("algorithm.expert_share=0" in command for command in trains)
    commands.clear()
    assert run(tmp_path, *asked, "--algorithm", "sac-expert") == 0
    trains = [command for command in commands if command[0] == "train"]
    assert len(trains) == 3
    assert all(command[1] == "sac" and "algorithm.expert_share=0.25" in command for command in trains)
    assert _page(tmp_path).count("| sac |") == _page(tmp_path).count("| sac-expert |") == 3
    commands.clear()
    assert (
        run(tmp_path, "--tables", "one", "--tasks", "MoveBucket", "--seeds", "0", "--algorithm", "sac-expert") == 0
    )
    values = commands[0][commands[0].index("--set") + 1 :]
    assert {"algorithm.expert_share=0.5", "algorithm.action_entropy=-3", "config.state.relative=true"} <= {*values}


def test_what_is_changed_has_rows_of_its_own(tmp_path: Path, commands: list[list[str]]) -> None:
    asked = ("--tables", "many", "--counts", "20", "--seeds", "0")
    changes: list[tuple[str, ...]] = [(), ("--set", "normalise=false"), ("--steps", "7", "--set", "envs=4")]
    for changed in changes:
        commands.clear()
        assert run(tmp_path, *asked, *changed) == 0
        assert len(commands) == 3
    assert {"steps=7", "envs=4", "algorithm.batch_size=256"} <= {*commands[0]}
    assert "steps=500000" not in commands[0]
    page = _page(tmp_path)
    for changed_text in ("", ", normalise=false", ", steps=7 envs=4"):
        assert f"| 20 | with the handle | sac{changed_text} | 50% | 50% | 0 % | 2 | 10 |" in page
    commands.clear()
    assert run(tmp_path, *asked, "--set", "normalise=false") == 0
    assert commands == []


@pytest.mark.parametrize("task", TASKS)
def test_the_page_has_the_objects_that_its_commands_train_on(task: str) -> None:
    with (PAGE.parent / "data" / "reinforcement.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["table"] == ONE and row["task"] == task]
    assert {(row["objects"], row["target"]) for row in rows} == set(GRADED[task])


@pytest.mark.parametrize("task", TASKS)
def test_the_table_measures_the_defaults_of_each_task(task: str) -> None:
    algorithm = "sac" if task == "OpenCabinetDrawer" else "sac-expert"
    measured = values_of(Policy("one", task, (GRADED[task][0][0],), "", algorithm, 0))
    asked = {key: yaml.safe_load(value) for key, value in (one.split("=") for one in measured)}
    assert load_reinforcement_config("sac", task, asked) == load_reinforcement_config("sac", task)
    of_ppo = values_of(Policy("one", task, (GRADED[task][0][0],), "", "ppo", 0))
    asked = {key: yaml.safe_load(value) for key, value in (one.split("=") for one in of_ppo)}
    assert load_reinforcement_config("ppo", task, asked) == load_reinforcement_config("ppo", task)
    steps = {"OpenCabinetDrawer": 400_000, "OpenCabinetDoor": 600_000}
    assert load_reinforcement_config("sac", task).steps == steps.get(task, 1_000_000)


def test_ended_runs_keep_their_last_value_in_curves(tmp_path: Path) -> None:
    points = [("0", "20", "1"), ("0", "40", "2"), ("1", "20", "3"), ("1", "40", "2"), ("1", "60", "4")]
    same = dict.fromkeys(curves.CSV_HEAD, "a") | {"episodes": "4"}
    rows = [same | {"seed": seed, "step": step, "successes": solved} for seed, step, solved in points]
    steps, rates = curves.curves(rows)
    assert steps.tolist() == [20, 40, 60]
    assert rates.tolist() == [[0.25, 0.5, 0.5], [0.75, 0.5, 1.0]]
    curves.draw(rows, tmp_path / "curves.png")
    with Image.open(tmp_path / "curves.png") as picture:
        assert picture.width > 300


def test_failures_are_told(tmp_path: Path, commands: list[list[str]]) -> None:
    assert run(tmp_path, "--tables", "one", "--tasks", "PushChair", "--seeds", "0") == 1
    assert "Nothing is measured yet." in _page(tmp_path)
    assert run(tmp_path, "--jobs", "0") == 2


def _page(folder: Path) -> str:
    return " ".join((folder / "page.md").read_text().replace("\n", " \n ").split(" ")).replace("  ", " ")

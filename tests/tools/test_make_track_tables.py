"""Queue and table of generalising policies, with commands that write what real ones would."""

import json
import re
import shutil
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import make_track_tables as script
from artiskill.assets.catalog import resolve_objects
from artiskill.errors import ConfigError
from learning_tables.cells import Cell, Method
from learning_tables.results import CSV_HEAD, Measured, Result, csv_rows, write_rows
from make_learning_tables import make_parser, make_settings
from make_track_tables import (
    BEGIN,
    BEGIN_SEEDS,
    END,
    END_SEEDS,
    PAGE,
    TABLE,
    Policy,
    data_commands,
    evaluate_command,
    read_csv,
    seeds_text,
    table_text,
    train_command,
)

WORDS = f"before\n{BEGIN}\nold\n{END}\nbetween\n{BEGIN_SEEDS}\n{END_SEEDS}\nafter\n"


@pytest.fixture
def commands(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Commands that were called; each leaves what the real one would, but those of chairs, which fail.

    Doors are solved half as often as drawers.
    """
    called: list[list[str]] = []

    def call(command: list[str], environment: object) -> bool:
        called.append(command)
        if command[0] == "train":
            Path(command[command.index("--out") + 1]).mkdir(parents=True, exist_ok=True)
        elif command[0] == "export-policy":
            assert Path(command[1]).is_dir()
            Path(command[2]).touch()
        else:
            assert Path(command[command.index("--policy") + 1]).is_file()
            seed = int(command[command.index("--policy") + 1].split("seed-")[1].split("/")[0])
            solved = 20 + 20 * seed if "OpenCabinetDrawer" in " ".join(command) else 10
            objects = [{"object": name, "episodes": 50, "successes": solved} for name in ("one", "two")]
            report = Path(command[command.index("--out") + 1]) / "report.json"
            report.parent.mkdir(parents=True, exist_ok=True)
            report.write_text(json.dumps({"objects": objects, "timing": {"seconds": 1.0}}))
        return "PushChair" not in command

    monkeypatch.setattr("learning_tables.commands.call", call)
    monkeypatch.setattr(script, "ROLLED", {"train": "4..4", "development": "1000002..1000002"})
    one_each = {"train": ("chair-0004", "generated:chair:200"), "development": ("generated:chair:1000006",)}
    monkeypatch.setattr(script, "SCALED", one_each)
    return called


def run(folder: Path, *options: str) -> int:
    page = folder / "page.md"
    if not page.exists():
        page.write_text(WORDS)
    fixed = ["--work", str(folder / "work"), "--page", str(page), "--tracks", "no-restrictions", "--jobs", "1"]
    return script.main([*fixed, *options])


def test_seeds_are_averaged_and_nothing_is_done_twice(
    tmp_path: Path, commands: list[list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    options = ("--tasks", "OpenCabinetDrawer", "OpenCabinetDoor", "--seeds", "0", "1")
    assert run(tmp_path, *options) == 0
    assert len(commands) == 2 * 2 * 4
    rows = (tmp_path / "page.md").read_text().splitlines()
    assert (rows[0], rows[-1]) == ("before", "after")
    test_row = next(row for row in rows if row.startswith("| no-restrictions | test"))
    doors, drawers = (cell.strip() for cell in test_row.split("|")[3:5])
    assert drawers == "60.0% ± 28.3%, 2 seeds"  # of 40 and 80 %
    assert doors == "20.0% ± 0.0%, 2 seeds"
    by_seed = "\n".join(rows).split(BEGIN_SEEDS)[1]
    assert "| no-restrictions | ood | 20, 20 of 100 | 40, 80 of 100 | missing | missing |" in by_seed
    table = (tmp_path / "data" / "tracks.csv").read_text().splitlines()
    assert len(table) == 1 + 2 * 2 * 2 * 2
    assert "no-restrictions,OpenCabinetDrawer,1,test,two,50,40" in table

    cabinets = [
        list((tmp_path / "work/objects/OpenCabinetDoor" / name).glob("rolled-*"))
        for name in ("train", "development")
    ]
    assert [len(found) for found in cabinets] == [1, 1]
    commands.clear()
    assert run(tmp_path, *options) == 0
    shutil.rmtree(tmp_path / "work")  # the CSV file knows
    assert run(tmp_path, *options) == 0
    assert (
        "nothing to train or to measure: these rows are known; --again makes them anew" in capsys.readouterr().out
    )
    assert commands == []
    assert (tmp_path / "page.md").read_text().splitlines() == rows
    assert (tmp_path / "data" / "tracks.csv").read_text().splitlines() == table


def test_baselines_stand_below(tmp_path: Path, commands: list[list[str]]) -> None:
    trained = {"steps": 20_000, "samples": 2_560_000, "seconds": 90.0, "machine": "2 cores"}
    results = [
        Result(Cell("b", Method("small", "bc"), "PushChair", seed), trained, {"train": of(4), "test": of(seed)})
        for seed in (1, 3)
    ]
    drawer = Result(Cell("a", Method("small", "bcq"), "10", 0), trained, {"new": of(4)})
    settings = make_settings(make_parser().parse_args([]), {})
    (tmp_path / "data").mkdir()
    write_rows(tmp_path / "data" / "learning.csv", [CSV_HEAD, *csv_rows([*results, drawer], settings)])
    assert run(tmp_path, "--tasks", "MoveBucket", "--seeds", "0") == 0
    rows = [
        [cell.strip() for cell in line.strip("| ").split("|")]
        for line in (tmp_path / "page.md").read_text().splitlines()
    ]
    assert [row for row in rows if row[0].startswith("small")] == [
        ["small, BC", "test", "missing", "missing", "50%", "missing"]
    ]
    assert ["ManiSkill paper: PointNet, BC", "its own", "4%", "11%", "9%", "2%"] in rows


def of(successes: int) -> Measured:
    return Measured(Counter(one=successes), Counter(one=4), 60.0)


def test_reports_of_another_command_are_no_results(tmp_path: Path, commands: list[list[str]]) -> None:
    options = ("--tasks", "MoveBucket", "--seeds", "0")
    assert run(tmp_path, *options) == 0
    (tmp_path / "data" / "tracks.csv").unlink()
    before, folder = list(commands), Policy("no-restrictions", "MoveBucket", 0).folder(tmp_path / "work")
    commands.clear()
    assert run(tmp_path, *options) == 0
    assert commands == []  # the folder knows, too
    (tmp_path / "data" / "tracks.csv").unlink()
    (folder / "trained").write_text("train dagger by another recipe")
    assert run(tmp_path, *options) == 0
    assert commands == before


def test_again_makes_rows_anew(tmp_path: Path, commands: list[list[str]], monkeypatch: pytest.MonkeyPatch) -> None:
    options = ("--tasks", "MoveBucket", "--seeds", "0", "1")
    assert run(tmp_path, *options) == 0
    path = tmp_path / "data" / "tracks.csv"
    rows = path.read_text().replace(",50,10", ",50,7")
    path.write_text(rows)
    shutil.rmtree(tmp_path / "work")
    commands.clear()
    options = ("--tasks", "MoveBucket", "--seeds", "1", "--again")
    with monkeypatch.context() as failing:
        failing.setattr("learning_tables.commands.call", lambda command, environment: False)
        assert run(tmp_path, *options) == 1
    assert path.read_text() == rows  # as long as there are no new ones
    assert run(tmp_path, *options) == 0
    assert [command[0] for command in commands] == ["train", "export-policy", "evaluate", "evaluate"]
    assert path.read_text() == re.sub(r"(MoveBucket,1,.*,50),7", r"\1,10", rows)
    page = (tmp_path / "page.md").read_text()
    assert "| no-restrictions | ood | missing | missing | missing | 14, 20 of 100 |" in page
    assert "17.0% ± 4.2%, 2 seeds" in page


def test_again_says_what_it_takes_as_it_is(
    tmp_path: Path, commands: list[list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    options = ("--tasks", "MoveBucket", "--seeds", "0", "2")
    assert run(tmp_path, *options, "--stages", "train") == 0
    shutil.rmtree(Policy("no-restrictions", "MoveBucket", 2).folder(tmp_path / "work"))
    assert run(tmp_path, *options, "--again") == 0  # an interrupted command goes on
    assert [command[0] for command in commands[4:]] == ["evaluate"] * 2 + [
        "train",
        "export-policy",
        *["evaluate"] * 2,
    ]
    assert "taken as it is" not in capsys.readouterr().out
    path = tmp_path / "data" / "tracks.csv"
    path.write_text(path.read_text().replace(",50,10", ",50,7"))
    commands.clear()
    assert run(tmp_path, *options[:-1], "--again") == 0
    assert commands == []
    assert capsys.readouterr().out.splitlines()[0].endswith(str(Path("MoveBucket", "seed-0")))
    page = (tmp_path / "page.md").read_text()
    assert "| no-restrictions | ood | missing | missing | missing | 20, 14 of 100 (seeds 0, 2) |" in page
    assert "\nbetween\n" in page


def test_training_leaves_test_objects_alone(tmp_path: Path, commands: list[list[str]]) -> None:
    options = ("--tasks", "MoveBucket", "--seeds", "3", "--stages")
    assert run(tmp_path, *options, "train") == 0
    assert [command[0] for command in commands] == ["train", "export-policy"]
    assert run(tmp_path, *options, "evaluate") == 0
    assert [command[0] for command in commands] == ["train", "export-policy", "evaluate", "evaluate"]


def test_what_fails_is_not_measured(tmp_path: Path, commands: list[list[str]]) -> None:
    assert run(tmp_path, "--tasks", "PushChair", "MoveBucket", "--seeds", "0") == 1
    assert [command[0] for command in commands] == ["train", "train", "export-policy", "evaluate", "evaluate"]


def test_larger_chairs_are_made_once(tmp_path: Path, commands: list[list[str]]) -> None:
    options = ("--tasks", "PushChair", "--seeds", "0", "--stages", "train")
    assert run(tmp_path, *options) == 1
    lists = [tmp_path / "work/objects/PushChair" / name / "objects.yaml" for name in ("train", "development")]
    train, development = (resolve_objects([str(path)], task="PushChair") for path in lists)
    assert [one.metadata["scaled_from"] for one in train] == ["chair-0004", "generated-chair-200"]
    assert [one.metadata["scaled_from"] for one in development] == ["generated-chair-1000006"]
    assert all(1.05 <= one.metadata["scale"] <= 1.35 for one in (*train, *development))
    when = [path.stat().st_mtime_ns for path in lists]
    assert run(tmp_path, *options) == 1
    assert [path.stat().st_mtime_ns for path in lists] == when
    assert [word for word in commands[0] if word.endswith(".yaml")] == [str(path) for path in lists]


def test_commands_of_the_tracks() -> None:
    work = Path("w")
    student = Policy("interactive-expert", "PushChair", 2)
    assert " ".join(train_command(student, work)) == (
        "train dagger --task PushChair --out w/interactive-expert/PushChair/seed-2/run --objects train "
        "--seed 2 --threads 1 --workers 1"
    )
    drawer = " ".join(train_command(Policy("interactive-expert", "OpenCabinetDrawer", 0), work))
    assert "--objects train --set network.input.velocities=true --seed 0 " in drawer
    assert "velocities" not in " ".join(train_command(Policy("no-restrictions", "OpenCabinetDrawer", 0), work))
    door = " ".join(train_command(Policy("no-restrictions", "OpenCabinetDoor", 0), work))
    assert (
        "--objects train generated:cabinet:0..599 w/objects/OpenCabinetDoor/train/objects.yaml "
        "--dev-objects generated:cabinet:1000000..1000023 w/objects/OpenCabinetDoor/development/objects.yaml "
        "--seed 0 "
    ) in door
    assert "w/objects" not in " ".join(train_command(Policy("interactive-expert", "OpenCabinetDoor", 0), work))
    chair = " ".join(train_command(Policy("no-restrictions", "PushChair", 1), work))
    assert (
        "--objects train generated:chair:0..199 w/objects/PushChair/train/objects.yaml "
        "--dev-objects generated:chair:1000000..1000005 w/objects/PushChair/development/objects.yaml "
        "--set algorithm.generated_share=0.5 --seed 1 "
    ) in chair
    imitators = [Policy("no-interactions", task, 0) for task in ("MoveBucket", "PushChair")]
    bucket, chair = (" ".join(train_command(policy, work)) for policy in imitators)
    assert bucket == (
        "train command_bc --task MoveBucket --out w/no-interactions/MoveBucket/seed-0/run --dev-objects none "
        "--data w/sets/MoveBucket --seed 0 --threads 1 --workers 1"
    )
    assert chair == (
        "train bc --task PushChair --out w/no-interactions/PushChair/seed-0/run --dev-objects none "
        "--data w/sets/PushChair --steps 2000 --seed 0 --threads 1 --workers 1"
    )
    collect, _ = data_commands("OpenCabinetDoor", work, 2)
    assert "--per-object 120" in " ".join(collect)
    for task, method in {"MoveBucket": "shares", "PushChair": "maniskill"}.items():
        _, make_set = data_commands(task, work, 2)
        assert f"--points 128 --method {method} --frame robot" in " ".join(make_set)
    assert " ".join(evaluate_command(student, "ood", work)) == (
        "evaluate --policy w/interactive-expert/PushChair/seed-2/policy.npz --protocol "
        "artiskill-1/PushChair/ood/joint/pointcloud --track interactive-expert "
        "--out w/interactive-expert/PushChair/seed-2/ood --workers 1"
    )


def test_a_set_that_was_made_in_another_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sampling = {"num_points": 128, "method": "shares", "frame": "robot"}
    held = SimpleNamespace(sampling=sampling, trajectories=80, objects=["bucket-0000", "bucket-0001"])
    monkeypatch.setattr(script, "is_training_set", lambda folder: True)
    monkeypatch.setattr(script, "read_set_manifest", lambda folder: held)
    assert data_commands("MoveBucket", tmp_path, 2) == []
    with pytest.raises(ConfigError, match="40 demonstrations of each object, not 120"):
        data_commands("OpenCabinetDoor", tmp_path, 2)
    with pytest.raises(
        ConfigError, match=r"--method shares --frame robot, not .*--method maniskill .*: remove it"
    ):
        data_commands("PushChair", tmp_path, 2)


@pytest.mark.parametrize("words", ["nothing", f"{BEGIN}\n{END}\n"])
def test_a_page_without_marks(
    words: str, tmp_path: Path, commands: list[list[str]], capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "page.md").write_text(words)
    assert run(tmp_path, "--tasks", "MoveBucket", "--seeds", "0") == 2
    error = capsys.readouterr().err
    assert "lacks the marks" in error
    assert END_SEEDS in error
    assert commands == []  # said before hours of training


def test_the_pages_say_what_the_rows_say() -> None:
    found = read_csv(PAGE.parent / TABLE)
    page = PAGE.read_text(encoding="utf-8")
    assert table_text(found, PAGE) in page
    assert seeds_text(found) in page
    readme = (PAGE.parents[1] / "README.md").read_text(encoding="utf-8")
    rows = {
        "| test | ": ("no-restrictions", "test"),
        "| ood | ": ("no-restrictions", "ood"),
        "| test, trained on the benchmark's training objects alone | ": ("interactive-expert", "test"),
        "| test, trained on demonstrations of these alone | ": ("no-interactions", "test"),
    }
    for head, (track, split) in rows.items():
        line = next(line for line in readme.splitlines() if line.startswith(head) and "±" in line)
        cells = [cell.strip() for cell in line.removeprefix(head).strip("| ").split("|")]
        for task, cell in zip(
            ("OpenCabinetDrawer", "OpenCabinetDoor", "PushChair", "MoveBucket"), cells, strict=True
        ):
            rates = [one[split].rate for policy, one in found.items() if policy[:2] == (track, task)]
            spread = f" ± {np.std(rates, ddof=1):.1%}" if len(rates) > 1 else ""
            mean = f"{np.mean(rates):.1%}{spread}".replace("%", "")  # rounded as the page's table is
            assert cell.split(" (")[0] == mean, (head, task)
            assert "(" not in cell or str(len(rates)) in cell.split("(")[1]

"""Queue and tables of variants, with commands that write what real ones would."""

import json
import shutil
from pathlib import Path

import pytest

import make_variant_tables as script
from artiskill.assets.catalog import resolve_objects
from artiskill.cli.parser import overrides_of
from artiskill.learning.train_config import load_train_config
from make_variant_tables import ABLATIONS, BEGIN, COUNTS, END, TASK, Variant, evaluate_command, train_command


@pytest.fixture
def commands(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Commands that were called; each leaves what the real one would, half of the episodes being solved."""
    called: list[list[str]] = []

    def call(command: list[str], environment: object) -> bool:
        called.append(command)
        folder = Path(command[command.index("--out") + 1])
        folder.mkdir(parents=True, exist_ok=True)
        if command[0] == "evaluate":
            objects = [
                {"object": name, "episodes": 4, "successes": k} for k, name in enumerate(("a", "b", "c", "d"))
            ]
            (folder / "report.json").write_text(json.dumps({"objects": objects, "timing": {"seconds": 1.0}}))
        return "network.input.frames=[tool]" not in command

    monkeypatch.setattr("learning_tables.commands.call", call)
    return called


def run(folder: Path, *options: str) -> int:
    page = folder / "page.md"
    if not page.exists():
        page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    return script.main(["--work", str(folder / "work"), "--page", str(page), "--jobs", "1", *options])


def test_what_is_finished_stays_and_what_fails_is_not_measured(tmp_path: Path, commands: list[list[str]]) -> None:
    options = ("--counts", "25", "--ablations", "no-dagger", "hand-frame")
    assert run(tmp_path, *options) == 1
    assert [command[0] for command in commands] == ["train", *["evaluate"] * 3, "train", "evaluate", "train"]
    rows = (tmp_path / "page.md").read_text().splitlines()
    assert (rows[0], rows[-1]) == ("before", "after")
    cells = {row.split(" | ")[0].strip("| "): row.split(" | ")[1:] for row in rows if row.startswith("| ")}
    assert all(cell.startswith("37.5% (") for cell in cells["25"])
    assert cells["the expert alone acts: behaviour cloning"][0].startswith("37.5% (")
    assert not {"100", "points in the hand's frame alone"} & set(cells)
    table = (tmp_path / "data" / "variants.csv").read_text().splitlines()
    assert "counts,25,0,ood,d,4,3" in table
    assert len(table) == 1 + 4 * 4

    commands.clear()
    shutil.rmtree(tmp_path / "work")  # the CSV file knows
    assert run(tmp_path, "--counts", "25", "--ablations", "no-dagger") == 0
    assert commands == []
    assert (tmp_path / "data" / "variants.csv").read_text().splitlines() == table


def test_a_report_of_another_command_is_no_result(tmp_path: Path, commands: list[list[str]]) -> None:
    options = ("--counts", "--ablations", "no-dagger")
    assert run(tmp_path, *options) == 0
    (tmp_path / "data" / "variants.csv").unlink()
    before = list(commands)
    commands.clear()
    assert run(tmp_path, *options) == 0
    assert commands == []  # the folder knows, too
    (tmp_path / "data" / "variants.csv").unlink()
    (tmp_path / "work" / "ablations" / "no-dagger" / "seed-0" / "trained").write_text("train dagger otherwise")
    assert run(tmp_path, *options) == 0
    assert commands == before


def test_rows_that_say_nothing_are_left_out(tmp_path: Path, commands: list[list[str]]) -> None:
    """Of a variant that is no more, and of one that was not measured on everything."""
    (tmp_path / "data").mkdir()
    rows = [
        "ablations,gone,0,generated,a,4,1",
        "counts,25,0,generated,a,4,1",
        "ablations,one-kind,0,generated,a,4,1",
    ]
    (tmp_path / "data" / "variants.csv").write_text("\n".join([",".join(script.CSV_HEAD), *rows, ""]))
    assert run(tmp_path, "--counts", "--ablations") == 0
    assert (tmp_path / "data" / "variants.csv").read_text().splitlines()[1:] == rows[2:]


@pytest.mark.parametrize("name", ABLATIONS)
def test_an_ablation_changes_one_thing(name: str) -> None:
    pytest.importorskip("torch")
    command = train_command(Variant("ablations", name, 0), Path("w"))
    values = [text for text in command if "=" in text]
    network = command[command.index("--network") + 1] if "--network" in command else None
    changed = load_train_config("dagger", TASK, network, overrides_of(values))
    unchanged = load_train_config("dagger", TASK, overrides={"network.input.velocities": True})
    assert (changed == unchanged) == (name == "as-it-is" or "--points" in command)
    assert changed.network.input.velocities == (network is None)


def test_commands() -> None:
    few = Variant("counts", "25", 3)
    assert " ".join(train_command(few, Path("w"))) == (
        "train dagger --task OpenCabinetDrawer --out w/counts/25/seed-3/run --objects generated:cabinet:0..37 "
        "--set network.input.velocities=true --seed 3 --threads 1 --workers 1"
    )
    assert "--objects generated:cabinet:7000000..7000059 --episodes 4" in " ".join(
        evaluate_command(few, "generated", Path("w"))
    )
    assert "--protocol artiskill-1/OpenCabinetDrawer/ood/joint/pointcloud" in " ".join(
        evaluate_command(few, "ood", Path("w"))
    )


def test_so_many_cabinets_have_a_drawer() -> None:
    found = resolve_objects([f"generated:cabinet:0..{COUNTS[25]}"], task=TASK)
    assert len(found) == 25
    assert found[-1] == f"generated-cabinet-{COUNTS[25]}"


def test_what_is_not_legal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(tmp_path, "--jobs", "0") == 2
    assert "--jobs must be at least 1" in capsys.readouterr().err

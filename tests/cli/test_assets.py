"""`artiskill assets`: what its commands print and write, and how they end."""

import io
import json
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from rich.console import Console

from artiskill.checks.context import CheckResult, at_least, at_most, failed, fine
from artiskill.checks.runner import ObjectReport
from artiskill.cli.assets import print_to
from artiskill.cli.main import main
from artiskill.experts.mpc import SolveResult


def test_writes_where_it_says(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "box"
    assert main(["assets", "export", "cabinet-0001", "--format", "mjcf", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert str(out / "cabinet-0001.xml") in said
    assert mujoco.MjModel.from_xml_path(str(out / "cabinet-0001.xml")).nbody > 1


def test_the_folder_is_named_after_object_and_format(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["assets", "export", "generated:bucket:3", "--format", "urdf"]) == 0
    assert (tmp_path / "exported" / "generated-bucket-3-urdf" / "mobility.urdf").is_file()


def test_several_objects_get_a_folder_each(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    names = ["bucket-0001", "generated:chair:7"]
    assert main(["assets", "export", *names, "--format", "urdf", "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    for object_id in ("bucket-0001", "generated-chair-7"):
        file = tmp_path / object_id / "mobility.urdf"
        assert f"{object_id}: {file}" in said
        assert file.is_file()


def test_several_objects_have_a_folder_of_their_own_by_default(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["assets", "export", "generated:bucket:3..4", "--format", "mjcf"]) == 0
    assert sorted(path.name for path in (tmp_path / "exported" / "mjcf").iterdir()) == [
        "generated-bucket-3",
        "generated-bucket-4",
    ]


def test_another_object_is_not_replaced_unasked(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    def export(name: str, *more: str) -> int:
        return main(["assets", "export", name, "--format", "urdf", "--out", str(tmp_path / "out"), *more])

    assert export("bucket-0001") == 0
    assert export("bucket-0001") == 0
    assert export("bucket-0002") == 2
    assert "an export of 'bucket-0001'" in capsys.readouterr().err
    assert export("bucket-0002", "--force") == 0


def test_gltf_is_understood(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    pytest.importorskip("trimesh", reason="needs the extra `export`")
    assert main(["assets", "export", "bucket-0001", "--format", "gltf", "--out", str(tmp_path / "out")]) == 0
    assert (tmp_path / "out" / "bucket-0001.glb").is_file()
    assert "reads glTF" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["cabinet-0001", "--format", "usd"], "unknown format 'usd'"),
        (["cabinet-001", "--format", "mjcf"], "did you mean 'cabinet-0001'"),
        (["cabinet-0001"], "--format"),
        (["cabinet-0001", "--format", "mjcf", "--fource"], "did you mean '--force'"),
    ],
)
def test_one_line_says_what_is_wrong(
    arguments: list[str],
    said: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["assets", "export", *arguments]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_foreign_files_are_only_replaced_by_force(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    command = ["assets", "export", "cabinet-0001", "--format", "mjcf", "--out", str(tmp_path)]
    assert main(command) == 2
    assert "notes.txt" in capsys.readouterr().err
    assert main([*command, "--force"]) == 0
    assert not (tmp_path / "notes.txt").exists()


def test_makes_the_page_of_the_named_objects(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["assets", "gallery", "cabinet-0001", "--out", str(out), "--workers", "1"]) == 0
    assert str(out / "index.html") in capsys.readouterr().out
    assert "cabinet-0001" in (out / "objects.js").read_text()


def test_unknown_names_are_said_before_anything_is_written(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    assert main(["assets", "gallery", "cabinet-001", "--out", str(out)]) == 2
    assert "did you mean" in capsys.readouterr().err
    assert not out.exists()


COMMAND = ["assets", "solve", "cabinet-0002", "--task", "OpenCabinetDrawer"]


def test_each_level_is_told_when_it_is_done(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shown_before: list[str] = []

    def solve(env: object, level: int, config: object, threads: int) -> SolveResult:
        assert threads == 1
        shown_before.append(capsys.readouterr().err)
        return SolveResult("cabinet-0002", "link_0", level, level == 0, 40 + level, 9.5, 61.2, np.zeros((1, 13)))

    monkeypatch.setattr("artiskill.experts.mpc.solve_level", solve)
    assert main([*COMMAND, "--levels", "0", "1", "--threads", "1"]) == 1
    assert shown_before[0] == ""
    assert "cabinet-0002, link_0, level 0: solved in 40 steps, 61 s\n" in shown_before[1]
    shown = capsys.readouterr()
    assert "cabinet-0002, link_0, level 1: not solved after 41 steps, 61 s\n" in shown.err
    assert [line.split()[3] for line in shown.out.splitlines() if "cabinet" in line] == ["yes", "no"]


@pytest.mark.parametrize("threads", ["0", "-2"])
def test_threads(threads: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*COMMAND, f"--threads={threads}"]) == 2
    assert capsys.readouterr().err == f"error: --threads must be at least 1, not {threads}\n"


def named(check: str, result: CheckResult) -> CheckResult:
    return replace(result, check=check)


SOUND = (
    named("compiles", fine("object", "")),
    named("closed", at_most("object", 0.2, 1.0, "mm")),
    named("roll", at_least("way", 0.5, 0.1, "m")),
)


def text_of(reports: list[ObjectReport], width: int = 120) -> str:
    console = Console(width=width, record=True, file=io.StringIO())
    print_to(console, reports)
    return console.export_text()


def test_a_table_of_sound_objects() -> None:
    text = text_of([ObjectReport("chair-1", "chair", "generated", SOUND, 0.1)])
    assert "chairs" in text
    assert "0.20" in text
    assert "faults\n" not in text
    assert "all pass" in text
    assert "compiles" not in text  # nothing to say about it


def test_faults_are_listed_and_shortened() -> None:
    faults = tuple(named("sweep", at_most(f"link_{i}", 5.0 + i, 1.0, "mm", "wheel in [fork]")) for i in range(9))
    lean = named("roll", at_most("lean", 20.0, 10.0, "deg", "60 N"))
    report = ObjectReport(
        "chair-1", "chair", "generated", (*SOUND, *faults, lean, named("loads", failed("object", "x"))), 0.1
    )
    text = text_of([report])
    assert "13.0 !" in text
    assert "20.0 deg !" in text  # another unit than its column's
    assert "wheel in [fork]" in text  # no markup
    assert "and 6 more" in text
    assert "1 of 1 objects fail" in text


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out.json"
    arguments = ["assets", "check", "generated:cabinet:8", "--workers", "1"]
    assert main([*arguments, "--json", str(out)]) in (0, 1)
    assert json.loads(out.read_text(encoding="utf-8"))["objects"][0]["id"] == "generated-cabinet-8"
    assert main([*arguments, "--set", "categories.cabinet.mass_kg=[1, 2]"]) == 1
    assert "1 to 2 kg" in capsys.readouterr().out


def test_errors_name_what_is_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["assets", "check", "cabinet-1"]) == 2
    assert "cabinet-0001" in capsys.readouterr().err
    assert main(["assets", "chekc"]) == 2
    assert "check" in capsys.readouterr().err
    assert main(["assets", "check", "--worker", "2"]) == 2
    assert "--workers" in capsys.readouterr().err
    assert main(["assets", "check", "generated:cabinet:8", "--json", "/no/such/place.json"]) == 2

"""`artiskill evaluate --protocol`, `artiskill protocols` and `artiskill report`."""

import json
from pathlib import Path

import pytest

from artiskill.cli.main import main
from artiskill.evaluation.protocols import standard_protocols

Capture = pytest.CaptureFixture[str]
PLAYED = [
    "--objects",
    "cabinet-0002",
    "cabinet-0007",
    "--episodes",
    "2",
    "--workers",
    "1",
    "--set",
    "episode_steps=4",
]


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folders = {name: tmp_path_factory.mktemp(name) for name in ("random", "still")}
    for policy, folder in folders.items():
        assert (
            main(["evaluate", "--policy", policy, *PLAYED, "--fresh-levels", "tomorrow", "--out", str(folder)])
            == 0
        )
    return folders


def test_a_report_is_verified(reports: dict[str, Path], capsys: Capture) -> None:
    command = ["report", "verify", str(reports["random"]), "--workers", "1"]
    assert main([*command, "--policy", "random", "--sample", "1"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "4 episodes, 16 steps played again: bit for bit as reported"
    assert lines[1] == "2 episodes played again by random: bit for bit as reported"
    assert main([*command, "--policy", "still"]) == 1
    assert "the policy acts otherwise from step 0 on" in capsys.readouterr().out


def test_a_forged_report_is_refused(reports: dict[str, Path], tmp_path: Path, capsys: Capture) -> None:
    for path in reports["still"].iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    data = json.loads((tmp_path / "report.json").read_text())
    (tmp_path / "report.json").write_text(json.dumps(data | {"success_rate": 1.0}, indent=2) + "\n")
    assert main(["report", "verify", str(tmp_path), "--workers", "1"]) == 1
    assert "  report.json: success_rate 1.0 there, 0.0 here\n" in capsys.readouterr().out
    (tmp_path / "actions.npz").unlink()
    assert main(["report", "verify", str(tmp_path)]) == 2
    assert "is no whole report: actions.npz: No such file" in capsys.readouterr().err


def test_reports_are_compared(reports: dict[str, Path], tmp_path: Path, capsys: Capture) -> None:
    assert main(["report", "compare", str(reports["random"]), str(reports["still"])]) == 0
    shown = capsys.readouterr().out
    assert "/fresh-tomorrow" in shown
    assert "second minus first: +0.0% (no interval: all episodes differ alike)" in shown
    assert main(["evaluate", "--policy", "still", *PLAYED, "--out", str(tmp_path)]) == 0
    capsys.readouterr()
    assert main(["report", "compare", str(reports["random"]), str(tmp_path)]) == 2
    assert capsys.readouterr().err.startswith("error: reports of different protocols do not compare: 'custom/")


def test_protocols_are_listed(capsys: Capture) -> None:
    assert main(["protocols"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(standard_protocols())
    assert all(line.endswith(" levels") for line in lines)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (
            ["--protocol", "artiskill-1/PushChair/test/joint/stat"],
            "did you mean 'artiskill-1/PushChair/test/joint/",
        ),
        (["--protocol", "artiskill-1/PushChair/test/joint/state", "--episodes", "5"], "decides --episodes, too"),
        (
            ["--track", "no-limits"],
            "egal: interactive-expert, no-external-annotations, no-interactions, no-restr",
        ),
        (["--fresh-levels", "a", "--seed", "3"], "fresh levels have no first one"),
    ],
)
def test_what_does_not_go_together(options: list[str], says: str, capsys: Capture) -> None:
    assert main(["evaluate", "--policy", "random", *options]) == 2
    assert says in capsys.readouterr().err


def test_a_policy_with_other_cameras_plays_no_standard_protocol(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "solution.py"
    path.write_text(
        "class Policy:\n    obs_mode, observation_config = 'pointcloud', {'cameras': {'width': 80}}\n"
        "    def reset(self, observation, info): ...\n    def act(self, observation): ...\n"
    )
    name = "artiskill-1/OpenCabinetDrawer/test/joint/pointcloud"
    assert main(["evaluate", "--policy", str(path), "--protocol", name]) == 2
    assert f"asks for other cameras or another picture quality than {name} has" in capsys.readouterr().err


def test_pages_and_leaderboards_are_written(reports: dict[str, Path], tmp_path: Path, capsys: Capture) -> None:
    """Of fresh levels, too; what is forged makes no page, and is not ranked."""
    mine, forged = tmp_path / "mine", tmp_path / "forged"
    for folder in (mine, forged):
        folder.mkdir()
        for path in reports["random"].iterdir():
            (folder / path.name).write_bytes(path.read_bytes())
    command = ["report", "page", str(mine), "--workers", "1", "--films", "1", "--verify"]
    assert main(command) == 0
    assert f"page: {mine}/page.html\n" in capsys.readouterr().out
    page = (mine / "page.html").read_text()
    assert "fresh, salt tomorrow" in page
    assert "all 4 episodes (16 steps) were played again" in page
    text = (forged / "episodes.csv").read_text()
    (forged / "episodes.csv").write_text(text[:-3] + ("1" if text[-3] != "1" else "2") + text[-2:])
    assert main(["report", "page", str(forged), "--workers", "1", "--verify"]) == 2
    assert "is not what it says: episodes.csv: line 5" in capsys.readouterr().err
    assert main(["report", "leaderboard", str(tmp_path), "--workers", "1", "--verify"]) == 0
    assert f"not ranked: {forged}: episodes.csv: line 5" in capsys.readouterr().out
    assert '<a href="./mine/page.html">' in (tmp_path / "leaderboard.html").read_text()
    assert main(["report", "leaderboard", str(tmp_path / "nothing")]) == 2

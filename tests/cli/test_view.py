"""`artiskill view`: what is refused, and that Ctrl-C ends all."""

import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from artiskill.cli.main import main
from artiskill.demos.demos import PACK
from artiskill.evaluation.evaluate import evaluate
from artiskill.evaluation.report import write_report

DEMOS = str(PACK / "OpenCabinetDrawer")


@pytest.fixture(autouse=True)
def _needs_viser() -> None:
    pytest.importorskip("viser")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["cabinet-0005", "--task", "PushChair"], "--task does not go with objects"),
        (["cabinet-0005", "--export", "a.html"], "--export does not go with objects"),
        (["cabinet-0005", "--demonstration", "1"], "--demonstration does not go with objects"),
        ([DEMOS, "--policy", "still"], "--policy does not go with demonstrations"),
        ([DEMOS, "--record", "demos"], "--record does not go with demonstrations"),
        ([DEMOS, "--episode", "1"], "--episode does not go with demonstrations"),
        (["--record", DEMOS, "--port", "0"], "holds demonstrations of other settings"),
        (["--demonstration", "1"], "--demonstration does not go with an episode that is played"),
        (["cabinet-999"], "unknown object 'cabinet-999'"),
        (["--task", "OpenDoor"], "unknown task 'OpenDoor'"),
        (["--policy", "nobody"], "unknown policy 'nobody'"),
        (["--export", "a.mp4"], "must end in .html"),
        (["--port", "70000"], "[0, 65535]"),
        ([DEMOS, "--demonstration", "99", "--export", "a.html"], "not 99"),
    ],
)
def test_what_is_refused(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["view", *arguments]) == 2
    assert message in capsys.readouterr().err


def test_a_demonstration_is_exported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "demo.html"
    assert main(["view", DEMOS, "--demonstration", "1", "--export", str(path)]) == 0
    assert re.fullmatch(rf"replay: {path} \(\d\.\d MB\)\n", capsys.readouterr().out)


def test_an_episode_of_a_report_is_exported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    played = evaluate("OpenCabinetDrawer", "still", "cabinet-0002", 2, config={"episode_steps": 5})
    folder, path = str(write_report(played, tmp_path / "report")), tmp_path / "episode.html"
    assert main(["view", folder, "--episode", "1", "--export", str(path)]) == 0
    assert "level 1, still" in path.read_text(encoding="utf-8")
    assert main(["view", folder, "--episode", "2", "--export", str(path)]) == 2
    assert "the episodes 0 to 1, not 2" in capsys.readouterr().err
    assert main(["view", folder, "--policy", "still"]) == 2
    assert "--policy does not go with a report" in capsys.readouterr().err


def test_ctrl_c_ends_all() -> None:
    command = [sys.executable, "-m", "artiskill", "view", "--port", "0"]
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # tests may run where it is ignored
    ) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        found = re.fullmatch(r"open (http://127\.0\.0\.1:\d+) in a browser; Ctrl-C ends\n", line)
        assert found is not None, line
        page = urllib.request.urlopen(found[1], timeout=60).read()
        assert b"<html" in page
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=60) == 130
        assert process.stdout.read() == ""

"""The command line as a person meets it."""

import argparse
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
import yaml

from artiskill import __version__
from artiskill.cli.main import main
from artiskill.cli.parser import UsageError, overrides_of
from artiskill.files import lock_folder

Capture = pytest.CaptureFixture[str]
SMALL = ["--objects", "cabinet-0005", "--episodes", "1", "--workers", "1"]
CABINET_TASKS = ("OpenCabinetDrawer", "OpenCabinetDoor")
COMMAND = [sys.executable, "-m", "artiskill"]
# What `--help` has no time for.
HEAVY = ("scipy", "numba", "rich", "PIL", "torch", "artiskill.envs.manipulation", "artiskill.evaluation.evaluate")


def test_evaluate_writes_shows_and_films(tmp_path: Path, capsys: Capture) -> None:
    out, film = tmp_path / "out", tmp_path / "films" / "film.gif"
    films = ["--video", str(film), "--set", "episode_steps=6"]
    assert main(["evaluate", "--policy", "random", *SMALL, "--out", str(out), *films]) == 0
    shown = capsys.readouterr()
    assert re.search(r"cabinet-0005 +any +0/1 +0%", shown.out)
    assert "policy random: 0.0% solved" in shown.out
    assert "1/1 episodes" in shown.err
    data = json.loads((out / "report.json").read_text())
    assert (data["policy"], data["mean_length"], data["config"]["episode_steps"]) == ("random", 6, 6)
    assert film.stat().st_size > 1000


def test_the_demo_is_the_commands_that_it_prints(capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    ran: list[argparse.Namespace] = []
    for name in ("evaluate._run_evaluate", "report._run_page"):
        monkeypatch.setattr(f"artiskill.cli.{name}", ran.append)
    prepared: list[bool] = []
    monkeypatch.setattr("artiskill.evaluation.recording.prepare_films", lambda: prepared.append(True))
    assert main(["demo", "--out", "some/where", "--workers", "1"]) == 0
    printed = capsys.readouterr().out
    commands = [line.split()[1:] for line in printed.splitlines() if line.startswith("artiskill ")]
    assert [one[:3] for one in commands[::2]] == [["evaluate", "--task", task] for task in CABINET_TASKS]
    for task, page in zip(CABINET_TASKS, commands[1::2], strict=True):
        assert page[:3] == ["report", "page", f"some/where/{task}"]
        assert f"some/where/{task}/page.html" in printed
    for command in commands:
        assert main(command) == 0
    first, second = ([vars(one) | {"parser": None, "run": None} for one in half] for half in (ran[:4], ran[4:]))
    assert first == second
    assert (first[0]["policy"], first[1]["films"], prepared) == ("pretrained", 6, [True])
    assert all(one["objects"] == ["test"] for one in first[::2])


@pytest.mark.slow
def test_the_demo_opens_cabinets_without_any_extra(tmp_path: Path) -> None:
    extras = "imageio", "imageio_ffmpeg", "matplotlib", "h5py", "trimesh", "pygame"
    code = (
        f"import sys; sys.modules.update(dict.fromkeys({extras}))\n"
        "from artiskill.cli.main import main; sys.exit(main())"
    )
    subprocess.run([sys.executable, "-c", code, "demo"], cwd=tmp_path, check=True)
    for task in CABINET_TASKS:
        folder = tmp_path / "results" / "demo" / task
        report = json.loads((folder / "report.json").read_text())
        assert (report["episodes"], report["policy"]) == (10, "pretrained")
        assert 100_000 < (folder / "page.html").stat().st_size < 10_000_000


def test_objects(capsys: Capture) -> None:
    assert main(["objects", "--task", "OpenCabinetDrawer", "--split", "test"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 10
    assert [line.split()[1] for line in lines] == ["test"] * 10
    assert any(line.split()[:5] == ["cabinet-0005", "test", "display", "drawers", "link_0"] for line in lines)


def test_tasks(capsys: Capture) -> None:
    assert main(["tasks"]) == 0
    assert "OpenCabinetDrawer  25 train, 10 test, 9 ood objects" in capsys.readouterr().out


def test_config_show_has_robot_and_light_and_takes_dotted_keys(capsys: Capture) -> None:
    changes = ["robot=two_arms", "robot.drives.arm_damping=50", "physics.solver=cg", "render.sun.strength=0.5"]
    assert main(["config", "show", "OpenCabinetDoor", "--set", *changes]) == 0
    shown = yaml.safe_load(capsys.readouterr().out)
    assert (shown["robot"]["name"], shown["robot"]["drives"]["arm_damping"]) == ("two_arms", 50)
    assert (shown["physics"]["solver"], shown["render"]["sun"]["strength"]) == ("cg", 0.5)
    assert {"drives", "actions", "mounts"} <= set(shown["robot"])
    assert {"lamps", "floor", "background"} <= set(shown["render"])


def test_config_show(capsys: Capture) -> None:
    assert main(["config", "show", "OpenCabinetDrawer", "--set", "success.hold_s=0.25", "episode_steps=7"]) == 0
    shown = capsys.readouterr().out
    assert "hold_s: 0.25" in shown
    assert "episode_steps: 7" in shown


def test_version(capsys: Capture) -> None:
    assert main(["version"]) == 0
    assert f"artiskill {__version__}" in capsys.readouterr().out.splitlines()


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("evalute", "unknown command 'evalute'; did you mean 'evaluate'?"),
        ("evaluate --episods 3", "unknown option '--episods'; did you mean '--episodes'?"),
        ("evaluate --episode 3", "did you mean '--episodes'?"),
        ("evaluate --episodes three", "invalid int value: 'three'"),
        ("evaluate --episodes 0", "episodes must be a whole number of at least 1"),
        ("evaluate --task OpenCabinetDrwer", "did you mean 'OpenCabinetDrawer'?"),
        ("evaluate --objects cabnet-0005", "unknown object 'cabnet-0005'"),
        ("evaluate --policy exprt", "did you mean 'expert'?"),
        ("evaluate --policy nowhere/solution.py", "'nowhere/solution.py' does not exist"),
        ("evaluate --obs-mode stat", "did you mean 'state'?"),
        ("evaluate --target link_99", "unknown target link 'link_99'"),
        ("evaluate --set episode_steps", "--set needs KEY=VALUE"),
        ("evaluate --set episode_stps=3", "did you mean 'episode_steps'?"),
        ("evaluate --set episode_steps=[", "not valid YAML"),
        ("evaluate --video film.avi", "must end in .gif"),
        ("evaluate --video film.gif --video-episodes 0", "must be at least 1"),
        ("evaluate --workers 0", "workers must be"),
        ("evaluate --step-timeout 0", "must be a positive number of seconds, not 0.0"),
        ("evaluate --seed -1", "a level is an integer from 0"),
        ("evaluate more", "unexpected argument 'more'"),
        ("config shw OpenCabinetDrawer", "did you mean 'show'?"),
        ("config show Nothing", "unknown task 'Nothing'"),
        ("objects --split tst", "did you mean 'test'?"),
        ("objects --task Nothing", "unknown task 'Nothing'"),
        ("", "required: COMMAND"),
    ],
)
def test_errors_are_one_line(
    line: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    out = ["--out", "out"] if line.startswith("evaluate") else []
    assert main([*line.split(), *out]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("error: ")
    assert shown.err.count("\n") == 1
    assert says in shown.err
    assert not list(tmp_path.iterdir())


def test_a_failing_solution_leaves_nothing(tmp_path: Path, capsys: Capture) -> None:
    solution = tmp_path / "solution.py"
    solution.write_text("def policy(observation):\n    raise ValueError('no idea')\n")
    assert main(["evaluate", "--policy", str(solution), *SMALL, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error == (
        f"error: {solution}: policy() raised ValueError: no idea (line 2, object cabinet-0005, level 0, step 0)\n"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["solution.py"]


def test_an_earlier_report_is_not_taken_for_that_of_a_run_that_failed(tmp_path: Path, capsys: Capture) -> None:
    """Not even where a policy ends with the exit status of success."""
    solution, out = tmp_path / "solution.py", tmp_path / "out"
    assert main(["evaluate", "--policy", "still", *SMALL, "--out", str(out), "--set", "episode_steps=2"]) == 0
    before = (out / "report.json").read_bytes()
    capsys.readouterr()
    for text in ("import os\ndef policy(observation):\n    os._exit(0)\n", "import os\nos._exit(0)\n"):
        solution.write_text(text)
        assert main(["evaluate", "--policy", str(solution), *SMALL, "--out", str(out)]) == 2
        shown = capsys.readouterr()
        assert shown.out == ""
        assert "its process ended (exit status 0)" in shown.err
        assert f"note: {out}/report.json is from an earlier evaluation\n" in shown.err
        assert (out / "report.json").read_bytes() == before


def test_only_one_evaluation_per_folder(tmp_path: Path, capsys: Capture) -> None:
    with lock_folder(tmp_path):
        assert main(["evaluate", "--policy", "random", *SMALL, "--out", str(tmp_path)]) == 2
    shown = capsys.readouterr()
    assert re.fullmatch(r"error: another evaluation \(process \d+\) is already writing to .*\n", shown.err)
    assert not list(tmp_path.iterdir())


def test_a_report_that_could_not_be_written_is_not_made(tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "report.json").mkdir()
    assert main(["evaluate", "--policy", "random", *SMALL, "--out", str(tmp_path)]) == 2
    assert "report.json' is a folder" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["report.json"]


def test_debug_shows_the_traceback() -> None:
    with pytest.raises(UsageError):
        main(["evaluate", "more", "--debug"])


def test_overrides_are_read_as_yaml() -> None:
    assert overrides_of(["a.b=1", "c=[1, x]", "d=", "e=a=b"]) == {"a.b": 1, "c": [1, "x"], "d": None, "e": "a=b"}


def test_help_is_light_and_quick() -> None:
    code = (
        "import sys, contextlib, artiskill.cli.main as m\n"
        "with contextlib.suppress(SystemExit): m.main(['evaluate', '--help'])\n"
        f"print('heavy:', *[name for name in {HEAVY!r} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert "--video-episodes" in done.stdout
    assert done.stdout.splitlines()[-1] == "heavy:"


def processes_of(session: int) -> list[str]:
    """State lines of the processes that are left of a session."""
    lines = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            lines.append(path.read_text())
    fields = {line: line.rpartition(")")[2].split() for line in lines}
    return [line for line, (state, _, _, its, *_) in fields.items() if state != "Z" and int(its) == session]


@contextmanager
def evaluation(folder: Path, policy: str, workers: int, *arguments: str) -> Iterator["subprocess.Popen[str]"]:
    """A running evaluation of a solution `solution.py` in the folder, which has begun to act in all workers."""
    (folder / "solution.py").write_text(
        "import os\nfrom pathlib import Path\nacted = []\ndef policy(observation):\n    if not acted:\n"
        f"        acted.append(Path(__file__).with_name(f'acts-{{os.getpid()}}').touch())\n{policy}"
    )
    # without confinement, for it writes a file where it is
    arguments = ("--out", str(folder / "out"), "--workers", str(workers), "--sandbox", "none", *arguments)
    process = subprocess.Popen(
        [*COMMAND, "evaluate", "--policy", str(folder / "solution.py"), *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,  # so that the signal reaches its workers, as a terminal's would, but not us
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    try:
        end = time.perf_counter() + 120  # a busy machine may let a process wait for many seconds
        while len(list(folder.glob("acts-*"))) < workers and time.perf_counter() < end:
            time.sleep(0.05)
        assert process.poll() is None
        assert len(list(folder.glob("acts-*"))) >= workers  # in time
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
    assert {path.name.split("-")[0] for path in folder.iterdir()} == {"acts", "solution.py"}


@pytest.mark.parametrize("workers", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_ctrl_c_is_quiet(tmp_path: Path, workers: int) -> None:
    arguments = ["--objects", "test", "--episodes", "10000"]
    with evaluation(tmp_path, "    return [0.0] * 13\n", workers, *arguments) as process:
        os.killpg(process.pid, signal.SIGINT)
        shown, error = process.communicate(timeout=120)  # one episode at most; all that are planned take hours
    assert process.returncode == 130
    progress = re.compile(r"OpenCabinetDrawer, .*solution\.py: \d+/100000 episodes, 0% solved, [^\n]*left\n")
    assert (shown, progress.sub("", error)) == ("", "")  # a line of progress may have been due before
    assert not processes_of(process.pid)


@pytest.mark.parametrize("workers", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_ctrl_c_ends_a_policy_that_hangs(tmp_path: Path, workers: int) -> None:
    """Whatever it does about the signal, which it never sees."""
    arguments = ["--objects", "cabinet-0005", "cabinet-0010"]
    hang = "    import signal\n    signal.signal(signal.SIGTERM, signal.SIG_IGN)\n    while True:\n        pass\n"
    with evaluation(tmp_path, hang, workers, *arguments) as process:
        process.send_signal(signal.SIGINT)
        shown, error = process.communicate(timeout=120)
        assert not processes_of(process.pid)
    assert process.returncode == 130
    named = "; ".join(
        f"{tmp_path}/solution.py, object {name}" for name in ("cabinet-0005", "cabinet-0010")[:workers]
    )
    assert error == f"interrupted: ended workers that did not stop by themselves ({named})\n"
    assert shown == ""


def test_a_reader_that_leaves_is_no_error() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as gone:
        done = subprocess.run([*COMMAND, "objects"], stdout=gone, stderr=subprocess.PIPE, text=True, timeout=60)
    assert done.returncode == 141
    assert done.stderr == ""


def test_folder_and_film_cannot_be_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place = str(tmp_path / "film.gif")
    assert main(["evaluate", "--policy", "still", "--out", place, "--video", place]) == 2
    assert "--out and --video are both" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_errors_do_not_drive_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    solution = tmp_path / "solution.py"
    solution.write_text("def policy(observation):\n    raise ValueError('red \\x1b[31m and \\x00 and \\x9b')\n")
    assert main(["evaluate", "--policy", str(solution), "--objects", "cabinet-0005", "--episodes", "1"]) == 2
    said = capsys.readouterr().err
    assert r"red \x1b[31m and \x00 and \x9b" in said
    assert not set("\x1b\x00\x9b") & set(said)

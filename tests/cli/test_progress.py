import io
import sys

import pytest

from artiskill.cli.progress import ProgressBar


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_plain_lines_where_there_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with ProgressBar("title", 25, "episodes") as progress:
        for k in range(25):
            progress.advance(k % 5 == 0)
    shown = capsys.readouterr()
    assert shown.out == ""
    lines = shown.err.splitlines()
    assert len(lines) == 10
    assert lines[-1].startswith("title: 25/25 episodes, 20% solved, ")
    assert lines[-1].endswith(" 0 s left")


def test_a_bar_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    with ProgressBar("title", 2, "episodes") as progress:
        progress.advance(True)
        progress.advance(False)
    assert "2/2" in terminal.getvalue()
    assert "50% solved" in terminal.getvalue()


def test_attempts_advance_only_if_solved(capsys: pytest.CaptureFixture[str]) -> None:
    with ProgressBar("title", 4, "trajectories") as progress:
        progress.skip(2)
        for success in (False, True, False, True):
            progress.attempt(success)
    lines = capsys.readouterr().err.splitlines()
    assert [line.split(",")[0] for line in lines] == ["title: 3/4 trajectories", "title: 4/4 trajectories"]
    assert "50% solved" in lines[-1]


def test_what_was_there_before_is_shown_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    with ProgressBar("title", 9, "trajectories") as progress:
        progress.skip(7)
        progress.attempt(False)
        progress.attempt(True)
    assert "8/9" in terminal.getvalue()
    assert "50% solved" in terminal.getvalue()


def test_a_line_now_and_then_although_nothing_is_solved(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = 0.0
    monkeypatch.setattr("time.perf_counter", lambda: now)
    with ProgressBar("title", 300, "trajectories") as progress:
        for _ in range(25):
            now += 10.0
            progress.attempt(False)
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["title: 0/300 trajectories, 0% solved, 0.0/s"] * 3


def test_lines_between(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    with ProgressBar("title", 9, "levels") as progress:
        progress.print("level 0 [solved]")
    assert capsys.readouterr() == ("", "level 0 [solved]\n")
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    with ProgressBar("title", 9, "levels") as progress:
        progress.print("level 0 [solved]")
    assert "level 0 [solved]" in terminal.getvalue()


def test_what_there_is_to_say_about_units(capsys: pytest.CaptureFixture[str]) -> None:
    with ProgressBar("training", 40, "steps") as progress:
        progress.skip(20)
        for step in range(21, 41):
            progress.show(step, f"loss {step / 100}")
    lines = capsys.readouterr().err.splitlines()
    assert [line.split("/")[0] for line in lines] == [f"training: {step}" for step in (24, 28, 32, 36, 40)]
    assert lines[-1].startswith("training: 40/40 steps, loss 0.4, ")

import numpy as np
import pytest

from artiskill.cli.main import main
from artiskill.experts.mpc import SolveResult

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

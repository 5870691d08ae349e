"""`artiskill render`."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from artiskill.cli.main import main

EPISODE = ["render", "--task", "OpenCabinetDrawer", "--object", "cabinet-0005", "--level", "3"]
OBJECT = ["render", "--object", "cabinet-0005"]
SMALL = ["--width", "80", "--height", "60"]


def shown(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def test_a_picture_of_an_episode(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.png"
    assert main([*EPISODE, *SMALL, "--out", str(path), "--step", "2", "--policy", "still"]) == 0
    assert capsys.readouterr().out == f"picture: {path}\n"
    assert shown(path).shape == (60, 80, 3)


@pytest.mark.slow
def test_options_reach_the_picture(tmp_path: Path) -> None:
    path = tmp_path / "a.png"

    def made(*options: str) -> np.ndarray:
        assert main([*EPISODE, "--out", str(path), *options]) == 0
        return shown(path)

    usual = made(*SMALL)
    options = (
        ["--azimuth", "100"],
        ["--elevation", "60"],
        ["--distance", "1.5"],
        ["--at", "0", "0", "1"],
        ["--view", "cloud"],
        ["--masks"],
        ["--look", "sun.strength=0.1"],
    )
    for option in options:
        assert (made(*SMALL, *option) != usual).any(axis=-1).mean() > 0.02, option
    assert made("--view", "sensor", "--set", "cameras.width=50", "cameras.height=20").shape[0] == 20


def test_a_picture_of_an_object(tmp_path: Path) -> None:
    paths = [tmp_path / "a.png", tmp_path / "b.jpg"]
    assert main([*OBJECT, *SMALL, "--out", str(paths[0])]) == 0
    assert main([*OBJECT, *SMALL, "--out", str(paths[1]), "--open", "0.8"]) == 0
    closed, opened = map(shown, paths)
    assert closed.shape == opened.shape == (60, 80, 3)
    assert (np.abs(closed.astype(int) - opened) > 30).any(axis=-1).mean() > 0.02


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([*OBJECT, "--view", "world"], "--view needs --task"),
        ([*OBJECT, "--step", "0"], "--step needs --task"),
        ([*EPISODE, "--open", "1"], "--open cannot be combined with --task"),
        ([*EPISODE, "--view", "wrld"], "did you mean 'world'"),
        ([*EPISODE, "--level", "-4"], "a level is an integer from 0"),
        ([*EPISODE, "--step", "-1"], "negative"),
        ([*OBJECT, "--open", "0.5", "0.5", "0.5", "0.5", "0.5", "0.5", "0.5", "0.5"], "one share for all"),
        ([*OBJECT, "--open", "nan"], r"lie in [0, 1]"),
        ([*OBJECT, "--width", "0"], "width"),
        ([*OBJECT, "--elevation", "-100"], "elevation"),
        ([*OBJECT, "--look", "sun.strenth=1"], "did you mean 'strength'"),
        (["render", "--object", "cabnet-0005"], "did you mean 'cabinet-0005'"),
        (["render"], "--object"),
    ],
)
def test_errors_are_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main([*arguments, "--out", str(tmp_path / "a.png")]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_an_unknown_suffix_is_refused_before_anything_is_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*OBJECT, "--out", str(tmp_path / "a.tiff")]) == 2
    assert "must end in .png" in capsys.readouterr().err

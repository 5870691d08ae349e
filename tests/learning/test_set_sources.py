"""What a folder offers for a training set, and what it does not."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from artiskill.demos.demos import PACK, load_demo_pack
from artiskill.demos.training_file import Sampling
from artiskill.errors import ArtiSkillError, ConfigError, DemoError
from artiskill.learning.building import build_training_set
from artiskill.learning.set_sources import SetOptions, find_source

from .training_files import settings, write_files

CHAIRS = PACK / "PushChair"


def test_demonstrations_are_replayed_as_the_options_say() -> None:
    options = SetOptions(num_points=100, objects=("chair-0013",), count=2, frame="robot", method="uniform")
    found = find_source(CHAIRS, options)
    assert found.settings.sampling == Sampling(100, "uniform", "robot")
    assert (found.settings.count, found.settings.obs_mode, found.settings.control_mode) == (
        2,
        "pointcloud",
        "joint",
    )
    entries = load_demo_pack("PushChair").manifest.files
    assert found.sources == {"chair-0013.h5": entries["chair-0013.h5"].sha256}


def test_without_options_demonstrations_keep_their_control_mode() -> None:
    found = find_source(CHAIRS, SetOptions())
    assert found.settings.sampling == Sampling(256, "maniskill", "world")
    assert found.settings.control_mode == load_demo_pack("PushChair").manifest.settings.control_mode
    assert find_source(CHAIRS, SetOptions(control_mode="operational_space")).settings.control_mode != "joint"


def test_training_files_say_for_themselves(tmp_path: Path) -> None:
    files = write_files(tmp_path / "files")
    found = find_source(files, SetOptions(num_points=2, frame="robot", method="uniform", control_mode="joint"))
    assert (found.settings, list(found.sources)) == (settings(), ["cabinet-0002.h5", "cabinet-0020.h5"])
    assert found.training_files(tmp_path / "never", 1, None) == files


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"frame": "world"}, "has training files of frame robot, not 'world'"),
        ({"method": "fps"}, "has training files of method uniform, not 'fps'"),
        ({"control_mode": "operational_space"}, "has training files of control mode joint, not"),
        ({"objects": ("cabinet-0003",)}, "unknown object 'cabinet-0003'; did you mean 'cabinet-0020'"),
    ],
)
def test_files_of_another_kind(options: dict[str, Any], message: str, tmp_path: Path) -> None:
    files = write_files(tmp_path / "files")
    with pytest.raises(ArtiSkillError, match=message):
        find_source(files, SetOptions(num_points=4, **options))


def test_training_files_of_another_mode(tmp_path: Path) -> None:
    files = write_files(tmp_path / "files", {}, settings(obs_mode="state", sampling=None))
    with pytest.raises(DemoError, match="of obs_mode state, a set needs pointcloud: replay the demonstrations"):
        find_source(files, SetOptions())


def test_other_folders(tmp_path: Path) -> None:
    with pytest.raises(DemoError, match=r"holds neither training files nor demonstrations$"):
        find_source(tmp_path / "missing", SetOptions())
    (tmp_path / "manifest.json").write_text('{"format": "cakes"}')
    with pytest.raises(DemoError, match="its manifest's format is 'cakes'"):
        find_source(tmp_path, SetOptions())


@pytest.mark.parametrize("options", [{"num_points": 0}, {"count": 0}])
def test_illegal_options(options: dict[str, int]) -> None:
    with pytest.raises(ConfigError, match="must be at least 1, not 0"):
        SetOptions(**options)  # type: ignore[arg-type]


@pytest.mark.parametrize("options", [{"frame": "moon"}, {"method": "magic"}, {"control_mode": "telepathy"}])
def test_unknown_names(options: dict[str, str]) -> None:
    with pytest.raises(ArtiSkillError, match="unknown"):
        find_source(CHAIRS, SetOptions(**options))  # type: ignore[arg-type]


def test_other_versions_of_libraries_replay_the_same_demonstrations(tmp_path: Path) -> None:
    """A run that made its set from demonstrations goes on after an upgrade."""
    files = write_files(tmp_path / "files")
    made = build_training_set(files, tmp_path / "set", SetOptions(num_points=4)).manifest
    given = find_source(files, SetOptions(num_points=4))
    upgraded = replace(given, is_demos=True, settings=replace(given.settings, versions={"numpy": "9"}))
    upgraded.check_same(tmp_path / "set")
    with pytest.raises(DemoError, match="made from something else"):
        replace(upgraded, is_demos=False).check_same(tmp_path / "set")
    assert made.settings["versions"] == {}

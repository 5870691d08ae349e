"""What a training set is made from, and fewer points than a training file has."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artiskill.demos.demos import PACK, load_demo_pack
from artiskill.demos.training_file import Sampling, make_sampling
from artiskill.envs.wrappers import PointCloudDownsample
from artiskill.errors import ArtiSkillError, ConfigError, DemoError
from artiskill.learning.building import build_training_set
from artiskill.learning.set_sources import SetOptions, Thinner, choose_first_drawn, find_source
from artiskill.sensors.observations.sampling import ManiskillSampler, downsample, make_sampler
from artiskill.tasks.registry import make_task

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


def test_number_of_points_without_one_given(tmp_path: Path) -> None:
    files = write_files(tmp_path / "files")  # of 4 points
    found = find_source(files, SetOptions())
    assert (found.num_points, found.options.num_points) == (4, 4)
    assert find_source(CHAIRS, SetOptions()).settings.sampling == make_sampling(256, "maniskill", "world")


def test_points_by_the_shares_of_the_task() -> None:
    sampling = find_source(CHAIRS, SetOptions(num_points=30, method="shares", frame="robot")).settings.sampling
    assert sampling == Sampling(30, "shares", "robot", {"shares": [0, 30]})
    doors = make_sampling(16, "shares", task=make_task("OpenCabinetDoor"))
    assert doors == Sampling(16, "shares", "world", {"shares": [4, 10, 0, 2]})


def test_fewer_points_by_shares() -> None:
    """6, 4 and 2 points of two masks and of none, in that order; half of each is left, or what was seen."""
    thinner = Thinner(Sampling(12, "shares", settings={"shares": [6, 4, 2]}), 6)
    assert thinner.sampling == Sampling(6, "shares", settings={"shares": [3, 2, 1]})
    for masked in ([1] * 6 + [2] * 4 + [0] * 2, [1] * 2 + [2] * 4 + [0] * 2):
        codes = np.array(masked, np.uint8) + np.uint8(REAL)
        seg = thin(thinner, cloud_of(codes))["seg"]
        counts = [int(seg[:, 0].sum()), int(seg[:, 1].sum())]
        assert counts == [min(3, masked.count(1)), 2]


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


REAL = 128


def cloud_of(codes: np.ndarray) -> dict[str, np.ndarray]:
    """A cloud whose x counts the points and whose masks are bits of the codes."""
    xyz = np.zeros((len(codes), 3), np.float32)
    xyz[:, 0] = np.where(codes >= REAL, np.arange(1, len(codes) + 1), 0)
    xyz[:, 2] = codes >= REAL
    seg = (codes[:, None] >> np.arange(3)) & 1 == 1
    return {"xyz": xyz, "rgb": np.full((len(codes), 3), 7, np.uint8), "seg": seg}


def thin(thinner: Thinner, cloud: dict[str, np.ndarray], step: int = 0, level: int = 0) -> dict[str, np.ndarray]:
    """The result for one cloud."""
    thinned = thinner.thin({name: values[None] for name, values in cloud.items()}, level, step)
    return {name: values[0] for name, values in thinned.items()}


@pytest.mark.parametrize(
    ("masked", "kept"),
    [
        ([3, 3, 2, 2, 4, 4, 2, 2, 4, 4, 3, 2, 2, 4], [0, 2, 4, 6, 7, 8, 9, 14, 15, 16]),
        # the handle has one point
        ([3, 2, 2, 4, 4, 2, 2, 4, 4, 2, 2, 2, 4, 2], [0, 1, 3, 5, 6, 7, 8, 14, 15, 16]),
    ],
)
def test_by_hand(masked: list[int], kept: list[int]) -> None:
    """2 of each mask, masked ones up to 14, others up to 20; now half of all that."""
    codes = np.array(masked + [0] * 6, np.uint8) + np.uint8(REAL)
    assert choose_first_drawn(codes, ManiskillSampler(20, 14, 2), ManiskillSampler(10, 7, 1)).tolist() == kept


@pytest.mark.parametrize("method", ["uniform", "voxel", "fps"])
def test_other_methods_keep_what_was_drawn_first(method: str) -> None:
    codes = np.full(20, REAL, np.uint8)
    codes[18:] = 0
    thinner = Thinner(Sampling(20, method, "robot"), 5)
    thinned = thin(thinner, cloud_of(codes))
    assert thinned["xyz"][:, 0].tolist() == [1, 2, 3, 4, 5]
    assert (thinner.sampling.num_points, thinner.sampling.method, thinner.sampling.frame) == (5, method, "robot")


def test_padding_stands_at_the_end() -> None:
    codes = np.array([REAL, REAL, 0, 0, 0], np.uint8)
    thinned = thin(Thinner(Sampling(5, "uniform"), 3), cloud_of(codes))
    assert thinned["xyz"][:, 0].tolist() == [1, 2, 0]
    assert thinned["rgb"][:, 0].tolist() == [7, 7, 0]


def test_as_many_points_are_the_same_points() -> None:
    cloud = cloud_of(np.full(6, REAL + 1, np.uint8))
    thinned = thin(Thinner(Sampling(6), 6), cloud)
    for name, values in cloud.items():
        np.testing.assert_array_equal(thinned[name], values)


@pytest.mark.parametrize(
    "sizes",
    [
        pytest.param((60, 3000, 9000, 20000), id="many of all"),
        pytest.param((20, 300, 9000, 20000), id="a handle with few points"),
        pytest.param((20, 100, 300, 20000), id="fewer masked points than wanted"),
        pytest.param((0, 0, 9000, 100), id="only one mask, and few others"),
    ],
)
def test_masks_have_the_shares_that_the_sensor_gives(sizes: tuple[int, ...]) -> None:
    handle, link, robot, others = sizes
    codes = np.repeat(
        np.array([3, 2, 4, 0], np.uint8) + np.uint8(REAL), (handle, link - handle if link else 0, robot, others)
    )
    whole = cloud_of(codes)
    rng = np.random.default_rng(0)
    many, few = make_sampler("maniskill", 1200), make_sampler("maniskill", 256)
    thinner = Thinner(Sampling(1200), 256)
    direct, thinned = np.zeros(4), np.zeros(4)
    repeats = 60
    for step in range(repeats):
        file = downsample(whole["xyz"], whole["rgb"], whole["seg"], many, rng)
        for counts, cloud in (
            (direct, downsample(whole["xyz"], whole["rgb"], whole["seg"], few, rng)),
            (thinned, thin(thinner, file, step)),
        ):
            assert len(np.unique(cloud["xyz"][:, 0])) == np.count_nonzero(cloud["xyz"][:, 0]) + (
                cloud["xyz"][-1, 0] == 0
            )
            counts += [*cloud["seg"].sum(axis=0), np.count_nonzero(cloud["xyz"][:, 0])]
    np.testing.assert_allclose(thinned / repeats, direct / repeats, atol=2.5)


def test_full_clouds_give_the_points_that_the_environment_gives() -> None:
    with load_demo_pack("OpenCabinetDrawer").open("cabinet-0002") as file:
        options = {"level": 3, "object": file.load_object()}
        env = file.header.settings.make_env([file.load_object()], obs_mode="pointcloud")
        full = env.reset(options=options)[0]["pointcloud"]
        thinner = Thinner(None, 256)
        sampling = thinner.sampling
        sampled = PointCloudDownsample(env, sampling.method, sampling.num_points, sampling.frame)
        wanted = sampled.reset(options=options)[0]["pointcloud"]
    found = thin(thinner, full, level=3)
    for name, values in wanted.items():
        np.testing.assert_array_equal(found[name], values)


def test_settings_that_count_points_shrink_with_them() -> None:
    sampling = Sampling(1200, settings={"masked_points": 600, "points_per_mask": 60})
    assert Thinner(sampling, 300).sampling.settings == {"masked_points": 150, "points_per_mask": 15}
    assert Thinner(Sampling(1200, "voxel", settings={"voxel_m": 0.1}), 300).sampling.settings == {"voxel_m": 0.1}


def test_more_points_than_there_are() -> None:
    with pytest.raises(ConfigError, match="the training files have 4 points each: choose at most so many, not 5"):
        Thinner(Sampling(4), 5)

"""A policy that stands still gives commands of other kinds; one that moves never does."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.wrappers import PointCloudDownsample
from artiskill.errors import ConfigError, PolicyError
from artiskill.learning.array_policy import ArrayPolicy, pretrained_file
from artiskill.learning.recovery import Recovery, RecoveryConfig

CONFIG = RecoveryConfig(window_steps=3, distance_m=0.01, recovery_steps=2, kinds=2)
LOGITS = np.array([0.0, 3.0, 1.0, 2.0])  # from the likeliest on: 1, 3, 2, 0
STILL = np.zeros(5)


def test_the_second_likeliest_comes_first_then_the_third_then_the_second_again() -> None:
    recovery = Recovery(CONFIG)
    found = [recovery.choose(LOGITS, STILL) for _ in range(17)]
    assert found == [1, 1, 1, 3, 3, 1, 1, 2, 2, 1, 1, 3, 3, 1, 1, 2, 2]


def test_what_was_begun_is_carried_on_whatever_is_likeliest_now() -> None:
    recovery = Recovery(CONFIG)
    assert [recovery.choose(LOGITS, STILL) for _ in range(4)][-1] == 3
    assert recovery.choose(-LOGITS, STILL + 1.0) == 3
    assert recovery.choose(-LOGITS, STILL + 2.0) == 0


@pytest.mark.parametrize("axis", [0, 4])
def test_who_moves_goes_on(axis: int) -> None:
    recovery, place = Recovery(CONFIG), np.zeros(5)
    for _ in range(20):
        place = place.copy()
        place[axis] += 0.004  # 12 mm in the window
        assert recovery.choose(LOGITS, place) == 1


def test_episodes_know_nothing_of_each_other() -> None:
    recovery = Recovery(CONFIG)
    first = [recovery.choose(LOGITS, STILL) for _ in range(9)]
    recovery.reset()
    assert [recovery.choose(LOGITS, STILL) for _ in range(9)] == first


def test_one_kind_is_all_there_is() -> None:
    recovery = Recovery(CONFIG)
    assert {recovery.choose(LOGITS[:1], STILL) for _ in range(9)} == {0}


@pytest.mark.parametrize(
    "values",
    [{"window_steps": 0}, {"window_steps": 20_000}, {"distance_m": -1.0}, {"recovery_steps": 0}, {"kinds": 0}],
)
def test_illegal_values(values: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=next(iter(values))):
        RecoveryConfig(**values)


def with_recovery(path: Path, recovery: Any) -> Path:
    """Write the package's policy of doors with another recovery."""
    with np.load(pretrained_file("OpenCabinetDoor")) as archive:
        values = dict(archive)
    header = json.loads(str(values.pop("header"))) | {"recovery": recovery}
    np.savez(path, header=np.array(json.dumps(header)), **values)
    return path


def test_a_policy_acts_as_without_until_it_stands_still(tmp_path: Path) -> None:
    quick = dataclasses.asdict(RecoveryConfig(window_steps=4, distance_m=10.0, recovery_steps=3))
    plain = ArrayPolicy(with_recovery(tmp_path / "plain.npz", None))
    restless = ArrayPolicy(with_recovery(tmp_path / "restless.npz", quick))
    whole = ManipulationEnv("OpenCabinetDoor", "cabinet-0005", obs_mode="pointcloud")
    env = PointCloudDownsample(
        whole, plain.sampling["method"], plain.sampling["num_points"], plain.sampling["frame"]
    )
    observation, info = env.reset(seed=0)
    for _ in range(2):  # of the second episode, nothing is known from the first
        restless.reset(observation, info)
        same = [np.array_equal(plain.act(observation), restless.act(observation)) for _ in range(10)]
        assert same == [True] * 4 + [False] * 3 + [True] * 2 + [False]


@pytest.mark.parametrize(
    ("recovery", "message"), [({"window_steps": 0}, "window_steps"), ({"window": 3}, "window"), (3, "recovery")]
)
def test_damaged_headers(tmp_path: Path, recovery: Any, message: str) -> None:
    with pytest.raises(PolicyError, match=f"is damaged: .*{message}"):
        ArrayPolicy(with_recovery(tmp_path / "policy.npz", recovery))

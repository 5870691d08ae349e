"""Varied values of experts, and pushes."""

import dataclasses
from dataclasses import dataclass
from itertools import groupby

import numpy as np
import pytest

from artiskill.config import check_positive, from_mapping, to_mapping
from artiskill.envs.control import action_scale
from artiskill.errors import ConfigError, UnknownNameError
from artiskill.experts.registry import make_expert
from artiskill.experts.variation import (
    Disturbance,
    DisturbanceConfig,
    VariationConfig,
    load_variation,
    numbers_of,
    varied,
)
from artiskill.robots.config import load_robot
from artiskill.tasks.registry import make_task, task_names


@dataclass(frozen=True)
class Inner:
    steps: int
    share: float


@dataclass(frozen=True)
class Config:
    speed_m_s: float
    carry_m: tuple[float, float]
    inner: Inner
    kind: str = "x"

    def __post_init__(self) -> None:
        check_positive(self, "speed_m_s")


CONFIG = Config(0.5, (0.1, 0.2), Inner(3, 0.25))
RANGES = {"speed_m_s": (0.4, 0.6), "carry_m.1": (0.3, 0.5), "inner.steps": (2.0, 6.0)}


def rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_values_are_drawn_from_their_ranges_and_the_rest_stays() -> None:
    drawn = [varied(CONFIG, RANGES, rng(seed)) for seed in range(200)]
    for name, (low, high), values in (
        ("speed_m_s", (0.4, 0.6), [one.speed_m_s for one in drawn]),
        ("carry_m", (0.3, 0.5), [one.carry_m[1] for one in drawn]),
    ):
        assert low <= min(values) < low + 0.05 * (high - low), name
        assert high >= max(values) > high - 0.05 * (high - low), name
    assert {one.inner.steps for one in drawn} == {2, 3, 4, 5, 6}
    assert all(type(one.inner.steps) is int for one in drawn)
    assert {(one.carry_m[0], one.inner.share, one.kind) for one in drawn} == {(0.1, 0.25, "x")}
    assert Config(0.5, (0.1, 0.2), Inner(3, 0.25)) == CONFIG


def test_the_same_seed_the_same_values() -> None:
    assert varied(CONFIG, RANGES, rng(4)) == varied(CONFIG, RANGES, rng(4)) != varied(CONFIG, RANGES, rng(5))


def test_nothing_varies_without_ranges() -> None:
    assert varied(CONFIG, {}, rng(0)) == CONFIG


@pytest.mark.parametrize(
    ("key", "nearest"),
    [
        ("sped_m_s", "speed_m_s"),
        ("inner.step", "inner.steps"),
        ("carry_m.2", "carry_m.1"),
        ("inner", "inner.steps"),
    ],
)
def test_a_key_that_leads_to_no_number(key: str, nearest: str) -> None:
    with pytest.raises(UnknownNameError, match=f"key of a varied expert '{key}'; did you mean '{nearest}'"):
        varied(CONFIG, {key: (0.0, 1.0)}, rng(0))


def test_texts_do_not_vary() -> None:
    with pytest.raises(UnknownNameError, match="key of a varied expert 'kind'"):
        varied(CONFIG, {"kind": (0.0, 1.0)}, rng(0))


def test_the_configuration_checks_what_is_drawn() -> None:
    with pytest.raises(ConfigError, match="a varied expert: speed_m_s must be positive"):
        varied(CONFIG, {"speed_m_s": (-2.0, -1.0)}, rng(0))


def test_ranges_rise() -> None:
    disturbance = to_mapping(load_variation("PushChair").disturbance)
    with pytest.raises(ConfigError, match=r"ranges: speed_m_s must have a lower and a higher number, not \[2"):
        from_mapping(VariationConfig, {"ranges": {"speed_m_s": [2, 1]}, "disturbance": disturbance})


@pytest.mark.parametrize("task", task_names())
def test_ranges_of_the_package_are_legal_at_both_ends(task: str) -> None:
    """One value at a time, for some may only be extreme while others are not."""
    config, ranges = make_expert(task, make_task(task).robot).config, load_variation(task).ranges
    assert len(ranges) >= 5
    for key, (low, high) in ranges.items():
        for end in (low, high):
            varied(config, {key: (end, end)}, rng(0))
    assert set(ranges) <= set(numbers_of(to_mapping(config)))
    varied(config, ranges, rng(1))


PUSHES = DisturbanceConfig((4, 9), (3, 6), base_m=0.05, yaw_rad=0.1, lift_m=0.03, arm_rad=0.2)
STEP_S = 0.05
STEPS = 6000
OPEN = np.zeros(22)


def play(config: DisturbanceConfig, robot: str = "one_arm", seed: int = 0, steps: int = STEPS) -> list:
    half_range = action_scale(load_robot(robot)).half_range
    arms = 1 if robot == "one_arm" else 2
    disturbance = Disturbance(config, half_range, arms, STEP_S, np.random.default_rng(seed))
    return [disturbance.next(OPEN[: len(half_range)]) for _ in range(steps)]


def pushes(offsets: list) -> list[np.ndarray]:
    """Runs of steps with a push, each (n, R)."""
    runs = [list(run) for _, run in groupby(offsets, lambda one: one is None)]
    return [np.array(run) for run in runs if run[0] is not None]


def test_gaps_and_lengths() -> None:
    runs = [(pushed, len(list(run))) for pushed, run in groupby(play(PUSHES), lambda one: one is not None)][:-1]
    assert {length for pushed, length in runs if pushed} == {3, 4, 5, 6}
    assert {length for pushed, length in runs if not pushed} == {4, 5, 6, 7, 8, 9}
    assert not runs[0][0], "no episode begins with a push"


@pytest.mark.parametrize("robot", ["one_arm", "two_arms"])
def test_as_far_as_they_say(robot: str) -> None:
    half_range = action_scale(load_robot(robot)).half_range
    ways = np.array([run.sum(axis=0) * half_range * STEP_S for run in pushes(play(PUSHES, robot))[:-1]])
    arms = [ways[:, 4:11], ways[:, 13:20]] if robot == "two_arms" else [ways[:, 4:11]]
    groups = [(ways[:, :2], 0.05), (ways[:, 2:3], 0.1), (ways[:, 3:4], 0.03), *((arm, 0.2) for arm in arms)]
    for way, most in groups:
        length = np.linalg.norm(way, axis=1)
        assert length.max() <= most * (1 + 1e-9)
        assert length.max() > 0.95 * most
        assert abs(way.mean(axis=0)).max() < 0.1 * most, "in all directions alike"
    fingers = [11, 12] if robot == "one_arm" else [11, 12, 20, 21]
    assert not ways[:, fingers].any()


def test_they_swell_and_ebb() -> None:
    for run in pushes(play(PUSHES, steps=500))[:-1]:
        strength = np.linalg.norm(run, axis=1)
        middle = len(run) // 2
        assert (np.diff(strength[: (len(run) + 1) // 2]) > 0).all()
        np.testing.assert_allclose(strength, strength[::-1])
        assert strength[0] < strength[middle]


def test_the_same_seed_the_same_pushes() -> None:
    one, same, other = (np.concatenate(pushes(play(PUSHES, seed=seed, steps=100))) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert one.shape != other.shape or (one != other).any()


@pytest.mark.parametrize(("robot", "finger"), [("one_arm", 11), ("two_arms", 12), ("two_arms", 20)])
def test_they_are_gentler_while_a_hand_is_closed(robot: str, finger: int) -> None:
    half_range = action_scale(load_robot(robot)).half_range
    closed = np.zeros(len(half_range))
    closed[finger] = -1.0
    gentle = dataclasses.replace(PUSHES, gripping=0.25)
    arms = len(half_range) // 9
    found = [Disturbance(gentle, half_range, arms, STEP_S, np.random.default_rng(0)) for _ in range(2)]
    for _ in range(60):
        free, held = found[0].next(np.zeros(len(half_range))), found[1].next(closed)
        assert (free is None) == (held is None)
        if free is not None and held is not None:
            np.testing.assert_allclose(held, 0.25 * free)


def test_no_strength_no_push() -> None:
    calm = dataclasses.replace(PUSHES, base_m=0.0, yaw_rad=0.0, lift_m=0.0, arm_rad=0.0)
    assert not any(one is not None and one.any() for one in play(calm, steps=200))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"gap_steps": [9, 4]}, r"gap_steps must be two rising whole numbers from 0 on, not \(9, 4\)"),
        ({"burst_steps": [0, 4]}, "burst_steps must be two rising whole numbers from 1 on"),
        ({"burst_steps": [3, 9]}, "burst_steps must not exceed 8: more is a drift"),
        ({"gap_steps": [1.5, 4]}, "gap_steps"),
        ({"arm_rad": -0.1}, "arm_rad must be finite and at least 0"),
        ({"arm_m": 0.1}, "did you mean 'arm_rad'"),
    ],
)
def test_illegal_values_of_pushes(changes: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        from_mapping(DisturbanceConfig, to_mapping(PUSHES) | changes)

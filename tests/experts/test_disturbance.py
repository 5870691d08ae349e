"""Pushes: as far as they say, for as long, after such gaps, and never of the fingers."""

import dataclasses
from itertools import groupby

import numpy as np
import pytest

from artiskill.config import from_mapping, to_mapping
from artiskill.envs.control import action_scale
from artiskill.errors import ConfigError
from artiskill.experts.disturbance import Disturbance, DisturbanceConfig
from artiskill.robots.config import load_robot

CONFIG = DisturbanceConfig((4, 9), (3, 6), base_m=0.05, yaw_rad=0.1, lift_m=0.03, arm_rad=0.2)
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
    runs = [(pushed, len(list(run))) for pushed, run in groupby(play(CONFIG), lambda one: one is not None)][:-1]
    assert {length for pushed, length in runs if pushed} == {3, 4, 5, 6}
    assert {length for pushed, length in runs if not pushed} == {4, 5, 6, 7, 8, 9}
    assert not runs[0][0], "no episode begins with a push"


@pytest.mark.parametrize("robot", ["one_arm", "two_arms"])
def test_as_far_as_they_say(robot: str) -> None:
    half_range = action_scale(load_robot(robot)).half_range
    ways = np.array([run.sum(axis=0) * half_range * STEP_S for run in pushes(play(CONFIG, robot))[:-1]])
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
    for run in pushes(play(CONFIG, steps=500))[:-1]:
        strength = np.linalg.norm(run, axis=1)
        middle = len(run) // 2
        assert (np.diff(strength[: (len(run) + 1) // 2]) > 0).all()
        np.testing.assert_allclose(strength, strength[::-1])
        assert strength[0] < strength[middle]


def test_the_same_seed_the_same_pushes() -> None:
    one, same, other = (np.concatenate(pushes(play(CONFIG, seed=seed, steps=100))) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert one.shape != other.shape or (one != other).any()


@pytest.mark.parametrize(("robot", "finger"), [("one_arm", 11), ("two_arms", 12), ("two_arms", 20)])
def test_they_are_gentler_while_a_hand_is_closed(robot: str, finger: int) -> None:
    half_range = action_scale(load_robot(robot)).half_range
    closed = np.zeros(len(half_range))
    closed[finger] = -1.0
    gentle = dataclasses.replace(CONFIG, gripping=0.25)
    arms = len(half_range) // 9
    found = [Disturbance(gentle, half_range, arms, STEP_S, np.random.default_rng(0)) for _ in range(2)]
    for _ in range(60):
        free, held = found[0].next(np.zeros(len(half_range))), found[1].next(closed)
        assert (free is None) == (held is None)
        if free is not None and held is not None:
            np.testing.assert_allclose(held, 0.25 * free)


def test_no_strength_no_push() -> None:
    calm = dataclasses.replace(CONFIG, base_m=0.0, yaw_rad=0.0, lift_m=0.0, arm_rad=0.0)
    assert not any(one is not None and one.any() for one in play(calm, steps=200))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"gap_steps": [9, 4]}, r"gap_steps must be two rising whole numbers from 0 on, not \(9, 4\)"),
        ({"burst_steps": [0, 4]}, "burst_steps must be two rising whole numbers from 1 on"),
        ({"burst_steps": [3, 9]}, "burst_steps must not exceed 8: more is a drift"),
        ({"gap_steps": [1.5, 4]}, "gap_steps"),
        ({"arm_rad": -0.1}, "arm_rad must not be negative"),
        ({"arm_m": 0.1}, "did you mean 'arm_rad'"),
    ],
)
def test_illegal_values(changes: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        from_mapping(DisturbanceConfig, to_mapping(CONFIG) | changes)

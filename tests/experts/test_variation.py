"""Manners: values within their ranges, of numbers that exist; all ranges of the package are legal."""

from dataclasses import dataclass

import numpy as np
import pytest

from artiskill.config import check_positive, from_mapping, to_mapping
from artiskill.errors import ConfigError, UnknownNameError
from artiskill.experts.registry import make_expert
from artiskill.experts.variation import VariationConfig, load_variation, numbers_of, varied
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


def test_the_same_seed_the_same_manner() -> None:
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

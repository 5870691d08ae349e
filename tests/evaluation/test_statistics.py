import numpy as np
import pytest
from scipy.stats import binomtest

from artiskill.errors import ConfigError
from artiskill.evaluation.statistics import (
    EpisodeResult,
    cluster_interval,
    compare_episodes,
    object_interval,
    paired_interval,
    wilson_interval,
)


@pytest.mark.parametrize(("k", "n"), [(0, 1), (1, 1), (0, 10), (3, 10), (10, 10), (17, 20), (249, 250), (1, 3000)])
def test_agrees_with_scipy(k: int, n: int) -> None:
    expected = binomtest(k, n).proportion_ci(confidence_level=0.95, method="wilson")
    assert wilson_interval(k, n) == pytest.approx((expected.low, expected.high), abs=1e-12)


def test_bounds_contain_the_rate_and_stay_in_range() -> None:
    for k in range(8):
        low, high = wilson_interval(k, 7)
        assert 0 <= low <= k / 7 <= high <= 1


def test_more_trials_say_more() -> None:
    widths = [high - low for low, high in (wilson_interval(n // 2, n) for n in (10, 100, 1000))]
    assert widths == sorted(widths, reverse=True)


def played(outcomes: dict[str, str]) -> list[EpisodeResult]:
    """Episodes of objects, `+` for a success."""
    return [
        EpisodeResult(name, "x", level, mark == "+", 10, {"open": mark == "+"})
        for name, marks in outcomes.items()
        for level, mark in enumerate(marks)
    ]


def test_the_bootstrap_draws_objects_as_a_whole(rng: np.random.Generator) -> None:
    """Against the plain percentile bootstrap, drawn here, which a symmetric sample does not tell from ours."""
    rates = np.linspace(0.1, 0.9, 17)
    low, high = cluster_interval(np.rint(rates * 50).astype(int).tolist(), [50] * 17) or (0, 0)
    means = rates[rng.integers(17, size=(20_000, 17))].mean(axis=1)
    assert (low, high) == pytest.approx(np.quantile(means, (0.025, 0.975)), abs=0.02)
    # with episodes for objects it would be narrower by far
    narrow = wilson_interval(425, 850)
    assert high - low > 2 * (narrow[1] - narrow[0])


def test_the_interval_is_the_same_every_time_and_covers_what_it_says(rng: np.random.Generator) -> None:
    assert cluster_interval([3, 9, 5, 10], [10] * 4) == cluster_interval([3, 9, 5, 10], [10] * 4)
    covered, tries = 0, 60
    for _ in range(tries):
        rates = rng.beta(4, 2, 30)  # of mean 2/3
        low, high = cluster_interval(rng.binomial(50, rates).tolist(), [50] * 30) or (0, 0)
        covered += low <= 2 / 3 <= high
    assert covered >= 0.85 * tries


def test_few_objects_and_equal_ones() -> None:
    assert object_interval(played({"a": "+-+-"})) is None
    assert object_interval(played({"a": "+++-", "b": "+-++"})) is None, "no width would be a lie"
    assert object_interval(played({"a": "+-", "b": "++++"})) is not None


def test_paired_differences_draw_objects_and_then_levels(rng: np.random.Generator) -> None:
    """Against the same drawn one by one, and where all objects have one mean but their episodes differ."""
    gains = [rng.integers(-1, 2, 10).tolist() for _ in range(8)]
    means = []
    for _ in range(4000):
        drawn = [rng.choice(gains[k], 10) for k in rng.integers(8, size=8)]
        means.append(np.concatenate(drawn).mean())
    assert paired_interval(gains) == pytest.approx(np.quantile(means, (0.025, 0.975)), abs=0.02)
    low, high = paired_interval([[1, -1]] * 10) or (0, 0)
    assert low == pytest.approx(-high, abs=0.02)
    assert 0.3 < high < 0.6
    for alike in ([[0] * 4] * 3, [[1] * 4] * 3, [[1]]):
        assert paired_interval(alike) is None, "no width would be a lie"


def test_paired_intervals_cover_what_they_say(rng: np.random.Generator) -> None:
    """Of ten objects, whose true differences have a spread."""
    covered, tries = 0, 60
    for _ in range(tries):
        truths = rng.normal(0.2, 0.2, 10).clip(-1, 1)
        gains = [(np.sign(truth) * (rng.random(20) < abs(truth))).astype(int).tolist() for truth in truths]
        low, high = paired_interval(gains) or (0, 0)
        covered += low <= 0.2 <= high
    assert covered >= 0.85 * tries


def test_two_policies_are_compared_level_by_level() -> None:
    first = played({"a": "+--+", "b": "----", "c": "++++"})
    second = played({"a": "-+++", "b": "+--+", "c": "++++"})
    found = compare_episodes(first, second)
    assert (found.difference, found.only_first, found.only_second) == (3 / 12, 1, 4)
    assert found.by_object == {"a": (0.5, 0.75), "b": (0.0, 0.5), "c": (1.0, 1.0)}
    assert found.interval == paired_interval([[-1, 1, 1, 0], [1, 0, 0, 1], [0] * 4])
    back = compare_episodes(second, first)
    assert (back.difference, back.only_first) == (-found.difference, found.only_second)
    one = compare_episodes(first[:4], second[:4])
    assert one.interval == paired_interval([[-1, 1, 1, 0]])
    with pytest.raises(ConfigError, match="not the same episodes"):
        compare_episodes(first, second[1:])

import pytest
from scipy.stats import binomtest

from artiskill.evaluation.intervals import wilson_interval


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

"""How certain a measured rate is."""

import math

_Z_95 = 1.959963984540054  # 0.975 quantile of the normal distribution


def wilson_interval(successes: int, trials: int, z: float = _Z_95) -> tuple[float, float]:
    """Wilson's score interval of a binomial rate, without continuity correction; by default the 95 % one.

    E. B. Wilson, "Probable inference, the law of succession, and statistical inference", JASA 22 (1927). It stays
    within [0, 1] and has a sensible width at rates of 0 and 1, where the textbook interval has none.

    Args:
        successes: from 0 to `trials`.
        trials: at least 1.
        z: the normal quantile of the wanted confidence.

    Returns:
        Lower and upper bound of the rate.
    """
    assert trials > 0
    assert 0 <= successes <= trials
    rate = successes / trials
    shrink = 1.0 / (1.0 + z * z / trials)
    center = shrink * (rate + z * z / (2 * trials))
    half = shrink * z * math.sqrt(rate * (1.0 - rate) / trials + z * z / (4 * trials * trials))
    low = 0.0 if successes == 0 else center - half  # exact at the ends, where rounding leaves 1e-17
    high = 1.0 if successes == trials else center + half
    return low, high

"""Statistics of episodes: rates with intervals, and the difference of two policies on the same episodes.

Wilson's interval treats episodes as independent: how well does the policy do on these objects? Bootstrapping over
objects treats each object as one draw: how well would it do on other objects of this kind?
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from artiskill.demos.demonstrator import fault_kind
from artiskill.errors import ConfigError

_Z_95 = 1.959963984540054  # 0.975 quantile of the normal distribution
_RESAMPLES = 9999
_DIGITS = 4  # of a bootstrapped bound: the last digits of its terms are not worth comparing
Interval = tuple[float, float]


@dataclass(frozen=True)
class EpisodeResult:
    """The outcome of one episode.

    Attributes:
        object: id of the object.
        target: name of the target link.
        level: of the episode.
        success: whether the task was solved.
        length: environment steps until it was solved or cut off.
        flags: condition -> did it hold, long enough, at the end; none of one that a fault ended.
        fault: what ended it, where that was not the episode's end, physics that ran away say: a text that begins
            with the kind; else empty.
        reward_sum: of the dense rewards.
        digest: of the exact state at the end, hexadecimal; empty where a fault ended it.
        actions: (T, A) float64, clipped to [-1, 1]; the one at which the physics ran away is the last.
        act_s: (T,) seconds that the policy took for each; NaN where it was of an earlier answer.
    """

    object: str
    target: str
    level: int
    success: bool
    length: int
    flags: dict[str, bool]
    fault: str = ""
    reward_sum: float = 0.0
    digest: str = ""
    actions: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)), compare=False, repr=False)
    act_s: np.ndarray = field(default_factory=lambda: np.zeros(0), compare=False, repr=False)


@dataclass(frozen=True)
class EpisodeStatistics:
    """Counts and rates of some episodes.

    Attributes:
        episodes: how many.
        successes: how many of them were solved.
        success_rate: their ratio.
        interval: 95 % Wilson interval of the success rate.
        flags: condition -> share of episodes at whose end it held.
        mean_length: environment steps per episode, failed ones included.
        faults: what ended episodes before their end, `DivergedError` say, and how many of them.
    """

    episodes: int
    successes: int
    success_rate: float
    interval: Interval
    flags: dict[str, float]
    mean_length: float
    faults: dict[str, int]

    @property
    def faults_text(self) -> str:
        """A sentence about faults; empty without any."""
        kinds = ", ".join(f"{count} by {kind}" for kind, count in self.faults.items())
        return f"Episodes that a fault ended, which count as failed: {kinds}." if kinds else ""

    def cells(self, precision: str) -> list[str]:
        """Return the cells of a table for people, rates formatted as `.1%` say."""
        low, high = (f"{bound:{precision}}" for bound in self.interval)
        rate, flags = f"{self.success_rate:{precision}}", [f"{share:.0%}" for share in self.flags.values()]
        return [f"{self.successes}/{self.episodes}", rate, f"{low} to {high}", *flags, f"{self.mean_length:.1f}"]


def summarize(episodes: Sequence[EpisodeResult]) -> EpisodeStatistics:
    """Return the statistics of at least one episode."""
    n, successes = len(episodes), sum(result.success for result in episodes)
    names = episodes[0].flags
    return EpisodeStatistics(
        episodes=n,
        successes=successes,
        success_rate=successes / n,
        interval=wilson_interval(successes, n),
        flags={name: sum(result.flags[name] for result in episodes) / n for name in names},
        mean_length=sum(result.length for result in episodes) / n,
        faults=dict(Counter(sorted(fault_kind(result.fault) for result in episodes if result.fault))),
    )


def wilson_interval(successes: int, trials: int, z: float = _Z_95) -> Interval:
    """Return Wilson's score interval of a binomial rate, without continuity correction; by default the 95 % one.

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


def object_interval(episodes: Sequence[EpisodeResult]) -> Interval | None:
    """Return the 95 % interval of the success rate by bootstrap over objects, see `counts_interval`."""
    return counts_interval(Counter(r.object for r in episodes if r.success), Counter(r.object for r in episodes))


def counts_interval(successes: Mapping[str, int], episodes: Mapping[str, int]) -> Interval | None:
    """Return the 95 % interval of the success rate by bootstrap over objects.

    None with a single object, or with the same rate on all: from those it could say nothing about others.

    Args:
        successes: by object; none of an object that is missing.
        episodes: by object.
    """
    solved = [successes.get(name, 0) for name in episodes]
    return cluster_interval(solved, list(episodes.values())) if episodes else None


def cluster_interval(sums: Sequence[int], counts: Sequence[int]) -> Interval | None:
    """Return the 95 % interval of a mean over clusters, by bootstrap over clusters.

    B. Efron, "Better bootstrap confidence intervals", JASA 82 (1987): bias-corrected and accelerated, of
    `scipy.stats.bootstrap`, from a fixed seed and rounded to four digits.

    Args:
        sums: of each cluster's values; of one at least.
        counts: of each cluster's members.

    Returns:
        Lower and upper bound; None where all clusters have the same mean: nothing is known of their spread.
    """
    totals, sizes = np.asarray(sums, dtype=np.float64), np.asarray(counts, dtype=np.float64)
    if (totals * sizes[0] == totals[0] * sizes).all():
        return None
    from scipy.stats import bootstrap  # half a second

    def mean_of(totals: np.ndarray, sizes: np.ndarray, axis: int = -1) -> np.ndarray:
        found: np.ndarray = totals.sum(axis=axis) / sizes.sum(axis=axis)
        return found

    generator = np.random.Generator(np.random.PCG64(0))
    options = {"paired": True, "vectorized": True, "n_resamples": _RESAMPLES, "method": "BCa"}
    found = bootstrap((totals, sizes), mean_of, random_state=generator, **options).confidence_interval
    return round(float(found.low), _DIGITS), round(float(found.high), _DIGITS)


def paired_interval(gains: Sequence[Sequence[int]]) -> Interval | None:
    """Return the 95 % interval of the mean of paired differences, by bootstrap over objects, then levels.

    Each resample draws objects, and then, of each that was drawn, as many of its episodes as it has, both with
    replacement. (A. C. Davison and D. V. Hinkley, "Bootstrap Methods and their Application", 1997, section 3.8,
    weigh this against drawing objects alone, which gives no width where all have the same mean.) It counts the
    spread between episodes twice, so it is too wide where objects differ little; with few objects it is too
    narrow. The bounds are quantiles of the resamples' means, from a fixed seed, rounded to four digits. With one
    object, levels alone are drawn.

    Args:
        gains: by object, the difference of each episode: -1, 0 or 1.

    Returns:
        Lower and upper bound; None where all differences are the same: nothing is known of their spread.
    """
    if len({gain for one in gains for gain in one}) < 2:
        return None
    generator = np.random.Generator(np.random.PCG64(0))
    counts = np.array([[list(one).count(value) for value in (-1, 0, 1)] for one in gains])  # (K, 3)
    sizes = counts.sum(axis=1)
    drawn = generator.integers(len(gains), size=(_RESAMPLES, len(gains)))
    found = generator.multinomial(sizes[drawn], (counts / sizes[:, None])[drawn])  # (R, K, 3)
    means = (found[..., 2] - found[..., 0]).sum(axis=1) / sizes[drawn].sum(axis=1)
    low, high = np.quantile(means, (0.025, 0.975)).tolist()
    return round(low, _DIGITS), round(high, _DIGITS)


@dataclass(frozen=True)
class Comparison:
    """Two policies on the same episodes.

    Attributes:
        first: statistics of the first one.
        second: statistics of the second one.
        difference: success rate of the second minus that of the first.
        interval: 95 % interval of the difference, see `paired_interval`.
        only_first: episodes that the first one alone solved.
        only_second: episodes that the second one alone solved.
        by_object: object -> success rates of both.
    """

    first: EpisodeStatistics
    second: EpisodeStatistics
    difference: float
    interval: Interval | None
    only_first: int
    only_second: int
    by_object: dict[str, tuple[float, float]]


def compare_episodes(first: Sequence[EpisodeResult], second: Sequence[EpisodeResult]) -> Comparison:
    """Compare two policies, each of whose episodes has one of the other with the same object, target and level.

    Raises:
        ConfigError: they played other episodes.
    """
    if [_key(one) for one in first] != [_key(one) for one in second]:
        raise ConfigError("these are not the same episodes: objects, targets or levels differ")
    gains = [other.success - one.success for one, other in zip(first, second, strict=True)]
    names = list(dict.fromkeys(one.object for one in first))
    rows = {name: [k for k, one in enumerate(first) if one.object == name] for name in names}
    return Comparison(
        first=summarize(first),
        second=summarize(second),
        difference=sum(gains) / len(gains),
        interval=paired_interval([[gains[k] for k in at] for at in rows.values()]),
        only_first=gains.count(-1),
        only_second=gains.count(1),
        by_object={name: (_rate(first, at), _rate(second, at)) for name, at in rows.items()},
    )


def _key(result: EpisodeResult) -> tuple[str, str, int]:
    return result.object, result.target, result.level


def _rate(episodes: Sequence[EpisodeResult], at: Sequence[int]) -> float:
    return sum(episodes[k].success for k in at) / len(at)

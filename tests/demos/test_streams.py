import numpy as np
import pytest

from artiskill.demos.config import PatienceConfig
from artiskill.demos.streams import Stream, make_streams

PATIENCE = PatienceConfig(attempts=10, least_rate=0.25)


def stream(wanted: int = 7) -> Stream:
    return Stream("link_1", first=3, stride=2, wanted=wanted, patience=PATIENCE)


def solved(level: int, rate: float) -> bool:
    """Chance that depends on the level alone."""
    return bool(np.random.default_rng(level).uniform() < rate)


def first_successes(wanted: int, rate: float) -> list[int]:
    """Levels up to the last one that counts, by plain counting."""
    levels: list[int] = []
    successes = 0
    while successes < wanted and not (len(levels) >= 10 and successes < 0.25 * len(levels)):
        levels.append(3 + 2 * len(levels))
        successes += solved(levels[-1], rate)
    return levels


@pytest.mark.parametrize("rate", [0.0, 0.1, 0.3, 0.6, 1.0])
@pytest.mark.parametrize("seed", range(5))
def test_whoever_tries_what_when_the_same_levels_count(rate: float, seed: int, rng: np.random.Generator) -> None:
    rng = np.random.default_rng(seed)
    tried, at_work = stream(), []
    while tried.end is None:
        taken = tried.take(int(rng.integers(1, 4)))
        assert tried.successes + len(tried.handed_out) <= tried.wanted
        at_work += list(taken)
        if rng.uniform() < 0.1:  # killed: what was being tried is lost
            left = stream()
            left.outcomes = dict(tried.outcomes)
            tried, at_work = left, []
        elif at_work:
            level = at_work.pop(int(rng.integers(len(at_work))))
            tried.tell(level, solved(level, rate))
    assert list(tried.levels) == first_successes(7, rate)


def test_no_attempt_is_in_vain_where_it_is_not_given_up() -> None:
    tried = stream()
    while tried.end is None:
        for level in tried.take(3):
            tried.tell(level, solved(level, 0.6))
    assert sorted(tried.outcomes) == list(tried.levels)
    assert tried.outcomes[tried.levels[-1]]
    assert tried.take(3) == ()


def test_targets_share_an_object_and_no_level() -> None:
    targets = ("link_1", "link_2", "link_3")
    streams = make_streams(targets, targets, 11, 100, PATIENCE)
    assert [s.wanted for s in streams] == [4, 4, 3]
    assert [[s.level(k) for k in range(3)] for s in streams] == [[100, 103, 106], [101, 104, 107], [102, 105, 108]]


def test_a_target_has_the_same_levels_whichever_are_chosen() -> None:
    (only,) = make_streams(("link_1", "link_2", "link_3"), ("link_2",), 11, 100, PATIENCE)
    assert (only.wanted, only.level(0), only.level(1)) == (11, 101, 104)


def test_nothing_to_do() -> None:
    assert stream(wanted=0).end == 0
    assert stream(wanted=0).take(5) == ()

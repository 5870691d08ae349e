"""The promises of staged rewards: later stages earn more, nothing jumps where stages meet, nothing is above 0."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest

from artiskill.errors import ConfigError
from artiskill.tasks.registry import make_task, task_names
from artiskill.tasks.staged_reward import STAGE_TERM, Ramp, Stage, StageTable

TOY = StageTable(
    {"near": Ramp("gap", 2.0, 0.0), "fast": Ramp("speed", 0.0, 1.0)},
    (
        Stage("far", asks=("near",), leaves=(Ramp("gap", 0.2, 0.1), Ramp("angle", 0.5, 0.3))),
        Stage("close", asks=("near", "fast"), enters=(Ramp("gap", 0.1, 0.05), Ramp("angle", 0.3, 0.2))),
    ),
)
TOY_BONUS, TOY_WEIGHTS = (-6.5, -3.5), {"near": 2.0, "fast": 1.5, STAGE_TERM: 1.0}


def tables() -> list[tuple[str, StageTable, Sequence[float], dict[str, float]]]:
    found = [("toy", TOY, TOY_BONUS, TOY_WEIGHTS)]
    for name in task_names():
        task = make_task(name)
        found.append((name, task.reward_table, task.config.reward.stage_bonus, dict(task.reward_weights)))
    return found


every_table = pytest.mark.parametrize(
    ("name", "table", "bonus", "weights"), tables(), ids=lambda v: v if type(v) is str else ""
)


def named(table: StageTable, measured: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip(table.measures, measured.T, strict=True))


def reward(
    table: StageTable, bonus: Sequence[float], weights: dict[str, float], measured: np.ndarray, stage: np.ndarray
) -> np.ndarray:
    terms = table.evaluate(named(table, measured), stage, bonus)
    return np.asarray(sum(weights.get(name, 0.0) * value for name, value in terms.items()))


def share_of(table: StageTable, ramps: Sequence[Ramp], measured: np.ndarray) -> np.ndarray:
    """The least of the ramps, (B,) in [0, 1]; 1 where there are none."""
    values = [(measured[:, table.measures.index(r.measure)] - r.zero) / (r.one - r.zero) for r in ramps]
    return np.clip(np.min(values, axis=0), 0.0, 1.0) if values else np.ones(len(measured))


def random_measures(table: StageTable, count: int, rng: np.random.Generator) -> np.ndarray:
    """Around and beyond the ends of the ramps, and often exactly at them."""
    ramps = [*table.terms.values(), *(r for s in table.stages for r in (*s.enters, *s.leaves))]
    columns = []
    for name in table.measures:
        ends = np.array([end for ramp in ramps if ramp.measure == name for end in (ramp.zero, ramp.one)])
        span = np.ptp(ends)
        values = rng.uniform(ends.min() - span, ends.max() + span, count)
        exact = rng.random(count) < 0.3
        values[exact] = rng.choice(ends, exact.sum())
        columns.append(values)
    return np.stack(columns, axis=1)


@every_table
def test_a_later_stage_always_earns_more(
    name: str, table: StageTable, bonus: Sequence[float], weights: dict[str, float]
) -> None:
    """Whatever is measured, also what no state has: the order does not hang on physics."""
    rng = np.random.default_rng(0)
    earned = []
    for stage in range(len(table.stages)):
        measured = random_measures(table, 5000, rng)
        earned.append(reward(table, bonus, weights, measured, np.full(5000, stage)))
    for lower, higher in pairwise(earned):
        assert lower.max() < higher.min()


@every_table
def test_nothing_jumps_where_stages_meet(
    name: str, table: StageTable, bonus: Sequence[float], weights: dict[str, float]
) -> None:
    """At the border of two stages both earn the upper bonus, but where two borders meet: a stage is skipped."""
    rng = np.random.default_rng(1)
    for k, (lower, upper) in enumerate(pairwise(table.stages)):
        measured = random_measures(table, 2000, rng)
        for ramp in lower.leaves:
            measured[:, table.measures.index(ramp.measure)] = ramp.one
        inside = share_of(table, lower.enters, measured) > 0.01  # not at the lower stage's own lower border
        measured = measured[inside]
        assert len(measured) > 50
        entering = {ramp.measure: ramp.zero for ramp in upper.enters}
        leaving = {ramp.measure: ramp.one for ramp in lower.leaves}
        assert entering == leaving, "what one stage is left by is what the next is entered by"
        for stage in (k, k + 1):
            found = reward(table, bonus, weights, measured, np.full(len(measured), stage))
            np.testing.assert_allclose(found, bonus[k + 1], atol=1e-6)


@every_table
def test_no_state_earns_more_than_nothing(
    name: str, table: StageTable, bonus: Sequence[float], weights: dict[str, float]
) -> None:
    """The best of all states is known, and is not worth staying in."""
    greatest = table.greatest(bonus, weights)
    assert greatest <= 0
    rng = np.random.default_rng(6)
    for stage in range(len(table.stages)):
        earned = reward(table, bonus, weights, random_measures(table, 5000, rng), np.full(5000, stage))
        assert earned.max() <= greatest + 1e-12
    last = table.stages[-1]
    ends = [table.terms[term] for term in last.asks]
    ideal = np.zeros((1, len(table.measures)))
    for ramp in (*last.enters, *ends):  # what a term asks for lies beyond what the stage asks for
        ideal[:, table.measures.index(ramp.measure)] = ramp.one
    best = reward(table, bonus, weights, ideal, np.array([len(table.stages) - 1]))
    assert best[0] == pytest.approx(greatest)


@every_table
@pytest.mark.parametrize("discount", [1.0, 0.95])
def test_dawdling_costs_more_than_finishing(
    name: str, table: StageTable, bonus: Sequence[float], weights: dict[str, float], discount: float
) -> None:
    """In and out of the last stage, never `hold` steps in it, against holding its best state until the end."""
    hold, steps, rng = 10, 60, np.random.default_rng(7)
    factors = discount ** np.arange(steps)
    for _ in range(50):
        stages = np.full(steps, len(table.stages) - 1)
        stages[np.arange(rng.integers(1, hold), steps, hold)] -= 1  # a condition of success is broken
        earned = reward(table, bonus, weights, random_measures(table, steps, rng), stages)
        start = int(np.argmax(earned))
        if start > steps - hold:
            continue
        finish = earned[:start] @ factors[:start] + earned[start] * factors[start : start + hold].sum()
        assert finish > earned @ factors


def test_terms_stay_in_their_range_and_only_count_where_asked() -> None:
    measured = random_measures(TOY, 1000, np.random.default_rng(2))
    terms = TOY.evaluate(named(TOY, measured), np.zeros(1000, dtype=int), TOY_BONUS)
    assert all((terms[name] >= 0).all() and (terms[name] <= 1).all() for name in TOY.terms)
    assert (terms["fast"] == 0).all()
    assert (terms["near"] > 0).any()


def test_the_reward_rises_along_the_way() -> None:
    """From far to close, with the angle right: every step nearer earns more."""
    gaps = np.linspace(1.9, 0.0, 60)
    columns = {"gap": gaps, "speed": np.full(60, 0.5), "angle": np.full(60, 0.1)}
    measured = np.stack([columns[name] for name in TOY.measures], axis=1)
    earned = reward(TOY, TOY_BONUS, TOY_WEIGHTS, measured, (gaps <= 0.1).astype(int))
    assert (np.diff(earned) > 0).all()


@pytest.mark.parametrize(
    ("bonus", "weights", "message"),
    [
        ((0.0,), TOY_WEIGHTS, r"needs 2 finite numbers, not \[0.0\]"),
        ((-4.5, -3.5), TOY_WEIGHTS, r"must rise by more than 2 from stage 0 \(far\) to 1.*rises by 1"),
        ((0.0, float("nan")), TOY_WEIGHTS, "finite"),
        ((-3.0, 0.0), TOY_WEIGHTS, r"no state may earn more than 0.*last stage \(close\) can earn 3.5: lower"),
        ((-6.0, -3.4), TOY_WEIGHTS, r"can earn 0.1: lower every bonus by at least as much: \[-6.0, -3.4\]"),
        (TOY_BONUS, {"nearer": 1.0}, r"unknown terms \['nearer'\]; legal are those .*: near, fast, stage"),
        (TOY_BONUS, {**TOY_WEIGHTS, "fast": -1.0}, "at least 0"),
    ],
)
def test_weights_that_break_a_promise_are_refused(
    bonus: tuple[float, ...], weights: dict[str, float], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        TOY.check_weights(bonus, weights)


@every_table
def test_the_kernel_does_what_the_reference_says(
    name: str, table: StageTable, bonus: Sequence[float], weights: dict[str, float]
) -> None:
    rng = np.random.default_rng(5)
    measured, stage = random_measures(table, 500, rng), rng.integers(0, len(table.stages), 500)
    found = table.evaluate(named(table, measured), stage, bonus)
    np.testing.assert_allclose(
        np.stack(list(found.values()), axis=1), table.terms_reference(measured, stage, bonus), atol=1e-12
    )
    assert tuple(found) == (*table.terms, STAGE_TERM)


@every_table
def test_single_precision_is_finite_everywhere(
    name: str, table: StageTable, bonus: Sequence[float], weights: dict[str, float]
) -> None:
    """Also where two borders meet, and 1 - 1e-9 is 1."""
    rng = np.random.default_rng(8)
    measured, stage = random_measures(table, 5000, rng), rng.integers(0, len(table.stages), 5000)
    found = table.terms_reference(measured.astype(np.float32), stage, bonus)
    assert found.dtype == np.float32
    assert np.isfinite(found).all()

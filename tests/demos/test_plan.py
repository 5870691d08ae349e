"""What is checked before anything is collected, and which levels are tried."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from artiskill.assets.catalog import load_object
from artiskill.demos import plan as planning
from artiskill.demos.plan import CollectionOptions, CollectionPlan, LevelQueue, ObjectPlan
from artiskill.demos.settings import GiveUpConfig
from artiskill.errors import ConfigError
from artiskill.evaluation.protocols import EPISODES
from artiskill.learning.reinforcement_config import load_reinforcement_config
from artiskill.tasks.levels import RngStream, level_generator
from artiskill.tasks.registry import make_task

from .conftest import drawer_plan

MakePlan = Callable[..., CollectionPlan]
PATIENCE = GiveUpConfig(attempts=10, least_rate=0.25)


@pytest.mark.parametrize(
    ("option", "value", "told"),
    [
        ("keep_failures", "no", "keep_failures must be True or False, not 'no'"),
        ("variety", None, "variety must be True or False, not None"),
        ("variety", 1, "variety must be True or False, not 1"),
        ("targets", "link_0", "targets must be a list of names of links, .* not 'link_0'"),
        ("targets", [1], r"targets must be a list of names of links, .* not \[1\]"),
        ("targets", [], r"targets must be a list of names of links, .* not \[\]"),
        (
            "per_object",
            2**31,
            "trajectories per object must be a whole number from 1 to 2147483647, not 2147483648",
        ),
    ],
)
def test_values_of_the_wrong_kind(plan: MakePlan, option: str, value: Any, told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        plan(**{option: value})


def test_the_order_of_targets_means_nothing(plan: MakePlan) -> None:
    orders = (["link_1", "link_0"], ("link_0", "link_1"))
    one, other = (plan(objects=["cabinet-0026"], targets=names) for names in orders)
    assert one.settings == other.settings
    assert one.objects[0].chosen == ("link_0", "link_1")


def test_the_order_of_ranges_is_hashed(plan: MakePlan, monkeypatch: pytest.MonkeyPatch) -> None:
    """Values are drawn in it: another one makes other trajectories."""
    before, variation = plan().settings.expert.config_hash, planning.load_variation("OpenCabinetDrawer")
    turned = dataclasses.replace(variation, ranges=dict(reversed(variation.ranges.items())))
    assert turned == variation
    monkeypatch.setattr(planning, "load_variation", lambda task: turned)
    assert plan().settings.expert.config_hash != before


def queue(wanted: int = 7) -> LevelQueue:
    return LevelQueue("link_1", first=3, stride=2, wanted=wanted, patience=PATIENCE)


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
    tried, at_work = queue(), []
    while tried.end is None:
        taken = tried.take(int(rng.integers(1, 4)))
        assert tried.successes + len(tried.in_progress) <= tried.wanted
        at_work += list(taken)
        if rng.uniform() < 0.1:  # killed: what was being tried is lost
            left = queue()
            left.outcomes = dict(tried.outcomes)
            tried, at_work = left, []
        elif at_work:
            level = at_work.pop(int(rng.integers(len(at_work))))
            tried.add_result(level, solved(level, rate))
    assert list(tried.levels) == first_successes(7, rate)


def test_no_attempt_is_in_vain_where_it_is_not_given_up() -> None:
    tried = queue()
    while tried.end is None:
        for level in tried.take(3):
            tried.add_result(level, solved(level, 0.6))
    assert sorted(tried.outcomes) == list(tried.levels)
    assert tried.outcomes[tried.levels[-1]]
    assert tried.take(3) == ()


def test_demonstrations_begin_where_no_protocol_plays() -> None:
    """Nor where training measures: all objects start alike at a level."""
    plan = planning.make_plan("PushChair", ["train"], CollectionOptions(per_object=300))
    shown = {queue.level(k) for one in plan.objects for queue in plan.queues(one) for k in range(1000)}
    assert min(shown) >= EPISODES
    assert max(shown) < load_reinforcement_config("sac", "PushChair").evaluation.first_level
    task, starts = make_task("PushChair"), []
    for name in ("chair-0004", "chair-0012"):
        rng = level_generator(7, RngStream.INITIAL_STATE)
        starts.append(np.asarray(task.sample_initial_state(load_object(name), rng).robot_qpos))
    np.testing.assert_array_equal(*starts)


def queues_of(chosen: tuple[str, ...]) -> list[LevelQueue]:
    """Of an object with three targets, 11 trajectories in all, from level 100 on."""
    settings = dataclasses.replace(drawer_plan().settings, per_object=11, first_level=100)
    made = ObjectPlan("cabinet-0002", "cabinet-0002", "hash", ("link_1", "link_2", "link_3"), chosen)
    return CollectionPlan(settings, (made,), (), 1).queues(made)


def test_targets_share_an_object_and_no_level() -> None:
    queues = queues_of(("link_1", "link_2", "link_3"))
    assert [one.wanted for one in queues] == [4, 4, 3]
    levels = [[one.level(k) for k in range(3)] for one in queues]
    assert levels == [[100, 103, 106], [101, 104, 107], [102, 105, 108]]


def test_a_target_has_the_same_levels_whichever_are_chosen() -> None:
    (only,) = queues_of(("link_2",))
    assert (only.wanted, only.level(0), only.level(1)) == (11, 101, 104)


def test_nothing_to_do() -> None:
    assert queue(wanted=0).end == 0
    assert queue(wanted=0).take(5) == ()

"""What is checked before anything is collected."""

import dataclasses
from collections.abc import Callable
from typing import Any

import pytest

from artiskill.demos import plan as planning
from artiskill.demos.plan import Plan
from artiskill.errors import ConfigError

MakePlan = Callable[..., Plan]


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

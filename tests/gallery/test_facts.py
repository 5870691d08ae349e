"""Facts: plain values, whatever an object's numbers are made of."""

import json
import xml.etree.ElementTree as ET
from dataclasses import asdict, replace

import numpy as np
import pytest

from artiskill.assets.catalog import list_objects, load_object
from artiskill.gallery.facts import (
    KINDS,
    JointFacts,
    ObjectFacts,
    bin_edges,
    by_split,
    object_facts,
    shares,
)
from artiskill.gallery.gallery import category_chart


def sprung(category: str) -> str:
    """The first object of the catalogue with a spring in one of its joints."""
    names = [*list_objects(category, "ood"), *list_objects(category)]
    return next(n for n in names if any(joint.stiffness > 0 for joint in load_object(n).joints))


@pytest.fixture(params=["cabinet", "chair"])
def facts(request: pytest.FixtureRequest) -> ObjectFacts:
    return object_facts(load_object(sprung(request.param)))


def test_facts_of_sprung_joints_are_plain(facts: ObjectFacts) -> None:
    assert json.loads(json.dumps(asdict(facts)))["id"] == facts.id
    assert {type(joint.spring) for joint in facts.joints} == {bool}
    assert any(joint.spring for joint in facts.joints)


@pytest.mark.slow
def test_facts_of_the_whole_catalogue_are_plain() -> None:
    for name in [*list_objects(split="all"), *list_objects(split="ood")]:
        json.dumps(asdict(object_facts(load_object(name))))


JOINT = JointFacts("slide", "link_0", "prismatic", 0.4, False)


def fact(number: int, split: str = "train", **values: object) -> ObjectFacts:
    made = ObjectFacts(
        *(f"cabinet-{number}", "cabinet", split, "<chest>", (0.5, 0.4 + 0.01 * number, 0.8), 30.0 + number),
        joints=(JOINT,) * (1 + number % 3),
        handles=("bar", "bar"),
        tags=(),
        triangles=100,
        shapes=10,
        content_hash="0",
        more=(),
    )
    return replace(made, **values)


@pytest.mark.parametrize(
    ("values", "is_count"),
    [
        ([0.41, 0.93, 1.27], False),
        ([0.5, 0.5], False),
        ([1, 2, 19], True),
        ([3], True),
        ([0, 0], True),
        ([7, 40], True),
    ],
)
def test_bins_hold_all_values(values: list[float], is_count: bool) -> None:
    edges = bin_edges(values, is_count)
    assert np.histogram(values, edges)[0].sum() == len(values)
    assert np.allclose(np.diff(edges), edges[1] - edges[0])
    assert len(edges) <= 21


def test_small_counts_have_a_bin_each() -> None:
    assert bin_edges([1, 2, 4], is_count=True).tolist() == [0.5, 1.5, 2.5, 3.5, 4.5]
    assert np.histogram([1, 2, 2, 4], bin_edges([1, 2, 4], is_count=True))[0].tolist() == [1, 2, 0, 1]


def test_kinds_count_objects_not_handles() -> None:
    facts = [fact(1), fact(2, handles=("bar", "knob")), fact(3, handles=())]
    assert shares(facts, KINDS["kinds of handle"]) == {"bar": 2, "knob": 1, "none": 1}


def test_splits_come_in_their_usual_order() -> None:
    facts = [fact(1, "ood"), fact(2, "test"), fact(3, "train")]
    assert list(by_split(facts)) == ["train", "test", "ood"]


def test_charts_are_xml_with_a_bar_per_filled_bin() -> None:
    facts = [fact(k, "train" if k % 2 else "test") for k in range(10)]
    root = ET.fromstring(category_chart(facts))
    names = {"{http://www.w3.org/2000/svg}" + tag for tag in ("rect",)}
    titles = [rect[0].text for rect in root.iter() if rect.tag in names]
    assert "1: 2 of 5 in train" in titles or "1: 1 of 5 in train" in titles
    assert any("<chest>: 5 of 5 in test" in (title or "") for title in titles)


def test_what_no_object_has_is_not_drawn() -> None:
    svg = category_chart([fact(k, handles=()) for k in range(4)])
    assert "handles" not in svg
    assert "kinds of handle" not in svg
    assert "family" in svg

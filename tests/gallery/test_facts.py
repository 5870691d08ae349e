"""Facts: plain values, whatever an object's numbers are made of."""

import json
from dataclasses import asdict

import pytest

from artiskill.assets.catalog import list_objects, load_object
from artiskill.gallery.facts import ObjectFacts, object_facts


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

"""The similarity of objects: duplicates, scaled and opened ones, order and colour."""

from dataclasses import replace

import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object
from artiskill.assets.similarity import describe, distance, nearest_neighbour, nearest_neighbours


def scaled(obj: ArticulatedObject, factor: tuple[float, float, float], name: str) -> ArticulatedObject:
    links = tuple(
        replace(
            link,
            position=link.position * factor,
            visuals=tuple(replace(v, mesh=v.mesh.scaled(factor)) for v in link.visuals),
        )
        for link in obj.links
    )
    return replace(obj, id=name, links=links, bounds=obj.bounds * factor)


@pytest.fixture(scope="module")
def cabinet() -> ArticulatedObject:
    return load_object("generated:cabinet:3")


def test_duplicates_and_copies_elsewhere(cabinet: ArticulatedObject) -> None:
    first = describe(cabinet)
    assert distance(first, describe(replace(cabinet, id="duplicate"))) < 1e-3
    root = cabinet.links[0]
    moved = replace(cabinet.links[0], position=root.position + np.array((0.3, -0.2, 0)))
    away = replace(cabinet, links=(moved, *cabinet.links[1:]), bounds=cabinet.bounds + np.array((0.3, -0.2, 0)))
    assert distance(first, describe(away)) < 1e-3


def test_the_more_it_differs_the_further_it_is(cabinet: ArticulatedObject) -> None:
    first = describe(cabinet)
    wider = [distance(first, describe(scaled(cabinet, (1, f, 1), "wider"))) for f in (1.02, 1.1, 1.3)]
    assert 0 < wider[0] < wider[1] < wider[2]


def test_what_opens_differently_is_another_object(cabinet: ArticulatedObject) -> None:
    """Closed, the two are the same."""
    stuck = tuple(
        replace(link, joint=replace(link.joint, limits=(0.0, 0.02))) if link.joint is not None else link
        for link in cabinet.links
    )
    first, duplicate = describe(cabinet), describe(replace(cabinet, id="duplicate"))
    assert distance(first, describe(replace(cabinet, id="stuck", links=stuck))) > 5 * distance(first, duplicate)


def test_symmetric_and_deterministic(cabinet: ArticulatedObject) -> None:
    a, b = describe(cabinet), describe(load_object("generated:cabinet:4"))
    assert distance(a, b) == distance(b, a)
    np.testing.assert_array_equal(a.points, describe(cabinet).points)


def test_neighbours() -> None:
    objects = [load_object(f"generated:cabinet:{seed}") for seed in range(4)]
    objects.append(scaled(objects[2], (1.01, 1.0, 1.0), "nearly-2"))
    found = {n.id: n for n in nearest_neighbours([describe(o) for o in objects])}
    assert list(found) == [o.id for o in objects]
    assert found[objects[2].id].nearest == "nearly-2"
    assert found["nearly-2"].nearest == objects[2].id
    assert found["nearly-2"].same_joints
    assert found["nearly-2"].distance_m < 0.01 < found[objects[0].id].distance_m
    assert nearest_neighbours([describe(objects[0])]) == ()
    one, *others = [describe(o) for o in objects]
    assert nearest_neighbour(one, others) == found[objects[0].id]
    assert nearest_neighbour(one, []) is None


@pytest.mark.slow
def test_no_nearer_object_is_missed() -> None:
    described = [describe(load_object(f"generated:chair:{seed}")) for seed in range(25)]
    for found, one in zip(nearest_neighbours(described), described, strict=True):
        assert found.distance_m == min(distance(one, other) for other in described if other is not one)

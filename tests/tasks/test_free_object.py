"""Fingertips' distances to surfaces: the kernel, its definition, and a brute-force answer."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from artiskill.assets.catalog import load_object
from artiskill.geometry.rotations import quat_to_matrix
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.free_object import (
    SURFACE_POINTS,
    fingertip_distance,
    fingertip_distance_reference,
    surface_samples,
)
from artiskill.tasks.registry import make_task

CHAIR = "chair-0002"


@pytest.fixture(scope="module")
def instant(play) -> tuple[Snapshot, object]:
    return play(make_task("PushChair"), CHAIR, 5)


def test_samples_lie_on_their_links_and_are_always_the_same() -> None:
    chair = load_object(CHAIR)
    points, link = surface_samples(chair)
    assert points.shape == (SURFACE_POINTS, 3)
    again, _ = surface_samples.__wrapped__(chair)
    np.testing.assert_array_equal(points, again)
    for k in set(link.tolist()):
        bounds = np.stack([v.mesh.bounds for v in chair.links[k].visuals])
        assert (points[link == k] >= bounds[:, 0].min(axis=0) - 1e-9).all()
        assert (points[link == k] <= bounds[:, 1].max(axis=0) + 1e-9).all()


def test_distance_is_that_of_the_nearest_point(instant: tuple[Snapshot, object]) -> None:
    snapshot, goal = instant
    turns = quat_to_matrix(snapshot.link_quaternion_w[0])[goal.point_link[0]]
    in_world = np.einsum("pij,pj->pi", turns, goal.points[0]) + snapshot.link_position_w[0, goal.point_link[0]]
    brute = cKDTree(in_world).query(snapshot.fingertip_position_w[0])[0].mean()
    found = fingertip_distance(snapshot, goal)
    assert found[0] == pytest.approx(brute, abs=1e-12)
    links = snapshot.link_position_w, snapshot.link_rotation_w
    defined = fingertip_distance_reference(snapshot.fingertip_position_w, *links, goal)
    assert found[0] == pytest.approx(defined[0], abs=1e-12)

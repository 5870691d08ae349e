"""Fingertips at surfaces: the kernel, its definition, and a brute-force answer; states that say where they are."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from artiskill.assets.catalog import load_object
from artiskill.errors import ConfigError
from artiskill.geometry.rotations import quat_to_matrix
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.free_object import (
    SURFACE_POINTS,
    fingertip_distance,
    fingertip_gaps,
    fingertip_gaps_reference,
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
    gaps = fingertip_gaps(snapshot, goal)
    assert np.linalg.norm(gaps[0], axis=1).mean() == pytest.approx(brute, abs=1e-12)
    np.testing.assert_allclose(gaps, fingertip_gaps_reference(snapshot, goal), atol=1e-12)


@pytest.mark.parametrize(("name", "object_id"), [("PushChair", CHAIR), ("MoveBucket", "bucket-0016")])
def test_the_state_may_be_what_the_base_sees(play, name: str, object_id: str) -> None:
    """Vectors along the axes of the base come first, then the robot's joints, as in the paper's state."""
    task, plain = make_task(name, {"state.relative": True}), make_task(name)
    snapshot, goal = play(task, object_id, 5)
    seen, usual = task.observe_state(snapshot, goal)[0], plain.observe_state(snapshot, goal)[0]
    assert len(seen) == sum(field.size for field in task.state_fields)
    np.testing.assert_array_equal(seen[-38:], usual[-38:])
    x, y, yaw = snapshot.robot_qpos[0, :3]
    turn = np.array(((np.cos(yaw), -np.sin(yaw), 0), (np.sin(yaw), np.cos(yaw), 0), (0, 0, 1)))
    vectors = seen[:-38].reshape(-1, 3) @ turn.T  # in the world's axes
    expected = {
        "target": np.array(((-x, -y, 0),)),
        "root": snapshot.link_position_w[0, :1] - (x, y, 0),
        "axes": snapshot.link_rotation_w[0, 0].T[[0, 2]],
        "velocities": snapshot.root_velocity_w[0].reshape(2, 3),
        "props": snapshot.prop_position_w[0] - (x, y, 0),
        "how props move": snapshot.prop_velocity_w[0],
        "gaps": fingertip_gaps(snapshot, goal)[0],
        "hands": snapshot.tool_rotation_w[0].transpose(2, 0, 1)[[2, 1]].reshape(-1, 3),
        "how fingertips move": snapshot.fingertip_velocity_w[0],
        "how the base moves": snapshot.robot_qvel[0, None, :3],
    }
    np.testing.assert_allclose(vectors, np.concatenate(list(expected.values())), atol=1e-5)
    with pytest.raises(ConfigError, match="relative"):
        make_task("OpenCabinetDoor", {"state.relative": True})


def test_torch_gives_the_same_relative_state(instant: tuple[Snapshot, object], assert_torch_agrees) -> None:
    assert_torch_agrees(make_task("PushChair", {"state.relative": True}), *instant)

"""Grasp poses of plain shapes, whose right answers are known."""

from typing import Any

import numpy as np
import pytest

from artiskill.assets.articulated_object import Handle
from artiskill.assets.handles import POINTS_PER_HANDLE, HandleGrasp, handle_from_mesh
from artiskill.errors import AssetError
from artiskill.geometry.meshes import TriMesh, depth_inside
from artiskill.geometry.primitives import box, cylinder
from artiskill.geometry.rotations import quat_from_axis_angle, quat_rotate

OUTWARD = np.array((-1.0, 0.0, 0.0))
# a bar along y, 12 mm thick (z), standing 20 mm (x) deep, 200 mm long
BAR = box((0.010, 0.100, 0.006)).transformed((-0.04, 0.3, 0.7))
X, Y, Z = np.eye(3)


def handle_of(mesh: TriMesh, outward: Any = OUTWARD, seed: int = 0) -> Handle:
    return handle_from_mesh("link_0", "bar", mesh, np.asarray(outward), np.random.default_rng(seed), hookable=True)


def hand_axis(handle: Handle, axis: np.ndarray) -> np.ndarray:
    """An axis of the hand in its best grasp pose, in the link's frame."""
    return np.asarray(quat_rotate(handle.grasp_quaternions[0], axis))


def test_the_bar_is_gripped_across() -> None:
    handle = handle_of(BAR)
    np.testing.assert_allclose(hand_axis(handle, Z), -OUTWARD, atol=1e-12)
    np.testing.assert_allclose(np.abs(hand_axis(handle, Y)), Z, atol=1e-12)  # closes over the 12 mm
    np.testing.assert_allclose(np.abs(hand_axis(handle, X)), Y, atol=1e-12)  # the hand's flat lies along the bar
    assert handle.grasp_width_m == pytest.approx(0.012)


def test_the_grasp_is_on_the_bar() -> None:
    handle = handle_of(BAR)
    np.testing.assert_allclose(handle.grasp_positions[0], (-0.04, 0.3, 0.7), atol=1e-12)
    assert depth_inside(handle.planes, handle.grasp_positions).min() > 0


def test_a_deep_bar_is_gripped_near_its_face() -> None:
    handle = handle_of(box((0.030, 0.100, 0.006)))
    np.testing.assert_allclose(handle.grasp_positions[0], (-0.030 + 0.010, 0, 0), atol=1e-12)


def test_both_halves_of_a_turn_are_listed() -> None:
    handle = handle_of(BAR)
    assert handle.grasp_positions.shape == (2, 3)
    one, other = (np.asarray(quat_rotate(q, np.eye(3))) for q in handle.grasp_quaternions)
    np.testing.assert_allclose(other, one * np.array([[-1], [-1], [1]]), atol=1e-12)
    np.testing.assert_allclose(handle.grasp_positions[0], handle.grasp_positions[1])


def test_the_samples_lie_on_the_surface() -> None:
    handle = handle_of(BAR)
    assert handle.points.shape == (POINTS_PER_HANDLE, 3)
    np.testing.assert_allclose(depth_inside(handle.planes, handle.points), 0, atol=1e-8)
    np.testing.assert_array_equal(handle.points, handle_of(BAR).points)
    assert not np.array_equal(handle.points, handle_of(BAR, seed=1).points)


def test_the_length_of_outward_does_not_matter() -> None:
    np.testing.assert_allclose(handle_of(BAR, 7 * OUTWARD).grasp_quaternions, handle_of(BAR).grasp_quaternions)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.0, np.pi / 2, 2.0, np.pi, -2.5])
@pytest.mark.parametrize("axis", [X, Y, Z, np.array((1.0, 2.0, -1.0))], ids=["x", "y", "z", "skew"])
def test_a_turned_frame_turns_the_grasp(axis: np.ndarray, angle: float) -> None:
    turn = quat_from_axis_angle(axis, angle)
    shift = np.array((0.1, -0.2, 0.3))
    handle = handle_of(BAR.transformed(shift, turn), quat_rotate(turn, OUTWARD))
    straight = handle_of(BAR)
    for hand in (X, Y, Z):
        wanted = np.asarray(quat_rotate(turn, hand_axis(straight, hand)))
        assert abs(hand_axis(handle, hand) @ wanted) > 1 - 1e-9
    expected = np.asarray(quat_rotate(turn, straight.grasp_positions[0])) + shift
    np.testing.assert_allclose(handle.grasp_positions[0], expected, atol=1e-7)
    assert handle.grasp_width_m == pytest.approx(0.012, abs=1e-7)
    np.testing.assert_allclose(np.linalg.norm(handle.grasp_quaternions, axis=1), 1.0)


@pytest.mark.parametrize(
    "outward", [Z, -Z, X + 1e-6 * Z, (0.1, 0.0, 0.99)], ids=["up", "down", "nearly x", "steep"]
)
def test_any_direction_may_be_outward(outward: Any) -> None:
    handle = handle_of(box((0.02, 0.1, 0.03)), outward)
    unit = np.asarray(outward) / np.linalg.norm(outward)
    np.testing.assert_allclose(hand_axis(handle, Z), -unit, atol=1e-9)
    np.testing.assert_allclose(np.abs(hand_axis(handle, X)), Y, atol=1e-9)


def test_a_round_knob() -> None:
    knob = cylinder(0.015, 0.012).transformed((0.2, 0.0, 0.0), quat_from_axis_angle(Y, np.pi / 2))
    handle = handle_of(knob)
    assert handle.grasp_width_m == pytest.approx(0.030, abs=0.0005)
    np.testing.assert_allclose(handle.grasp_positions[0], (0.2 - 0.012 + 0.010, 0, 0), atol=1e-9)


def test_a_grip_that_is_given_comes_with_its_half_turns() -> None:
    grasp = HandleGrasp(np.array((-0.05, 0.3, 0.7)), np.stack((Y, Z)), 0.02)
    handle = handle_from_mesh(
        "link_0", "knob", BAR, OUTWARD, np.random.default_rng(0), hookable=False, grasp=grasp
    )
    assert handle.grasp_positions.shape == (4, 3)
    assert (handle.grasp_positions == grasp.position).all()
    assert handle.grasp_width_m == 0.02
    for k, across in enumerate((Y, Y, Z, Z)):
        np.testing.assert_allclose(quat_rotate(handle.grasp_quaternions[k], Z), -OUTWARD, atol=1e-12)
        np.testing.assert_allclose(np.abs(quat_rotate(handle.grasp_quaternions[k], Y)), across, atol=1e-12)


@pytest.mark.parametrize(
    "mesh",
    [
        TriMesh(np.eye(3), np.array([[0, 1, 2]])),
        TriMesh(BAR.vertices * (1, 1, 0), BAR.faces),
        TriMesh(np.zeros((0, 3)), np.zeros((0, 3))),
    ],
    ids=["triangle", "flat", "empty"],
)
def test_a_handle_without_a_volume(mesh: TriMesh) -> None:
    with pytest.raises(AssetError, match="link 'link_0': its handle's mesh is flat or empty"):
        handle_of(mesh)


def test_outward_needs_a_direction() -> None:
    with pytest.raises(AssetError, match="link 'link_0': its handle's outward direction"):
        handle_of(BAR, np.zeros(3))

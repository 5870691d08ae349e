"""Rotations against SciPy's, and against an array library that has nothing but the Array API."""

from collections.abc import Callable
from typing import Any

import array_api_strict
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from artiskill.geometry import rotations as r

N = 200


def scipy_of(q: np.ndarray) -> Rotation:
    return Rotation.from_quat(q, scalar_first=True)


def random_quats(rng: np.random.Generator, count: int = N) -> np.ndarray:
    q = rng.normal(size=(count, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def same_rotation(a: Any, b: Any) -> bool:
    """Whether quaternions agree up to their sign."""
    return bool(np.allclose(np.abs(np.sum(np.asarray(a) * np.asarray(b), axis=-1)), 1.0, atol=1e-12))


def test_multiply_is_composition(rng: np.random.Generator) -> None:
    a, b = random_quats(rng), random_quats(rng)
    assert same_rotation(r.quat_multiply(a, b), (scipy_of(a) * scipy_of(b)).as_quat(scalar_first=True))


def test_conjugate_undoes(rng: np.random.Generator) -> None:
    q = random_quats(rng)
    np.testing.assert_allclose(r.quat_multiply(q, r.quat_conjugate(q)), np.tile((1, 0, 0, 0), (N, 1)), atol=1e-14)


def test_rotate_and_matrix(rng: np.random.Generator) -> None:
    q, v = random_quats(rng), rng.normal(size=(N, 3))
    np.testing.assert_allclose(r.quat_rotate(q, v), scipy_of(q).apply(v), atol=1e-13)
    np.testing.assert_allclose(r.quat_to_matrix(q), scipy_of(q).as_matrix(), atol=1e-14)


def test_cross_broadcasts(rng: np.random.Generator) -> None:
    a, b = rng.normal(size=(5, 1, 3)), rng.normal(size=(4, 3))
    np.testing.assert_allclose(r.cross(a, b, np), np.cross(a, b), atol=1e-14)


def test_angle_between(rng: np.random.Generator) -> None:
    a, b = random_quats(rng), random_quats(rng)
    np.testing.assert_allclose(r.quat_angle(a, b), (scipy_of(a).inv() * scipy_of(b)).magnitude(), atol=1e-7)
    np.testing.assert_array_equal(r.quat_angle(a, b), r.quat_angle(a, -b))


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-9, 1e-4, 1.0, np.pi - 1e-6, np.pi])
def test_angle_is_accurate_at_both_ends(angle: float) -> None:
    one = r.quat_from_axis_angle((1, 2, 3), 0.4)
    other = r.quat_multiply(one, r.quat_from_axis_angle((0, 1, 1), angle))
    np.testing.assert_allclose(r.quat_angle(one, other), angle, rtol=1e-6, atol=1e-15)


def test_rotation_vector(rng: np.random.Generator) -> None:
    q = random_quats(rng)
    np.testing.assert_allclose(r.quat_to_rotation_vector(q), scipy_of(q).as_rotvec(), atol=1e-12)
    assert np.linalg.norm(r.quat_to_rotation_vector(-q), axis=1).max() <= np.pi


@pytest.mark.parametrize("angle", [0.0, 1e-14, 1e-11, 1e-6, 3.0])
def test_rotation_vector_of_small_angles(angle: float) -> None:
    axis = np.array((0.6, 0.0, 0.8))
    vector = r.quat_to_rotation_vector(r.quat_from_axis_angle(axis, angle))
    np.testing.assert_allclose(vector, axis * angle, rtol=1e-9, atol=1e-18)


def test_transform_points_of_a_batch(rng: np.random.Generator) -> None:
    q, position, points = random_quats(rng, 6), rng.normal(size=(6, 3)), rng.normal(size=(6, 10, 3))
    wanted = np.stack([scipy_of(q[i]).apply(points[i]) + position[i] for i in range(6)])
    np.testing.assert_allclose(r.transform_points(position, q, points), wanted, atol=1e-13)
    np.testing.assert_allclose(r.transform_points(position[0], q[0], points[0]), wanted[0], atol=1e-13)


def test_axis_angle_of_any_length() -> None:
    q = r.quat_from_axis_angle((0, 0, 5), np.pi / 2)
    np.testing.assert_allclose(r.quat_rotate(q, np.array((1.0, 0.0, 0.0))), (0, 1, 0), atol=1e-15)


def test_rpy_turns_about_fixed_axes(rng: np.random.Generator) -> None:
    for rpy in rng.uniform(-np.pi, np.pi, size=(50, 3)):
        assert same_rotation(r.quat_from_rpy(rpy), Rotation.from_euler("xyz", rpy).as_quat(scalar_first=True))


@pytest.mark.parametrize("angles", [(0.3, -0.4, 2.0), (0.1, np.pi / 2, 0.7), (-1.0, -np.pi / 2, 0.2), (3, 1, -3)])
def test_roll_pitch_and_yaw_give_the_rotation_back(angles: tuple[float, float, float]) -> None:
    quaternion = r.quat_from_rpy(angles)
    difference = r.quat_multiply(r.quat_conjugate(quaternion), r.quat_from_rpy(r.quat_to_rpy(quaternion)))
    assert np.linalg.norm(difference[1:]) < 1e-7


def test_from_matrix_in_all_four_branches(rng: np.random.Generator) -> None:
    half_turns = np.eye(4)  # where the scalar part vanishes
    for q in np.concatenate((random_quats(rng), half_turns, r.quat_multiply(half_turns, random_quats(rng, 4)))):
        back = r.quat_from_matrix(scipy_of(q).as_matrix())
        assert same_rotation(back, q)
        assert back[0] >= 0
        assert np.linalg.norm(back) == pytest.approx(1.0, abs=1e-14)


def as_strict(*arrays: np.ndarray) -> list[Any]:
    return [array_api_strict.asarray(a) for a in arrays]


ARRAY_FUNCTIONS: dict[str, tuple[Callable[..., Any], tuple[tuple[int, ...], ...]]] = {
    "quat_multiply": (r.quat_multiply, ((5, 4), (5, 4))),
    "quat_conjugate": (r.quat_conjugate, ((5, 4),)),
    "quat_rotate": (r.quat_rotate, ((5, 4), (5, 3))),
    "quat_to_matrix": (r.quat_to_matrix, ((5, 4),)),
    "quat_angle": (r.quat_angle, ((5, 4), (5, 4))),
    "quat_to_rotation_vector": (r.quat_to_rotation_vector, ((5, 4),)),
    "transform_points": (r.transform_points, ((5, 3), (5, 4), (5, 7, 3))),
}


@pytest.mark.parametrize("name", ARRAY_FUNCTIONS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_any_array_library_will_do(name: str, dtype: type, rng: np.random.Generator) -> None:
    function, shapes = ARRAY_FUNCTIONS[name]
    values = [rng.normal(size=shape) for shape in shapes]
    values = [(v / np.linalg.norm(v, axis=-1, keepdims=True)).astype(dtype) for v in values]
    wanted = function(*values)
    answer = function(*as_strict(*values))
    assert answer.__array_namespace__() is array_api_strict
    assert wanted.dtype == dtype, "the precision that came in goes out"
    np.testing.assert_allclose(np.asarray(answer), wanted, rtol=1e-6, atol=1e-7)

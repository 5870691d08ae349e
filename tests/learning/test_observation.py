"""Observations to records and back."""

from typing import Any

import numpy as np
import pytest

from artiskill.errors import ConfigError
from artiskill.learning.observation import ObservationLayout

LAYOUT = ObservationLayout(points=3, masks=2, agent=2)


def observation(**changes: Any) -> dict[str, Any]:
    """Two points and a row of padding; the second point is in both masks."""
    cloud = {
        "xyz": np.array([[0.5, -0.25, 1.0], [0.0, 0.0, 2.0], [0.0, 0.0, 0.0]], np.float32),
        "rgb": np.array([[0, 51, 255], [255, 0, 0], [0, 0, 0]], np.uint8),
        "seg": np.array([[False, False], [True, True], [False, False]]),
    }
    agent = np.array([1.5, -1e-3], np.float32)
    return {
        "pointcloud": cloud | {k: v for k, v in changes.items() if k in cloud},
        "agent": changes.get("agent", agent),
    }


def test_what_a_network_sees() -> None:
    seen = LAYOUT.observe(observation())
    np.testing.assert_array_equal(seen.points, observation()["pointcloud"]["xyz"][None])
    np.testing.assert_allclose(seen.colors[0], [[0, 0.2, 1], [1, 0, 0], [0, 0, 0]], atol=1e-7)
    np.testing.assert_array_equal(seen.masks, [[[0, 0], [1, 1], [0, 0]]])
    np.testing.assert_array_equal(seen.valid, [[True, True, False]])
    np.testing.assert_array_equal(seen.agent, np.array([[1.5, -1e-3]], np.float32))
    assert {array.dtype for array in seen} == {np.dtype(np.float32), np.dtype(bool)}


def test_a_record_has_no_gaps() -> None:
    assert LAYOUT.dtype.itemsize == 3 * (6 + 3 + 1) + 2 * 4


def test_a_batch_is_its_rows() -> None:
    one, other = observation(), observation(agent=np.array([7.0, 8.0], np.float32))
    cloud = {name: np.stack([one["pointcloud"][name], other["pointcloud"][name]]) for name in one["pointcloud"]}
    both = LAYOUT.observe({"pointcloud": cloud, "agent": np.stack([one["agent"], other["agent"]])})
    for row, single in enumerate((one, other)):
        for found, wanted in zip(both, LAYOUT.observe(single), strict=True):
            np.testing.assert_array_equal(found[row], wanted[0])


def test_points_are_rounded_to_half_precision_and_nothing_else() -> None:
    xyz = np.array([[1.0004, 2.001, 1e-9], [0.1, 0.2, 0.3], [-3.3, 65504.0, 1.0]], np.float32)
    agent = np.array([1.0004, 2.001], np.float32)
    seen = LAYOUT.observe(observation(xyz=xyz, agent=agent))
    np.testing.assert_array_equal(seen.points[0], xyz.astype(np.float16).astype(np.float32))
    np.testing.assert_array_equal(seen.agent[0], agent)
    assert seen.valid.all()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 65520.0])
def test_coordinates_beyond_half_precision_are_refused(value: float) -> None:
    with pytest.raises(ConfigError, match=r"not finite, or coordinates beyond 65504\.0 m"):
        LAYOUT.observe(observation(xyz=np.full((3, 3), value, np.float32)))


def test_what_the_robot_knows_must_be_finite() -> None:
    with pytest.raises(ConfigError, match="not finite"):
        LAYOUT.observe(observation(agent=np.array([0.0, np.nan], np.float32)))


@pytest.mark.parametrize(("name", "shape"), [("xyz", (4, 3)), ("rgb", (3, 4)), ("seg", (3, 1)), ("agent", (3,))])
def test_other_shapes_are_refused(name: str, shape: tuple[int, ...]) -> None:
    with pytest.raises(ConfigError, match=r"\(1, 3, 3\).* were expected"):
        LAYOUT.observe(observation(**{name: np.zeros(shape, np.float32)}))


@pytest.mark.parametrize("given", [{}, {"pointcloud": {}}, np.zeros(3), None])
def test_other_observations_are_refused(given: Any) -> None:
    with pytest.raises(ConfigError, match="obs_mode pointcloud was expected"):
        LAYOUT.observe(given)

"""Objects of another size: lengths grow with the factor, masses with its cube, and springs still carry them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object
from artiskill.assets.kinematics import drawn_points, joint_values
from artiskill.assets.scaling import original_id, scaled
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import AssetError
from artiskill.geometry.meshes import depth_inside

FACTOR = 1.25
OBJECTS = ("generated:cabinet:3000001", "generated:chair:3000000", "generated:bucket:3000001")


@pytest.fixture(scope="module", params=OBJECTS)
def both(request: pytest.FixtureRequest) -> tuple[ArticulatedObject, ArticulatedObject]:
    obj = load_object(request.param)
    return obj, scaled(obj, FACTOR)


def test_what_is_drawn_grows_closed_and_open(both: tuple[ArticulatedObject, ArticulatedObject]) -> None:
    small, large = both
    assert large.bounds == pytest.approx(FACTOR * small.bounds)
    for share in (0.0, 0.7):
        points = drawn_points(large, joint_values(large, share))
        np.testing.assert_allclose(points, FACTOR * drawn_points(small, joint_values(small, share)), atol=1e-12)


def test_what_collides_weighs_the_cube(both: tuple[ArticulatedObject, ArticulatedObject]) -> None:
    small, large = both
    task = {"cabinet": "OpenCabinetDrawer", "chair": "PushChair", "bucket": "MoveBucket"}[small.category]
    masses = []
    for one in both:
        env = ManipulationEnv(task, objects=one)
        env.reset(options={"level": 0})
        names = [env.scene.model.body(body).name for body in range(env.scene.model.nbody)]
        bodies = [body for body, name in enumerate(names) if name.startswith("object/")]
        masses.append(env.scene.model.body_mass[bodies])
    assert len(masses[0]) > 1
    np.testing.assert_allclose(masses[1], FACTOR**3 * masses[0], rtol=1e-6)
    assert large.metadata["mass_kg"] == pytest.approx(FACTOR**3 * small.metadata["mass_kg"], rel=1e-3)
    assert large.metadata["height_m"] == pytest.approx(FACTOR * small.metadata["height_m"], rel=1e-3)
    assert large.metadata["scale"] == FACTOR


def test_springs_carry_a_larger_chair() -> None:
    """Forces grow as the weight does, with the cube of the size; torques once more, by their arms."""
    small = load_object("generated:chair:3000000")
    kinds = []
    for one, other in zip(small.joints, scaled(small, FACTOR).joints, strict=True):
        before, after = (joint.stiffness * joint.spring_reference for joint in (one, other))
        slides = one.kind == "prismatic"
        assert after == pytest.approx(before * FACTOR ** (3 if slides else 4), rel=1e-12)
        assert other.spring_reference == one.spring_reference * (FACTOR if slides else 1)
        kinds += [one.kind] * (before != 0)
    assert kinds == ["prismatic", "revolute"], "it has both"


def test_a_handle_keeps_its_shape() -> None:
    small = load_object("generated:cabinet:3000001")
    before, after = small.handles[0], scaled(small, FACTOR).handles[0]
    assert depth_inside(after.planes, FACTOR * before.points) == pytest.approx(
        FACTOR * depth_inside(before.planes, before.points), abs=1e-9
    )
    assert after.grasp_width_m == FACTOR * before.grasp_width_m
    np.testing.assert_array_equal(after.grasp_quaternions, before.grasp_quaternions)


def test_factors_multiply() -> None:
    small = load_object("generated:chair:3000000")
    again = scaled(scaled(small, 2.0), 0.5)
    assert again.id == "scaled-scaled-generated-chair-3000000-200-50"
    assert (again.metadata["scale"], again.metadata["scaled_from"]) == (1.0, small.id)
    assert again.bounds.tolist() == small.bounds.tolist()


@pytest.mark.parametrize("factor", [0.01, 0.995, 1.2, 100.0])
def test_an_id_says_what_was_scaled(factor: float) -> None:
    small = load_object("generated:chair:3000000")
    assert original_id(scaled(scaled(small, 1.05), factor).id) == small.id == original_id(small.id)
    assert original_id("scaled-") == "scaled-"


def test_what_an_importer_says_of_an_object(drawer_box: ArticulatedObject) -> None:
    facts = {"scale": 0.8, "partnet_id": "179", "handle_gaps_m": (0.02, 0.04), "parts": ["front"]}
    found = scaled(replace(drawer_box, metadata=facts), 0.5).metadata
    assert found == {
        "scale": 0.4,
        "scaled_from": "drawer-box",
        "handle_gaps_m": (0.01, 0.02),
        "parts": ["front"],
    }, "it can no longer be loaded by its number"


def test_it_hangs_on_the_wall_higher_up() -> None:
    small = load_object("generated:cabinet:3000004")
    large = scaled(small, FACTOR)
    assert len(large.own_links) < len(large.links)
    assert large.bounds[0, 2] == FACTOR * small.bounds[0, 2] > 0


@pytest.mark.parametrize("factor", [0, -1.2, 0.009, 101, math.inf, math.nan, True, "1.2", None])
def test_illegal_factors(factor: object) -> None:
    with pytest.raises(AssetError, match=r"must be a number from 0\.01 to 100, not"):
        scaled(load_object("generated:chair:3000000"), factor)  # type: ignore[arg-type]

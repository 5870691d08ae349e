"""Which end of a joint's range is closed."""

import numpy as np
import pytest

from artiskill.errors import AssetError
from artiskill.geometry.rotations import quat_from_axis_angle, quat_rotate


def test_drawn_at_the_upper_limit_turns_the_axis(toy, load):
    reference = load(toy)
    toy.joints["link_1"] = toy.joints["link_1"].replace('xyz="0 0 1"', 'xyz="0 0 -1"')
    toy.set_limits("link_1", "-0.5", "0")
    obj = load(toy)
    np.testing.assert_allclose(obj.links[2].joint.axis, (-1, 0, 0), atol=1e-9)
    assert obj.links[2].joint.limits == reference.links[2].joint.limits
    assert len(obj.metadata["warnings"]) == 1
    assert "axis turned round" in obj.metadata["warnings"][0]


@pytest.mark.parametrize(("axis", "end"), [("0 0 1", "lower"), ("0 0 -1", "upper")])
def test_drawn_inside_the_range_closes_the_inner_end(toy, load, axis, end):
    reference = load(toy, scale=0.5)
    toy.joints["link_1"] = toy.joints["link_1"].replace('xyz="0 0 1"', f'xyz="{axis}"')
    toy.set_limits("link_1", "-0.2", "0.2")
    obj = load(toy, scale=0.5)
    np.testing.assert_allclose(obj.links[2].joint.axis, (-1, 0, 0), atol=1e-9)
    assert obj.links[2].joint.limits == pytest.approx((0.0, 0.2))
    # closed is 0.2 units (0.1 m) further in than drawn; the door still stands out
    inwards = (obj.links[2].position - obj.links[1].position) - (
        reference.links[2].position - reference.links[1].position
    )
    np.testing.assert_allclose(inwards, (0.1, 0, 0), atol=1e-9)
    assert any(f"the {end} limit" in text for text in obj.metadata["warnings"])


def test_door_drawn_ajar_is_closed(toy, load):
    reference = load(toy, scale=0.5)
    toy.set_limits("link_0", "0.3", "1.5")
    obj = load(toy, scale=0.5)
    joint = obj.links[1].joint
    assert joint.limits == pytest.approx((0.0, 1.2))
    # "closed" is the file's 0.3: the drawn surface turned by 0.3 about the axis
    turn = quat_from_axis_angle(joint.axis, 0.3)
    for new, old in zip(obj.links[1].visuals, reference.links[1].visuals, strict=True):
        np.testing.assert_allclose(new.mesh.vertices, quat_rotate(turn, old.mesh.vertices), atol=1e-9)


def test_chairs_keep_their_drawn_pose(toy, load):
    toy.meta = {"model_cat": "Chair"}
    toy.set_limits("link_0", "-0.5", "0.5")
    obj = load(toy)
    assert obj.category == "chair"
    assert obj.links[1].joint.limits == (-0.5, 0.5)


@pytest.mark.parametrize(
    ("lower", "upper", "message"),
    [
        ("0.2", "0.2", "degenerate limits"),
        ("0.3", "0.1", "degenerate limits"),
        ("0", "inf", "infinite limits"),
        ("-inf", "inf", "infinite limits"),
        ("nan", "1", "lower limit must be a finite number, not 'nan'"),
        ("0", "1e9", r"travel of 1e\+09; at most the object's own size, its diagonal of 1\.99"),
        ("1e9", "1000000000.5", "travel of 1e.09; at most"),
    ],
)
def test_degenerate_limits(toy, load, lower, upper, message):
    toy.set_limits("link_1", lower, upper)
    with pytest.raises(AssetError, match=message) as caught:
        load(toy)
    assert "joint_1" in str(caught.value)
    assert "toy" in str(caught.value)


def test_hinge_beyond_a_turn(toy, load):
    toy.set_limits("link_0", "0", "1e9")
    with pytest.raises(AssetError, match=r"'joint_0'.*range of 1e\+09 rad; at most one turn, 2 pi") as caught:
        load(toy)
    assert "toy" in str(caught.value)
    toy.set_limits("link_0", "-3.14159", "3.1416")  # a turn, rounded
    assert load(toy).links[1].joint.limits == pytest.approx((0.0, 6.28319))


def test_travel_up_to_the_objects_size_is_legal_at_any_scale(toy, load):
    toy.set_limits("link_1", "0", "1.9")
    assert load(toy, scale=0.1).links[2].joint.limits == pytest.approx((0.0, 0.19))


def test_missing_limits(toy, load):
    toy.joints["link_1"] = toy.joints["link_1"].partition("<limit")[0] + "</joint>"
    with pytest.raises(AssetError, match=r"'joint_1'.*has no <limit>"):
        load(toy)

"""Every check passes sound objects and fails one that is broken in the way that it is there to find."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object
from artiskill.checks.config import default_checks_config, load_checks_config
from artiskill.checks.context import CheckResult
from artiskill.checks.runner import check_object


def faults(obj: ArticulatedObject) -> dict[str, list[CheckResult]]:
    """What is wrong, by check."""
    found: dict[str, list[CheckResult]] = {}
    for result in check_object(obj, default_checks_config()):
        if not result.passed:
            found.setdefault(result.check, []).append(result)
    return found


@pytest.mark.parametrize("name", ["cabinet", "door_cabinet", "chair", "bucket"])
def test_sound_objects_pass(make: SimpleNamespace, name: str) -> None:
    assert faults(getattr(make, name)()) == {}


def test_a_drawer_that_stands_in_its_carcass(make: SimpleNamespace) -> None:
    obj = make.with_boxes(make.cabinet(), "link_0", [("drawer_side", (0.1, 0.22, 0.37), (0.05, 0.015, 0.02))])
    found = faults(obj)
    assert set(found) == {"closed", "sweep"}
    assert found["closed"][0].subject == "link_0/base"
    assert found["closed"][0].value == pytest.approx(5, abs=0.1)  # mm: 0.235 in a side that begins at 0.23
    assert "drawer_side in frame" in found["closed"][0].note


def test_a_pin_in_its_hinge_is_meant(make: SimpleNamespace) -> None:
    obj = make.with_boxes(make.cabinet(), "link_0", [("hinge_pin", (0.1, 0.22, 0.37), (0.05, 0.015, 0.02))])
    assert faults(obj) == {}


def test_a_door_that_meets_something_on_its_way(make: SimpleNamespace) -> None:
    obj = make.with_boxes(make.door_cabinet(), "base", [("post", (-0.3, 0.0, 0.2), (0.01, 0.01, 0.2))])
    found = faults(obj)
    assert set(found) == {"sweep"}
    assert found["sweep"][0].subject == "link_0_hinge"
    assert "deg" in found["sweep"][0].note


def test_a_wall_that_a_door_swings_into() -> None:
    """A wall is checked like a link and weighs nothing of the object's: where it belongs, nothing is found."""
    obj = load_object("cabinet-0052")
    assert obj.links[-1].is_wall
    assert faults(obj) == {}
    corner = replace(obj.links[-1], position=np.array((obj.bounds[0, 0] - 0.15, 0.0, 0.0)))
    found = faults(replace(obj, links=(*obj.links[:-1], corner)))
    assert "sweep" in found
    assert "room_wall/link_0" in found["sweep"][0].note
    assert "mass" not in found


def test_a_joint_that_turns_about_nothing_useful(make: SimpleNamespace) -> None:
    """A flap of lead: what moves it under the worst damping does not bring it round in time."""
    obj = make.cabinet()
    joint = replace(obj.links[1].joint, limits=(0.0, 40.0))
    found = faults(make.with_link(obj, "link_0", joint=joint))
    assert set(found) == {"drive"}
    assert "range 0.000 to 40.000" in found["drive"][0].note


def test_a_chair_that_tips(make: SimpleNamespace) -> None:
    found = faults(make.chair(reach_m=0.08, seat_height_m=0.7))
    assert "roll" in found
    assert any(result.subject == "lean" for result in found["roll"])


def test_a_chair_that_does_not_roll(make: SimpleNamespace) -> None:
    """Its casters neither swivel nor roll."""
    obj = make.chair()
    stuck = [replace(k, joint=None) if k.name.startswith(("fork", "wheel")) else k for k in obj.links]
    found = faults(replace(obj, links=tuple(stuck)))
    assert any(result.subject == "way" for result in found["roll"])


def test_a_chair_that_leans_on_three_legs(make: SimpleNamespace) -> None:
    obj = make.chair()
    short = obj.links[obj.link_index("wheel_0")]
    obj = make.with_link(obj, "wheel_0", position=short.position + np.array((0, 0, 0.02)))
    assert "settle" in faults(obj)


def test_a_drawer_that_is_solid_to_the_touch(make: SimpleNamespace) -> None:
    lid = [("drawer_side", (0.18, 0, 0.36), (0.16, 0.2, 0.05))]
    found = faults(make.with_boxes(make.cabinet(), "link_0", lid, drawn=False))
    assert set(found) == {"cavity", "surfaces"}
    assert found["cavity"][0].value > 30
    assert "link_0" in found["cavity"][0].note


def test_what_is_drawn_elsewhere(make: SimpleNamespace) -> None:
    obj = make.cabinet()
    moved = tuple(replace(v, mesh=v.mesh.transformed((0, 0, 0.03))) for v in obj.links[1].visuals)
    found = faults(make.with_link(obj, "link_0", visuals=moved))
    assert "surfaces" in found
    assert {result.subject for result in found["surfaces"]} == {"link_0"}


def test_a_link_that_is_drawn_and_cannot_be_touched(make: SimpleNamespace) -> None:
    found = faults(make.with_link(make.cabinet(), "link_0", collisions=()))
    assert "no collision shape" in found["surfaces"][0].note
    assert "nothing gives it a mass" in found["mass"][0].note


def test_a_handle_that_is_too_thick(make: SimpleNamespace) -> None:
    thick = [("handle", (-0.072, 0, 0.37), (0.05, 0.07, 0.05))]
    obj = make.with_boxes(make.cabinet(), "link_0", thick)
    obj = replace(obj, handles=(make.grip("link_0", thick, False),))
    found = faults(obj)
    assert set(found) == {"handles"}
    assert "mm into link_0" in found["handles"][0].note


def test_a_grasp_pose_beside_the_handle(make: SimpleNamespace) -> None:
    obj = make.cabinet()
    handle = obj.handles[0]
    away = replace(handle, grasp_positions=handle.grasp_positions + np.array((-0.1, 0, 0)), hookable=False)
    found = faults(replace(obj, handles=(away,)))
    assert "2 of 2 pads close without meeting it" in found["handles"][0].note


def test_a_handle_that_can_only_be_hooked(make: SimpleNamespace) -> None:
    """Too wide for the gripper, but a finger fits behind; it passes if it says so."""
    wide = [
        ("handle", (-0.066, 0, 0.37), (0.004, 0.07, 0.05)),
        ("handle", (-0.042, -0.06, 0.37), (0.02, 0.005, 0.005)),
        ("handle", (-0.042, 0.06, 0.37), (0.02, 0.005, 0.005)),
    ]
    plain = make.cabinet()
    bare = plain.links[1]
    obj = make.with_link(plain, "link_0", visuals=bare.visuals[:-3], collisions=bare.collisions[:-3])
    obj = make.with_boxes(obj, "link_0", wide)
    hooked = replace(obj, handles=(make.grip("link_0", wide, True),))
    results = [r for r in check_object(hooked, default_checks_config()) if r.check == "handles"]
    assert [r.passed for r in results] == [True]
    assert "hooked from" in results[0].note
    silent = replace(obj, handles=(make.grip("link_0", wide, False),))
    assert "handles" in faults(silent)


def test_a_handle_out_of_reach(make: SimpleNamespace) -> None:
    obj = make.cabinet()
    high = replace(obj.handles[0], grasp_positions=obj.handles[0].grasp_positions + np.array((0, 0, 2.8)))
    assert "reach" in faults(replace(obj, handles=(high,)))


def test_masses(make: SimpleNamespace) -> None:
    heavy = faults(make.with_link(make.cabinet(), "base", density_kg_m3=1e5))
    assert set(heavy) == {"mass"}
    assert heavy["mass"][0].subject == "object"
    light = faults(make.with_link(make.cabinet(), "link_0", density_kg_m3=0.5))
    assert light["mass"][0].subject == "link_0"


def test_what_the_engine_refuses(make: SimpleNamespace) -> None:
    found = faults(make.with_link(make.cabinet(), "link_0", density_kg_m3=0.0))
    assert set(found) == {"compiles"}
    assert "the engine refuses it" in found["compiles"][0].note


def test_a_bucket_without_a_wall(make: SimpleNamespace) -> None:
    obj = make.bucket()
    root = obj.links[0]
    open_side = make.with_link(obj, "base", collisions=(*root.collisions[:1], *root.collisions[2:]))
    found = faults(open_side)
    assert "ball" in found
    assert found["ball"][0].value < 5
    assert "whose top is that of 'wall': the one dropped" in found["ball"][0].note


def test_the_budget(make: SimpleNamespace) -> None:
    boxes = [("frame", (0.2, 0, 0.12), (0.1, 0.1, 0.1))] * 80
    found = faults(make.with_boxes(make.cabinet(), "base", boxes, drawn=False))
    assert "geoms" in found


def test_limits_can_be_changed(make: SimpleNamespace) -> None:
    strict = load_checks_config({"categories.cabinet.mass_kg": [1, 2]})
    assert not all(r.passed for r in check_object(make.cabinet(), strict))


def test_checks_are_deterministic(make: SimpleNamespace) -> None:
    assert check_object(make.chair()) == check_object(make.chair())

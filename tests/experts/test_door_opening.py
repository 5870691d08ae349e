"""Where an expert sees a door, and how it would move the hand: against the object's own shapes and kinematics."""

import dataclasses

import numpy as np
import pytest

from artiskill.config import CONFIG_DIR, load_config
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError
from artiskill.experts import door_opening
from artiskill.experts.door_opening import Door, door_of
from artiskill.experts.frames import Frame, axis_rotation
from artiskill.experts.handle_grasp import CabinetPhase, HandAtHandle
from artiskill.experts.open_cabinet import OpenCabinetExpertConfig

EXPERT = load_config(OpenCabinetExpertConfig, CONFIG_DIR / "experts" / "open_cabinet.yaml")
CONFIG = EXPERT.door
SIDES = ("link_0", "link_1")  # of cabinet-0006: hinges on the left and on the right


def door_at(target: str, angle_rad: float) -> tuple[ManipulationEnv, Door]:
    env = ManipulationEnv("OpenCabinetDoor", objects="cabinet-0006", target=target)
    env.reset(seed=0)
    simulation, goal = env.simulation, env.goal
    simulation._qpos[0, simulation.scene.index.object_qpos][goal.joint[0]] = angle_rad
    simulation._batch.forward()
    return env, door_of(simulation.snapshot(), goal)


def hand_at(door: Door, along_m: float, outward_m: float) -> Frame:
    return Frame(door.point(along_m, outward_m), door_opening.pushing_hand(door, CONFIG))


def fingers(opening_m: float, off_m: float) -> HandAtHandle:
    """Of a hand that is so far before the grasp."""
    return HandAtHandle(EXPERT.grip, np.array((0.0, 0.0, off_m)), 0.0, 0.0, opening_m, 0.01, 0.036)


OFF = fingers(0.0, 0.3)  # the handle is far from the hand


def phase_of(door: Door, tool: Frame, hand: HandAtHandle = OFF) -> CabinetPhase | None:
    return door_opening.phase_at(door, tool, hand, CONFIG)


@pytest.mark.parametrize("target", SIDES)
@pytest.mark.parametrize("angle_rad", [0.0, 0.7, 2.0])
def test_edge_and_faces_bound_what_is_drawn(target: str, angle_rad: float) -> None:
    env, door = door_at(target, angle_rad)
    link = env.simulation.scene.object.links[int(env.goal.link[0])]
    drawn = np.concatenate([visual.mesh.vertices for visual in link.visuals])
    snapshot = env.simulation.snapshot()
    rotation, position = (
        a[0, int(env.goal.link[0])] for a in (snapshot.link_rotation_w, snapshot.link_position_w)
    )
    world = drawn @ rotation.T + position
    along, outward = (world - door.hinge) @ door.along, (world - door.hinge) @ door.outward
    assert along.max() == pytest.approx(door.edge_m, abs=1e-6)
    assert outward.min() == pytest.approx(door.inner_m, abs=1e-6)
    assert outward.max() == pytest.approx(door.outer_m, abs=1e-6)
    assert door.inner_m < 0 < door.grasp_m < door.outer_m
    assert door.angle_rad == pytest.approx(angle_rad)
    grasp = position + rotation @ env.goal.grasp_positions[0, 0]
    assert (grasp - door.hinge) @ door.axis == pytest.approx(0, abs=1e-9)
    assert door.coordinates(grasp)[1] == pytest.approx(door.grasp_m)


@pytest.mark.parametrize("target", SIDES)
def test_the_arc_is_the_way_of_a_point_that_opens(target: str) -> None:
    _, door = door_at(target, 0.5)
    _, later = door_at(target, 0.5 + 1e-5)
    moved = (later.point(0.3, -0.02) - door.point(0.3, -0.02)) / 1e-5
    np.testing.assert_allclose(door.arc(door.point(0.3, -0.02)), moved, atol=1e-4)
    assert door.arc(door.point(0.3, 0)) @ door.outward > 0, "it opens towards the room"


@pytest.mark.parametrize("target", SIDES)
@pytest.mark.parametrize("angle_rad", [0.6, 1.2, 2.4])
def test_a_pushing_hand_is_slim_and_points_into_the_cabinet(target: str, angle_rad: float) -> None:
    _, door = door_at(target, angle_rad)
    rotation = door_opening.pushing_hand(door, CONFIG)
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-9)
    assert np.linalg.det(rotation) == pytest.approx(1)
    np.testing.assert_allclose(rotation[:, 1], door.axis, atol=1e-12)
    assert rotation[0, 2] > np.cos(CONFIG.heading_rad) - 1e-6, "the cabinet lies towards +x"


def test_the_way_around_the_edge_stays_clear_of_the_door() -> None:
    _, door = door_at("link_0", 0.6)
    tool, way = hand_at(door, 0.28, 0.12), []
    for _ in range(200):
        motion = door_opening.around(door, tool, tool.rotation, CONFIG)
        assert motion.speed_m_s == CONFIG.around_m_s
        step = motion.wanted.position - tool.position
        tool = Frame(tool.position + 0.01 * step / max(np.linalg.norm(step), 1e-9), tool.rotation)
        way.append(door.coordinates(tool.position))
        if phase_of(door, tool) is CabinetPhase.PUSH:
            break
    assert phase_of(door, tool) is CabinetPhase.PUSH
    for along, outward in way:
        assert along > door.edge_m + 0.03 or outward > door.outer_m - 1e-9 or outward < door.inner_m - 0.01


def test_what_is_done_with_a_door() -> None:
    _, door = door_at("link_0", 0.6)
    at_handle, clear = hand_at(door, 0.28, door.grasp_m), hand_at(door, 0.28, door.grasp_m + 0.08)
    assert phase_of(door, at_handle, fingers(0.01, 0.0)) is CabinetPhase.RELEASE
    assert phase_of(door, hand_at(door, 0.28, door.grasp_m + 0.04), fingers(0.08, 0.04)) is CabinetPhase.RELEASE
    assert phase_of(door, clear, fingers(0.08, 0.08)) is CabinetPhase.AROUND
    pushing, off = hand_at(door, door.edge_m - 0.04, -0.03), hand_at(door, door.edge_m + 0.05, -0.03)
    assert phase_of(door, pushing) is CabinetPhase.PUSH
    assert phase_of(door, off) is CabinetPhase.AROUND
    shut = dataclasses.replace(door, angle_rad=0.1)
    assert phase_of(shut, clear) is None, "it is taken by its handle again"


def test_a_narrow_door_is_pulled_further() -> None:
    """The gap at its edge is what the hand fits through."""
    _, door = door_at("link_0", 0.0)
    narrow, wide = (dataclasses.replace(door, edge_m=edge) for edge in (0.2, 0.6))
    assert door_opening.ajar_rad(wide, CONFIG) == CONFIG.ajar_rad
    assert door_opening.ajar_rad(narrow, CONFIG) * 0.2 == pytest.approx(CONFIG.gap_m)


def test_a_lost_door_is_gone_around_if_it_is_nearly_ajar() -> None:
    _, door = door_at("link_0", 0.6)
    clear = hand_at(door, 0.28, door.grasp_m + 0.08)
    for share, held, phase in (
        (0.9, False, CabinetPhase.AROUND),
        (0.9, True, None),
        (0.7, False, None),
    ):
        seen = dataclasses.replace(door, angle_rad=share * CONFIG.ajar_rad)
        hand = fingers(0.01, 0.0) if held else OFF
        assert phase_of(seen, clear, hand) is phase


def test_pushing_asks_for_more_where_the_door_lags_and_stops_at_the_end() -> None:
    _, door = door_at("link_0", 1.0)
    tool = hand_at(door, door.edge_m - 0.04, door.inner_m)
    speeds = []
    for rate, left in ((CONFIG.rate_rad_s, 1.0), (CONFIG.rate_rad_s / 2, 1.0), (0.0, 0.0)):
        moving = dataclasses.replace(door, rate_rad_s=rate)
        motion = door_opening.push(moving, left, tool, tool.rotation, CONFIG)
        speeds.append(float(motion.feed_m_s @ door.outward))
    assert speeds[1] > speeds[0] > speeds[2] == 0
    assert max(speeds) <= CONFIG.push_speed_m_s


def test_a_pulling_hand_follows_the_turn_but_for_what_its_grip_can_pivot() -> None:
    _, closed = door_at("link_1", 0.0)
    _, door = door_at("link_1", 0.5)
    door = dataclasses.replace(door, rate_rad_s=0.8)
    grasp = hand_at(door, 0.28, door.grasp_m)
    most = (1 - CONFIG.follow) * 0.5
    wide = dataclasses.replace(door, grasp_width_m=0.05)
    hanging = dataclasses.replace(door, axis=np.array((0.0, 1, 0)), along=np.array((0.0, 0, -1)), angle_rad=0.3)
    for seen, behind, kept in (
        (door, 0.1, 0.1),
        (door, 0.4, most),
        (door, -0.1, 0),
        (wide, 0.1, 0),
        (hanging, 0.1, 0),
    ):
        tool = Frame(grasp.position, axis_rotation(seen.axis, -behind) @ grasp.rotation)
        motion = door_opening.pull(seen, 1.0, grasp, tool, CONFIG)
        wanted = axis_rotation(seen.axis, -kept) @ grasp.rotation
        np.testing.assert_allclose(motion.wanted.rotation, wanted, atol=1e-9)
        share = CONFIG.follow if seen is door else 1.0
        np.testing.assert_allclose(motion.feed_rad_s, share * 0.8 * seen.axis, atol=1e-12)
    assert hanging.hangs
    assert not closed.hangs


def test_illegal_values_are_refused() -> None:
    with pytest.raises(ConfigError, match="push_speed_m_s"):
        dataclasses.replace(CONFIG, push_speed_m_s=0.0)


def test_a_hand_comes_in_only_when_it_is_turned() -> None:
    _, door = door_at("link_0", 0.6)
    hand = hand_at(door, door.edge_m + CONFIG.clearance_m, door.inner_m - CONFIG.behind_m)
    turned = door_opening.around(door, hand, hand.rotation, CONFIG)
    broad = Frame(hand.position, hand.rotation @ axis_rotation(np.array((0.0, 0, 1)), np.pi / 2))
    waiting = door_opening.around(door, broad, hand.rotation, CONFIG)
    assert door.coordinates(turned.wanted.position)[0] < door.edge_m
    assert door.coordinates(waiting.wanted.position)[0] > door.edge_m
    np.testing.assert_allclose(waiting.wanted.rotation, hand.rotation)


def test_a_hand_that_pressed_the_door_shut_comes_out_again() -> None:
    """It goes sideways, and from there begins anew."""
    _, door = door_at("link_0", CONFIG.ajar_rad / 3)
    shut = dataclasses.replace(door, angle_rad=0.05)
    tool, phase = hand_at(door, door.edge_m - 0.02, door.inner_m - 0.04), None
    for _ in range(200):
        motion = door_opening.around(shut, tool, tool.rotation, CONFIG)
        step = motion.wanted.position - tool.position
        tool = Frame(tool.position + step * min(1.0, 0.02 / max(np.linalg.norm(step), 1e-9)), tool.rotation)
        along, outward = door.coordinates(tool.position)
        assert outward < door.inner_m or along > door.edge_m + 0.03, "not through the door"
        phase = phase_of(shut, tool)
        if phase is None:
            return
    pytest.fail("it is still behind the door")


def test_a_hand_that_slipped_off_the_edge_goes_around_again() -> None:
    _, door = door_at("link_0", 1.0)
    inside = hand_at(door, door.edge_m - CONFIG.overlap_m, door.inner_m - 0.01)
    outside = hand_at(door, door.edge_m - CONFIG.overlap_m, door.outer_m + 0.05)
    assert phase_of(door, inside) is CabinetPhase.PUSH
    assert phase_of(door, outside) is CabinetPhase.AROUND

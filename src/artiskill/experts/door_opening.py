"""How a door is opened: pulled ajar by its handle, let go, and pushed on from inside.

A door opens by up to 170 degrees, and no hand can follow its handle so far: it would end up between door and wall.
So the hand lets go when the door is ajar, goes around its free edge and pushes its inner face the rest of the way.
The same words hold for flaps, whose hinge is level; one that hangs from its hinge is held to the end.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from artiskill.config import check_inside, check_not_negative, check_positive
from artiskill.experts.frames import (
    Frame,
    Motion,
    axis_rotation,
    cross,
    head_for,
    limited,
    ramp,
    rotation_error,
)
from artiskill.experts.handle_grasp import CabinetPhase, HandAtHandle
from artiskill.geometry.arrays import norm, small_product
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.open_cabinet import CabinetGoal

_AIM_M = 0.04  # beyond where the hand turns in around an edge, lest it creeps there
_BLEND_M = 0.025  # on which one way around an edge turns into the next
_PRESSED_M = 0.02  # beyond the inner face, where the centre of a hand that pushes it can still be
_IN_M = 0.015  # before the edge it does not push yet, behind it altogether
_ENOUGH = 0.8  # of how far a door is to be ajar, for a hand that slipped off to go behind it
_NO_WAY = 0.4  # likewise, below which it comes out again
_TURNED_RAD, _BROAD_RAD = 0.5, 0.9  # from how it will push: up to here it goes in, from here on not at all
_HANGING = -0.5  # a closed door whose edge is so far below its hinge (cosine to the vertical) hangs
_MOST_AJAR_RAD = 0.9  # further no hand follows a handle
_GAP_RAD = 0.1  # a door that is less open has no room behind it
_LET_GO_M = 0.06  # opening of a hand that has let go
_BESIDE_M, _ALONG_M = 0.06, 0.15  # a hand further from the grasp, across or along, is clear of the handle


@dataclass(frozen=True)
class DoorConfig:
    """How doors are opened."""

    ajar_rad: float  # so far it is pulled by its handle, and then pushed
    gap_m: float  # likewise, at its edge: the hand has to fit through
    follow: float  # share of the door's turning that the gripping hand follows; about the rest the grip pivots
    pivot_width_m: float  # of the widest handle that a grip pivots about
    rate_rad_s: float  # how fast the door is to turn while it is pushed
    pull_rate_rad_s: float  # likewise, while it is pulled
    stop_gain_s: float  # turning rate per what is left of the way, near its end
    # while pulling, what is asked for beyond that rate per rad/s that the door turns more slowly, for the drives
    # give way to force
    pull_gain: float
    push_gain: float  # likewise while pushing
    pull_speed_m_s: float  # no more is asked of the pulling hand along the arc, lest the grip slips
    push_speed_m_s: float  # likewise of the pushing hand
    correction_m_s: float  # how fast it returns to its place on the door
    release_m: float  # the hand withdraws so far from the handle before it goes around the edge
    around_m_s: float  # speed of the hand on its way around the edge
    clearance_m: float  # between the door's edge and the tool's centre, on the way around it
    behind_m: float  # the tool's centre goes so far behind the inner face before it comes in
    overlap_m: float  # the tool's centre pushes so far from the door's edge
    heading_rad: float  # the pushing hand points at most so much towards where it pushes
    lead_rad: float  # it points so much further in than along the door

    def __post_init__(self) -> None:
        check_positive(
            self, "ajar_rad", "gap_m", "rate_rad_s", "pull_rate_rad_s", "stop_gain_s", "heading_rad", "overlap_m"
        )
        check_positive(self, "pull_speed_m_s", "push_speed_m_s", "around_m_s", "correction_m_s", "release_m")
        check_positive(self, "clearance_m", "behind_m")
        check_not_negative(self, "pull_gain", "push_gain", "pivot_width_m", "lead_rad")
        check_inside("follow", self.follow, (0, 1))


@dataclass(frozen=True, eq=False)
class Door:
    """A door, or a flap, whose hinge is level. Vectors in the world frame.

    Attributes:
        hinge: (3,) the point of the hinge's axis at the grasp's height.
        axis: (3,) of turning; the door opens anticlockwise about it.
        along: (3,) from the hinge to the free edge, in the door's plane.
        outward: (3,) from the outer face to the room.
        angle_rad: how far it is open.
        rate_rad_s: how fast it opens.
        edge_m: coordinate of the free edge along `along`.
        inner_m: coordinate of the inner face along `outward`.
        outer_m: likewise, of what stands out the furthest: the handle.
        grasp_m: likewise, of the grasp.
        grasp_width_m: of the handle between the fingers.
    """

    hinge: np.ndarray
    axis: np.ndarray
    along: np.ndarray
    outward: np.ndarray
    angle_rad: float
    rate_rad_s: float
    edge_m: float
    inner_m: float
    outer_m: float
    grasp_m: float
    grasp_width_m: float

    @cached_property
    def back(self) -> np.ndarray:
        """Rotation (3, 3) that closes the door."""
        return axis_rotation(self.axis, -self.angle_rad)

    @property
    def hangs(self) -> bool:
        """Whether it hangs from its hinge, and falls shut when it is let go."""
        return float(small_product(self.back, self.along)[2]) < _HANGING

    def point(self, along_m: float, outward_m: float) -> np.ndarray:
        """Return a point of the level that the grasp lies in, (3,)."""
        return self.hinge + along_m * self.along + outward_m * self.outward

    def coordinates(self, point: np.ndarray) -> tuple[float, float]:
        """Of a point: along the door from the hinge on, and outward."""
        offset = point - self.hinge
        return float(small_product(offset, self.along)), float(small_product(offset, self.outward))

    def arc(self, point: np.ndarray) -> np.ndarray:
        """Return velocity of a point of the door per rad/s of opening, (3,)."""
        return cross(self.axis, point - self.hinge)


def door_of(snapshot: Snapshot, goal: CabinetGoal) -> Door:
    """Return the door that a goal asks for (B = 1)."""
    link, joint = int(goal.link[0]), int(goal.joint[0])
    rotation, position = snapshot.link_rotation_w[0, link], snapshot.link_position_w[0, link]
    axis, origin = goal.joint_axis[0], goal.joint_origin[0]
    lever = goal.grasp_positions[0, 0] - origin
    height = float(small_product(lever, axis))
    outward = -goal.grasp_rotations[0, 0][:, 2]  # the hand comes from the room
    outward = outward - small_product(outward, axis) * axis
    outward = outward / norm(outward)
    along = cross(outward, axis)
    corners = np.array(list(product(*goal.link_bounds[0].T))) - origin  # (8, 3)
    return Door(
        hinge=position + small_product(rotation, origin + height * axis),
        axis=small_product(rotation, axis),
        along=small_product(rotation, along),
        outward=small_product(rotation, outward),
        angle_rad=float(snapshot.object_qpos[0, joint] - goal.lower[0]),
        rate_rad_s=float(snapshot.object_qvel[0, joint]),
        edge_m=float(small_product(corners, along).max()),
        inner_m=float(small_product(corners, outward).min()),
        outer_m=float(small_product(corners, outward).max()),
        grasp_m=float(small_product(lever, outward)),
        grasp_width_m=float(goal.grasp_width_m[0]),
    )


def phase_at(door: Door, tool: Frame, hand: HandAtHandle, config: DoorConfig) -> CabinetPhase | None:
    """Return what is done with a door that is ajar; None for one that is to be taken, or pulled, by its handle."""
    along, outward = door.coordinates(tool.position)
    is_behind, is_beside = outward < door.inner_m, along > door.edge_m
    if door.hangs:
        return None
    inside = outward < door.inner_m + _PRESSED_M and along < door.edge_m + config.overlap_m / 2
    if inside and door.angle_rad > _GAP_RAD:
        return CabinetPhase.PUSH
    if is_behind and along < door.edge_m + config.clearance_m:
        return CabinetPhase.AROUND
    lost = _NO_WAY if is_behind or is_beside else _ENOUGH
    if door.angle_rad < ajar_rad(door, config) * (1.0 if hand.is_around else lost):
        return None
    if not is_behind and (hand.is_around or _withdraws(door, outward, hand, config)):
        return CabinetPhase.RELEASE
    return CabinetPhase.AROUND


def ajar_rad(door: Door, config: DoorConfig) -> float:
    """Return how far a door is to be pulled by its handle."""
    return max(config.ajar_rad, min(config.gap_m / door.edge_m, _MOST_AJAR_RAD))


def _withdraws(door: Door, outward_m: float, hand: HandAtHandle, config: DoorConfig) -> bool:
    """Return whether an open hand is still on its way back from the handle."""
    along, across, _ = np.abs(hand.error_m).tolist()
    near = outward_m < door.grasp_m + config.release_m and across < _BESIDE_M and along < _ALONG_M
    return near and hand.opening_m > _LET_GO_M


def pushing_hand(door: Door, config: DoorConfig) -> np.ndarray:
    """Rotation (3, 3) of a hand that pushes: its fingers lie along the hinge, so that it fits through a gap.

    It points into the cabinet, and as far towards the door as keeps it along the inner face of one that is ajar.
    """
    turn = np.clip(np.pi / 2 - door.angle_rad + config.lead_rad, 0.0, config.heading_rad)
    forward = small_product(small_product(axis_rotation(door.axis, -turn), door.back), -door.outward)
    return np.stack((cross(door.axis, forward), door.axis, forward), axis=1)


def pull(door: Door, left_rad: float, grasp: Frame, tool: Frame, config: DoorConfig) -> Motion:
    """Along the arc, with a hand that follows the door's turning, but for what its grip can pivot.

    On the long way of a flap it follows all of it, and around a wide handle, which the fingers would lose.

    Args:
        door: as it is.
        left_rad: to where it stops.
        grasp: where the hand should be.
        tool: where the hand is.
        config: values.
    """
    stiff = door.hangs or door.grasp_width_m > config.pivot_width_m
    pivot = 0.0 if stiff else _pivot_rad(door, grasp, tool, config)
    wanted = Frame(grasp.position, small_product(axis_rotation(door.axis, -pivot), grasp.rotation))
    wanted_rad_s = _wanted_rate(left_rad, config.pull_rate_rad_s, config)
    feed = _feed(door, wanted_rad_s, tool, config.pull_gain, config.pull_speed_m_s)
    turning = (1.0 if stiff else config.follow) * max(door.rate_rad_s, 0.0)
    return Motion(wanted, config.correction_m_s, feed, turning * door.axis)


def _pivot_rad(door: Door, grasp: Frame, tool: Frame, config: DoorConfig) -> float:
    """Return by how much a gripping hand may be turned less than the door: as it is, up to its share.

    Where the door takes the hand along, because fingertips meet the panel, to resist would press the door shut.
    """
    now = float(small_product(rotation_error(tool.rotation, grasp.rotation), door.axis))
    return min(max(now, 0.0), (1 - config.follow) * max(door.angle_rad, 0.0))


def release(door: Door, tool: Frame, config: DoorConfig) -> Motion:
    """Back from the handle and away from the door."""
    away = limited(door.outward - tool.forward, 1.0)
    return head_for(Frame(tool.position + config.release_m * away, tool.rotation), config.around_m_s)


def around(door: Door, tool: Frame, rotation: np.ndarray, config: DoorConfig) -> Motion:
    """From before the door, round its edge, to behind it; `rotation` (3, 3) is the hand's.

    One way blends into the next: along the door, past its edge, and in. It comes in only when it is turned: its
    broad side would press the door shut. If it did, it goes back.
    """
    along, outward = door.coordinates(tool.position)
    clear, behind = door.edge_m + config.clearance_m, door.inner_m - config.behind_m
    if door.angle_rad < _NO_WAY * ajar_rad(door, config):
        point = door.point(clear + _AIM_M, outward)
    else:
        turn_rad = float(norm(rotation_error(tool.rotation, rotation)))
        beside = ramp(along, clear - 2 * _BLEND_M, clear - _BLEND_M)
        is_behind = ramp(outward, behind + 2 * _BLEND_M, behind + _BLEND_M)
        enters = max(ramp(turn_rad, _BROAD_RAD, _TURNED_RAD), ramp(along, door.edge_m + _BLEND_M, door.edge_m))
        outside, past = max(outward, door.outer_m), max(beside, is_behind)
        inwards = is_behind * enters
        point = door.point(
            clear + _AIM_M - inwards * (config.clearance_m + _AIM_M + config.overlap_m),
            outside + past * (behind - (1.0 - inwards) * _AIM_M - outside),
        )
    return head_for(Frame(point, rotation), config.around_m_s)


def push(door: Door, left_rad: float, tool: Frame, rotation: np.ndarray, config: DoorConfig) -> Motion:
    """Along the arc, against the inner face near the edge; `rotation` (3, 3) is the hand's."""
    # the centre of the tool heads for the face itself, half a finger beyond where it can go: that presses
    wanted = Frame(door.point(door.edge_m - config.overlap_m, door.inner_m), rotation)
    wanted_rad_s = _wanted_rate(left_rad, config.rate_rad_s, config)
    feed = _feed(door, wanted_rad_s, tool, config.push_gain, config.push_speed_m_s)
    along, _ = door.coordinates(tool.position)  # a hand that is hardly in would slip off the edge
    return Motion(wanted, config.correction_m_s, ramp(along, door.edge_m + _IN_M, door.edge_m - _IN_M) * feed)


def _wanted_rate(left_rad: float, most_rad_s: float, config: DoorConfig) -> float:
    return float(np.clip(config.stop_gain_s * left_rad, 0.0, most_rad_s))


def _feed(door: Door, wanted_rad_s: float, tool: Frame, gain: float, speed_m_s: float) -> np.ndarray:
    """Velocity (3,) of the hand along its arc."""
    arc = door.arc(tool.position)
    rate = wanted_rad_s + gain * (wanted_rad_s - door.rate_rad_s)
    return arc * min(rate, speed_m_s / float(norm(arc)))

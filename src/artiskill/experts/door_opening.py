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
from artiskill.experts.frames import Frame, Motion, axis_rotation, head_for, limited, rotation_error
from artiskill.experts.handle_grasp import CabinetPhase
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.open_cabinet import CabinetGoal

_BEHIND_M = 0.03  # short of where the hand turns in around an edge
_OUTSIDE_M = 0.03  # beyond the inner face, where no hand that pushes it can be
_ENOUGH = 0.8  # of how far a door is to be ajar, for a hand that slipped off to go behind it
_TURNED_RAD = 0.6  # from how it will push
_HANGING = -0.5  # a closed door whose edge is so far below its hinge (cosine to the vertical) hangs


@dataclass(frozen=True)
class DoorConfig:
    """How doors are opened."""

    ajar_rad: float  # so far it is pulled by its handle, and then pushed
    follow: float  # share of the door's turning that the gripping hand follows; about the rest the grip pivots
    pivot_width_m: float  # of the widest handle that a grip pivots about
    stuck_rad: float  # a hand that turned so much further does not pivot: it is stuck
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
    release_steps: int  # or tries to for so many steps
    around_m_s: float  # speed of the hand on its way around the edge
    around_steps: int  # after so many steps on that way the door is taken by its handle again
    clearance_m: float  # between the door's edge and the tool's centre, on the way around it
    behind_m: float  # the tool's centre goes so far behind the inner face before it comes in
    overlap_m: float  # the tool's centre pushes so far from the door's edge
    heading_rad: float  # the pushing hand points at most so much towards where it pushes
    lead_rad: float  # it points so much further in than along the door

    def __post_init__(self) -> None:
        check_positive(
            self, "ajar_rad", "rate_rad_s", "pull_rate_rad_s", "stop_gain_s", "heading_rad", "overlap_m"
        )
        check_positive(self, "pull_speed_m_s", "push_speed_m_s", "around_m_s", "correction_m_s", "release_m")
        check_positive(self, "release_steps", "around_steps", "clearance_m", "behind_m", "stuck_rad")
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
        return float((self.back @ self.along)[2]) < _HANGING

    def point(self, along_m: float, outward_m: float) -> np.ndarray:
        """Return a point of the level that the grasp lies in, (3,)."""
        return self.hinge + along_m * self.along + outward_m * self.outward

    def coordinates(self, point: np.ndarray) -> tuple[float, float]:
        """Of a point: along the door from the hinge on, and outward."""
        offset = point - self.hinge
        return float(offset @ self.along), float(offset @ self.outward)

    def arc(self, point: np.ndarray) -> np.ndarray:
        """Return velocity of a point of the door per rad/s of opening, (3,)."""
        return np.cross(self.axis, point - self.hinge)


def door_of(snapshot: Snapshot, goal: CabinetGoal) -> Door:
    """Return the door that a goal asks for (B = 1)."""
    link, joint = int(goal.link[0]), int(goal.joint[0])
    rotation, position = snapshot.link_rotation_w[0, link], snapshot.link_position_w[0, link]
    axis, origin = goal.joint_axis[0], goal.joint_origin[0]
    lever = goal.grasp_positions[0, 0] - origin
    height = float(lever @ axis)
    outward = -goal.grasp_rotations[0, 0][:, 2]  # the hand comes from the room
    outward = outward - (outward @ axis) * axis
    outward = outward / np.linalg.norm(outward)
    along = np.cross(outward, axis)
    corners = np.array(list(product(*goal.link_bounds[0].T))) - origin  # (8, 3)
    return Door(
        hinge=position + rotation @ (origin + height * axis),
        axis=rotation @ axis,
        along=rotation @ along,
        outward=rotation @ outward,
        angle_rad=float(snapshot.object_qpos[0, joint] - goal.lower[0]),
        rate_rad_s=float(snapshot.object_qvel[0, joint]),
        edge_m=float((corners @ along).max()),
        inner_m=float((corners @ outward).min()),
        outer_m=float((corners @ outward).max()),
        grasp_m=float(lever @ outward),
        grasp_width_m=float(goal.grasp_width_m[0]),
    )


def is_ajar(door: Door, config: DoorConfig) -> bool:
    """Return whether a door is open so far that it may be let go."""
    return door.angle_rad > config.ajar_rad and not door.hangs


def after_slip(door: Door, config: DoorConfig) -> CabinetPhase:
    """Return what to do after a lost grip: with a door that is nearly ajar, go on as if it had been let go."""
    return (
        CabinetPhase.RELEASE
        if door.angle_rad > _ENOUGH * config.ajar_rad and not door.hangs
        else CabinetPhase.APPROACH
    )


def next_phase(phase: CabinetPhase, steps: int, door: Door, tool: Frame, config: DoorConfig) -> CabinetPhase:
    """Return what follows on `RELEASE`, `AROUND` or `PUSH`, of which so many steps were done."""
    along, outward = door.coordinates(tool.position)
    if phase is CabinetPhase.RELEASE:
        clear = outward > door.grasp_m + config.release_m or steps > config.release_steps
        return CabinetPhase.AROUND if clear else phase
    if phase is CabinetPhase.AROUND:
        is_shut = outward > door.inner_m and door.angle_rad < config.ajar_rad / 2  # pushed, or fallen
        if is_shut or steps > config.around_steps:
            return CabinetPhase.APPROACH
        inside = along < door.edge_m - config.overlap_m / 4 and outward < door.inner_m
        return CabinetPhase.PUSH if inside else phase
    has_slipped_off = along > door.edge_m + config.overlap_m / 2 or outward > door.inner_m + _OUTSIDE_M
    return CabinetPhase.AROUND if has_slipped_off else phase


def pushing_hand(door: Door, config: DoorConfig) -> np.ndarray:
    """Rotation (3, 3) of a hand that pushes: its fingers lie along the hinge, so that it fits through a gap.

    It points into the cabinet, and as far towards the door as keeps it along the inner face of one that is ajar.
    """
    turn = np.clip(np.pi / 2 - door.angle_rad + config.lead_rad, 0.0, config.heading_rad)
    forward = axis_rotation(door.axis, -turn) @ door.back @ -door.outward
    return np.stack((np.cross(door.axis, forward), door.axis, forward), axis=1)


def pull(
    door: Door, left_rad: float, grasp: Frame, tool: Frame, config: DoorConfig, gripped_rad: float = 0.0
) -> Motion:
    """Along the arc, with a hand that follows the door's turning, but for what its grip can pivot.

    Args:
        door: as it is.
        left_rad: to where it stops.
        grasp: where the hand should be.
        tool: where the hand is.
        config: values.
        gripped_rad: angle of the door when the hand closed.
    """
    pivot = _pivot_rad(door, grasp, tool, config, gripped_rad)
    wanted = Frame(grasp.position, axis_rotation(door.axis, -pivot) @ grasp.rotation)
    wanted_rad_s = _wanted_rate(left_rad, config.pull_rate_rad_s, config)
    feed = _feed(door, wanted_rad_s, tool, config.pull_gain, config.pull_speed_m_s)
    return Motion(wanted, config.correction_m_s, feed)


def _pivot_rad(door: Door, grasp: Frame, tool: Frame, config: DoorConfig, gripped_rad: float) -> float:
    """Return by how much a gripping hand is to turn less than the door.

    Not at all on the long way of a flap, around a wide handle, which the fingers would lose, or where the door
    takes the hand along, because the fingertips meet the panel: to resist that would press the door shut.
    """
    most = (1 - config.follow) * (door.angle_rad - gripped_rad)
    now = float(rotation_error(tool.rotation, grasp.rotation) @ door.axis)
    stiff = door.hangs or door.grasp_width_m > config.pivot_width_m or now < most - config.stuck_rad
    return 0.0 if stiff else most


def release(door: Door, tool: Frame, config: DoorConfig) -> Motion:
    """Back from the handle and away from the door."""
    away = limited(door.outward - tool.forward, 1.0)
    return head_for(Frame(tool.position + config.release_m * away, tool.rotation), config.around_m_s)


def around(door: Door, tool: Frame, rotation: np.ndarray, config: DoorConfig) -> Motion:
    """From before the door, round its edge, to behind it; `rotation` (3, 3) is the hand's.

    It comes in only when it is turned: its broad side would press the door shut. If it did, it goes back.
    """
    along, outward = door.coordinates(tool.position)
    clear, behind = door.edge_m + config.clearance_m, door.inner_m - config.behind_m
    is_beside = along > clear - _BEHIND_M
    if door.angle_rad < config.ajar_rad / 2:
        point = door.point(clear, door.outer_m if is_beside else outward)
    elif outward <= behind + _BEHIND_M:
        turned = float(np.linalg.norm(rotation_error(tool.rotation, rotation))) < _TURNED_RAD
        is_inside = along < door.edge_m
        point = door.point(door.edge_m - config.overlap_m if turned or is_inside else clear, behind)
    elif is_beside:
        point = door.point(clear, behind)
    else:
        point = door.point(clear, max(outward, door.outer_m))
    return head_for(Frame(point, rotation), config.around_m_s)


def push(door: Door, left_rad: float, tool: Frame, rotation: np.ndarray, config: DoorConfig) -> Motion:
    """Along the arc, against the inner face near the edge; `rotation` (3, 3) is the hand's."""
    # the centre of the tool heads for the face itself, half a finger beyond where it can go: that presses
    wanted = Frame(door.point(door.edge_m - config.overlap_m, door.inner_m), rotation)
    wanted_rad_s = _wanted_rate(left_rad, config.rate_rad_s, config)
    feed = _feed(door, wanted_rad_s, tool, config.push_gain, config.push_speed_m_s)
    return Motion(wanted, config.correction_m_s, feed)


def _wanted_rate(left_rad: float, most_rad_s: float, config: DoorConfig) -> float:
    return float(np.clip(config.stop_gain_s * left_rad, 0.0, most_rad_s))


def _feed(door: Door, wanted_rad_s: float, tool: Frame, gain: float, speed_m_s: float) -> np.ndarray:
    """Velocity (3,) of the hand along its arc."""
    arc = door.arc(tool.position)
    rate = wanted_rad_s + gain * (wanted_rad_s - door.rate_rad_s)
    return arc * min(rate, speed_m_s / float(np.linalg.norm(arc)))

"""How a door is opened: pulled ajar by its handle, let go, and pushed on from inside.

A door opens by up to 170 degrees, and no hand can follow its handle so far: it would end up between door and wall.
So the hand lets go when the door is ajar, goes around its free edge and pushes its inner face the rest of the way.
The same words hold for flaps, whose hinge is level; one that hangs from its hinge is held to the end.
"""

from dataclasses import dataclass

import numpy as np

from artiskill.config import check_inside, check_not_negative, check_positive
from artiskill.experts.door import Door
from artiskill.experts.frames import Frame, Motion, axis_rotation, head_for, limited, rotation_error
from artiskill.experts.grip import Phase

_BEHIND_M = 0.03  # short of where the hand turns in around an edge
_OUTSIDE_M = 0.03  # beyond the inner face, where no hand that pushes it can be
_ENOUGH = 0.8  # of how far a door is to be ajar, for a hand that slipped off to go behind it
_TURNED_RAD = 0.6  # from how it will push


@dataclass(frozen=True)
class DoorConfig:
    """How doors are opened.

    Attributes:
        ajar_rad: so far it is pulled by its handle, and then pushed.
        follow: share of the door's turning that the gripping hand follows; about the rest the grip pivots.
        pivot_width_m: of the widest handle that a grip pivots about.
        stuck_rad: a hand that turned so much further does not pivot: it is stuck.
        rate_rad_s: how fast the door is to turn while it is pushed.
        pull_rate_rad_s: likewise, while it is pulled.
        stop_gain_s: turning rate per what is left of the way, near its end.
        pull_gain: while pulling, what is asked for beyond that rate per rad/s that the door turns more slowly, for
            the drives give way to force.
        push_gain: likewise while pushing.
        pull_speed_m_s: no more is asked of the pulling hand along the arc, lest the grip slips.
        push_speed_m_s: likewise of the pushing hand.
        correction_m_s: how fast it returns to its place on the door.
        release_m: the hand withdraws so far from the handle before it goes around the edge.
        release_steps: or tries to for so many steps.
        around_m_s: speed of the hand on its way around the edge.
        around_steps: after so many steps on that way the door is taken by its handle again.
        clearance_m: between the door's edge and the tool's centre, on the way around it.
        behind_m: the tool's centre goes so far behind the inner face before it comes in.
        overlap_m: the tool's centre pushes so far from the door's edge.
        heading_rad: the pushing hand points at most so much towards where it pushes.
        lead_rad: it points so much further in than along the door.
    """

    ajar_rad: float
    follow: float
    pivot_width_m: float
    stuck_rad: float
    rate_rad_s: float
    pull_rate_rad_s: float
    stop_gain_s: float
    pull_gain: float
    push_gain: float
    pull_speed_m_s: float
    push_speed_m_s: float
    correction_m_s: float
    release_m: float
    release_steps: int
    around_m_s: float
    around_steps: int
    clearance_m: float
    behind_m: float
    overlap_m: float
    heading_rad: float
    lead_rad: float

    def __post_init__(self) -> None:
        check_positive(
            self, "ajar_rad", "rate_rad_s", "pull_rate_rad_s", "stop_gain_s", "heading_rad", "overlap_m"
        )
        check_positive(self, "pull_speed_m_s", "push_speed_m_s", "around_m_s", "correction_m_s", "release_m")
        check_positive(self, "release_steps", "around_steps", "clearance_m", "behind_m", "stuck_rad")
        check_not_negative(self, "pull_gain", "push_gain", "pivot_width_m", "lead_rad")
        check_inside("follow", self.follow, (0, 1))


def is_ajar(door: Door, config: DoorConfig) -> bool:
    """Whether a door is open so far that it may be let go."""
    return door.angle_rad > config.ajar_rad and not door.hangs


def after_slip(door: Door, config: DoorConfig) -> Phase:
    """What to do about a grip that is lost: with a door that is nearly ajar, go on as if it had been let go."""
    return Phase.RELEASE if door.angle_rad > _ENOUGH * config.ajar_rad and not door.hangs else Phase.APPROACH


def next_phase(phase: Phase, steps: int, door: Door, tool: Frame, config: DoorConfig) -> Phase:
    """What follows on `RELEASE`, `AROUND` or `PUSH`, of which so many steps were done."""
    along, outward = door.coordinates(tool.position)
    if phase is Phase.RELEASE:
        clear = outward > door.grasp_m + config.release_m or steps > config.release_steps
        return Phase.AROUND if clear else phase
    if phase is Phase.AROUND:
        is_shut = outward > door.inner_m and door.angle_rad < config.ajar_rad / 2  # pushed, or fallen
        if is_shut or steps > config.around_steps:
            return Phase.APPROACH
        inside = along < door.edge_m - config.overlap_m / 4 and outward < door.inner_m
        return Phase.PUSH if inside else phase
    has_slipped_off = along > door.edge_m + config.overlap_m / 2 or outward > door.inner_m + _OUTSIDE_M
    return Phase.AROUND if has_slipped_off else phase


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
    """By how much a gripping hand is to turn less than the door.

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

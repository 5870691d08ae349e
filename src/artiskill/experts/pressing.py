"""Two hands that press an object from opposite sides, and move it between them.

Without memory: what they do follows from where everything is now, and changes smoothly with it. Hands that are
not yet in line with their places keep a gap to the object, which shrinks as they come into line; the force grows
as the gap closes; once they hold it they go with the object. So what slips out is taken again, from any state.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from artiskill.config import check_inside, check_not_negative, check_positive, check_vector
from artiskill.experts.clearances import Cylinder, base_too_near, clear_of_object, clear_of_robot
from artiskill.experts.frames import cross, limited, ramp, rotation_error
from artiskill.experts.walls import Press, Wall
from artiskill.experts.whole_body import (
    TRUNK,
    Command,
    CommandController,
    Grip,
    WholeBodyConfig,
    WholeBodyController,
    in_base_axes,
    in_hand_axes,
)
from artiskill.geometry.arrays import norm, small_product
from artiskill.robots.config import RobotConfig
from artiskill.sim.snapshot import Snapshot

_ARMS = 2
_UP = np.array((0.0, 0.0, 1.0))
_SIDES = np.array((-1.0, 1.0))  # the first arm is the right one; the hands' axis points from right to left
_MOST_PITCH_RAD = 0.5  # hands turn so far from level for the object's sake

# Where a measure counts for nothing, and where in full (`ramp`)
_HELD_GAP_M = (0.05, 0.025)  # fingertips to the wall: the press stays where the hands are
_HELD_ASIDE_M = (0.06, 0.045)  # likewise, hands to their line
_INSIDE_GAP_M = (-0.08, -0.05)  # likewise: nearer, and the hand is not outside the wall
_TOUCH_GAP_M = (0.026, 0.014)  # hands press
_TOUCH_ASIDE_M = (0.07, 0.05)  # likewise
_STILL_M_S = (0.06, 0.02)  # hands that close in: they hold it
_FLAT_M = (0.012, 0.005)  # distances from the wall of a hand's fingertips: likewise, they differ no more
_OFF_ASIDE_M = (0.015, 0.05)  # hands keep their gap to the wall
_OFF_RAD = (0.15, 0.45)  # likewise, by their orientation
_FAR_ASIDE_M = (0.08, 0.2)  # hands move out first, then to their line
_ASTRAY_ARM_RAD = (1.5, 2.2)  # an arm's joints from their posture: arms and base go home first
_ASTRAY_YAW_RAD = (0.9, 1.5)  # likewise, the base from facing the hold
_ASTRAY_M = (0.8, 1.3)  # likewise, from its place
_WAIT_M = (0.04, 0.015)  # by so much nearer than the other hand, a hand waits
_NEAR_GAP_M = (0.045, 0.02)  # the last bit to the wall


@dataclass(frozen=True)
class PressingConfig:
    """Distances, speeds and gains of the hands."""

    standoff_m: float  # fingertips that are not in line stay this far from the wall
    around_m: float  # hands that are far aside stay so much further away
    hold_distance_m: float  # from the robot's base to the object
    back_m: float  # a robot whose arms are out of place stands so much further away
    up_m: float  # and holds them so much higher
    position_gain_s: float  # hand velocity per position error
    rotation_gain_s: float  # hand angular velocity per orientation error
    posture_gain_s: float  # joint velocity per posture error
    base_speed_m_s: float  # of the base, at most, beside the object's
    approach_speed_m_s: float  # of the hands, on their way to the object
    close_speed_m_s: float  # of the hands, from the standoff to the wall
    touch_speed_m_s: float  # of the hands, the last bit to the wall
    press_n: float  # force of each hand once both touch
    lead_m_s: float  # by how much hands that hold the object change their velocity at a time, at most
    turn_speed_rad_s: float  # of the hands
    roll_rad: float  # 0: the fingers of a hand are beside each other; pi / 2: one above the other
    # of the gain, about the vertical, while they touch, so that they lie flat: contacts turn them as well. 0: they
    # keep pointing at each other
    yaw_share: float
    level_share: float  # how far hands turn about their axis with what they hold, so that it becomes level again
    pad_to_tip_m: float  # how far the fingertips are ahead of the tool's centre
    spread_m: float  # the open fingertips touch the wall up to this far beside the hand's axis
    finger_position_m: float  # of each finger, open, for two places of contact per hand
    arm_qpos_rad: tuple[float, ...]  # preferred posture of the right arm; the left one's is its mirror image
    lift_below_hand_m: float  # preferred height of the hands above the lift's position
    whole_body: WholeBodyConfig  # weights of the inverse kinematics

    def __post_init__(self) -> None:
        check_positive(self, "standoff_m", "hold_distance_m", "base_speed_m_s", "lead_m_s", "press_n", "spread_m")
        check_positive(self, "position_gain_s", "rotation_gain_s", "posture_gain_s", "turn_speed_rad_s")
        check_positive(self, "approach_speed_m_s", "close_speed_m_s", "touch_speed_m_s")
        check_not_negative(
            self,
            "around_m",
            "back_m",
            "up_m",
            "finger_position_m",
            "lift_below_hand_m",
            "yaw_share",
            "pad_to_tip_m",
        )
        check_inside("level_share", self.level_share, (0, 1))
        check_inside("roll_rad", self.roll_rad, (-math.pi, math.pi))
        check_vector(self, "arm_qpos_rad", size=7)


@dataclass(frozen=True, eq=False)
class Body:
    """What is pressed, at this instant.

    Attributes:
        position: (3,) of its frame, in the world.
        rotation: (3, 3) likewise.
        wall: what can be pressed of it.
        held: whether it is held already, 0 to 1, if the hands touch.
        around: what hands and base keep clear of; hands then keep clear of the robot, too. None: of neither.
    """

    position: np.ndarray
    rotation: np.ndarray
    wall: Wall
    held: float = 0.0
    around: Cylinder | None = None


@dataclass(frozen=True, eq=False)
class View:
    """The hands and their places at this instant, in the world; shares are from 0 to 1.

    Attributes:
        press: the places.
        axis: (3,) level unit vector from the right hand's place to the left one's.
        heading: (3,) where a robot faces whose left side the axis points to.
        middle: (3,) the point of the object's axis between the places.
        gaps: (2,) the fingertips' distances from the wall, m.
        aside: (2,) the hands' distances from their line, m.
        errors: (2, 3) rotation vectors that turn the hands so that they point at their places.
        settled: share to which the places are those where the hands are.
        off: to which the hands are out of line and keep their gap.
        astray: to which the robot first has to bring arms and base to where they can go in from.
        touch: to which they press.
        carry: to which they hold the object and move with it.
    """

    press: Press
    axis: np.ndarray
    heading: np.ndarray
    middle: np.ndarray
    gaps: np.ndarray
    aside: np.ndarray
    errors: np.ndarray
    settled: float = 0.0
    off: float = 1.0
    astray: float = 0.0
    touch: float = 0.0
    carry: float = 0.0


class PressingHands:
    """The two hands of a robot that press.

    Args:
        robot: who acts, with two arms.
        config: values.
    """

    def __init__(self, robot: RobotConfig, config: PressingConfig) -> None:
        self.config = config
        right = np.array(config.arm_qpos_rad)
        self.controller = CommandController(
            WholeBodyController(robot, config.whole_body, _ARMS),
            np.concatenate((right, _mirrored(right))),
            close_speed_m_s=config.close_speed_m_s,
        )

    def view(self, snapshot: Snapshot, body: Body, best: Callable[[], Press]) -> View:
        """Return how far the work has come; `best` chooses the places, unless the hands are at some already."""
        present = self._place(snapshot, body, _present_press(snapshot, body))
        settled = ramp(present.gaps.max(), *_HELD_GAP_M) * ramp(present.aside.max(), *_HELD_ASIDE_M)
        settled *= ramp(present.gaps.min(), *_INSIDE_GAP_M)
        if settled == 1.0:
            return self._shares(snapshot, body, present, settled)
        press = best()
        if settled > 0.0:
            turn = math.remainder(present.press.direction_rad - press.direction_rad, math.tau)
            height = press.height_m + settled * (present.press.height_m - press.height_m)
            press = body.wall.between(height, press.direction_rad + settled * turn)
        return self._shares(snapshot, body, self._place(snapshot, body, press), settled)

    def command(self, snapshot: Snapshot, view: View, body: Body, velocity: np.ndarray, phase: int) -> Command:
        """Return what to do.

        Args:
            snapshot: of one environment.
            view: of it.
            body: what is pressed.
            velocity: (3,) that the object shall have once it is held, m/s.
            phase: for the command.
        """
        config = self.config
        present = _hand_velocities(snapshot).mean(axis=0)
        velocity = present + limited(velocity - present, config.lead_m_s)
        linear = (1 - view.carry) * self._reach(snapshot, view) + view.carry * self._follow(
            snapshot, view, velocity
        )
        twists = np.concatenate((linear, self._turn(snapshot, view, body)), axis=1)
        trunk = self._trunk(snapshot, view, velocity)
        if view.astray > 0.0:
            home = self._home_twists(snapshot, trunk)
            if body.around is not None:
                home[:, :3] = clear_of_object(snapshot, home[:, :3], body.around)
            twists += view.astray * (home - twists)
        if body.around is not None:
            clear = clear_of_robot(snapshot, twists, lambda: self._carried_twists(snapshot, trunk))
            twists += (1 - view.settled) * (clear - twists)
        return Command(
            phase=phase,
            twists=in_hand_axes(snapshot, twists),
            trunk_qvel=in_base_axes(snapshot, trunk),
            arm_gain_s=(1 - view.touch) * config.posture_gain_s,  # arms that strive for it would press less
            grip=np.full(_ARMS, Grip.OPEN),
            width_m=np.full(_ARMS, config.finger_position_m),
            press_n=view.touch * config.press_n,
        )

    def _place(self, snapshot: Snapshot, body: Body, press: Press) -> View:
        """Return where hands and places are."""
        axis = small_product(
            body.rotation, np.array((math.cos(press.direction_rad), math.sin(press.direction_rad), 0.0))
        )
        axis[2] = 0.0
        axis /= max(float(norm(axis)), 1e-6)
        heading = np.array((axis[1], -axis[0], 0.0))
        middle = body.position + press.height_m * body.rotation[:, 2]
        from_middle = snapshot.tool_position_w[0] - middle
        out = _SIDES * small_product(from_middle, axis)
        aside = np.sqrt(np.maximum((from_middle**2).sum(axis=-1) - out**2, 0.0))
        errors, roll = [], self.config.roll_rad
        for arm, side in enumerate(_SIDES):
            forward, across = -side * axis, side * (math.cos(roll) * heading + math.sin(roll) * _UP)
            wanted = np.stack((cross(across, forward), across, forward), axis=-1)
            errors.append(rotation_error(snapshot.tool_rotation_w[0, arm], wanted))
        gaps = out - press.reach_m - self.config.pad_to_tip_m
        return View(press, axis, heading, middle, gaps, aside, np.array(errors))

    def _shares(self, snapshot: Snapshot, body: Body, view: View, settled: float) -> View:
        """Return the view with its shares."""
        right, left = _hand_velocities(snapshot)
        closing = abs(float(small_product(left - right, view.axis)))
        touch = settled * ramp(view.gaps.max(), *_TOUCH_GAP_M) * ramp(view.aside.max(), *_TOUCH_ASIDE_M)
        firm = ramp(closing, *_STILL_M_S) * ramp(self._uneven(snapshot, body, view.press), *_FLAT_M)
        carry = touch * max(firm, body.held)
        turned = max(float(norm(error)) for error in view.errors)
        off = (1 - settled) * max(ramp(view.aside.max(), *_OFF_ASIDE_M), ramp(turned, *_OFF_RAD))
        astray = (1 - settled) * self._astray(snapshot, body, view)
        return replace(view, settled=settled, off=off, touch=touch, carry=carry, astray=astray)

    def _astray(self, snapshot: Snapshot, body: Body, view: View) -> float:
        """Return how far the robot is from where its hands can go in: its arms from their posture, or its base."""
        arms = self.controller.whole_body.qpos(snapshot)[TRUNK:] - self.controller.arm_qpos_rad
        farthest = float(norm(arms.reshape(_ARMS, -1)).max())
        base, yaw = self._base_error(snapshot, view, view.middle, 0.0)
        away, near = float(norm(base)), 0.0
        if body.around is not None:
            near = base_too_near(snapshot, view.middle, self.config.hold_distance_m)
        return max(
            ramp(farthest, *_ASTRAY_ARM_RAD), ramp(abs(yaw), *_ASTRAY_YAW_RAD), ramp(away, *_ASTRAY_M), near
        )

    def _base_error(
        self, snapshot: Snapshot, view: View, middle: np.ndarray, back_m: float
    ) -> tuple[np.ndarray, float]:
        """Return how the base is off its place before the hold, or so far back from there: (2,) and the yaw."""
        place = middle[:2] - (self.config.hold_distance_m + back_m) * view.heading[:2]
        yaw = math.atan2(view.heading[1], view.heading[0]) - float(snapshot.robot_qpos[0, 2])
        return place - snapshot.robot_qpos[0, :2], math.remainder(yaw, math.tau)

    def _home_twists(self, snapshot: Snapshot, trunk: np.ndarray) -> np.ndarray:
        """Return twists (2, 6) of hands whose arms go to their posture while the trunk moves as it likes."""
        body = self.controller.whole_body
        arms = self.config.posture_gain_s * (self.controller.arm_qpos_rad - body.qpos(snapshot)[TRUNK:])
        arms = np.clip(arms, -self.config.turn_speed_rad_s, self.config.turn_speed_rad_s)
        return body.twists_w(snapshot, np.concatenate((trunk, arms)))

    def _carried_twists(self, snapshot: Snapshot, trunk: np.ndarray) -> np.ndarray:
        """Return twists (2, 6) of hands whose arms rest while the trunk moves."""
        arms = np.zeros_like(self.controller.arm_qpos_rad)
        return self.controller.whole_body.twists_w(snapshot, np.concatenate((trunk, arms)))

    def _uneven(self, snapshot: Snapshot, body: Body, press: Press) -> float:
        """Return by how much the distances of a hand's fingertips from the wall differ, m; 0 if they may."""
        if self.config.yaw_share == 0:
            return 0.0
        tips = press.clearance_m(small_product(snapshot.fingertip_position_w[0] - body.position, body.rotation))
        return float(np.abs(tips[::2] - tips[1::2]).max())

    def _reach(self, snapshot: Snapshot, view: View) -> np.ndarray:
        """Return velocities (2, 3): to the hands' line, and along it to the wall as far as they are in line."""
        config, most = self.config, self.config.approach_speed_m_s
        found = []
        for arm in range(_ARMS):
            gap, outwards = view.gaps[arm], _SIDES[arm] * view.axis
            from_middle = snapshot.tool_position_w[0, arm] - view.middle
            to_line = small_product(from_middle, outwards) * outwards - from_middle
            far = ramp(view.aside[arm], *_FAR_ASIDE_M)
            beside = 1 - far * (1 - ramp(gap, config.around_m - 0.07, config.around_m - 0.02))
            lateral = beside * limited(config.position_gain_s * to_line, most)
            near = ramp(gap, *_NEAR_GAP_M)
            inwards = near * config.touch_speed_m_s + (1 - near) * config.close_speed_m_s
            inwards *= ramp(gap - view.gaps[1 - arm], -_WAIT_M[0], -_WAIT_M[1]) * (1 - view.touch)
            kept = view.off * config.standoff_m + far * config.around_m
            along = min(max(config.position_gain_s * (kept - gap), -most), most)
            along = max(along, -0.9 * view.off - inwards) if view.off > 0 else -inwards
            found.append(limited(lateral + along * outwards, most))
        return np.array(found)

    def _follow(self, snapshot: Snapshot, view: View, velocity: np.ndarray) -> np.ndarray:
        """Return velocities (2, 3): with the object, on one level line, at a height where it can be pressed."""
        line = snapshot.tool_position_w[0].mean(axis=0)
        line[2] = view.middle[2]
        off = line - snapshot.tool_position_w[0]
        off = off - small_product(off, view.axis)[:, None] * view.axis
        followed: np.ndarray = velocity + self.config.position_gain_s * off
        return followed

    def _turn(self, snapshot: Snapshot, view: View, body: Body) -> np.ndarray:
        """Return angular velocities (2, 3): hands that touch lie flat on the wall, and may level the object."""
        config, found = self.config, []
        tilt = float(small_product(cross(body.rotation[:, 2], _UP), view.axis))
        for arm in range(_ARMS):
            error = view.errors[arm].copy()
            if view.settled > 0 and config.yaw_share > 0:
                flat = config.yaw_share * _yaw_to_wall(snapshot, body, view.press, arm)
                error[2] += view.settled * (flat - error[2])
            pitch = -float(small_product(error, view.axis))  # of the hand
            wanted = min(max(config.level_share * (pitch + tilt), -_MOST_PITCH_RAD), _MOST_PITCH_RAD)
            error += view.carry * wanted * view.axis
            found.append(limited(config.rotation_gain_s * error, config.turn_speed_rad_s))
        return np.array(found)

    def _trunk(self, snapshot: Snapshot, view: View, velocity: np.ndarray) -> np.ndarray:
        """Return velocities (4,) towards base pose and lift from which the hands reach the object with ease."""
        config = self.config
        hands = snapshot.tool_position_w[0].mean(axis=0)
        middle = view.middle + view.carry * (hands - view.middle)
        base, yaw = self._base_error(snapshot, view, middle, view.astray * config.back_m)
        height = middle[2] - config.lift_below_hand_m + view.astray * config.up_m
        lift = max(0.0, height) - float(snapshot.robot_qpos[0, TRUNK - 1])
        trunk = config.posture_gain_s * np.array((*base, yaw, lift))
        trunk[:2] = limited(trunk[:2], config.base_speed_m_s) + view.carry * velocity[:2]
        trunk[3] = (1 - view.touch) * trunk[3] + view.carry * velocity[2]
        return trunk


def _mirrored(qpos: np.ndarray) -> np.ndarray:
    """Return the left arm's joints that mirror the right arm's: odd joints and the mount turn the other way."""
    signs = np.array((-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0))
    mirrored: np.ndarray = signs * qpos
    mirrored[-1] += np.pi / 2
    return mirrored


def _hand_velocities(snapshot: Snapshot) -> np.ndarray:
    """Return the velocities of the hands' fingertips, (2, 3)."""
    found: np.ndarray = snapshot.fingertip_velocity_w[0].reshape(_ARMS, 2, 3).mean(axis=1)
    return found


def _present_press(snapshot: Snapshot, body: Body) -> Press:
    """Return the places that the hands are opposite to now."""
    local = small_product(snapshot.tool_position_w[0] - body.position, body.rotation)
    way = local[1] - local[0]
    return body.wall.between(float(local[:, 2].mean()), math.atan2(way[1], way[0]))


def _yaw_to_wall(snapshot: Snapshot, body: Body, press: Press, arm: int) -> float:
    """Angle about the vertical that makes both fingertips of a hand equally far from the wall."""
    tips = snapshot.fingertip_position_w[0, 2 * arm : 2 * arm + 2]
    first, second = press.clearance_m(small_product(tips - body.position, body.rotation))
    apart = float(small_product(cross(_UP, tips[0] - tips[1]), snapshot.tool_rotation_w[0, arm, :, 2]))
    return float(first - second) / apart if abs(apart) > 1e-3 else 0.0

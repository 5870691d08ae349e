"""The expert of MoveBucket: press the bucket from two sides below its lip, lift it, carry it over the platform.

Closed loop: every step it looks where the hands are relative to the bucket and decides anew; a bucket that slips
out is taken again. Bail and ears stay untouched. It reads the snapshot and the goal, nothing else.
"""

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from artiskill.config import (
    CONFIG_DIR,
    check_inside,
    check_not_negative,
    check_positive,
    check_value,
    check_vector,
    load_config,
)
from artiskill.experts.frames import Frame, axis_rotation, curved, limited, rotation_error
from artiskill.experts.whole_body import TRUNK, WholeBodyConfig, WholeBodyController
from artiskill.robots.config import RobotConfig
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.grasp_candidates import OUTLINE_LEVELS
from artiskill.tasks.move_bucket import BucketGoal

_ARMS = 2
_UP = np.array((0.0, 0.0, 1.0))
_MOST_PITCH_RAD = 0.5  # hands turn so far from level for the bucket's sake
_SIDES = (-1.0, 1.0)  # the first arm is the right one; the hands' axis points from right to left


class BucketPhase(Enum):
    """What the hands are doing."""

    APPROACH = "approach"
    CLOSE = "close"
    CARRY = "carry"


@dataclass(frozen=True)
class PressConfig:
    """What makes a pair of places good."""

    # the side to stand on is chosen as if the robot stood so far around the bucket, counter-clockwise; 0 for the
    # nearest one
    side_bias_rad: float
    pad_to_tip_m: float  # how far the fingertips are ahead of the tool's centre
    spread_m: float  # the open fingertips touch the wall up to this far beside the hand's axis
    share: float  # best height, as a share of the body's
    least_height_m: float  # hands do not go lower, for the ground is there
    bail_clearance_m: float  # a bail at least this far above or below the hands is not in their way
    bail_band_m: float  # nor is one this far beside their axis
    turn_weight: float  # cost of a radian that the robot has to go around the bucket; of n radians n^2 as much
    width_weight: float  # cost of a metre by which the bucket is wider there than at its narrowest
    height_weight: float  # cost of a whole body's height of distance from the best height
    bail_weight: float  # cost of a metre that is missing to the bail's clearance
    platform_side_rad: float  # the robot stays beyond the bucket as seen from the platform, up to this far aside

    def __post_init__(self) -> None:
        check_inside("side_bias_rad", self.side_bias_rad, (-math.pi, math.pi))
        check_inside("share", self.share, (0, 1))
        check_positive(self, "spread_m")
        check_not_negative(self, "pad_to_tip_m", "least_height_m", "bail_clearance_m", "bail_band_m")
        check_not_negative(
            self, "turn_weight", "width_weight", "height_weight", "bail_weight", "platform_side_rad"
        )


@dataclass(frozen=True)
class MoveBucketExpertConfig:
    """Distances, speeds and gains."""

    standoff_m: float  # the fingertips stop this far from the wall before the hands close
    hold_distance_m: float  # from the robot's base to the bucket
    position_gain_s: float  # hand velocity per position error
    rotation_gain_s: float  # hand angular velocity per orientation error
    posture_gain_s: float  # joint velocity per posture error
    carry_gain_s: float  # bucket velocity per distance to its goal
    approach_speed_m_s: float  # of the hands, on their way to the bucket
    close_speed_m_s: float  # of the hands, from the standoff to the wall
    touch_speed_m_s: float  # of the hands, the last bit to the wall
    press_n: float  # force of each hand once both touch
    lift_speed_m_s: float  # of the bucket, upwards
    carry_speed_m_s: float  # of the bucket, sideways
    carry_acceleration_m_s2: float  # of the bucket
    turn_speed_rad_s: float  # of the hands
    yaw_share: float  # of the gain, about the vertical, while they touch: contacts turn them as well
    level_gain_s: float  # how fast the hands turn a bucket level that has tilted between them, per radian of tilt
    aligned_m: float  # position error below which the hands close
    aligned_rad: float  # orientation error below which they close
    touching_m: float  # distance of the fingertips from the wall below which a hand counts as touching
    ramp_steps: int  # environment steps of touching until they press with all of it
    press_steps: int  # environment steps of touching before the bucket is lifted
    slip_m: float  # distance of a hand from its place above which the bucket counts as lost
    rise_m: float  # how high the bucket is lifted
    clear_m: float  # it moves sideways once it is this high
    inner_distance_m: float  # how far from the platform's middle, on the robot's side, it is held
    aside_m: float  # how far from there to the robot's left
    curve_rad_m: float  # it is carried this far aside of that place, per metre from it: in a curve
    finger_position_m: float  # of each finger, open, for two places of contact per hand
    arm_qpos_rad: tuple[float, ...]  # preferred posture of the right arm; the left one's is its mirror image
    lift_below_hand_m: float  # preferred height of the hands above the lift's position
    press: PressConfig  # where to press
    whole_body: WholeBodyConfig  # weights of the inverse kinematics

    def __post_init__(self) -> None:
        check_positive(self, "standoff_m", "hold_distance_m", "rise_m", "clear_m", "slip_m", "touching_m")
        check_positive(self, "position_gain_s", "rotation_gain_s", "posture_gain_s", "carry_gain_s")
        check_positive(self, "approach_speed_m_s", "close_speed_m_s", "touch_speed_m_s", "turn_speed_rad_s")
        check_positive(self, "lift_speed_m_s", "carry_speed_m_s", "carry_acceleration_m_s2", "press_n")
        check_positive(self, "aligned_m", "aligned_rad", "ramp_steps", "press_steps")
        check_not_negative(self, "inner_distance_m", "finger_position_m", "lift_below_hand_m")
        check_not_negative(self, "yaw_share", "level_gain_s")
        check_vector(self, "arm_qpos_rad", size=7)
        for name in ("aside_m", "curve_rad_m"):
            check_value(self, name, math.isfinite(getattr(self, name)), "must be finite")


class MoveBucketExpert:
    """Carries buckets pressed between two hands.

    Args:
        robot: who acts, with two arms.
        config: values; by default those that come with the package.
    """

    def __init__(self, robot: RobotConfig, config: MoveBucketExpertConfig | None = None) -> None:
        self.config = config or load_config(MoveBucketExpertConfig, CONFIG_DIR / "experts" / "move_bucket.yaml")
        self.controller = WholeBodyController(robot, self.config.whole_body, _ARMS)
        right = np.array(self.config.arm_qpos_rad)
        self._arms_qpos = np.concatenate((right, _mirrored(right)))
        self.phase = BucketPhase.APPROACH
        self._press = Press(0.0, 0.0, np.zeros(_ARMS), np.zeros(1))
        self._touching_steps = 0
        self._velocity = np.zeros(3)  # of the carried bucket
        self._pitch_rad = 0.0  # of the carrying hands
        self._axis = np.zeros(3)

    def reset(self, snapshot: Snapshot, goal: BucketGoal) -> None:
        """Begin an episode at its first state (B = 1)."""
        self._start_over(snapshot, goal)

    def act(self, snapshot: Snapshot, goal: BucketGoal) -> np.ndarray:
        """Return the next action, (R,) in [-1, 1]."""
        self._advance_phase(snapshot, goal)
        twists = self._carry_twists(snapshot) if self.phase is BucketPhase.CARRY else self._reach_twists(snapshot)
        qvel = self.controller.joint_velocities(snapshot, twists, self._posture_velocity(snapshot))
        qvel = qvel + self.controller.pushing_velocities(snapshot, self._forces(snapshot))
        return self.controller.to_action(snapshot, qvel, np.full((_ARMS, 2), self.config.finger_position_m))

    def _start_over(self, snapshot: Snapshot, goal: BucketGoal) -> None:
        self.phase, self._touching_steps = BucketPhase.APPROACH, 0
        self._velocity, self._pitch_rad = np.zeros(3), 0.0
        self._press = choose_press(snapshot, goal, self.config.press)

    def _advance_phase(self, snapshot: Snapshot, goal: BucketGoal) -> None:
        gaps, aside = self._gaps(snapshot)
        if self.phase is BucketPhase.APPROACH:
            frames = [self._frame(snapshot, arm, self.config.standoff_m) for arm in range(_ARMS)]
            if all(self._is_aligned(snapshot, arm, frame) for arm, frame in enumerate(frames)):
                self.phase = BucketPhase.CLOSE
            return
        if max(aside.max(), gaps.max() - self.config.standoff_m) > self.config.slip_m:
            self._start_over(snapshot, goal)
        elif self.phase is BucketPhase.CLOSE:
            touching = gaps.max() < self.config.touching_m
            self._touching_steps = self._touching_steps + 1 if touching else 0
            if self._touching_steps >= self.config.press_steps:
                self.phase, self._axis = BucketPhase.CARRY, self._hand_axis(snapshot)
        elif gaps.max() > self.config.slip_m:
            self._start_over(snapshot, goal)
        else:
            self._velocity = self._next_velocity(snapshot, goal)

    def _is_aligned(self, snapshot: Snapshot, arm: int, frame: Frame) -> bool:
        away = float(np.linalg.norm(frame.position - snapshot.tool_position_w[0, arm]))
        turned = float(np.linalg.norm(rotation_error(snapshot.tool_rotation_w[0, arm], frame.rotation)))
        return away < self.config.aligned_m and turned < self.config.aligned_rad

    def _next_velocity(self, snapshot: Snapshot, goal: BucketGoal) -> np.ndarray:
        """Of the carried bucket: up first, then to the platform's near side, with limited acceleration."""
        config = self.config
        position = snapshot.link_position_w[0, 0]
        target = -config.inner_distance_m * self._heading(snapshot) + config.aside_m * self._axis
        way = (target - position)[:2]
        flat = limited(config.carry_gain_s * way, config.carry_speed_m_s)
        flat = curved(flat, config.curve_rad_m * float(np.linalg.norm(way)))
        flat = flat if position[2] > config.clear_m else np.zeros(2)
        up = np.clip(
            config.carry_gain_s * (config.rise_m - position[2]), -config.lift_speed_m_s, config.lift_speed_m_s
        )
        change = np.array((*flat, up)) - self._velocity
        return self._velocity + limited(change, config.carry_acceleration_m_s2 * snapshot.step_s)

    def _hand_axis(self, snapshot: Snapshot) -> np.ndarray:
        """Return level unit vector from the right hand's place to the left one's, (3,)."""
        if self.phase is BucketPhase.CARRY:
            return self._axis
        angle = self._press.direction_rad
        axis = snapshot.link_rotation_w[0, 0] @ np.array((np.cos(angle), np.sin(angle), 0.0))
        axis[2] = 0.0
        return axis / float(np.linalg.norm(axis))

    def _heading(self, snapshot: Snapshot) -> np.ndarray:
        """Return where a robot faces whose left side the hands' axis points to, (3,)."""
        axis = self._hand_axis(snapshot)
        return np.array((axis[1], -axis[0], 0.0))

    def _middle(self, snapshot: Snapshot) -> np.ndarray:
        """Return the point of the bucket's axis between the hands' places, (3,)."""
        up = snapshot.link_rotation_w[0, 0, :, 2]
        return snapshot.link_position_w[0, 0] + self._press.height_m * up

    def _gaps(self, snapshot: Snapshot) -> tuple[np.ndarray, np.ndarray]:
        """Return the fingertips' distances from the wall, (2,), and the hands' from their line, (2,)."""
        from_middle = snapshot.tool_position_w[0] - self._middle(snapshot)  # (2, 3)
        out = np.array(_SIDES) * (from_middle @ self._hand_axis(snapshot))
        aside = np.sqrt(np.maximum((from_middle**2).sum(axis=-1) - out**2, 0.0))
        return out - self._press.reach_m - self.config.press.pad_to_tip_m, aside

    def _frame(self, snapshot: Snapshot, arm: int, gap_m: float) -> Frame:
        """Return where a hand is that points at its place with its fingertips so far from it."""
        axis, heading = _SIDES[arm] * self._hand_axis(snapshot), self._heading(snapshot)
        out = self._press.reach_m[arm] + self.config.press.pad_to_tip_m + gap_m
        across = _SIDES[arm] * heading
        rotation = np.stack((np.cross(across, -axis), across, -axis), axis=-1)
        return Frame(self._middle(snapshot) + out * axis, rotation)

    def _reach_twists(self, snapshot: Snapshot) -> np.ndarray:
        """Return (2, 6): towards the standoffs, or from there to the wall."""
        config = self.config
        closing = self.phase is BucketPhase.CLOSE
        gaps, _ = self._gaps(snapshot)
        twists = []
        for arm in range(_ARMS):
            frame = self._frame(snapshot, arm, gaps[arm] if closing else config.standoff_m)
            linear = config.position_gain_s * (frame.position - snapshot.tool_position_w[0, arm])
            linear = limited(linear, config.approach_speed_m_s)
            if closing:
                near = gaps[arm] < 2 * config.touching_m
                # the drives turn a blocked velocity into force and moment: it gives way to the pure force
                speed = config.touch_speed_m_s * (1 - self._pressing()) if near else config.close_speed_m_s
                linear = linear + speed * frame.forward
            twists.append(np.concatenate((linear, self._turn(snapshot, arm, frame.rotation))))
        return np.array(twists)

    def _carry_twists(self, snapshot: Snapshot) -> np.ndarray:
        """Return (2, 6): both hands go with the bucket, stay on one level line and press."""
        config = self.config
        middle = snapshot.tool_position_w[0].mean(axis=0)
        self._pitch_rad = self._next_pitch(snapshot)
        twists = []
        for arm in range(_ARMS):
            frame = self._frame(snapshot, arm, 0.0)
            if self._pitch_rad:
                frame = Frame(frame.position, axis_rotation(self._axis, self._pitch_rad) @ frame.rotation)
            off = middle - snapshot.tool_position_w[0, arm]
            off = off - (off @ self._axis) * self._axis
            linear = self._velocity + config.position_gain_s * off
            twists.append(np.concatenate((linear, self._turn(snapshot, arm, frame.rotation))))
        return np.array(twists)

    def _forces(self, snapshot: Snapshot) -> np.ndarray:
        """Return (2, 3): of the hands on the bucket: more and more once both touch."""
        force = self._pressing() * self.config.press_n * self._hand_axis(snapshot)
        return np.array([-side * force for side in _SIDES])

    def _pressing(self) -> float:
        """Share of the pressing force by now, 0 to 1."""
        return min(1.0, self._touching_steps / self.config.ramp_steps)

    def _turn(self, snapshot: Snapshot, arm: int, wanted: np.ndarray) -> np.ndarray:
        error = rotation_error(snapshot.tool_rotation_w[0, arm], wanted)
        if self.phase is not BucketPhase.APPROACH:
            error[2] = self.config.yaw_share * self._yaw_to_wall(snapshot, arm)
        return limited(self.config.rotation_gain_s * error, self.config.turn_speed_rad_s)

    def _next_pitch(self, snapshot: Snapshot) -> float:
        """Return by how much both hands turn about their axis: ever more while the bucket is tilted about it."""
        tilt = float(np.cross(snapshot.link_rotation_w[0, 0, :, 2], _UP) @ self._axis)
        pitch = self._pitch_rad + self.config.level_gain_s * snapshot.step_s * tilt
        return min(max(pitch, -_MOST_PITCH_RAD), _MOST_PITCH_RAD)

    def _yaw_to_wall(self, snapshot: Snapshot, arm: int) -> float:
        """Angle about the vertical that makes both fingertips of a hand equally far from the wall."""
        tips = snapshot.fingertip_position_w[0, 2 * arm : 2 * arm + 2]
        local = (tips - snapshot.link_position_w[0, 0]) @ snapshot.link_rotation_w[0, 0]
        first, second = self._press.clearance_m(local)
        forward = snapshot.tool_rotation_w[0, arm, :, 2]
        return float((first - second) / (np.cross(_UP, tips[0] - tips[1]) @ forward))

    def _posture_velocity(self, snapshot: Snapshot) -> np.ndarray:
        """Towards the base pose, lift and arms from which the hands reach the bucket with ease."""
        config = self.config
        heading = self._heading(snapshot)
        carrying = self.phase is BucketPhase.CARRY
        middle = snapshot.tool_position_w[0].mean(axis=0) if carrying else self._middle(snapshot)
        base = middle[:2] - config.hold_distance_m * heading[:2]
        yaw, lift = np.arctan2(heading[1], heading[0]), max(0.0, middle[2] - config.lift_below_hand_m)
        error = np.concatenate((base, (yaw, lift), self._arms_qpos)) - self.controller.qpos(snapshot)
        error[2] = np.arctan2(np.sin(error[2]), np.cos(error[2]))
        velocity: np.ndarray = config.posture_gain_s * error
        if self._touching_steps:  # arms that strive for their posture would press less
            velocity[TRUNK - 1 :] = 0.0
        if carrying:
            velocity[:2] += self._velocity[:2]
            velocity[TRUNK - 1] = self._velocity[2]
        return velocity


def _mirrored(qpos: np.ndarray) -> np.ndarray:
    """Return the left arm's joints that mirror the right arm's: odd joints and the mount turn the other way."""
    signs = np.array((-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0))
    mirrored: np.ndarray = signs * qpos
    mirrored[-1] += np.pi / 2
    return mirrored


@dataclass(frozen=True, eq=False)
class Press:
    """Two opposite places on a bucket's wall, in its root's frame.

    Attributes:
        height_m: of both.
        direction_rad: from the root's z axis to the left hand's place; the right hand's is opposite.
        reach_m: (2,) distance of the places of right and left hand from the axis.
        outline_m: (D,) how far the body reaches out at this height, in directions evenly around from +x on.
    """

    height_m: float
    direction_rad: float
    reach_m: np.ndarray
    outline_m: np.ndarray

    def clearance_m(self, points: np.ndarray) -> np.ndarray:
        """Return how far points (N, 3) in the root's frame are outside the body, seen from its axis, (N,)."""
        step = 2 * np.pi / len(self.outline_m)
        angles = np.arctan2(points[:, 1], points[:, 0]) % (2 * np.pi)
        rim = np.interp(
            angles, step * np.arange(len(self.outline_m) + 1), np.append(self.outline_m, self.outline_m[0])
        )
        clearance: np.ndarray = np.hypot(points[:, 0], points[:, 1]) - rim
        return clearance


def choose_press(snapshot: Snapshot, goal: BucketGoal, config: PressConfig) -> Press:
    """Return the best pair of places for a robot that stands where it does (B = 1)."""
    heights, outline = goal.outline_height[0], _without_gaps(goal.outline[0])  # (Z,), (Z, D)
    directions = 2 * np.pi / outline.shape[1] * np.arange(outline.shape[1])
    reach = _support(outline, directions, config.spread_m)
    opposite = np.roll(reach, -outline.shape[1] // 2, axis=1)
    width = reach + opposite
    cost = config.width_weight * (width - width.min(axis=1, keepdims=True))
    cost += (config.height_weight * np.abs(np.array(OUTLINE_LEVELS) - config.share))[:, None]
    cost += np.where(heights < config.least_height_m, 100.0, 0.0)[:, None]
    cost += _turn_cost(snapshot, directions, config)
    missing = _missing_clearance(snapshot, goal, (heights, directions, reach), config)
    cost += config.bail_weight * (missing + np.roll(missing, -outline.shape[1] // 2, axis=1))
    level, k = np.unravel_index(int(np.argmin(cost)), cost.shape)
    places = np.array((opposite[level, k], reach[level, k]), dtype=float)
    return Press(float(heights[level]), float(directions[k]), places, outline[level])


def _without_gaps(outline: np.ndarray) -> np.ndarray:
    """Return the outline (Z, D) where rays that pass between two staves reach as far as their neighbours."""
    beside = np.maximum(np.roll(outline, 1, axis=1), np.roll(outline, -1, axis=1))
    return np.where(outline > 0, outline, beside)


def _support(outline: np.ndarray, directions: np.ndarray, spread_m: float) -> np.ndarray:
    """Return how far from the axis a plate, twice `spread_m` wide, is that touches the outline, (Z, D)."""
    turn = directions[None, :] - directions[:, None]  # (D, D): of each ray against each direction
    along, across = outline[:, None] * np.cos(turn), outline[:, None] * np.sin(turn)  # (Z, D, D)
    touched = (np.abs(across) <= spread_m) & (along > 0)
    found: np.ndarray = np.where(touched, along, 0.0).max(axis=-1)
    return found


def _turn_cost(snapshot: Snapshot, directions: np.ndarray, config: PressConfig) -> np.ndarray:
    """Return (D,): how far around the bucket the robot has to go, and whether the platform is in the way there."""
    bucket, base = snapshot.link_position_w[0, 0, :2], snapshot.robot_qpos[0, :2]
    x_axis = snapshot.link_rotation_w[0, 0, :2, 0]
    yaw = np.arctan2(x_axis[1], x_axis[0])
    heading = directions + yaw - np.pi / 2  # the robot's, whose left side the direction is
    now, outwards = (np.arctan2(*v[::-1]) for v in (bucket - base, bucket))
    turn, biased = np.abs(_wrapped(heading - now)), np.abs(_wrapped(heading - now - config.side_bias_rad))
    aside = np.abs(_wrapped(heading + np.pi - outwards))
    too_far = np.maximum(aside - config.platform_side_rad, 0.0)
    return config.turn_weight * biased**2 + 10 * too_far + np.where(turn > np.pi / 2, 100.0, 0.0)


def _missing_clearance(
    snapshot: Snapshot, goal: BucketGoal, places: tuple[np.ndarray, np.ndarray, np.ndarray], config: PressConfig
) -> np.ndarray:
    """Return by how much the nearest part of the bail in front of a place is too near in height, (Z, D)."""
    heights, directions, reach = places
    link = goal.point_link[0]
    moving = np.flatnonzero(link > 0)
    if not len(moving):
        return np.zeros_like(reach)
    points = (snapshot.link_rotation_w[0, link[moving]] @ goal.points[0, moving, :, None])[..., 0]
    points = points + snapshot.link_position_w[0, link[moving]] - snapshot.link_position_w[0, 0]
    points = points @ snapshot.link_rotation_w[0, 0]  # in the root's frame, (M, 3)
    along = np.cos(directions)[:, None] * points[:, 0] + np.sin(directions)[:, None] * points[:, 1]  # (D, M)
    across = np.cos(directions)[:, None] * points[:, 1] - np.sin(directions)[:, None] * points[:, 0]
    before = (np.abs(across) < config.bail_band_m) & (along > reach[:, :, None] - 0.01)  # (Z, D, M)
    gap = np.where(before, np.abs(points[:, 2] - heights[:, None, None]), np.inf)
    missing: np.ndarray = np.maximum(config.bail_clearance_m - gap.min(axis=-1), 0.0)
    return missing


def _wrapped(angle: np.ndarray) -> np.ndarray:
    return np.arctan2(np.sin(angle), np.cos(angle))

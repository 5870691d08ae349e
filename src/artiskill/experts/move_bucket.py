"""The expert of MoveBucket: press the bucket from two sides below its lip, lift it, carry it over the platform.

Closed loop: every step it looks where the hands are relative to the bucket and decides anew; a bucket that slips
out is taken again. Bail and ears stay untouched. It reads the snapshot and the goal, nothing else.
"""

from enum import Enum

import numpy as np

from artiskill.config import CONFIG_DIR, load_config
from artiskill.experts.frames import Frame, axis_rotation, curved, limited, rotation_error
from artiskill.experts.move_bucket_config import MoveBucketExpertConfig
from artiskill.experts.move_bucket_press import Press, choose_press
from artiskill.experts.whole_body import TRUNK, WholeBodyController
from artiskill.robots.config import RobotConfig
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.move_bucket import BucketGoal

_ARMS = 2
_UP = np.array((0.0, 0.0, 1.0))
_MOST_PITCH_RAD = 0.5  # hands turn so far from level for the bucket's sake
_SIDES = (-1.0, 1.0)  # the first arm is the right one; the hands' axis points from right to left


class Phase(Enum):
    """What the hands are doing."""

    APPROACH = "approach"
    CLOSE = "close"
    CARRY = "carry"


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
        self.phase = Phase.APPROACH
        self._press = Press(0.0, 0.0, np.zeros(_ARMS), np.zeros(1))
        self._touching_steps = 0
        self._velocity = np.zeros(3)  # of the carried bucket
        self._pitch_rad = 0.0  # of the carrying hands
        self._axis = np.zeros(3)

    def reset(self, snapshot: Snapshot, goal: BucketGoal) -> None:
        """Begin an episode at its first state (B = 1)."""
        self._start_over(snapshot, goal)

    def act(self, snapshot: Snapshot, goal: BucketGoal) -> np.ndarray:
        """The next action, (R,) in [-1, 1]."""
        self._advance_phase(snapshot, goal)
        twists = self._carry_twists(snapshot) if self.phase is Phase.CARRY else self._reach_twists(snapshot)
        qvel = self.controller.joint_velocities(snapshot, twists, self._posture_velocity(snapshot))
        qvel = qvel + self.controller.pushing_velocities(snapshot, self._forces(snapshot))
        return self.controller.to_action(snapshot, qvel, np.full((_ARMS, 2), self.config.finger_position_m))

    # -- deciding ------------------------------------------------------------------------------------------------

    def _start_over(self, snapshot: Snapshot, goal: BucketGoal) -> None:
        self.phase, self._touching_steps = Phase.APPROACH, 0
        self._velocity, self._pitch_rad = np.zeros(3), 0.0
        self._press = choose_press(snapshot, goal, self.config.press)

    def _advance_phase(self, snapshot: Snapshot, goal: BucketGoal) -> None:
        gaps, aside = self._gaps(snapshot)
        if self.phase is Phase.APPROACH:
            frames = [self._frame(snapshot, arm, self.config.standoff_m) for arm in range(_ARMS)]
            if all(self._is_aligned(snapshot, arm, frame) for arm, frame in enumerate(frames)):
                self.phase = Phase.CLOSE
            return
        if max(aside.max(), gaps.max() - self.config.standoff_m) > self.config.slip_m:
            self._start_over(snapshot, goal)
        elif self.phase is Phase.CLOSE:
            touching = gaps.max() < self.config.touching_m
            self._touching_steps = self._touching_steps + 1 if touching else 0
            if self._touching_steps >= self.config.press_steps:
                self.phase, self._axis = Phase.CARRY, self._hand_axis(snapshot)
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

    # -- where things are ----------------------------------------------------------------------------------------

    def _hand_axis(self, snapshot: Snapshot) -> np.ndarray:
        """(3,) level unit vector from the right hand's place to the left one's."""
        if self.phase is Phase.CARRY:
            return self._axis
        angle = self._press.direction_rad
        axis = snapshot.link_rotation_w[0, 0] @ np.array((np.cos(angle), np.sin(angle), 0.0))
        axis[2] = 0.0
        return axis / float(np.linalg.norm(axis))

    def _heading(self, snapshot: Snapshot) -> np.ndarray:
        """(3,) where a robot faces whose left side the hands' axis points to."""
        axis = self._hand_axis(snapshot)
        return np.array((axis[1], -axis[0], 0.0))

    def _middle(self, snapshot: Snapshot) -> np.ndarray:
        """(3,) the point of the bucket's axis between the hands' places."""
        up = snapshot.link_rotation_w[0, 0, :, 2]
        return snapshot.link_position_w[0, 0] + self._press.height_m * up

    def _gaps(self, snapshot: Snapshot) -> tuple[np.ndarray, np.ndarray]:
        """(2,) distances of the fingertips from the wall, and (2,) distances of the hands from their line."""
        from_middle = snapshot.tool_position_w[0] - self._middle(snapshot)  # (2, 3)
        out = np.array(_SIDES) * (from_middle @ self._hand_axis(snapshot))
        aside = np.sqrt(np.maximum((from_middle**2).sum(axis=-1) - out**2, 0.0))
        return out - self._press.reach_m - self.config.press.pad_to_tip_m, aside

    def _frame(self, snapshot: Snapshot, arm: int, gap_m: float) -> Frame:
        """Where a hand is that points at its place with its fingertips so far from it."""
        axis, heading = _SIDES[arm] * self._hand_axis(snapshot), self._heading(snapshot)
        out = self._press.reach_m[arm] + self.config.press.pad_to_tip_m + gap_m
        across = _SIDES[arm] * heading
        rotation = np.stack((np.cross(across, -axis), across, -axis), axis=-1)
        return Frame(self._middle(snapshot) + out * axis, rotation)

    # -- moving --------------------------------------------------------------------------------------------------

    def _reach_twists(self, snapshot: Snapshot) -> np.ndarray:
        """(2, 6) towards the standoffs, or from there to the wall."""
        config = self.config
        closing = self.phase is Phase.CLOSE
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
        """(2, 6) both hands go with the bucket, stay on one level line and press."""
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
        """(2, 3) of the hands on the bucket: more and more once both touch."""
        force = self._pressing() * self.config.press_n * self._hand_axis(snapshot)
        return np.array([-side * force for side in _SIDES])

    def _pressing(self) -> float:
        """Share of the pressing force by now, 0 to 1."""
        return min(1.0, self._touching_steps / self.config.ramp_steps)

    def _turn(self, snapshot: Snapshot, arm: int, wanted: np.ndarray) -> np.ndarray:
        error = rotation_error(snapshot.tool_rotation_w[0, arm], wanted)
        if self.phase is not Phase.APPROACH:
            error[2] = self.config.yaw_share * self._yaw_to_wall(snapshot, arm)
        return limited(self.config.rotation_gain_s * error, self.config.turn_speed_rad_s)

    def _next_pitch(self, snapshot: Snapshot) -> float:
        """By how much both hands turn about their axis: ever more while the bucket is tilted about it."""
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
        carrying = self.phase is Phase.CARRY
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
    """The left arm's joints that mirror the right arm's: odd joints turn the other way, the hand's mount too."""
    signs = np.array((-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0))
    mirrored: np.ndarray = signs * qpos
    mirrored[-1] += np.pi / 2
    return mirrored

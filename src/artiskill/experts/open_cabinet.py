"""The expert of the cabinet tasks: approach the handle, reach around it, grip, pull along the joint, be still.

Closed loop: every step it looks where the hand is relative to the handle and decides anew; a grip that slips is
taken again. Doors it pulls ajar and then pushes open from inside (`experts.door_opening`). It reads the snapshot
and the goal, nothing else.
"""

from dataclasses import dataclass

import numpy as np

from artiskill.config import CONFIG_DIR, check_inside, check_positive, load_config
from artiskill.experts import door_opening
from artiskill.experts.door_opening import Door, DoorConfig, door_of
from artiskill.experts.frames import Frame, Motion, head_for, limited, rotation_error, tool_frame, yaw_rotation
from artiskill.experts.handle_grasp import (
    CabinetPhase,
    GraspConfig,
    GripConfig,
    Posture,
    StanceConfig,
    after_approach,
    after_reach,
    approach_point,
    choose_grasp,
    default_grasp,
    has_slipped,
    tilted,
)
from artiskill.experts.whole_body import WholeBodyConfig, WholeBodyController
from artiskill.robots.config import RobotConfig
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.open_cabinet import CabinetGoal

_OPEN_HANDED = (CabinetPhase.APPROACH, CabinetPhase.REACH)
_GRIPPING = (
    CabinetPhase.PULL,
    CabinetPhase.HOLD,
)  # with all their force; in other phases fingers are on their way
_INTO_LIMIT_M = 0.01  # pulling aims so far beyond where it stops, lest it creeps there
_INTO_LIMIT_RAD = 0.03
_HALF_TURN = np.diag((-1.0, -1.0, 1.0))  # of a hand about its own z axis
_AJAR_RAD = 0.05  # a door that is less open when it is gripped counts as closed
_SPARE_STEPS = 10  # of reaching in
_UPRIGHT = 0.5  # cosine to the vertical above which a hinge counts as upright


@dataclass(frozen=True)
class OpenCabinetExpertConfig:
    """Speeds and gains."""

    position_gain_s: float  # hand velocity per position error
    rotation_gain_s: float  # hand angular velocity per orientation error
    posture_gain_s: float  # joint velocity per posture error
    approach_speed_m_s: float  # of the hand, far from the handle
    reach_speed_m_s: float  # of the hand, from the standoff to the handle
    pull_speed_m_s: float  # of the hand, along a slide
    turn_speed_rad_s: float  # of the hand
    overshoot: float  # how far beyond the open position to go, as a fraction of what is left of the range
    stance: StanceConfig  # where the base stands, and from where the hand comes
    grasp: GraspConfig  # which way handles are gripped
    grip: GripConfig  # when the fingers close on them
    door: DoorConfig  # how doors are opened
    whole_body: WholeBodyConfig  # weights of the inverse kinematics

    def __post_init__(self) -> None:
        check_positive(self, "position_gain_s", "rotation_gain_s", "posture_gain_s", "turn_speed_rad_s")
        check_positive(self, "approach_speed_m_s", "reach_speed_m_s", "pull_speed_m_s")
        check_inside("overshoot", self.overshoot, (0, 1))


@dataclass(frozen=True, eq=False)
class _Situation:
    """What one decision rests on; `left` is the rest of the joint's way to where the expert stops."""

    snapshot: Snapshot
    goal: CabinetGoal
    tool: Frame
    grasp: Frame
    door: Door | None
    left: float


class OpenCabinetExpert:
    """Opens drawers and doors by their handles.

    Args:
        robot: who acts; its first arm is used.
        config: values; by default those that come with the package.

    Attributes:
        phase: what the hand is doing.
    """

    def __init__(self, robot: RobotConfig, config: OpenCabinetExpertConfig | None = None) -> None:
        self.config = config or load_config(OpenCabinetExpertConfig, CONFIG_DIR / "experts" / "open_cabinet.yaml")
        self.controller = WholeBodyController(robot, self.config.whole_body)
        self.phase = CabinetPhase.APPROACH
        self._last_joint = self.controller.num_joints - 1
        self._rest_arm = np.asarray(robot.initial.arm_qpos_rad)
        self._mount_m = np.asarray(robot.mounts[0].position_m)
        self._max_opening = float(self.controller.scale.half_range[-1] * 2)
        self._rest = self._stance = Posture(self._rest_arm, np.zeros(3))
        self._grasp = default_grasp()
        self._begin()

    def _begin(self) -> None:
        self.phase, self._steps_in_phase = CabinetPhase.APPROACH, 0
        self._before_hold = CabinetPhase.PULL
        self._held: Frame | None = None  # where the hand holds still
        self._flipped, self._tilt = False, 1.0
        self._is_second_try = False  # the first one with default grasp and stance, after others
        self._gripped_rad = 0.0  # angle of the door when the hand closed

    def reset(self, snapshot: Snapshot, goal: CabinetGoal) -> None:
        """Begin an episode at its first state, in which the arm is at rest (B = 1)."""
        self._begin()
        x, y, yaw, lift = snapshot.robot_qpos[0, :4]
        offset = yaw_rotation(-yaw) @ (snapshot.tool_position_w[0, 0] - (x, y, lift))
        self._rest = Posture(self._rest_arm, offset)
        self._stance = self._rest.turned(self.config.stance.bearing_rad, self._mount_m)
        self._grasp = choose_grasp(self.config.grasp, snapshot, goal, self._last_joint)

    def act(self, snapshot: Snapshot, goal: CabinetGoal) -> np.ndarray:
        """Return the next action, (R,) in [-1, 1]."""
        now = self._look(snapshot, goal)
        phase = self._next_phase(now)
        if phase is self.phase:
            self._steps_in_phase += 1
        else:
            self._enter(phase, now)
        motion = self._motion(now)
        posture = self._posture_velocity(snapshot, motion.wanted)
        qvel = self.controller.joint_velocities(snapshot, self._twist(now.tool, motion)[None], posture)
        return self.controller.to_action(snapshot, qvel, self._fingers(now))

    def _look(self, snapshot: Snapshot, goal: CabinetGoal) -> _Situation:
        goal = self._grasp.on(goal)
        grasp = self._grasp.frame(snapshot, goal, self._last_joint)
        stop = goal.open_qpos[0] + self.config.overshoot * (goal.upper[0] - goal.open_qpos[0])
        return _Situation(
            snapshot=snapshot,
            goal=goal,
            tool=tool_frame(snapshot),
            grasp=self._grasp.leaning(self._tilted(grasp)),
            door=door_of(snapshot, goal) if goal.turns[0] else None,
            left=float(stop - snapshot.object_qpos[0, int(goal.joint[0])]),
        )

    def _tilted(self, frame: Frame) -> Frame:
        """Return a pose whose hand comes from above where that is low."""
        return tilted(frame, self._tilt, self._rest.tool_offset[2], self.config.grip)

    def _next_phase(self, now: _Situation) -> CabinetPhase:
        phase, steps = self.phase, self._steps_in_phase
        if phase is CabinetPhase.APPROACH:
            return after_approach(now.tool, now.grasp, self.config.grip)
        if phase is CabinetPhase.REACH:
            return after_reach(now.tool, now.grasp, steps, self._patience(now), self.config.grip)
        if phase in (CabinetPhase.GRIP, CabinetPhase.PULL) and has_slipped(now.tool, now.grasp, self.config.grip):
            return door_opening.after_slip(now.door, self.config.door) if now.door else CabinetPhase.APPROACH
        if phase is CabinetPhase.GRIP:
            return CabinetPhase.PULL if steps >= self.config.grip.grip_steps else phase
        if now.left <= 0:
            return CabinetPhase.HOLD
        if phase is CabinetPhase.HOLD:
            return self._before_hold
        if now.door is None:
            return phase
        if phase is CabinetPhase.PULL:
            return CabinetPhase.RELEASE if door_opening.is_ajar(now.door, self.config.door) else phase
        return door_opening.next_phase(phase, steps, now.door, now.tool, self.config.door)

    def _enter(self, phase: CabinetPhase, now: _Situation) -> None:
        """Begin another phase, and remember what it needs to know about its beginning."""
        before, steps = self.phase, self._steps_in_phase
        gave_up = before is CabinetPhase.REACH and steps >= self._patience(now)
        if phase is CabinetPhase.APPROACH and (gave_up or before is not CabinetPhase.REACH):
            self._try_again(gave_up)
        if phase is CabinetPhase.GRIP and now.door is not None:
            self._gripped_rad = now.door.angle_rad if now.door.angle_rad > _AJAR_RAD else 0.0
        if phase is CabinetPhase.HOLD:
            self._before_hold, self._held = before, now.tool
        if phase is CabinetPhase.AROUND and before is not CabinetPhase.PUSH:
            self._flipped = self._should_flip(now)
        self.phase, self._steps_in_phase = phase, 0

    def _try_again(self, gave_up: bool) -> None:
        """Come anew: with default grasp and stance; if those failed to reach the handle, nearer to level."""
        if gave_up and self._is_default:
            self._tilt /= 2
        self._is_second_try = not self._is_default
        self._grasp, self._stance = default_grasp(), self._rest

    @property
    def _is_default(self) -> bool:
        """Whether grasp and stance are the default ones."""
        return self._grasp.is_default and not self._stance.bearing_rad

    def _patience(self, now: _Situation) -> int:
        """Return the steps that reaching in may take; with a varied grasp or stance hardly more than it needs."""
        config = self.config
        if self._is_default and not self._is_second_try:
            return config.grip.patience_steps
        needed = config.grip.standoff_m / (config.reach_speed_m_s * now.snapshot.step_s)
        least = config.grip.blocked_steps + 1  # by then the fingers may close where they are
        return min(config.grip.patience_steps, max(int(needed) + _SPARE_STEPS, least))

    def _should_flip(self, now: _Situation) -> bool:
        """Return whether the pushing hand should be turned by half, so that the last joint stays in its range."""
        assert now.door is not None
        relative = now.tool.rotation.T @ door_opening.pushing_hand(now.door, self.config.door)
        roll = float(np.arctan2(relative[1, 0], relative[0, 0]))
        last = float(now.snapshot.robot_qpos[0, self._last_joint])
        return abs(last + roll - np.sign(roll) * np.pi) < abs(last + roll)

    def _fingers(self, now: _Situation) -> np.ndarray:
        """Return positions that the fingers are asked for, (1, 2)."""
        grip = self.config.grip
        if self.phase in _GRIPPING:
            return np.zeros((1, 2))
        if self.phase is CabinetPhase.RELEASE:
            return np.full((1, 2), self._max_opening)
        if self.phase in _OPEN_HANDED:
            wide = now.goal.grasp_width_m[0] / 2 + grip.finger_clearance_m
            return np.full((1, 2), min(self._max_opening, wide))
        return self.controller.closing_m(now.snapshot, grip.close_speed_m_s)

    def _motion(self, now: _Situation) -> Motion:
        config, grasp = self.config, now.grasp
        if self.phase is CabinetPhase.APPROACH:
            before = Frame(grasp.position - config.grip.standoff_m * grasp.forward, grasp.rotation)
            point = approach_point(config.stance, before, now.tool.position)
            return head_for(Frame(point, grasp.rotation), config.approach_speed_m_s)
        if self.phase in (CabinetPhase.REACH, CabinetPhase.GRIP):
            return head_for(grasp, config.reach_speed_m_s)
        if self.phase is CabinetPhase.HOLD:
            return head_for(self._held or now.tool, config.reach_speed_m_s)
        return self._slide_motion(now) if now.door is None else self._door_motion(now, now.door)

    def _slide_motion(self, now: _Situation) -> Motion:
        """Pulling a drawer."""
        config = self.config
        speed = np.clip(config.position_gain_s * (now.left + _INTO_LIMIT_M), 0.0, config.pull_speed_m_s)
        axis = now.snapshot.link_rotation_w[0, int(now.goal.link[0])] @ now.goal.joint_axis[0]
        return Motion(Frame(now.grasp.position, now.tool.rotation), config.reach_speed_m_s, speed * axis)

    def _door_motion(self, now: _Situation, door: Door) -> Motion:
        """Pulling, letting go of, going around and pushing a door."""
        config, left = self.config.door, now.left + _INTO_LIMIT_RAD
        if self.phase is CabinetPhase.PULL:
            return door_opening.pull(door, left, now.grasp, now.tool, config, self._gripped_rad)
        if self.phase is CabinetPhase.RELEASE:
            return door_opening.release(door, now.tool, config)
        hand = self._pushing_hand(door)
        if self.phase is CabinetPhase.AROUND:
            return door_opening.around(door, now.tool, hand, config)
        return door_opening.push(door, left, now.tool, hand, config)

    def _pushing_hand(self, door: Door) -> np.ndarray:
        """Rotation (3, 3) of the hand that pushes."""
        rotation = door_opening.pushing_hand(door, self.config.door)
        rotation = rotation @ _HALF_TURN if self._flipped else rotation
        upright = abs(door.axis[2]) > _UPRIGHT  # else it points up or down as the flap asks
        return self._tilted(Frame(door.hinge, rotation)).rotation if upright else rotation

    def _twist(self, tool: Frame, motion: Motion) -> np.ndarray:
        """Return the hand's velocity, (6,)."""
        config, wanted = self.config, motion.wanted
        towards = config.position_gain_s * (wanted.position - tool.position)
        turn = config.rotation_gain_s * rotation_error(tool.rotation, wanted.rotation)
        linear = limited(towards, motion.speed_m_s) + motion.feed_m_s
        return np.concatenate((linear, limited(turn, config.turn_speed_rad_s)))

    def _posture_velocity(self, snapshot: Snapshot, wanted: Frame) -> np.ndarray:
        """Towards the base pose and lift from which the arm in its posture would reach the wanted pose."""
        qpos = snapshot.robot_qpos[0, : self.controller.num_joints]
        if self.phase is CabinetPhase.HOLD:
            return np.zeros_like(qpos)
        let_go = self.phase in (CabinetPhase.RELEASE, CabinetPhase.AROUND, CabinetPhase.PUSH)
        posture = (self._rest if let_go else self._stance).joints(wanted)
        posture[-1] = qpos[-1]  # the last joint rolls the hand as the handle asks
        error = posture - qpos
        error[2] = np.arctan2(np.sin(error[2]), np.cos(error[2]))
        return self.config.posture_gain_s * error

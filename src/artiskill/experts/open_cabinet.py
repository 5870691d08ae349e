"""The expert of the cabinet tasks: approach the handle, grip, pull along the joint, be still.

Closed loop, and without memory: every step it looks where the hand is relative to the handle and decides anew; a
grip that slips is taken again. So it can say what to do in any state, also in one that somebody else came into.
Doors it pulls ajar and then pushes open from inside (`experts.door_opening`). It reads the snapshot and the goal,
nothing else.
"""

from dataclasses import dataclass, replace

import numpy as np

from artiskill.config import CONFIG_DIR, check_inside, check_positive, load_config
from artiskill.experts import door_opening
from artiskill.experts.door_opening import Door, DoorConfig, door_of
from artiskill.experts.frames import Frame, Motion, head_for, limited, ramp, rotation_error, tool_frame, wrapped
from artiskill.experts.handle_grasp import (
    CabinetPhase,
    GraspConfig,
    GripConfig,
    HandAtHandle,
    StanceConfig,
    approach_point,
    grasp_pose,
    hand_at_handle,
    leaning,
    nearest_roll,
    rest_posture,
    tilt_of,
    tilted,
)
from artiskill.experts.whole_body import (
    TRUNK,
    Command,
    CommandController,
    Grip,
    WholeBodyConfig,
    WholeBodyController,
    in_base_axes,
)
from artiskill.geometry.arrays import norm, small_product
from artiskill.robots.arm_config import load_arm
from artiskill.robots.config import RobotConfig
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.open_cabinet import CabinetGoal

_OPEN_HANDED = (CabinetPhase.APPROACH, CabinetPhase.RELEASE)
_MOST_OVERSHOOT = 20.0
_INTO_LIMIT_M = 0.01  # pulling aims so far beyond where it stops, lest it creeps there
_INTO_LIMIT_RAD = 0.03
_HALF_TURN = np.diag((-1.0, -1.0, 1.0))  # of a hand about its own z axis
_BENT_RAD, _FOLDED_RAD = 0.8, 1.3  # of a joint from its posture: from here on, and here altogether, it goes back
_RETREAT_M = 0.3  # of the base, meanwhile
_MOVES = 0.1  # m/s or rad/s of a joint: what is held moves along
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
    # how far beyond the open position to go, as a fraction of what is left of the range; beyond 1 it is pulled, or
    # pushed, at its limit
    overshoot: float
    stance: StanceConfig  # where the base stands, and from where the hand comes
    grasp: GraspConfig  # which way handles are gripped
    grip: GripConfig  # when the fingers close on them
    door: DoorConfig  # how doors are opened
    whole_body: WholeBodyConfig  # weights of the inverse kinematics

    def __post_init__(self) -> None:
        check_positive(self, "position_gain_s", "rotation_gain_s", "posture_gain_s", "turn_speed_rad_s")
        check_positive(self, "approach_speed_m_s", "reach_speed_m_s", "pull_speed_m_s")
        check_inside("overshoot", self.overshoot, (0, _MOST_OVERSHOOT))


@dataclass(frozen=True, eq=False)
class _Situation:
    """What one decision rests on; `left` is the rest of the joint's way to where the expert stops."""

    snapshot: Snapshot
    goal: CabinetGoal
    tool: Frame
    grasp: Frame
    hand: HandAtHandle
    door: Door | None
    left: float


class OpenCabinetExpert:
    """Opens drawers and doors by their handles.

    Args:
        robot: who acts; its first arm is used.
        config: values; by default those that come with the package.

    Attributes:
        phases: names of the parts of the work, which commands number.
        controller: carries commands out.
    """

    phases = tuple(phase.name.lower() for phase in CabinetPhase)

    def __init__(self, robot: RobotConfig, config: OpenCabinetExpertConfig | None = None) -> None:
        self.config = config or load_config(OpenCabinetExpertConfig, CONFIG_DIR / "experts" / "open_cabinet.yaml")
        rest = rest_posture(robot)
        self._stance = rest.turned(self.config.stance.bearing_rad, np.asarray(robot.mounts[0].position_m))
        self._last_joint = TRUNK + len(rest.arm) - 1
        self._widest_m = load_arm(robot.arm).finger.range_m[1]
        self.controller = CommandController(
            WholeBodyController(robot, self.config.whole_body),
            self._stance.arm,
            self.config.grip.close_speed_m_s,
            rolls=True,  # the last joint rolls the hand as the handle asks
        )

    def reset(self, snapshot: Snapshot, goal: CabinetGoal) -> None:
        """Begin an episode; there is nothing to remember."""

    def act(self, snapshot: Snapshot, goal: CabinetGoal) -> np.ndarray:
        """Return the next action, (R,) in [-1, 1]."""
        return self.controller.action(snapshot, self.command(snapshot, goal))

    def command(self, snapshot: Snapshot, goal: CabinetGoal) -> Command:
        """Return what is to be done in a state (B = 1), whoever brought it about."""
        now = self._look(snapshot, goal)
        phase = self._phase(now)
        motion = self._motion(phase, now)
        twist = np.zeros((1, 6)) if phase is CabinetPhase.HOLD else self._twist(now.tool, motion)
        trunk = np.zeros(TRUNK) if phase is CabinetPhase.HOLD else self._trunk_qvel(snapshot, motion.wanted)
        wide = 2 * self._widest_m if phase is CabinetPhase.RELEASE else now.hand.wide_m
        command = Command(
            phase=int(phase),
            twists=twist,
            trunk_qvel=trunk,
            arm_gain_s=0.0 if phase is CabinetPhase.HOLD else self.config.posture_gain_s,
            grip=np.array([Grip.OPEN if phase in _OPEN_HANDED else Grip.CLOSING]),
            width_m=np.array([wide / 2]),
        )
        return self._unfolding(command, now, motion.wanted) if phase is CabinetPhase.APPROACH else command

    def _unfolding(self, command: Command, now: _Situation, wanted: Frame) -> Command:
        """Return the command of an arm that is far from its posture: first it goes back there, and the base away.

        A folded arm can follow its hand's way only until one of its joints is at its limit.
        """
        off = np.abs(now.snapshot.robot_qpos[0, TRUNK : self._last_joint] - self._stance.arm[:-1]).max()
        share = ramp(off, _BENT_RAD, _FOLDED_RAD)
        if share == 0.0:
            return command
        back = Frame(wanted.position - share * _RETREAT_M * wanted.forward, wanted.rotation)
        command = replace(command, trunk_qvel=self._trunk_qvel(now.snapshot, back))
        twists = self.controller.posture_twists(now.snapshot, command)
        return replace(command, twists=command.twists + share * (twists - command.twists))

    def _look(self, snapshot: Snapshot, goal: CabinetGoal) -> _Situation:
        config, last = self.config, self._last_joint
        grasp = grasp_pose(config.grasp, snapshot, goal, last, float(self._stance.arm[-1]))
        tilt = self._tilt_rad(grasp)
        grasp = tilted(leaning(grasp, config.grasp, tilt), tilt)
        stop = goal.open_qpos[0] + config.overshoot * (goal.upper[0] - goal.open_qpos[0])
        width = float(goal.grasp_width_m[0])
        return _Situation(
            snapshot=snapshot,
            goal=goal,
            tool=tool_frame(snapshot),
            grasp=grasp,
            hand=hand_at_handle(snapshot, grasp, width, last + 1, 2 * self._widest_m, config.grip),
            door=door_of(snapshot, goal) if goal.turns[0] else None,
            left=float(stop - snapshot.object_qpos[0, int(goal.joint[0])]),
        )

    def _tilt_rad(self, frame: Frame) -> float:
        """Return by how much a hand comes from above where it is low."""
        return tilt_of(float(frame.position[2]), float(self._stance.tool_offset[2]), self.config.grip)

    def _phase(self, now: _Situation) -> CabinetPhase:
        """Return which part of the work a state belongs to."""
        if now.left <= 0:
            return CabinetPhase.HOLD
        if now.door is not None:
            phase = door_opening.phase_at(now.door, now.tool, now.hand, self.config.door)
            if phase is not None:
                return phase
        if now.hand.holds:
            return CabinetPhase.PULL
        return CabinetPhase.GRIP if now.hand.may_close else CabinetPhase.APPROACH

    def _motion(self, phase: CabinetPhase, now: _Situation) -> Motion:
        if phase is CabinetPhase.APPROACH:
            return self._approach_motion(now)
        if phase is CabinetPhase.GRIP:
            return head_for(now.grasp, self.config.reach_speed_m_s)
        if phase is CabinetPhase.HOLD:
            return head_for(now.tool, self.config.reach_speed_m_s)
        return self._slide_motion(now) if now.door is None else self._door_motion(phase, now, now.door)

    def _approach_motion(self, now: _Situation) -> Motion:
        """To the handle through the funnel before it."""
        config, grasp, share = self.config, now.grasp, now.hand.standoff
        before = Frame(grasp.position - share * config.grip.standoff_m * grasp.forward, grasp.rotation)
        far = ramp(float(norm(now.hand.error_m)), config.grip.standoff_m, 2 * config.grip.standoff_m)
        fast = max(share, far)
        speed = config.reach_speed_m_s + fast * (config.approach_speed_m_s - config.reach_speed_m_s)
        return head_for(Frame(approach_point(config.stance, before, now.tool.position), grasp.rotation), speed)

    def _slide_motion(self, now: _Situation) -> Motion:
        """Pulling a drawer."""
        config = self.config
        speed = np.clip(config.position_gain_s * (now.left + _INTO_LIMIT_M), 0.0, config.pull_speed_m_s)
        speed *= self._firmness(now)
        axis = small_product(now.snapshot.link_rotation_w[0, int(now.goal.link[0])], now.goal.joint_axis[0])
        return Motion(Frame(now.grasp.position, now.tool.rotation), config.reach_speed_m_s, speed * axis)

    def _firmness(self, now: _Situation) -> float:
        """Share of the speed with which to pull: all of it on what moves along, else by how firm the grip is."""
        speed = float(now.snapshot.object_qvel[0, int(now.goal.joint[0])])
        return max(now.hand.firmness, min(speed / _MOVES, 1.0))

    def _door_motion(self, phase: CabinetPhase, now: _Situation, door: Door) -> Motion:
        """Pulling, letting go of, going around and pushing a door."""
        config, left = self.config.door, now.left + _INTO_LIMIT_RAD
        if phase is CabinetPhase.PULL:
            pulling = door_opening.pull(door, left, now.grasp, now.tool, config)
            return replace(pulling, feed_m_s=self._firmness(now) * pulling.feed_m_s)
        if phase is CabinetPhase.RELEASE:
            return door_opening.release(door, now.tool, config)
        hand = self._pushing_hand(now, door)
        if phase is CabinetPhase.AROUND:
            return door_opening.around(door, now.tool, hand, config)
        return door_opening.push(door, left, now.tool, hand, config)

    def _pushing_hand(self, now: _Situation, door: Door) -> np.ndarray:
        """Rotation (3, 3) of the hand that pushes; either side of it may, as the last joint likes it."""
        rotation = door_opening.pushing_hand(door, self.config.door)
        last = float(now.snapshot.robot_qpos[0, self._last_joint])
        rotation = nearest_roll(
            np.stack((rotation, small_product(rotation, _HALF_TURN))), now.tool.rotation, last, last
        )
        upright = abs(door.axis[2]) > _UPRIGHT  # else it points up or down as the flap asks
        hand = Frame(door.hinge, rotation)
        return tilted(hand, self._tilt_rad(hand)).rotation if upright else rotation

    def _twist(self, tool: Frame, motion: Motion) -> np.ndarray:
        """Return the hand's velocity in its own axes, (1, 6)."""
        config, wanted = self.config, motion.wanted
        towards = config.position_gain_s * (wanted.position - tool.position)
        turn = config.rotation_gain_s * rotation_error(tool.rotation, wanted.rotation)
        linear = limited(towards, motion.speed_m_s) + motion.feed_m_s
        angular = limited(turn, config.turn_speed_rad_s) + motion.feed_rad_s
        twist = small_product(tool.rotation.T, linear), small_product(tool.rotation.T, angular)
        return np.concatenate(twist)[None]

    def _trunk_qvel(self, snapshot: Snapshot, wanted: Frame) -> np.ndarray:
        """Towards the base pose and lift from which the arm in its posture would reach the wanted pose, (4,)."""
        error = self._stance.joints(wanted)[:TRUNK] - snapshot.robot_qpos[0, :TRUNK]
        error[2] = wrapped(error[2])
        return in_base_axes(snapshot, self.config.posture_gain_s * error)

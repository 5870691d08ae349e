"""The expert of the cabinet tasks: approach the handle, reach around it, grip, pull along the joint, be still.

Closed loop: every step it looks where the hand is relative to the handle and decides anew; a grip that slips is
taken again. It reads the snapshot and the goal, nothing else.
"""

from dataclasses import dataclass
from enum import Enum
from typing import cast

import numpy as np

from artiskill.config import CONFIG_DIR, load_config
from artiskill.experts.whole_body import WholeBodyConfig, WholeBodyController
from artiskill.geometry.rotations import (
    quat_from_axis_angle,
    quat_from_matrix,
    quat_to_matrix,
    quat_to_rotation_vector,
)
from artiskill.robots.config import RobotConfig
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.open_cabinet.goal import OpenGoal


@dataclass(frozen=True)
class OpenCabinetExpertConfig:
    """Distances, speeds and gains.

    Attributes:
        standoff_m: the hand stops this far in front of the grasp before it reaches around the handle.
        position_gain_s: hand velocity per position error.
        rotation_gain_s: hand angular velocity per orientation error.
        posture_gain_s: joint velocity per posture error.
        approach_speed_m_s: of the hand, far from the handle.
        reach_speed_m_s: of the hand, from the standoff to the handle.
        pull_speed_m_s: of the hand, along the joint.
        turn_speed_rad_s: of the hand.
        aligned_m: sideways error below which the hand reaches in.
        aligned_rad: orientation error below which the hand reaches in.
        grasp_m: distance to the grasp below which the fingers close; along the handle, where it matters less,
            three times as much.
        blocked_steps: after so many steps of reaching in, the fingers close where they are, if
        blocked_m: the hand is at least this near: a panel or moulding behind the handle is in its way.
        slip_m: distance to the grasp above which a grip counts as lost.
        grip_steps: environment steps that the fingers get to close.
        overshoot: how far beyond the open position to pull, as a fraction of what is left of the range.
        finger_clearance_m: opening beyond the handle's width, each finger.
        arm_reach_m: horizontal distance from the shoulder to the tool in the robot's rest posture.
    """

    standoff_m: float
    position_gain_s: float
    rotation_gain_s: float
    posture_gain_s: float
    approach_speed_m_s: float
    reach_speed_m_s: float
    pull_speed_m_s: float
    turn_speed_rad_s: float
    aligned_m: float
    aligned_rad: float
    grasp_m: float
    blocked_steps: int
    blocked_m: float
    slip_m: float
    grip_steps: int
    overshoot: float
    finger_clearance_m: float
    arm_reach_m: float
    whole_body: WholeBodyConfig


class Phase(Enum):
    """What the hand is doing."""

    APPROACH = "approach"
    REACH = "reach"
    GRIP = "grip"
    PULL = "pull"
    HOLD = "hold"


@dataclass(frozen=True)
class _Frame:
    """A pose of the tool in the world: position (3,) and rotation (3, 3)."""

    position: np.ndarray
    rotation: np.ndarray


class OpenCabinetExpert:
    """Opens drawers by a gripped handle.

    Args:
        robot: who acts; its first arm is used.
        config: values; by default those that come with the package.
    """

    def __init__(self, robot: RobotConfig, config: OpenCabinetExpertConfig | None = None) -> None:
        self.config = config or load_config(OpenCabinetExpertConfig, CONFIG_DIR / "experts" / "open_cabinet.yaml")
        self.controller = WholeBodyController(robot, self.config.whole_body)
        self._rest_arm = np.asarray(robot.initial.arm_qpos_rad)
        self._max_opening = float(self.controller.scale.half_range[-1] * 2)
        self.phase = Phase.APPROACH
        self._steps_in_phase = 0
        self._rest_offset = np.zeros(3)

    def reset(self, snapshot: Snapshot, goal: OpenGoal) -> None:
        """Begin an episode at its first state, in which the arm is at rest (B = 1)."""
        self.phase, self._steps_in_phase = Phase.APPROACH, 0
        offset = snapshot.tool_position_w[0, 0] - _base_position(snapshot)
        self._rest_offset = _yaw_matrix(-snapshot.robot_qpos[0, 2]) @ offset

    def act(self, snapshot: Snapshot, goal: OpenGoal) -> np.ndarray:
        """The next action, (R,) in [-1, 1]."""
        grasp = self._grasp(snapshot, goal)
        tool = _Frame(snapshot.tool_position_w[0, 0], snapshot.tool_rotation_w[0, 0])
        self._advance_phase(snapshot, goal, grasp, tool)
        twist, wanted = self._twist(snapshot, goal, grasp, tool)
        posture = self._posture_velocity(snapshot, wanted)
        if self.phase is Phase.HOLD:
            twist, posture = np.zeros(6), np.zeros_like(posture)
        qvel = self.controller.joint_velocities(snapshot, twist, posture)
        return self.controller.to_action(snapshot, qvel, self._opening(goal))

    # -- deciding ------------------------------------------------------------------------------------------------

    def _advance_phase(self, snapshot: Snapshot, goal: OpenGoal, grasp: _Frame, tool: _Frame) -> None:
        before = self.phase
        error = tool.rotation.T @ (
            grasp.position - tool.position
        )  # in the hand's frame: x along the handle, z forward
        angle = float(np.linalg.norm(_rotation_error(tool.rotation, grasp.rotation)))
        if before is Phase.APPROACH:
            self.phase = self._after_approach(error, angle)
        elif before is Phase.REACH:
            self.phase = self._after_reach(error, angle)
        elif before is not Phase.HOLD and float(np.linalg.norm(error[1:])) > self.config.slip_m:
            self.phase = Phase.APPROACH
        elif before is Phase.GRIP and self._steps_in_phase >= self.config.grip_steps:
            self.phase = Phase.PULL
        elif before in (Phase.PULL, Phase.HOLD):
            open_enough = snapshot.object_qpos[0, goal.joint[0]] >= self._stop_qpos(goal)
            self.phase = Phase.HOLD if open_enough else Phase.PULL
        self._steps_in_phase = self._steps_in_phase + 1 if self.phase is before else 0

    def _after_approach(self, error: np.ndarray, angle: float) -> Phase:
        aligned = float(np.hypot(error[0], error[1])) < self.config.aligned_m and angle < self.config.aligned_rad
        return Phase.REACH if aligned else Phase.APPROACH

    def _after_reach(self, error: np.ndarray, angle: float) -> Phase:
        config = self.config
        along, across, forward = np.abs(error)
        if across > 3 * config.aligned_m or angle > 3 * config.aligned_rad:
            return Phase.APPROACH
        near = across < config.grasp_m and along < 3 * config.grasp_m
        blocked = self._steps_in_phase >= config.blocked_steps and forward < config.blocked_m
        return Phase.GRIP if near and (forward < config.grasp_m or blocked) else Phase.REACH

    def _stop_qpos(self, goal: OpenGoal) -> float:
        return float(goal.open_qpos[0] + self.config.overshoot * (goal.upper[0] - goal.open_qpos[0]))

    def _opening(self, goal: OpenGoal) -> float:
        """Position of each finger."""
        if self.phase in (Phase.GRIP, Phase.PULL, Phase.HOLD):
            return 0.0
        return min(self._max_opening, float(goal.grasp_width_m[0]) / 2 + self.config.finger_clearance_m)

    # -- moving --------------------------------------------------------------------------------------------------

    def _grasp(self, snapshot: Snapshot, goal: OpenGoal) -> _Frame:
        """The grasp pose in the world that is nearest to the hand, tilted down where the handle hangs low."""
        link = int(goal.link[0])
        rotation = snapshot.link_rotation_w[0, link]
        position = snapshot.link_position_w[0, link] + rotation @ goal.grasp_positions[0, 0]
        candidates = rotation @ goal.grasp_rotations[0]  # (G, 3, 3)
        likeness = np.einsum("gij,ij->g", candidates, snapshot.tool_rotation_w[0, 0])
        nearest = candidates[int(np.argmax(likeness))]
        return _Frame(position, self._tilt(position[2]) @ nearest)

    def _tilt(self, height_m: float) -> np.ndarray:
        """Rotation that lets the shoulder swing the hand down to handles below the lift's lowest reach."""
        drop = np.clip((self._rest_offset[2] - height_m) / self.config.arm_reach_m, 0.0, 0.7)
        return quat_to_matrix(quat_from_axis_angle((0, 1, 0), float(np.arcsin(drop))))

    def _twist(self, snapshot: Snapshot, goal: OpenGoal, grasp: _Frame, tool: _Frame) -> tuple[np.ndarray, _Frame]:
        """The hand's velocity in this phase, and the pose it is heading for."""
        config = self.config
        wanted, speed = grasp, config.reach_speed_m_s
        forward = grasp.rotation[:, 2]
        feed = np.zeros(3)
        if self.phase is Phase.APPROACH:
            wanted = _Frame(grasp.position - config.standoff_m * forward, grasp.rotation)
            speed = config.approach_speed_m_s
        elif self.phase is Phase.PULL:
            left = self._stop_qpos(goal) + 0.01 - float(snapshot.object_qpos[0, goal.joint[0]])
            rotation = snapshot.link_rotation_w[0, int(goal.link[0])]
            pull = np.clip(config.position_gain_s * left, 0.0, config.pull_speed_m_s)
            feed = pull * (rotation @ goal.joint_axis[0])
            wanted = _Frame(grasp.position, tool.rotation)
        linear = _limit(config.position_gain_s * (wanted.position - tool.position), speed) + feed
        turn = config.rotation_gain_s * _rotation_error(tool.rotation, wanted.rotation)
        return np.concatenate((linear, _limit(turn, config.turn_speed_rad_s))), wanted

    def _posture_velocity(self, snapshot: Snapshot, wanted: _Frame) -> np.ndarray:
        """Towards the base pose and lift from which the arm at rest would reach the wanted pose."""
        forward = wanted.rotation[:, 2]
        yaw = float(np.arctan2(forward[1], forward[0]))
        shoulder_drop = self._rest_offset[2]
        base = wanted.position[:2] - (_yaw_matrix(yaw) @ self._rest_offset)[:2]
        qpos = snapshot.robot_qpos[0, : self.controller.num_joints]
        lift = max(0.0, wanted.position[2] - shoulder_drop)
        posture = np.concatenate((base, (yaw, lift), self._rest_arm))
        posture[-1] = qpos[-1]  # the last joint rolls the hand as the handle asks
        error = posture - qpos
        error[2] = np.arctan2(np.sin(error[2]), np.cos(error[2]))
        return self.config.posture_gain_s * error


def _base_position(snapshot: Snapshot) -> np.ndarray:
    """Base x, y and lift height, (3,)."""
    x, y, _, lift = snapshot.robot_qpos[0, :4]
    return np.array((x, y, lift))


def _yaw_matrix(yaw: float) -> np.ndarray:
    return cast(np.ndarray, quat_to_matrix(quat_from_axis_angle((0, 0, 1), float(yaw))))


def _rotation_error(current: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Rotation vector (3,) that turns `current` into `wanted`, both (3, 3), in the world frame."""
    return cast(np.ndarray, quat_to_rotation_vector(quat_from_matrix(wanted @ current.T)))


def _limit(vector: np.ndarray, length: float) -> np.ndarray:
    return vector * min(1.0, length / max(float(np.linalg.norm(vector)), 1e-9))

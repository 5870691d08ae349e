"""Where the robot takes hold of a chair: which hand grips which column, and from which side."""

import math
from dataclasses import dataclass, replace

import numpy as np

from artiskill.config import check, check_inside, check_not_negative, check_positive, check_value, check_vector
from artiskill.experts.frames import Frame, yaw_rotation
from artiskill.experts.whole_body import WholeBodyConfig
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.push_chair import ChairGoal

LEFT, RIGHT = 1, 0  # the robot's second and first arm
_LEAST_APART_M = 0.25  # hands on two columns nearer than this would hinder one another
_MOST_APART_M = 0.6
_USUAL_COLUMN = np.array([[0.0, 0.0, 0.25]])  # where most chairs have one, for a chair whose columns are not known
_STEER_FROM_M = 0.25  # nearer to the target than this, where it lies says little about where to push
_LEAST_OUTWARD = 0.25  # of their distance: how far from the root their middle lies, else they are a diagonal


@dataclass(frozen=True)
class PushChairExpertConfig:
    """Distances, speeds and gains."""

    # the side to stand on is chosen as if the robot were so far around the chair, counter-clockwise; 0 for the
    # nearest one
    side_bias_rad: float
    oblique_rad: float  # how far aside of straight ahead a hand alone pushes
    grip_height_share: float  # where on the free part of a column hands grip: -1 lowest, 0 usual, 1 highest
    base_distance_m: float  # of the base from the middle of what the hands go for
    around_distance_m: float  # the same while the base drives around the chair
    around_step_rad: float  # how far ahead on that circle it steers
    # on its way around it faces as in its place, but away from the chair by so much at most
    around_face_rad: float
    base_speed_share: float  # of the base's highest speed, while no hand grips
    toe_in_rad: float  # how far a hand that grips in front of the robot points inwards
    pair_toe_in_rad: float  # the same where each hand has a column of its own
    # posture of the right arm, mirrored for the left; elbow and wrist are as low as the hand, under the seat
    arm_rad: tuple[float, ...]
    pitch_rad: float  # how far the hands point upwards, so that their wrists stay clear of the seat
    carry_m: tuple[float, float]  # where the hands are carried, forward and sideways of the base
    standoff_m: float  # the hand stops this far in front of the column before it reaches around it
    idle_m: float  # a hand that does not grip stays this far from the column
    shoulder_above_m: float  # height of a grip above which the lift goes up
    position_gain_s: float  # hand velocity per position error
    rotation_gain_s: float  # hand angular velocity per orientation error
    posture_gain_s: float  # velocity of base and lift per error
    arm_gain_s: float  # joint velocity per error of the arms' posture, where one hand grips
    pair_arm_gain_s: float  # the same where both do
    hand_speed_m_s: float  # of a free hand
    reach_speed_m_s: float  # of a hand, from the standoff to the column
    turn_speed_rad_s: float  # of a hand
    carried_m: float  # error of the base and the hands' height below which the hands go in
    aligned_m: float  # hand's error at the standoff below which it reaches
    aligned_rad: float  # likewise, of its orientation
    patience_steps: int  # after so many steps twice these errors will do, and so on
    grip_m: float  # distance to the column's axis below which the fingers close
    reach_steps: int  # after so many steps of reaching in vain it tries anew, with default values
    stray_m: float  # a reaching hand that is this far aside of its way goes back and tries anew
    slip_m: float  # distance to the column's axis above which a grip counts as lost
    grip_steps: int  # environment steps that the fingers get to close
    close_speed_m_s: float  # of each finger
    drive_speed_m_s: float  # of the chair, at most
    curve_rad_m: float  # the chair is driven this far aside of its target, per metre from it: in a curve
    steer_rad_s: float  # a robot that grips with one hand goes around the column with the way, so fast at most
    drive_gain_s: float  # speed per distance from the target
    drive_acceleration_m_s2: float  # of the chair, at most
    stop_m: float  # distance to the target at which the chair is held where it is
    leave_m: float  # distance from which it is driven again
    whole_body: WholeBodyConfig  # weights of the inverse kinematics

    def __post_init__(self) -> None:
        check_not_negative(self, "steer_rad_s")
        check_inside("grip_height_share", self.grip_height_share, (-1, 1))
        check_inside("base_speed_share", self.base_speed_share, (0.1, 1))
        check_inside("around_face_rad", self.around_face_rad, (0, math.pi))
        check_positive(self, "base_distance_m", "around_distance_m", "around_step_rad", "standoff_m", "idle_m")
        check_positive(self, "position_gain_s", "rotation_gain_s", "posture_gain_s", "drive_gain_s")
        check_positive(self, "hand_speed_m_s", "reach_speed_m_s", "turn_speed_rad_s", "close_speed_m_s")
        check_positive(self, "drive_speed_m_s", "drive_acceleration_m_s2", "carried_m", "stop_m", "leave_m")
        check_positive(self, "grip_m", "aligned_m", "aligned_rad", "stray_m", "slip_m")
        check_positive(self, "patience_steps", "reach_steps", "grip_steps")
        check_not_negative(self, "arm_gain_s", "pair_arm_gain_s", "shoulder_above_m")
        check_vector(self, "arm_rad", size=7)
        check_vector(self, "carry_m", size=2)
        check_value(self, "curve_rad_m", math.isfinite(self.curve_rad_m), "must be finite")
        for name in ("side_bias_rad", "oblique_rad", "toe_in_rad", "pair_toe_in_rad", "pitch_rad"):
            check_inside(name, getattr(self, name), (-math.pi, math.pi))
        check(self.stop_m < self.leave_m, f"stop_m = {self.stop_m} must be below leave_m = {self.leave_m}")


@dataclass(frozen=True, eq=False)
class GripPlan:
    """A hold on the chair, in its root's frame.

    Attributes:
        points: (2, 3) per hand the point that it goes for; both the same where `hands` has one.
        hands: which hands grip; the other one stays near.
        side_rad: the robot stands on this side of the middle of the points, an angle about the vertical in
            the root's frame where both hands grip, else in the world: a chair may turn about its column.
    """

    points: np.ndarray
    hands: tuple[int, ...]
    side_rad: float


def make_plan(snapshot: Snapshot, goal: ChairGoal, config: PushChairExpertConfig) -> GripPlan:
    """Return the best hold from where the robot is (B = 1): two columns of one side of the chair, else one column.

    A hand alone pushes best straight ahead, as sideways a finger yields sooner: the robot then stands so that this
    hand, turned inwards by `toe_in_rad`, points to where the chair shall go.
    """
    rotation = snapshot.link_rotation_w[0, 0]
    robot = rotation.T @ (np.append(snapshot.robot_qpos[0, :2], 0.0) - snapshot.link_position_w[0, 0])
    robot = yaw_rotation(config.side_bias_rad) @ robot
    columns = _columns(goal, config.grip_height_share)
    sides = _sides(columns)
    if not sides:
        return _single(snapshot, columns, robot, config)
    toward = math.atan2(robot[1], robot[0])
    side, first, second = min(sides, key=lambda s: abs(math.remainder(s[0] - toward, math.tau)))
    # seen by a robot that stands at that side and faces the chair, left is where this points
    leftward = np.array((math.sin(side), -math.cos(side)))
    ends = (first, second) if (first - second)[:2] @ leftward < 0 else (second, first)
    return GripPlan(np.stack(ends), (RIGHT, LEFT), side)


def _single(snapshot: Snapshot, columns: np.ndarray, robot: np.ndarray, config: PushChairExpertConfig) -> GripPlan:
    """Return one hand at the column that is nearest to the robot, which is at (3,) in the chair's frame."""
    rotation = snapshot.link_rotation_w[0, 0]
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    column = columns[np.argmin(np.linalg.norm(columns[:, :2] - robot[:2], axis=1))]
    way = snapshot.link_position_w[0, 0, :2]  # the target is at the origin: this points against the way to go
    backward = _backward(way, config)
    aside = math.remainder(backward - math.atan2(robot[1] - column[1], robot[0] - column[0]) - yaw, math.tau)
    hand = RIGHT if aside > 0 else LEFT
    return GripPlan(np.stack((column, column)), (hand,), backward + _turn(hand, config))


def _backward(chair_xy: np.ndarray, config: PushChairExpertConfig) -> float:
    """Against the way that a chair goes which is here, an angle in the world; the target is at the origin."""
    away = math.hypot(chair_xy[0], chair_xy[1])
    return math.atan2(chair_xy[1], chair_xy[0]) + config.oblique_rad + config.curve_rad_m * away


def _turn(hand: int, config: PushChairExpertConfig) -> float:
    """Return how far aside of this a robot stands whose hand, turned inwards, pushes alone."""
    return -config.toe_in_rad if hand == RIGHT else config.toe_in_rad


def steered(plan: GripPlan, snapshot: Snapshot, config: PushChairExpertConfig) -> GripPlan:
    """Return the plan one step on: the robot goes around the column, so that its hand pushes straight ahead."""
    chair = snapshot.link_position_w[0, 0, :2]
    if math.hypot(chair[0], chair[1]) < _STEER_FROM_M:
        return plan
    wanted = _backward(chair, config) + _turn(plan.hands[0], config)
    most = config.steer_rad_s * snapshot.step_s
    change = math.remainder(wanted - plan.side_rad, math.tau)
    return replace(plan, side_rad=plan.side_rad + min(max(change, -most), most))


def _columns(goal: ChairGoal, grip_height_share: float) -> np.ndarray:
    """Return where hands grip the chair's columns, in its root's frame, (G, 3)."""
    count = int(goal.grasp_count[0])
    if not count:
        return _USUAL_COLUMN
    usual = goal.grasp_points[0, :count]
    ends = goal.grasp_ends[0, :count, 1 if grip_height_share > 0 else 0]
    columns: np.ndarray = usual + abs(grip_height_share) * (ends - usual)
    return columns


def _sides(columns: np.ndarray) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Return pairs of columns that make a side of the chair: the side's direction, and the two."""
    found = []
    for i, first in enumerate(columns):
        for second in columns[i + 1 :]:
            middle, apart = (first + second)[:2] / 2, math.dist(first[:2], second[:2])
            outward = np.array((second - first)[[1, 0]] * (1, -1)) / max(apart, 1e-9)
            outward = outward * math.copysign(1.0, float(outward @ middle))
            if _LEAST_APART_M < apart < _MOST_APART_M and outward @ middle > _LEAST_OUTWARD * apart:
                found.append((math.atan2(outward[1], outward[0]), first, second))
    return found


def to_base_frame(snapshot: Snapshot, hand: int) -> Frame:
    """Pose of a hand in the base's frame."""
    x, y, yaw = snapshot.robot_qpos[0, :3]
    turn = yaw_rotation(-yaw)
    position = snapshot.tool_position_w[0, hand] - np.array((x, y, 0.0))
    return Frame(turn @ position, turn @ snapshot.tool_rotation_w[0, hand])


def to_world_frame(snapshot: Snapshot, frame: Frame) -> Frame:
    """Return the pose whose place in the base's frame is given."""
    x, y, yaw = snapshot.robot_qpos[0, :3]
    turn = yaw_rotation(yaw)
    return Frame(np.array((x, y, 0.0)) + turn @ frame.position, turn @ frame.rotation)


def hand_rotation(yaw_rad: float, pitch_rad: float, hand: int) -> np.ndarray:
    """Return the rotation of a hand that points upwards a little and closes sideways, (3, 3)."""
    cos, sin = math.cos(pitch_rad), math.sin(pitch_rad)
    forward = np.array((math.cos(yaw_rad) * cos, math.sin(yaw_rad) * cos, sin))
    y = np.array((-math.sin(yaw_rad), math.cos(yaw_rad), 0.0)) * (1.0 if hand == LEFT else -1.0)
    return np.stack((np.cross(y, forward), y, forward), axis=-1)

"""Where the robot takes hold of a chair: which hand grips which post, and from which side."""

import math
from dataclasses import dataclass, replace

import numpy as np

from artiskill.experts.frames import yaw_rotation
from artiskill.experts.push_chair_config import PushChairExpertConfig
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.push_chair import ChairGoal

LEFT, RIGHT = 1, 0  # the robot's second and first arm
_LEAST_APART_M = 0.25  # hands on two posts nearer than this would hinder one another
_MOST_APART_M = 0.6
_USUAL_COLUMN = np.array([[0.0, 0.0, 0.25]])  # where most chairs have one, for a chair whose posts are not known
_STEER_FROM_M = 0.25  # nearer to the target than this, where it lies says little about where to push
_LEAST_OUTWARD = 0.25  # of their distance: how far from the root their middle lies, else they are a diagonal


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
    """The best hold from where the robot is: two posts of one side of the chair, else a single post (B = 1).

    A hand alone pushes best straight ahead, as sideways a finger yields sooner: the robot then stands so that this
    hand, turned inwards by `toe_in_rad`, points to where the chair shall go.
    """
    rotation = snapshot.link_rotation_w[0, 0]
    robot = rotation.T @ (np.append(snapshot.robot_qpos[0, :2], 0.0) - snapshot.link_position_w[0, 0])
    robot = yaw_rotation(config.side_bias_rad) @ robot
    posts = _posts(goal, config.grip_height_share)
    sides = _sides(posts)
    if not sides:
        return _single(snapshot, posts, robot, config)
    toward = math.atan2(robot[1], robot[0])
    side, first, second = min(sides, key=lambda s: abs(math.remainder(s[0] - toward, math.tau)))
    # seen by a robot that stands at that side and faces the chair, left is where this points
    leftward = np.array((math.sin(side), -math.cos(side)))
    ends = (first, second) if (first - second)[:2] @ leftward < 0 else (second, first)
    return GripPlan(np.stack(ends), (RIGHT, LEFT), side)


def _single(snapshot: Snapshot, posts: np.ndarray, robot: np.ndarray, config: PushChairExpertConfig) -> GripPlan:
    """One hand at the post that is nearest to the robot, which is at (3,) in the chair's frame."""
    rotation = snapshot.link_rotation_w[0, 0]
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    post = posts[np.argmin(np.linalg.norm(posts[:, :2] - robot[:2], axis=1))]
    way = snapshot.link_position_w[0, 0, :2]  # the target is at the origin: this points against the way to go
    backward = _backward(way, config)
    aside = math.remainder(backward - math.atan2(robot[1] - post[1], robot[0] - post[0]) - yaw, math.tau)
    hand = RIGHT if aside > 0 else LEFT
    return GripPlan(np.stack((post, post)), (hand,), backward + _turn(hand, config))


def _backward(chair_xy: np.ndarray, config: PushChairExpertConfig) -> float:
    """Against the way that a chair goes which is here, an angle in the world; the target is at the origin."""
    away = math.hypot(chair_xy[0], chair_xy[1])
    return math.atan2(chair_xy[1], chair_xy[0]) + config.oblique_rad + config.curve_rad_m * away


def _turn(hand: int, config: PushChairExpertConfig) -> float:
    """How far aside of this a robot stands whose hand, turned inwards, pushes alone."""
    return -config.toe_in_rad if hand == RIGHT else config.toe_in_rad


def steered(plan: GripPlan, snapshot: Snapshot, config: PushChairExpertConfig) -> GripPlan:
    """A plan of one hand, one step on: the robot goes around the post, so that this hand pushes straight ahead."""
    chair = snapshot.link_position_w[0, 0, :2]
    if math.hypot(chair[0], chair[1]) < _STEER_FROM_M:
        return plan
    wanted = _backward(chair, config) + _turn(plan.hands[0], config)
    most = config.steer_rad_s * snapshot.step_s
    change = math.remainder(wanted - plan.side_rad, math.tau)
    return replace(plan, side_rad=plan.side_rad + min(max(change, -most), most))


def _posts(goal: ChairGoal, grip_height_share: float) -> np.ndarray:
    """(G, 3) where hands grip the chair's posts, in its root's frame."""
    count = int(goal.grasp_count[0])
    if not count:
        return _USUAL_COLUMN
    usual = goal.grasp_points[0, :count]
    ends = goal.grasp_ends[0, :count, 1 if grip_height_share > 0 else 0]
    posts: np.ndarray = usual + abs(grip_height_share) * (ends - usual)
    return posts


def _sides(posts: np.ndarray) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Pairs of posts that make a side of the chair: the side's direction, and the two."""
    found = []
    for i, first in enumerate(posts):
        for second in posts[i + 1 :]:
            middle, apart = (first + second)[:2] / 2, math.dist(first[:2], second[:2])
            outward = np.array((second - first)[[1, 0]] * (1, -1)) / max(apart, 1e-9)
            outward = outward * math.copysign(1.0, float(outward @ middle))
            if _LEAST_APART_M < apart < _MOST_APART_M and outward @ middle > _LEAST_OUTWARD * apart:
                found.append((math.atan2(outward[1], outward[0]), first, second))
    return found

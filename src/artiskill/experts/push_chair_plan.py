"""Where the robot takes hold of a chair: which hand grips which post, and from which side."""

import math
from dataclasses import dataclass

import numpy as np

from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.push_chair.goal import PushGoal

LEFT, RIGHT = 1, 0  # the robot's second and first arm
_LEAST_APART_M = 0.25  # hands on two posts nearer than this would hinder one another
_MOST_APART_M = 0.6
_USUAL_COLUMN = np.array([[0.0, 0.0, 0.25]])  # where most chairs have one, for a chair whose posts are not known
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


def make_plan(snapshot: Snapshot, goal: PushGoal, toe_in_rad: float) -> GripPlan:
    """The best hold from where the robot is: two posts of one side of the chair, else a single post (B = 1).

    A hand alone pushes best straight ahead, as sideways a finger yields sooner: the robot then stands so that this
    hand, turned inwards by `toe_in_rad`, points to where the chair shall go.
    """
    count = int(goal.grip_count[0])
    posts = goal.grip_points[0, :count] if count else _USUAL_COLUMN
    rotation = snapshot.link_rotation_w[0, 0]
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    robot = rotation.T @ (np.append(snapshot.robot_qpos[0, :2], 0.0) - snapshot.link_position_w[0, 0])
    sides = _sides(posts)
    if not sides:
        post = posts[np.argmin(np.linalg.norm(posts[:, :2] - robot[:2], axis=1))]
        way = snapshot.link_position_w[0, 0, :2]  # the target is at the origin: this points against the way to go
        backward = math.atan2(way[1], way[0])
        aside = math.remainder(backward - math.atan2(robot[1] - post[1], robot[0] - post[0]) - yaw, math.tau)
        hand, turn = (RIGHT, -toe_in_rad) if aside > 0 else (LEFT, toe_in_rad)
        return GripPlan(np.stack((post, post)), (hand,), backward + turn)
    toward = math.atan2(robot[1], robot[0])
    side, first, second = min(sides, key=lambda s: abs(math.remainder(s[0] - toward, math.tau)))
    # seen by a robot that stands at that side and faces the chair, left is where this points
    leftward = np.array((math.sin(side), -math.cos(side)))
    ends = (first, second) if (first - second)[:2] @ leftward < 0 else (second, first)
    return GripPlan(np.stack(ends), (RIGHT, LEFT), side)


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

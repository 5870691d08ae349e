"""The goal of PushChair: the target lies at the origin; what differs is the chair's surface."""

from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.geometry.arrays import Array
from artiskill.tasks.push_chair.posts import grip_places
from artiskill.tasks.surface import surface_samples


@dataclass(frozen=True, eq=False)
class PushGoal:
    """What B episodes ask for.

    Attributes:
        row: (B,) 0 to B - 1.
        points: (B, P, 3) samples of the chair's surface, in the frame of their link.
        point_link: (B, P) index of that link.
        grip_points: (B, G, 3) where hands can close around the chair's posts, in the root's frame; zero padded.
        grip_ends: (B, G, 2, 3) the lowest and the highest such point of each post.
        grip_count: (B,) how many of them there are.
    """

    row: Array
    points: Array
    point_link: Array
    grip_points: Array
    grip_ends: Array
    grip_count: Array


def make_push_goal(obj: ArticulatedObject, target: str) -> PushGoal:
    """The goal of pushing a chair, with B = 1; `target` is its root."""
    points, link = surface_samples(obj)
    grips = grip_places(obj)
    return PushGoal(
        np.array([0]), points[None], link[None], grips.points[None], grips.ends[None], np.array([grips.count])
    )

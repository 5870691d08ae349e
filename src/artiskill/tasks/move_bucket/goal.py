"""The goal of MoveBucket: the platform lies at the origin; what differs is the bucket's shape."""

from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.geometry.arrays import Array, namespace, rotate
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.move_bucket.outline import body_outline
from artiskill.tasks.surface import surface_samples


@dataclass(frozen=True, eq=False)
class BucketGoal:
    """What B episodes ask for.

    Attributes:
        row: (B,) 0 to B - 1.
        points: (B, P, 3) samples of the bucket's surface, in the frame of their link.
        point_link: (B, P) index of that link.
        box: (B, 2, 3) smallest and largest corner of the bucket's body, without its bail, in its own frame.
        start_height: (B,) of the box's middle above the ground while the bucket stands there, m.
        outline_height: (B, Z) heights in the root's frame at which its outline is known, m.
        outline: (B, Z, D) how far the body reaches out from the root's z axis there, m; D directions evenly around
            the axis, from the root's +x on. Controllers read both; rewards and success do not.
    """

    row: Array
    points: Array
    point_link: Array
    box: Array
    start_height: Array
    outline_height: Array
    outline: Array


def body_box(obj: ArticulatedObject) -> np.ndarray:
    """(2, 3) smallest and largest corner of what is drawn of an object's root, in its frame."""
    corners = np.stack([visual.mesh.bounds for visual in obj.links[0].visuals])
    return np.stack((corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)))


def make_bucket_goal(obj: ArticulatedObject, target: str) -> BucketGoal:
    """The goal of moving a bucket, with B = 1; `target` is its root."""
    points, link = surface_samples(obj)
    box = body_box(obj)
    heights, outline = body_outline(obj, float(box[0, 2]), float(box[1, 2]))
    middle = box[:, 2].mean()
    return BucketGoal(
        np.array([0]), points[None], link[None], box[None], middle[None], heights[None], outline[None]
    )


def bucket_centre_w(snapshot: Snapshot, goal: BucketGoal) -> Array:
    """(B, 3) the middle of the bucket's box, in the world."""
    xp = namespace(snapshot.link_position_w)
    middle = xp.mean(goal.box, axis=1)
    return rotate(snapshot.link_rotation_w[:, 0], middle) + snapshot.link_position_w[:, 0]

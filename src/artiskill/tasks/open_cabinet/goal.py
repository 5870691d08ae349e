"""The goal of the cabinet tasks: which joint, how far, and where its handle is."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.errors import AssetError
from artiskill.geometry.arrays import Array
from artiskill.geometry.rotations import quat_to_matrix

# A plane that every point lies inside of, far away: it pads hulls with fewer planes than their batch's largest.
_NO_PLANE = np.array((0.0, 0.0, 0.0, -1e3))


@dataclass(frozen=True, eq=False)
class OpenGoal:
    """What B episodes ask for; P handle points, F hull planes, G grasp poses. Handle data in the link's frame.

    Attributes:
        row: (B,) 0 to B - 1, so that `values[goal.row, goal.link]` is each environment's own entry.
        joint: (B,) index of the target among the object's joints.
        link: (B,) index of its link.
        lower: (B,) closed joint value, m or rad.
        upper: (B,) largest joint value.
        open_qpos: (B,) joint value from which it counts as open.
        turns: (B,) whether the joint is a hinge.
        joint_axis: (B, 3) direction of opening (slides) or axis of turning (hinges).
        joint_origin: (B, 3) point on that axis.
        link_bounds: (B, 2, 3) smallest and largest corner of what is drawn of the link, handle included.
        handle_points: (B, 3, P) surface samples, one per column.
        handle_planes: (B, F, 4) convex hull, outward normal and offset.
        grasp_positions: (B, G, 3) tool-centre points.
        grasp_rotations: (B, G, 3, 3) hand orientations, columns are the hand's axes.
        grasp_width_m: (B,) extent of the handle between the pads.
    """

    PADDING: ClassVar[Mapping[str, np.ndarray | None]] = {
        "handle_planes": _NO_PLANE,
        "grasp_positions": None,
        "grasp_rotations": None,
    }

    row: Array
    joint: Array
    link: Array
    lower: Array
    upper: Array
    open_qpos: Array
    turns: Array
    joint_axis: Array
    joint_origin: Array
    link_bounds: Array
    handle_points: Array
    handle_planes: Array
    grasp_positions: Array
    grasp_rotations: Array
    grasp_width_m: Array


def make_open_goal(obj: ArticulatedObject, target: str, open_fraction: float) -> OpenGoal:
    """The goal of opening one link of a cabinet, with B = 1. The link's first handle is the one that counts.

    Raises:
        UnknownNameError: the object has no such link.
        AssetError: the link has no joint, no handle or no finite limits.
    """
    link_index = obj.link_index(target)
    link, handles = obj.links[link_index], obj.handles_of(target)
    if link.joint is None or not handles:
        lacks = "no joint" if link.joint is None else "no handle"
        raise AssetError(f"object {obj.id!r}: link {target!r} cannot be a target, it has {lacks}")
    lower, upper = link.joint.limits
    if not np.isfinite((lower, upper)).all() or upper <= lower:
        raise AssetError(f"object {obj.id!r}: joint {link.joint.name!r} has the limits ({lower}, {upper})")
    handle = handles[0]
    drawn = np.concatenate([handle.points, *(visual.mesh.vertices for visual in link.visuals)])
    return OpenGoal(
        row=np.array([0]),
        joint=np.array([obj.jointed_links.index(link_index)]),
        link=np.array([link_index]),
        lower=np.array([lower]),
        upper=np.array([upper]),
        open_qpos=np.array([lower + open_fraction * (upper - lower)]),
        turns=np.array([link.joint.kind == "revolute"]),
        joint_axis=link.joint.axis[None],
        joint_origin=link.joint.origin[None],
        link_bounds=np.stack((drawn.min(axis=0), drawn.max(axis=0)))[None],
        handle_points=np.ascontiguousarray(handle.points.T)[None],
        handle_planes=handle.planes[None],
        grasp_positions=handle.grasp_positions[None],
        grasp_rotations=quat_to_matrix(handle.grasp_quaternions)[None],
        grasp_width_m=np.array([handle.grasp_width_m]),
    )

"""Where a door is: its hinge, its free edge and its two faces, in the world and at one instant."""

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from artiskill.experts.frames import axis_rotation
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.open_cabinet import CabinetGoal

_HANGING = -0.5  # a closed door whose edge is so far below its hinge (cosine to the vertical) hangs


@dataclass(frozen=True, eq=False)
class Door:
    """A door, or a flap, whose hinge is level. Vectors in the world frame.

    Attributes:
        hinge: (3,) the point of the hinge's axis at the grasp's height.
        axis: (3,) of turning; the door opens anticlockwise about it.
        along: (3,) from the hinge to the free edge, in the door's plane.
        outward: (3,) from the outer face to the room.
        angle_rad: how far it is open.
        rate_rad_s: how fast it opens.
        edge_m: coordinate of the free edge along `along`.
        inner_m: coordinate of the inner face along `outward`.
        outer_m: likewise, of what stands out the furthest: the handle.
        grasp_m: likewise, of the grasp.
        grasp_width_m: of the handle between the fingers.
    """

    hinge: np.ndarray
    axis: np.ndarray
    along: np.ndarray
    outward: np.ndarray
    angle_rad: float
    rate_rad_s: float
    edge_m: float
    inner_m: float
    outer_m: float
    grasp_m: float
    grasp_width_m: float

    @cached_property
    def back(self) -> np.ndarray:
        """Rotation (3, 3) that closes the door."""
        return axis_rotation(self.axis, -self.angle_rad)

    @property
    def hangs(self) -> bool:
        """Whether it hangs from its hinge, and falls shut when it is let go."""
        return float((self.back @ self.along)[2]) < _HANGING

    def point(self, along_m: float, outward_m: float) -> np.ndarray:
        """A point of the level that the grasp lies in, (3,)."""
        return self.hinge + along_m * self.along + outward_m * self.outward

    def coordinates(self, point: np.ndarray) -> tuple[float, float]:
        """Of a point: along the door from the hinge on, and outward."""
        offset = point - self.hinge
        return float(offset @ self.along), float(offset @ self.outward)

    def arc(self, point: np.ndarray) -> np.ndarray:
        """(3,) velocity of a point of the door per rad/s of opening."""
        return np.cross(self.axis, point - self.hinge)


def door_of(snapshot: Snapshot, goal: CabinetGoal) -> Door:
    """The door that a goal asks for (B = 1)."""
    link, joint = int(goal.link[0]), int(goal.joint[0])
    rotation, position = snapshot.link_rotation_w[0, link], snapshot.link_position_w[0, link]
    axis, origin = goal.joint_axis[0], goal.joint_origin[0]
    lever = goal.grasp_positions[0, 0] - origin
    height = float(lever @ axis)
    outward = -goal.grasp_rotations[0, 0][:, 2]  # the hand comes from the room
    outward = outward - (outward @ axis) * axis
    outward = outward / np.linalg.norm(outward)
    along = np.cross(outward, axis)
    corners = np.array(list(product(*goal.link_bounds[0].T))) - origin  # (8, 3)
    return Door(
        hinge=position + rotation @ (origin + height * axis),
        axis=rotation @ axis,
        along=rotation @ along,
        outward=rotation @ outward,
        angle_rad=float(snapshot.object_qpos[0, joint] - goal.lower[0]),
        rate_rad_s=float(snapshot.object_qvel[0, joint]),
        edge_m=float((corners @ along).max()),
        inner_m=float((corners @ outward).min()),
        outer_m=float((corners @ outward).max()),
        grasp_m=float(lever @ outward),
        grasp_width_m=float(goal.grasp_width_m[0]),
    )

"""`Snapshot`: the values of one step, for a batch of environments, as plain arrays.

Observations, rewards and success conditions are functions of a snapshot, never of an environment. The poses of
one step ago are part of it, so that asking twice answers the same.
"""

from dataclasses import dataclass, fields
from functools import cached_property

from artiskill.geometry.arrays import Array, arccos, clip, dot, namespace, norm


@dataclass(frozen=True, eq=False)
class Snapshot:
    """B environments; R robot joints, A arms, T = 2A fingertips, N bodies, L links, J object joints, K free props.

    L and J are what the scene's layout has room for: an object's own links and joints come first, in its order;
    beyond them joint values are 0 and links mean nothing.

    World frame, SI units, quaternions (w, x, y, z). Arrays are NumPy (or torch) and must not be written to.

    Attributes:
        time_s: (B,) since the episode's first state.
        step_s: duration of one environment step.
        robot_qpos: (B, R) base x, y, yaw, lift, then per arm its joints and two fingers.
        robot_qvel: (B, R) in the same order, base x and y along the world's axes.
        robot_joint_anchor_w: (B, R, 3) a point on each joint's axis.
        robot_joint_axis_w: (B, R, 3) unit direction of each joint.
        finger_line_w: (B, T, 2, 3) where each finger's line starts and ends: it runs along the pad to the tip.
        fingertip_position_w: (B, T, 3) the ends of these lines.
        fingertip_velocity_w: (B, T, 3).
        tool_position_w: (B, A, 3) centre between the pads.
        tool_rotation_w: (B, A, 3, 3) columns: the hand's axes; z forward, the fingers close along y.
        object_joints: (B,) how many of the J are the object's own.
        object_qpos: (B, J).
        object_qvel: (B, J).
        root_velocity_w: (B, 6) linear and angular velocity of the object's root; 0 where it is fixed.
        prop_position_w: (B, K, 3) of the free props.
        prop_velocity_w: (B, K, 3) linear.
        link_position_w: (B, L, 3) frames of the object's links.
        link_quaternion_w: (B, L, 4).
        link_rotation_w: (B, L, 3, 3) the same orientations as matrices.
        link_speed_m_s: (B, L) mean speed of each link's frame over the last environment step.
        link_angular_speed_rad_s: (B, L) mean angular speed of each link over the last environment step.
        previous_link_position_w: (B, L, 3) one environment step ago; at the first state, that state's.
        previous_link_quaternion_w: (B, L, 4).
        body_position_w: (B, N, 3) of everything that is drawn.
        body_quaternion_w: (B, N, 4).
    """

    time_s: Array
    step_s: float
    robot_qpos: Array
    robot_qvel: Array
    robot_joint_anchor_w: Array
    robot_joint_axis_w: Array
    finger_line_w: Array
    fingertip_velocity_w: Array
    tool_position_w: Array
    tool_rotation_w: Array
    object_joints: Array
    object_qpos: Array
    object_qvel: Array
    root_velocity_w: Array
    prop_position_w: Array
    prop_velocity_w: Array
    link_position_w: Array
    link_quaternion_w: Array
    link_rotation_w: Array
    previous_link_position_w: Array
    previous_link_quaternion_w: Array
    body_position_w: Array
    body_quaternion_w: Array

    def row(self, env: int) -> "Snapshot":
        """Return one environment's snapshot, B = 1; its arrays are views."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return Snapshot(**{k: v if k == "step_s" else v[env : env + 1] for k, v in values.items()})

    @property
    def fingertip_position_w(self) -> Array:
        """(B, T, 3) the ends of the finger lines."""
        return self.finger_line_w[:, :, 1]

    @cached_property
    def link_speed_m_s(self) -> Array:
        """(B, L) mean speed of each link's frame over the last environment step."""
        return norm(self.link_position_w - self.previous_link_position_w) / self.step_s

    @cached_property
    def link_angular_speed_rad_s(self) -> Array:
        """(B, L) mean angular speed of each link over the last environment step."""
        xp = namespace(self.link_quaternion_w)
        # by the scalar product, good to 6e-7 rad/s: half the array calls of `quat_angle`; every step asks for it
        cosine = xp.abs(dot(self.previous_link_quaternion_w, self.link_quaternion_w))
        return arccos(clip(cosine, 0.0, 1.0)) * (2.0 / self.step_s)

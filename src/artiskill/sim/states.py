"""Where an episode starts, and everything that its future depends on."""

from dataclasses import dataclass

import numpy as np

from artiskill.robots.config import RobotConfig
from artiskill.scene.physics import PhysicsConfig
from artiskill.scene.props import Prop


@dataclass(frozen=True, eq=False)
class InitialState:
    """Where one environment starts, and the parameters that its level gives the object's joints.

    Attributes:
        robot_qpos: (R,).
        object_qpos: (J,).
        joint_friction: (J,) N or N m.
        joint_damping: (J,) N s/m or N m s/rad.
        object_limits: (J, 2) limits that the level gives the object's joints; None leaves their own.
        root_pose_w: (7,) position and orientation of an object that is free to move, else None.
        prop_positions_w: (K, 3) of the free props, upright; None without any.
        settle_steps: physics steps taken before the first snapshot, with drives at rest.
    """

    robot_qpos: np.ndarray
    object_qpos: np.ndarray
    joint_friction: np.ndarray
    joint_damping: np.ndarray
    object_limits: np.ndarray | None = None
    root_pose_w: np.ndarray | None = None
    prop_positions_w: np.ndarray | None = None
    settle_steps: int = 0


@dataclass(frozen=True, eq=False)
class SimulationState:
    """Everything that the future of a batch depends on; `Simulation.restore` takes it back.

    The joints' friction, damping and limits are drawn by levels and restored; object, robot, props and physics are
    only named: they must be those of the simulation.

    Attributes:
        rows: (B, S) the engine's integration state (`mjSTATE_INTEGRATION`, warm start included).
        joint_friction: (B, J).
        joint_damping: (B, J).
        joint_limits: (B, J, 2), 0 where a joint has none.
        previous_link_position_w: (B, L, 3).
        previous_link_quaternion_w: (B, L, 4).
        object_hash: `ArticulatedObject.content_hash` of the object; of all, where they differ.
        robot: the configuration of the robot that it was simulated with.
        physics: the configuration that it was simulated with.
        props: what stood or lay beside robot and object and could be touched.
    """

    rows: np.ndarray
    joint_friction: np.ndarray
    joint_damping: np.ndarray
    joint_limits: np.ndarray
    previous_link_position_w: np.ndarray
    previous_link_quaternion_w: np.ndarray
    object_hash: str
    robot: RobotConfig
    physics: PhysicsConfig
    props: tuple[Prop, ...]

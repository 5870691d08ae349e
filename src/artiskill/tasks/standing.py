"""What the tasks with free objects share: where the object stands, how it leans and moves, what masks show."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from artiskill.config import check_not_negative, check_positive
from artiskill.errors import AssetError
from artiskill.geometry.arrays import Array, clamp, namespace, norm
from artiskill.scene.scene import Scene
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.fields import ObservationField, object_fields, robot_fields, robot_size, write_robot

WHOLE = "base"  # the target of tasks that move the whole object
MASK_NAMES = ("robot",)
_ROOT_SIZE = 13  # position, orientation, linear and angular velocity


@dataclass(frozen=True)
class StandingConfig:
    """When an object counts as standing still at its target.

    Attributes:
        near_m: greatest distance of its root from the target, in the plane.
        max_tilt_rad: greatest angle of its z axis with the vertical.
        max_speed_m_s: of its root, for it to count as still.
        max_angular_speed_rad_s: likewise.
        hold_s: how long each condition must hold before it counts.
    """

    near_m: float
    max_tilt_rad: float
    max_speed_m_s: float
    max_angular_speed_rad_s: float
    hold_s: float

    def __post_init__(self) -> None:
        check_positive(self, "near_m", "max_tilt_rad", "max_speed_m_s", "max_angular_speed_rad_s")
        check_not_negative(self, "hold_s")


@dataclass(frozen=True, eq=False)
class Stand:
    """How an object stands, measured once per snapshot: all (B,)."""

    snapshot: Snapshot

    @cached_property
    def distance_m(self) -> Array:
        """From the origin, where the target is, in the plane."""
        return norm(self.snapshot.link_position_w[:, 0, :2])

    @cached_property
    def tilt_rad(self) -> Array:
        """Angle of the root's z axis with the vertical, 0 to pi."""
        xp = namespace(self.snapshot.link_rotation_w)
        return xp.acos(clamp(self.snapshot.link_rotation_w[:, 0, 2, 2], -1.0, 1.0))

    @cached_property
    def speed_m_s(self) -> Array:
        """Of the root, over the last step."""
        return self.snapshot.link_speed_m_s[:, 0]

    @cached_property
    def angular_speed_rad_s(self) -> Array:
        """Of the root, over the last step."""
        return self.snapshot.link_angular_speed_rad_s[:, 0]

    @cached_property
    def approach_speed_m_s(self) -> Array:
        """How fast the root nears the target, in the plane; negative away from it."""
        xp = namespace(self.snapshot.link_position_w)
        position = self.snapshot.link_position_w[:, 0, :2]
        toward = xp.vecdot(position, self.snapshot.root_velocity_w[:, :2])
        return -toward / xp.maximum(self.distance_m, xp.asarray(1e-6, dtype=position.dtype))

    def near(self, config: StandingConfig) -> Array:
        """Whether it is near its target, (B,) bool."""
        return self.distance_m <= config.near_m

    def upright(self, config: StandingConfig) -> Array:
        """Whether it stands upright, (B,) bool."""
        return self.tilt_rad <= config.max_tilt_rad

    def still(self, config: StandingConfig) -> Array:
        """Whether it stands still, (B,) bool."""
        slow = self.speed_m_s <= config.max_speed_m_s
        return slow & (self.angular_speed_rad_s <= config.max_angular_speed_rad_s)


def state_fields(max_joints: int, arms: int, props: tuple[str, ...] = ()) -> tuple[ObservationField, ...]:
    """What the numbers of the state vector are, in order; `props` are the free ones."""
    return (
        *object_fields(max_joints),
        *(
            ObservationField(f"{name} {what}, world frame", 3, bound, unit)
            for name in props
            for what, bound, unit in (("position", 20.0, "m"), ("velocity", 100.0, "m/s"))
        ),
        *robot_fields(arms),
    )


def observe_standing_state(snapshot: Snapshot, goal: object, max_joints: int) -> Array:
    """The state vector, (B, D) float32: object, free props, robot; see `state_fields`. The goal is at the origin.

    Raises:
        AssetError: the object has more joints than the vector has slots.
    """
    xp = namespace(snapshot.object_qpos)
    batch, joints = snapshot.object_qpos.shape
    if joints > max_joints:
        raise AssetError(
            f"an object with {joints} joints does not fit a state vector with max_object_joints = {max_joints}; "
            "raise that value in the task's config"
        )
    props = snapshot.prop_position_w.shape[1]
    start = _ROOT_SIZE + 2 * max_joints
    values = xp.zeros((batch, start + 6 * props + robot_size(snapshot)), dtype=xp.float32)
    values[:, 0:3] = snapshot.link_position_w[:, 0]
    values[:, 3:7] = snapshot.link_quaternion_w[:, 0]
    values[:, 7:13] = snapshot.root_velocity_w
    values[:, _ROOT_SIZE : _ROOT_SIZE + joints] = snapshot.object_qpos
    values[:, _ROOT_SIZE + max_joints : _ROOT_SIZE + max_joints + joints] = snapshot.object_qvel
    for k in range(props):
        values[:, start : start + 3] = snapshot.prop_position_w[:, k]
        values[:, start + 3 : start + 6] = snapshot.prop_velocity_w[:, k]
        start += 6
    write_robot(snapshot, values[:, start:])
    return values


def robot_mask(scene: Scene, target: str) -> np.ndarray:
    """Which of `Scene.visuals` belong to the robot, (1, G) bool: the object is not told apart."""
    robot_bodies = [scene.model.body(name).id for name in scene.robot.bodies]
    return np.isin([body for body, _ in scene.visuals], robot_bodies)[None]

"""What the tasks with free objects share: where the object stands, how it leans and moves, what masks show."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from artiskill.config import check_not_negative, check_positive
from artiskill.geometry.arrays import Array, arccos, clip, dot, namespace, norm
from artiskill.scene.scene import Scene
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.fields import (
    ObservationField,
    object_fields,
    object_size,
    robot_fields,
    robot_size,
    write_object,
    write_robot,
)
from artiskill.tasks.staged_reward import Ramp, Stage

# The last stage begins a little nearer than near: an object that arrives slowly, and so counts as still, would
# otherwise skip the stage before it.
SAFELY_NEAR = 0.95
# Measures of how an object arrives, in the order of `Stand.arrival`: its distance over what counts as near, its
# tilt over what counts as upright, its speeds over what counts as still.
ARRIVAL = ("near", "lean", "speed", "angular_speed")
MASK_NAMES = ("robot",)


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


def arrival_stages(braking: str, arrived: str, asks: tuple[str, ...]) -> tuple[Stage, Stage]:
    """The last two stages of a task that brings an object somewhere: near, and near, upright and still."""
    braking_ends = (
        Ramp("speed", 3.0, 1.0),
        Ramp("angular_speed", 3.0, 1.0),
        Ramp("lean", 2.0, 1.0),
        Ramp("near", 1.0, SAFELY_NEAR),
    )
    inside = (
        Ramp("speed", 1.0, 0.8),
        Ramp("angular_speed", 1.0, 0.8),
        Ramp("lean", 1.0, 0.8),
        Ramp("near", SAFELY_NEAR, 0.9),
    )
    return (
        Stage(braking, asks, enters=(Ramp("near", 1.0, SAFELY_NEAR),), leaves=braking_ends),
        Stage(arrived, asks, enters=inside),
    )


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
        return arccos(clip(self.snapshot.link_rotation_w[:, 0, 2, 2], -1.0, 1.0))

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
        toward = dot(position, self.snapshot.root_velocity_w[:, :2])
        return -toward / xp.maximum(self.distance_m, xp.asarray(1e-6, dtype=position.dtype))

    def arrival(self, config: StandingConfig) -> tuple[Array, Array, Array, Array]:
        """The measures of `ARRIVAL`, each (B,)."""
        return (
            self.distance_m / config.near_m,
            self.tilt_rad / config.max_tilt_rad,
            self.speed_m_s / config.max_speed_m_s,
            self.angular_speed_rad_s / config.max_angular_speed_rad_s,
        )

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
    props, start = snapshot.prop_position_w.shape[1], object_size(max_joints)
    size = start + 6 * props + robot_size(snapshot)
    values = xp.zeros((snapshot.object_qpos.shape[0], size), dtype=xp.float32)
    write_object(snapshot, max_joints, values[:, :start])
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

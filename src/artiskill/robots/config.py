"""What a robot's YAML holds: base, lift, torso, where arms sit, drives and the meaning of actions."""

from dataclasses import dataclass, fields
from typing import Literal

from artiskill.config import (
    check,
    check_inside,
    check_not_negative,
    check_positive,
    check_range,
    check_vector,
    load_config,
)
from artiskill.errors import ConfigError, UnknownNameError
from artiskill.robots.arm_config import BodyConfig, ShapeConfig, load_arm, robot_file


@dataclass(frozen=True)
class MountConfig:
    """Where an arm's first joint sits on the torso; `side` prefixes its names."""

    side: Literal["right", "left"]
    position_m: tuple[float, ...]
    rpy_rad: tuple[float, ...]

    def __post_init__(self) -> None:
        check_vector(self, "position_m", "rpy_rad")


@dataclass(frozen=True)
class SlidingConfig:
    """A part that slides: the base along world x and y (it also turns about z), the lifted column along z."""

    range_m: tuple[float, ...]
    body: BodyConfig
    collisions: tuple[ShapeConfig, ...]

    def __post_init__(self) -> None:
        check_range(self, "range_m")


@dataclass(frozen=True)
class TorsoConfig:
    """The torso, rigid on the column."""

    position_m: tuple[float, ...]
    body: BodyConfig
    collisions: tuple[ShapeConfig, ...]

    def __post_init__(self) -> None:
        check_vector(self, "position_m")


@dataclass(frozen=True)
class DriveConfig:
    """Velocity drives: force = damping * (filtered target - velocity); fingers: position servos.

    Attributes:
        filter_cutoff_hz: of the first-order low-pass before each velocity drive.
        base_damping: N s/m, and N m s/rad for the yaw.
        lift_damping: N s/m.
        arm_damping: N m s/rad.
        finger_stiffness: N/m.
        finger_damping: N s/m.
        joint_friction: N m or N, in every robot joint.
        arm_armature: kg m^2, reflected rotor inertia.
        finger_armature: kg.
    """

    filter_cutoff_hz: float
    base_damping: float
    lift_damping: float
    arm_damping: float
    finger_stiffness: float
    finger_damping: float
    joint_friction: float
    arm_armature: float
    finger_armature: float

    def __post_init__(self) -> None:
        check_positive(self, "filter_cutoff_hz", "base_damping", "lift_damping", "arm_damping", "finger_stiffness")
        check_not_negative(self, "finger_damping", "joint_friction", "arm_armature", "finger_armature")


@dataclass(frozen=True)
class ActionConfig:
    """What an action of +1 means; fingers map [-1, 1] to their range.

    Attributes:
        base_velocity_m_s: of the base along its own x and y.
        yaw_rate_rad_s: of the base.
        lift_velocity_m_s: of the lift.
        arm_velocity_rad_s: of an arm's joint.
        hand_velocity_m_s: of a hand along its own axes, in operational space.
        hand_rate_rad_s: of a hand about its own axes, in operational space.
        null_rate_rad_s: of an arm's joints, as a vector, along the motion that leaves the hand in place.
    """

    base_velocity_m_s: float
    yaw_rate_rad_s: float
    lift_velocity_m_s: float
    arm_velocity_rad_s: float
    hand_velocity_m_s: float
    hand_rate_rad_s: float
    null_rate_rad_s: float

    def __post_init__(self) -> None:
        check_positive(self, *(f.name for f in fields(self)))


@dataclass(frozen=True)
class InitialConfig:
    """Joint values at the start of every episode."""

    arm_qpos_rad: tuple[float, ...]
    finger_qpos_m: float


@dataclass(frozen=True)
class RobotConfig:
    """A robot: base, lift, torso and one arm per mount."""

    name: str
    arm: str
    mounts: tuple[MountConfig, ...]
    base: SlidingConfig
    lift: SlidingConfig
    torso: TorsoConfig
    drives: DriveConfig
    actions: ActionConfig
    initial: InitialConfig

    def __post_init__(self) -> None:
        sides = [m.side for m in self.mounts]
        differ = bool(sides) and len(set(sides)) == len(sides)
        check(differ, f"mounts need one or two different sides, not {sides}")
        try:
            arm = load_arm(self.arm)
        except UnknownNameError as error:
            raise ConfigError(str(error)) from error
        given, count = self.initial.arm_qpos_rad, len(arm.joints)
        check(len(given) == count, f"initial.arm_qpos_rad needs {count} numbers, one per joint, not {len(given)}")
        for joint, value in zip(arm.joints, given, strict=True):
            check_inside(f"initial.arm_qpos_rad: {joint.name}", value, joint.range_rad)
        check_inside("initial.finger_qpos_m", self.initial.finger_qpos_m, arm.finger.range_m)


def load_robot(name: str) -> RobotConfig:
    """A robot that comes with the package, by name.

    Raises:
        UnknownNameError: there is no such robot.
    """
    return load_config(RobotConfig, robot_file("robot", name, has_key="mounts"))

"""What a robot's YAML holds: kinematics, inertias, collision shapes, drives and the meaning of actions."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Literal

from artiskill.config import CONFIG_DIR, check, load_config
from artiskill.errors import ConfigError, UnknownNameError

ROBOT_DIR = CONFIG_DIR / "robots"
_SIZES = {"box": 3, "capsule": 2, "cylinder": 2, "sphere": 1}  # numbers in a shape's size


@dataclass(frozen=True)
class BodyConfig:
    """Mass, centre of mass in the link's frame, and principal inertia about it."""

    mass_kg: float
    center_of_mass_m: tuple[float, ...]
    inertia_kgm2: tuple[float, ...]

    def __post_init__(self) -> None:
        _check_positive(self, "mass_kg")
        _check_vector(self, "center_of_mass_m", "inertia_kgm2")
        a, b, c = sorted(self.inertia_kgm2)
        check(a > 0 and a + b >= c, f"no body has the principal moments inertia_kgm2 {list(self.inertia_kgm2)}")


@dataclass(frozen=True)
class ShapeConfig:
    """A collision shape; sizes as in `assets.articulated_object.CollisionShape`."""

    kind: Literal["box", "capsule", "cylinder", "sphere"]
    size: tuple[float, ...]
    position_m: tuple[float, ...]
    rpy_rad: tuple[float, ...] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        _check_vector(self, "position_m", "rpy_rad")
        count = _SIZES.get(self.kind, len(self.size))
        check(
            len(self.size) == count and all(0 < x < math.inf for x in self.size),
            f"a {self.kind} has {count} sizes, all positive, not {list(self.size)}",
        )


@dataclass(frozen=True)
class ArmJointConfig:
    """A hinge about its own z axis; the frame is given in the previous joint's."""

    name: str
    rpy_rad: tuple[float, ...]
    position_m: tuple[float, ...]
    range_rad: tuple[float, ...]
    effort_nm: float

    def __post_init__(self) -> None:
        _check_vector(self, "rpy_rad", "position_m")
        _check_range(self, "range_rad")
        _check_positive(self, "effort_nm")


@dataclass(frozen=True)
class ArmLinkConfig:
    """The link behind a joint."""

    name: str
    body: BodyConfig
    collisions: tuple[ShapeConfig, ...]


@dataclass(frozen=True)
class HandConfig:
    """The hand, rigid on the last link."""

    position_m: tuple[float, ...]
    rpy_rad: tuple[float, ...]
    body: BodyConfig
    collisions: tuple[ShapeConfig, ...]

    def __post_init__(self) -> None:
        _check_vector(self, "position_m", "rpy_rad")


@dataclass(frozen=True)
class FingerConfig:
    """One finger, which slides along its +y; the other is the same, turned by pi about z."""

    position_m: tuple[float, ...]
    range_m: tuple[float, ...]
    effort_n: float
    body: BodyConfig
    tip_m: tuple[float, ...]
    pad_m: tuple[float, ...]
    line_start_m: tuple[float, ...]
    collisions: tuple[ShapeConfig, ...]

    def __post_init__(self) -> None:
        _check_vector(self, "position_m", "tip_m", "pad_m", "line_start_m")
        _check_range(self, "range_m")
        _check_positive(self, "effort_n")


@dataclass(frozen=True)
class ArmConfig:
    """An arm: as many links as joints, then hand and fingers."""

    joints: tuple[ArmJointConfig, ...]
    links: tuple[ArmLinkConfig, ...]
    hand: HandConfig
    finger: FingerConfig

    def __post_init__(self) -> None:
        check(
            len(self.joints) == len(self.links),
            f"an arm needs one link per joint, not {len(self.links)} links for {len(self.joints)} joints",
        )


@dataclass(frozen=True)
class MountConfig:
    """Where an arm's first joint sits on the torso; `side` prefixes its names."""

    side: Literal["right", "left"]
    position_m: tuple[float, ...]
    rpy_rad: tuple[float, ...]

    def __post_init__(self) -> None:
        _check_vector(self, "position_m", "rpy_rad")


@dataclass(frozen=True)
class BaseConfig:
    """The base, which slides along world x and y and turns about z."""

    range_m: tuple[float, ...]
    body: BodyConfig

    def __post_init__(self) -> None:
        _check_range(self, "range_m")


@dataclass(frozen=True)
class LiftConfig:
    """The lifted column."""

    range_m: tuple[float, ...]
    body: BodyConfig
    collisions: tuple[ShapeConfig, ...]

    def __post_init__(self) -> None:
        _check_range(self, "range_m")


@dataclass(frozen=True)
class TorsoConfig:
    """The torso, rigid on the column."""

    position_m: tuple[float, ...]
    body: BodyConfig
    collisions: tuple[ShapeConfig, ...]

    def __post_init__(self) -> None:
        _check_vector(self, "position_m")


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
        _check_positive(
            self, "filter_cutoff_hz", "base_damping", "lift_damping", "arm_damping", "finger_stiffness"
        )
        for name in ("finger_damping", "joint_friction", "arm_armature", "finger_armature"):
            _check_value(self, name, 0 <= getattr(self, name) < math.inf, "must not be negative, and finite")


@dataclass(frozen=True)
class ActionConfig:
    """What an action of +1 means; fingers map [-1, 1] to their range."""

    base_velocity_m_s: float
    yaw_rate_rad_s: float
    lift_velocity_m_s: float
    arm_velocity_rad_s: float

    def __post_init__(self) -> None:
        _check_positive(self, *(f.name for f in fields(self)))


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
    base: BaseConfig
    lift: LiftConfig
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
            _check_inside(f"initial.arm_qpos_rad: {joint.name}", value, joint.range_rad)
        _check_inside("initial.finger_qpos_m", self.initial.finger_qpos_m, arm.finger.range_m)


def load_robot(name: str) -> RobotConfig:
    """A robot that comes with the package, by name.

    Raises:
        UnknownNameError: there is no such robot.
    """
    return load_config(RobotConfig, _robot_file("robot", name, has_key="mounts"))


@cache
def load_arm(name: str) -> ArmConfig:
    """An arm that comes with the package, by name; errors as of `load_robot`."""
    return load_config(ArmConfig, _robot_file("arm", name, has_key="joints"))


def _robot_file(kind: str, name: str, has_key: str) -> Path:
    texts = {path: path.read_text(encoding="utf-8") for path in ROBOT_DIR.glob("*.yaml")}
    files = {path.stem: path for path, text in texts.items() if f"\n{has_key}:" in "\n" + text}
    if name not in files:
        raise UnknownNameError(kind, name, files)
    return files[name]


def _check_vector(config: object, *names: str) -> None:
    for name in names:
        value = getattr(config, name)
        _check_value(config, name, len(value) == 3 and all(map(math.isfinite, value)), "needs three numbers")


def _check_range(config: object, name: str) -> None:
    value = getattr(config, name)
    legal = len(value) == 2 and -math.inf < value[0] < value[1] < math.inf
    _check_value(config, name, legal, "must be a lower and a higher number")


def _check_positive(config: object, *names: str) -> None:
    for name in names:
        _check_value(config, name, 0 < getattr(config, name) < math.inf, "must be positive, and finite")


def _check_value(config: object, name: str, legal: bool, rule: str) -> None:
    owner = getattr(config, "name", "")
    check(legal, f"{owner}{': ' if owner else ''}{name} {rule}, not {getattr(config, name)}")


def _check_inside(what: str, value: float, limits: Sequence[float]) -> None:
    check(limits[0] <= value <= limits[1], f"{what} must lie in {list(limits)}, not {value}")

"""What a robot's YAML holds: kinematics, inertias, collision shapes, drives and the meaning of actions."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from artiskill.config import CONFIG_DIR, check, load_config
from artiskill.errors import UnknownNameError

ROBOT_DIR = CONFIG_DIR / "robots"


@dataclass(frozen=True)
class BodyConfig:
    """Mass, centre of mass in the link's frame, and principal inertia about it."""

    mass_kg: float
    center_of_mass_m: tuple[float, ...]
    inertia_kgm2: tuple[float, ...]

    def __post_init__(self) -> None:
        check(self.mass_kg > 0, f"mass_kg must be positive, not {self.mass_kg}")
        check(len(self.center_of_mass_m) == 3, "center_of_mass_m needs three numbers")
        check(
            len(self.inertia_kgm2) == 3 and min(self.inertia_kgm2) > 0, "inertia_kgm2 needs three positive numbers"
        )


@dataclass(frozen=True)
class ShapeConfig:
    """A collision shape; sizes as in `assets.articulated_object.CollisionShape`."""

    kind: Literal["box", "capsule", "cylinder", "sphere"]
    size: tuple[float, ...]
    position_m: tuple[float, ...]
    rpy_rad: tuple[float, ...] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class ArmJointConfig:
    """A hinge about its own z axis; the frame is given in the previous joint's."""

    name: str
    rpy_rad: tuple[float, ...]
    position_m: tuple[float, ...]
    range_rad: tuple[float, ...]
    effort_nm: float


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


@dataclass(frozen=True)
class BaseConfig:
    """The base, which slides along world x and y and turns about z."""

    range_m: tuple[float, ...]
    body: BodyConfig


@dataclass(frozen=True)
class LiftConfig:
    """The lifted column."""

    range_m: tuple[float, ...]
    body: BodyConfig
    collisions: tuple[ShapeConfig, ...]


@dataclass(frozen=True)
class TorsoConfig:
    """The torso, rigid on the column."""

    position_m: tuple[float, ...]
    body: BodyConfig
    collisions: tuple[ShapeConfig, ...]


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
        check(self.filter_cutoff_hz > 0, f"filter_cutoff_hz must be positive, not {self.filter_cutoff_hz}")


@dataclass(frozen=True)
class ActionConfig:
    """What an action of +1 means; fingers map [-1, 1] to their range."""

    base_velocity_m_s: float
    yaw_rate_rad_s: float
    lift_velocity_m_s: float
    arm_velocity_rad_s: float


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
        check(
            bool(sides) and len(set(sides)) == len(sides), f"mounts need one or two different sides, not {sides}"
        )


def load_robot(name: str) -> RobotConfig:
    """A robot that comes with the package, by name.

    Raises:
        UnknownNameError: there is no such robot.
    """
    return load_config(RobotConfig, _robot_file("robot", name, has_key="mounts"))


def load_arm(name: str) -> ArmConfig:
    """An arm that comes with the package, by name."""
    return load_config(ArmConfig, _robot_file("arm", name, has_key="joints"))


def _robot_file(kind: str, name: str, has_key: str) -> Path:
    files = {
        p.stem: p for p in ROBOT_DIR.glob("*.yaml") if f"\n{has_key}:" in "\n" + p.read_text(encoding="utf-8")
    }
    if name not in files:
        raise UnknownNameError(kind, name, files)
    return files[name]

"""What a robot's YAML holds: base, lift, torso, where arms sit, drives and the meaning of actions."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal

from artiskill.config import (
    check,
    check_inside,
    check_not_negative,
    check_positive,
    check_range,
    check_vector,
    from_mapping,
    load_yaml,
    merge_overrides,
)
from artiskill.errors import ConfigError, UnknownNameError, shown
from artiskill.files import check_path
from artiskill.robots.arm_config import BodyConfig, ShapeConfig, load_arm, robot_file

LIKE = "like"  # the key that names the robot whose values are taken where a mapping says nothing else


@dataclass(frozen=True)
class MountConfig:
    """Where an arm's first joint sits on the torso.

    Attributes:
        side: prefixes the names of its parts.
        position_m: in the torso's frame.
        rpy_rad: orientation there, roll, pitch, yaw.
    """

    side: Literal["right", "left"]
    position_m: tuple[float, ...]
    rpy_rad: tuple[float, ...]

    def __post_init__(self) -> None:
        check_vector(self, "position_m", "rpy_rad")


@dataclass(frozen=True)
class SlidingConfig:
    """A part that slides: the base along world x and y (it also turns about z), the lifted column along z.

    Attributes:
        range_m: lowest and highest joint value.
        body: mass and inertia.
        collisions: what collides.
    """

    range_m: tuple[float, ...]
    body: BodyConfig
    collisions: tuple[ShapeConfig, ...]

    def __post_init__(self) -> None:
        check_range(self, "range_m")


@dataclass(frozen=True)
class TorsoConfig:
    """The torso, rigid on the column.

    Attributes:
        position_m: in the column's frame, whose origin is its top.
        body: mass and inertia.
        collisions: what collides.
    """

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
        base_damping: [N s/m] of the base; of its yaw in N m s/rad.
        lift_damping: [N s/m] of the lift.
        arm_damping: [N m s/rad] of an arm's joints.
        finger_stiffness: [N/m] of a finger's servo.
        finger_damping: [N s/m] of a finger's servo.
        joint_friction: [N, N m] dry friction in every robot joint.
        arm_armature: [kg m²] rotor inertia of an arm's joints, as they feel it.
        finger_armature: [kg] the same of a finger.
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
    """Joint values at the start of every episode.

    Attributes:
        arm_qpos_rad: of each arm, one number per joint.
        finger_qpos_m: of each finger: half the opening.
    """

    arm_qpos_rad: tuple[float, ...]
    finger_qpos_m: float


@dataclass(frozen=True)
class RobotConfig:
    """A robot: base, lift, torso and one arm per mount.

    Attributes:
        name: what it is called.
        arm: the arm that sits on each mount; `panda` is the one that comes with the package.
        mounts: where the arms sit.
        base: the mobile base.
        lift: the lifted column.
        torso: the torso on the column.
        drives: how its joints are driven.
        actions: what an action of +1 means.
        initial: how it stands when an episode starts.
    """

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


def load_robot(given: str | Path | Mapping[str, Any]) -> RobotConfig:
    """A robot, as `robot_mapping` takes it.

    Raises:
        UnknownNameError: there is no such robot.
        ConfigError: its file cannot be read, or a value is unknown or illegal.
    """
    return from_mapping(RobotConfig, robot_mapping(given), source=f"robot {_title(given)}")


def robot_mapping(given: Any, folder: Path | None = None) -> dict[str, Any]:
    """The plain values of a robot, with `like` resolved.

    Args:
        given: the name of a robot that comes with the package; the path of a YAML file (it ends in `.yaml` or
            `.yml`); or values, which change the robot of such a name or path in the key `like`, if there is one.
        folder: what relative paths start from; by default the working directory.

    Raises:
        UnknownNameError: there is no such robot.
        ConfigError: a file cannot be read, or robots are like one another in a circle.
    """
    return _resolved(given, folder or Path(), ())


def _resolved(given: Any, folder: Path, seen: tuple[Path, ...]) -> dict[str, Any]:
    if isinstance(given, Mapping):
        own = {key: value for key, value in given.items() if key != LIKE}
        return merge_overrides(_resolved(given[LIKE], folder, seen), own) if LIKE in given else own
    if not isinstance(given, str | Path):
        raise ConfigError(
            f"a robot is a name, the path of a YAML file, or a mapping of values, not {shown(given)}"
        )
    if Path(given).suffix not in (".yaml", ".yml"):
        return load_yaml(robot_file("robot", str(given), has_key="mounts"))
    try:
        path = (folder / check_path(given).expanduser()).resolve()
    except (OSError, RuntimeError) as error:  # the latter of links in a circle, and of ~nobody
        said = getattr(error, "strerror", None) or error
        raise ConfigError(f"cannot read the robot {shown(str(given))}: {said}") from error
    if path in seen:
        raise ConfigError(f"robot {str(given)!r} is like itself: {' -> '.join(p.name for p in (*seen, path))}")
    return _resolved(load_yaml(path), path.parent, (*seen, path))


def _title(given: object) -> str:
    return shown(str(given)) if isinstance(given, str | Path) else "config"

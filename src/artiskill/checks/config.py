"""Limits and settings of the checks; the values stand in `configs/checks.yaml`."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

from artiskill.assets.similarity import DescriptorConfig
from artiskill.config import (
    CONFIG_DIR,
    check,
    check_not_negative,
    check_positive,
    check_range,
    load_config,
)
from artiskill.errors import UnknownNameError


@dataclass(frozen=True)
class SweepConfig:
    """At how many places a joint is looked at, links being geometry only.

    Attributes:
        steps: of a joint with limits, from one to the other.
        steps_per_turn: of a joint without limits.
        combinations: random values of all joints at once, for categories whose joints never hinder one another.
    """

    steps: int
    steps_per_turn: int
    combinations: int

    def __post_init__(self) -> None:
        check_positive(self, "steps", "steps_per_turn")
        check_not_negative(self, "combinations")


@dataclass(frozen=True)
class DriveConfig:
    """With what joints are driven through their ranges in the simulation.

    Attributes:
        force_n: on a sliding joint.
        torque_nm: on a turning joint.
        wheel_torque_nm: on casters and wheels.
        time_s: to get from one limit to the other.
        reach: share of the range that must be covered.
    """

    force_n: float
    torque_nm: float
    wheel_torque_nm: float
    time_s: float
    reach: float

    def __post_init__(self) -> None:
        check_positive(self, *(f.name for f in fields(self)))


@dataclass(frozen=True)
class SettleConfig:
    """What stands must stay: how long it is watched, how far it may move and lean."""

    time_s: float
    drift_m: float
    tilt_deg: float

    def __post_init__(self) -> None:
        check_positive(self, *(f.name for f in fields(self)))


@dataclass(frozen=True)
class PushConfig:
    """A push that a chair must follow without tipping, and a torque that must turn its seat.

    Attributes:
        force_n: horizontal, at most.
        weight_share: and at most this share of the chair's weight.
        height_share: height of the push as a share of the chair's, where metadata has no `seat_height_m`.
        time_s: how long force or torque act.
        coast_s: how long the chair is watched after that.
        directions: horizontal, evenly spread.
        distance_m: how far it must have moved.
        tilt_deg: how far it may lean meanwhile.
        torque_nm: about the vertical, on the seat.
        swivel_deg: how far the seat must have turned against the base.
    """

    force_n: float
    weight_share: float
    height_share: float
    time_s: float
    coast_s: float
    directions: int
    distance_m: float
    tilt_deg: float
    torque_nm: float
    swivel_deg: float

    def __post_init__(self) -> None:
        check_positive(self, *(f.name for f in fields(self)))


@dataclass(frozen=True)
class BallConfig:
    """A ball that a bucket must hold.

    Attributes:
        radius_m: of the ball.
        density_kg_m3: of the ball.
        drop_m: height of its centre above the rim.
        offset: how far from the middle it falls in too, as a share of what the mouth leaves it.
        speed_m_s: with which it then moves outwards.
        time_s: how long it is watched.
    """

    radius_m: float
    density_kg_m3: float
    drop_m: float
    offset: float
    speed_m_s: float
    time_s: float

    def __post_init__(self) -> None:
        check_positive(self, *(f.name for f in fields(self)))


@dataclass(frozen=True)
class SurfacesConfig:
    """How well what is touched must follow what is drawn.

    Attributes:
        points: samples of each surface of a link.
        percentile: of the samples' distances that the limit applies to.
        distance_m: the limit.
        solid_share: largest share of a drawn hollow that may be solid to the touch.
    """

    points: int
    percentile: float
    distance_m: float
    solid_share: float

    def __post_init__(self) -> None:
        check_positive(self, "points", "distance_m")
        check_range_of_percent(self.percentile)
        check_not_negative(self, "solid_share")


@dataclass(frozen=True)
class GripConfig:
    """How the gripper is tried on handles.

    Attributes:
        robot: whose gripper and reach are meant.
        penetration_m: of the gripper into the object or the ground that still counts as free.
        opening_m: of each finger, when open.
        step_m: by which fingers close.
        near_handle_m: a pad that touches the link this near to the handle's hull touches the handle.
        pull_m: a hooked finger that is pulled this far must have met the handle.
        reach_m: of the arm, from its first joint to between the pads.
        stand_off_m: horizontal distance of that joint to the handle in front of the object.
    """

    robot: str
    penetration_m: float
    opening_m: float
    step_m: float
    near_handle_m: float
    pull_m: float
    reach_m: float
    stand_off_m: float

    def __post_init__(self) -> None:
        check_positive(self, *(f.name for f in fields(self) if f.name != "robot"))


@dataclass(frozen=True)
class DynamicsConfig:
    """Friction (N or N m) and damping (N s/m or N m s/rad) of a joint: the highest that tasks draw."""

    friction: float
    damping: float

    def __post_init__(self) -> None:
        check_not_negative(self, "friction", "damping")


@dataclass(frozen=True)
class CategoryConfig:
    """What holds for one category.

    Attributes:
        triangles: at most.
        geoms: collision shapes, at most.
        mass_kg: lowest and highest, of the whole.
        link_mass_kg: lowest and highest, of each moving link.
        ground_friction: of the ground, as in the category's task.
        object_friction: of the object, likewise; wheels have their own.
        joints: of all joints but wheels.
        wheels: of joints that carry nothing but wheels: casters and the wheels themselves.
    """

    triangles: int
    geoms: int
    mass_kg: tuple[float, ...]
    link_mass_kg: tuple[float, ...]
    ground_friction: float
    object_friction: float
    joints: DynamicsConfig
    wheels: DynamicsConfig

    def __post_init__(self) -> None:
        check_positive(self, "triangles", "geoms")
        check_range(self, "mass_kg", "link_mass_kg", lowest=0.0)
        check_not_negative(self, "ground_friction", "object_friction")


@dataclass(frozen=True)
class ChecksConfig:
    """All of it.

    Attributes:
        penetration_m: of links into one another that is still called touching.
        bearing_parts: names of parts that may run into the parent's or child's, as a pin does into its hinge.
        categories: by name of the category.
    """

    penetration_m: float
    bearing_parts: tuple[str, ...]
    sweep: SweepConfig
    drive: DriveConfig
    settle: SettleConfig
    push: PushConfig
    ball: BallConfig
    surfaces: SurfacesConfig
    grip: GripConfig
    descriptor: DescriptorConfig
    categories: dict[str, CategoryConfig]

    def __post_init__(self) -> None:
        check_positive(self, "penetration_m")

    def of(self, category: str) -> CategoryConfig:
        """The values of one category.

        Raises:
            UnknownNameError: it has none.
        """
        if category not in self.categories:
            raise UnknownNameError("category", category, self.categories, "(configs/checks.yaml)")
        return self.categories[category]


def check_range_of_percent(value: float) -> None:
    """Refuse what is no percentage."""
    check(0 <= value <= 100, f"percentile must lie in [0, 100], not {value}")


def load_checks_config(overrides: Mapping[str, Any] | None = None) -> ChecksConfig:
    """The config of the package, with values changed: `{"settle.drift_m": 0.001}`.

    Raises:
        ConfigError: an unknown key or a value that is not legal.
    """
    return load_config(ChecksConfig, CONFIG_DIR / "checks.yaml", overrides)


@cache
def default_checks_config() -> ChecksConfig:
    """The config of the package."""
    return load_checks_config()

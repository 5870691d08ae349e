"""Limits and settings of the checks; the values stand in `configs/checks.yaml`."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

from artiskill.assets.similarity import DescriptorConfig
from artiskill.config import CONFIG_DIR, check, check_not_negative, check_positive, check_range, load_config
from artiskill.errors import UnknownNameError


class _PositiveNumbers:
    """Base of configs whose numbers must all be positive."""

    def __post_init__(self) -> None:
        numbers = (f.name for f in fields(self) if f.type is not str)  # type: ignore[arg-type]
        check_positive(self, *numbers)


@dataclass(frozen=True)
class SweepConfig:
    """At how many places a joint is looked at, links being geometry only."""

    steps: int  # of a joint with limits, from one to the other
    steps_per_turn: int  # of a joint without limits
    combinations: int  # random values of all joints at once, for categories whose joints never hinder one another

    def __post_init__(self) -> None:
        check_positive(self, "steps", "steps_per_turn")
        check_not_negative(self, "combinations")


@dataclass(frozen=True)
class DriveConfig(_PositiveNumbers):
    """With what joints are driven through their ranges in the simulation."""

    force_n: float  # on a sliding joint
    torque_nm: float  # on a turning joint
    wheel_torque_nm: float  # on casters and wheels
    time_s: float  # to get from one limit to the other
    reach: float  # share of the range that must be covered


@dataclass(frozen=True)
class SettleConfig(_PositiveNumbers):
    """How long an object on the ground is watched, and how far it may move and lean."""

    time_s: float
    drift_m: float
    tilt_deg: float


@dataclass(frozen=True)
class PushConfig(_PositiveNumbers):
    """A push that a chair must follow without tipping, and a torque that must turn its seat."""

    force_n: float  # horizontal, at most
    weight_share: float  # and at most this share of the chair's weight
    height_share: float  # height of the push as a share of the chair's, where metadata has no `seat_height_m`
    time_s: float  # how long force or torque act
    coast_s: float  # how long the chair is watched after that
    directions: int  # horizontal, evenly spread
    distance_m: float  # how far it must have moved
    tilt_deg: float  # how far it may lean meanwhile
    torque_nm: float  # about the vertical, on the seat
    swivel_deg: float  # how far the seat must have turned against the base


@dataclass(frozen=True)
class BallConfig(_PositiveNumbers):
    """A ball that a bucket must hold."""

    radius_m: float
    density_kg_m3: float
    drop_m: float  # height of its centre above the rim
    offset: float  # how far from the middle it is dropped too, as a share of the free half width of the mouth
    speed_m_s: float  # with which it then moves outwards
    time_s: float  # how long it is watched


@dataclass(frozen=True)
class SurfacesConfig:
    """How well collision shapes must follow the visual surfaces."""

    points: int  # samples of each surface of a link
    percentile: float  # of the samples' distances that the limit applies to
    distance_m: float  # the limit
    solid_share: float  # largest share of a drawer's visible cavity that collision shapes may fill

    def __post_init__(self) -> None:
        check_positive(self, "points", "distance_m")
        check(0 <= self.percentile <= 100, f"percentile must lie in [0, 100], not {self.percentile}")
        check_not_negative(self, "solid_share")


@dataclass(frozen=True)
class GripConfig(_PositiveNumbers):
    """How the gripper is tried on handles."""

    robot: str  # whose gripper and reach are meant
    penetration_m: float  # of the gripper into the object or the ground that still counts as free
    opening_m: float  # of each finger, when open
    step_m: float  # by which fingers close
    near_handle_m: float  # a pad that meets the link this near to the handle's hull meets the handle
    pull_m: float  # a hooked finger that is pulled this far must have met the handle
    reach_m: float  # of the arm, from its first joint to between the pads
    stand_off_m: float  # horizontal distance of that joint to the handle in front of the object


@dataclass(frozen=True)
class DynamicsConfig:
    """Friction (N or N m) and damping (N s/m or N m s/rad) of a joint: the highest that tasks draw."""

    friction: float
    damping: float

    def __post_init__(self) -> None:
        check_not_negative(self, "friction", "damping")


@dataclass(frozen=True)
class CategoryConfig:
    """What holds for one category."""

    triangles: int  # at most
    geoms: int  # collision shapes, at most
    mass_kg: tuple[float, ...]  # lowest and highest, of the whole
    link_mass_kg: tuple[float, ...]  # lowest and highest, of each moving link
    ground_friction: float  # as in the category's task
    object_friction: float  # as in the category's task; wheels have their own
    joints: DynamicsConfig  # of all joints but wheels
    wheels: DynamicsConfig  # of joints that carry nothing but wheels: casters and the wheels themselves

    def __post_init__(self) -> None:
        check_positive(self, "triangles", "geoms")
        check_range(self, "mass_kg", "link_mass_kg", lowest=0.0)
        check_not_negative(self, "ground_friction", "object_friction")


@dataclass(frozen=True)
class ChecksConfig:
    """All settings of the checks."""

    penetration_m: float  # of links into one another that still counts as touching
    bearing_parts: tuple[
        str, ...
    ]  # names of parts that may run into the parent's or child's, as a pin into its hinge
    sweep: SweepConfig
    drive: DriveConfig
    settle: SettleConfig
    push: PushConfig
    ball: BallConfig
    surfaces: SurfacesConfig
    grip: GripConfig
    descriptor: DescriptorConfig
    categories: dict[str, CategoryConfig]  # by name of the category

    def __post_init__(self) -> None:
        check_positive(self, "penetration_m")

    def of(self, category: str) -> CategoryConfig:
        """Return the values of one category.

        Raises:
            UnknownNameError: it has none.
        """
        if category not in self.categories:
            raise UnknownNameError("category", category, self.categories, "(configs/checks.yaml)")
        return self.categories[category]


def load_checks_config(overrides: Mapping[str, Any] | None = None) -> ChecksConfig:
    """Load the config of the package, with values changed: `{"settle.drift_m": 0.001}`.

    Raises:
        ConfigError: an unknown key or a value that is not legal.
    """
    return load_config(ChecksConfig, CONFIG_DIR / "checks.yaml", overrides)


@cache
def default_checks_config() -> ChecksConfig:
    """Return the config of the package."""
    return load_checks_config()

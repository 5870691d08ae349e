"""What an arm's YAML holds: its chain of joints, inertias, collision shapes, hand and fingers."""

import math
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from artiskill.config import CONFIG_DIR, check, check_positive, check_range, check_vector, load_config
from artiskill.errors import UnknownNameError
from artiskill.geometry.rotations import quat_from_rpy

ROBOT_DIR = CONFIG_DIR / "robots"
_SIZES = {"box": 3, "capsule": 2, "cylinder": 2, "sphere": 1}  # numbers in a shape's size


@dataclass(frozen=True)
class BodyConfig:
    """How a link weighs.

    Attributes:
        mass_kg: its mass.
        center_of_mass_m: in the link's frame.
        inertia_kgm2: principal moments about the centre of mass, along the link's axes.
    """

    mass_kg: float
    center_of_mass_m: tuple[float, ...]
    inertia_kgm2: tuple[float, ...]

    def __post_init__(self) -> None:
        check_positive(self, "mass_kg")
        check_vector(self, "center_of_mass_m", "inertia_kgm2")
        a, b, c = sorted(self.inertia_kgm2)
        check(a > 0 and a + b >= c, f"no body has the principal moments inertia_kgm2 {list(self.inertia_kgm2)}")


@dataclass(frozen=True)
class ShapeConfig:
    """A collision shape.

    Attributes:
        kind: which shape.
        size: [m] box: half lengths along x, y, z; capsule and cylinder: radius, and half length along z; sphere:
            radius.
        position_m: of its centre in the link's frame.
        rpy_rad: orientation there, roll, pitch, yaw.
    """

    kind: Literal["box", "capsule", "cylinder", "sphere"]
    size: tuple[float, ...]
    position_m: tuple[float, ...]
    rpy_rad: tuple[float, ...] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        check_vector(self, "position_m", "rpy_rad")
        count = _SIZES.get(self.kind, len(self.size))
        check(
            len(self.size) == count and all(0 < x < math.inf for x in self.size),
            f"a {self.kind} has {count} sizes, all positive, not {list(self.size)}",
        )

    @cached_property
    def quaternion(self) -> np.ndarray:
        """Orientation in the link's frame, (4,): remembered, since every scene asks for it."""
        return quat_from_rpy(self.rpy_rad)


@dataclass(frozen=True)
class ArmJointConfig:
    """A hinge about its own z axis; the frame is given in the previous joint's."""

    name: str
    rpy_rad: tuple[float, ...]
    position_m: tuple[float, ...]
    range_rad: tuple[float, ...]
    effort_nm: float

    def __post_init__(self) -> None:
        check_vector(self, "rpy_rad", "position_m")
        check_range(self, "range_rad")
        check_positive(self, "effort_nm")


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
        check_vector(self, "position_m", "rpy_rad")


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
        check_vector(self, "position_m", "tip_m", "pad_m", "line_start_m")
        check_range(self, "range_m")
        check_positive(self, "effort_n")


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


@cache
def load_arm(name: str) -> ArmConfig:
    """An arm that comes with the package, by name; errors as of `load_robot`."""
    return load_config(ArmConfig, robot_file("arm", name, has_key="joints"))


def robot_file(kind: str, name: str, has_key: str) -> Path:
    """The YAML file of a robot or arm, told from the others by a key that it has.

    Raises:
        UnknownNameError: there is none of this name.
    """
    texts = {path: path.read_text(encoding="utf-8") for path in ROBOT_DIR.glob("*.yaml")}
    files = {path.stem: path for path, text in texts.items() if f"\n{has_key}:" in "\n" + text}
    if name not in files:
        raise UnknownNameError(kind, name, files)
    return files[name]

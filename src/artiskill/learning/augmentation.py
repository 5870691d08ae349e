"""What else could have been seen and commanded: variations of steps, for policies that learn from few objects.

A mirrored step is as true as the step itself: world, robot and command, right and left exchanged. A robot with
one arm, at its side, has no mirror image. The other variations are of what a policy should not care about: how
large the object is around its handle, which points a sensor happens to give, and how exactly; and robots may stand
elsewhere (`learning/displacement.py`). NumPy only.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from artiskill.config import check_inside, check_not_negative
from artiskill.errors import ConfigError
from artiskill.learning.commands import GRIP_PHASES, CommandSpace
from artiskill.learning.displacement import Displacement
from artiskill.learning.observation import ObservationArrays

_FINGERS, _BASE = 2, 3
_MIRROR = np.array([1.0, -1.0, 1.0])  # of a place, and a hand's axes: its fingers change places
_TURN = -_MIRROR  # of an axis that something turns about
_PANDA = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0])  # its joints, seen in a mirror
_MOST_DISPLACED = 0.3  # metres, radians: beyond, inverse kinematics does not find where hands shall be
_HAND_RAD = np.pi / 2  # twice what the hand is turned by against the last joint


@dataclass(frozen=True)
class AugmentationConfig:
    """How steps are varied; zeros leave them as they are."""

    mirror: float = 0.0  # share of the steps that are mirrored
    stretch: float = (
        0.0  # points in no handle move away from it, or nearer, by up to this share, in each direction
    )
    jitter_m: float = 0.0  # standard deviation of each coordinate
    drop: float = 0.0  # up to this share of the points is missing
    unmask: float = 0.0  # up to this share of the points is in no mask
    cut: float = 0.0  # share of the steps without points below some height, but the robot's
    cut_m: float = 0.4  # that height at most
    displace: float = 0.0  # share of the steps whose robots stand elsewhere, and are led back
    displace_m: float = 0.06  # standard deviation of where their hands are, in each direction
    displace_rad: float = 0.2  # that of each component of the hands' rotation vectors

    def __post_init__(self) -> None:
        check_not_negative(self, "stretch", "jitter_m", "cut_m")
        for name in ("mirror", "drop", "unmask", "cut", "displace"):
            check_inside(name, getattr(self, name), (0, 1))
        for name in ("displace_m", "displace_rad"):
            check_inside(name, getattr(self, name), (0, _MOST_DISPLACED))


class Augmentation:
    """Variations of steps.

    Args:
        config: how they are varied.
        space: of the commands.
        frame: of the points: `world` or `robot`.
        masks: of a cloud; the last one is the robot's.

    Raises:
        ConfigError: a robot with one arm has no mirror image; there is no mask of a handle to stretch objects
            around; or robots with arms that are not commanded shall be displaced.
    """

    def __init__(self, config: AugmentationConfig, space: CommandSpace, frame: str, masks: int) -> None:
        if config.mirror and space.arms == 1:
            raise ConfigError(
                "augmentation.mirror is for robots with two arms; with one, at its side, it must be 0"
            )
        if config.stretch and masks < 2:
            raise ConfigError(
                "augmentation.stretch is for tasks whose first mask is a handle's; with the robot's mask alone it "
                "must be 0"
            )
        self.config, self._space = config, space
        self._displacement = (
            Displacement(space, frame, config.displace_m, config.displace_rad) if config.displace else None
        )

    def __call__(
        self, seen: ObservationArrays, labels: np.ndarray, rng: np.random.Generator
    ) -> tuple[ObservationArrays, np.ndarray]:
        """Return variations of B steps: what is seen, with points in `world` or `robot`, and commands (B, V)."""
        config, (count, points) = self.config, seen.valid.shape
        if config.mirror:
            rows = np.flatnonzero(rng.random(count) < config.mirror)
            seen, labels = _varied(rows, self.mirrored, seen, labels)
        if self._displacement is not None:
            rows = np.flatnonzero(rng.random(count) < config.displace)
            seen, labels = _varied(rows, partial(self._displacement, rng=rng), seen, labels)
        moved, masks, valid = seen.points, seen.masks, seen.valid
        if config.stretch:
            factors = (1.0 + config.stretch) ** rng.uniform(-1.0, 1.0, (count, 1, 3))
            moved = _stretched(moved, masks, factors)
        if config.jitter_m:
            moved = moved + rng.normal(0.0, config.jitter_m, moved.shape)
        if config.drop:
            valid = valid & (rng.random((count, points)) >= config.drop * rng.random((count, 1)))
        if config.cut:
            heights = np.where(rng.random((count, 1)) < config.cut, config.cut_m * rng.random((count, 1)), -np.inf)
            valid = valid & ((moved[..., 2] >= heights) | (masks[..., -1] > 0))
        if config.unmask:
            kept = rng.random((count, points)) >= config.unmask * rng.random((count, 1))
            masks = masks * kept[..., None].astype(masks.dtype)
        return seen._replace(points=moved.astype(np.float32), masks=masks, valid=valid), labels

    def mirrored(self, seen: ObservationArrays, labels: np.ndarray) -> tuple[ObservationArrays, np.ndarray]:
        """Return B steps as a mirror in the plane through the world's x and z axes shows them."""
        points = seen.points * _MIRROR.astype(np.float32)
        agent = mirrored_agent(seen.agent, self._space.arms)
        return seen._replace(points=points, agent=agent), self._mirrored_labels(labels)

    def _mirrored_labels(self, labels: np.ndarray) -> np.ndarray:
        """Return commands (B, V) as a mirror shows them: right and left change places."""
        space, found = self._space, labels.copy()
        a, m = space.arms, space.motion_size
        hands = labels[:, : 6 * a].reshape(-1, a, 2, 3)[:, ::-1] * np.stack((_MIRROR, _TURN))
        found[:, : 6 * a] = hands.reshape(-1, 6 * a)
        found[:, 6 * a + 1 : 6 * a + 3] *= -1.0  # the trunk's way to the left, and its turn
        for start in (m, m + a):  # widths, grips
            found[:, start : start + a] = labels[:, start : start + a][:, ::-1]
        if space.phases == GRIP_PHASES:  # of the first hand, which is another now
            found[:, -1] = found[:, m + a]
        return found


def mirrored_agent(agent: np.ndarray, arms: int) -> np.ndarray:
    """Return the proprioception (B, S) of robots that a mirror in the world's plane of x and z shows.

    Right and left arm change places, as do the fingers of each hand.
    """
    count, tips = len(agent), 6 * arms
    joints = 1 + arms * (len(_PANDA) + _FINGERS)
    found = agent.copy()
    for start in (0, tips):  # positions, velocities
        fingers = agent[:, start : start + tips].reshape(count, arms, _FINGERS, 3)
        found[:, start : start + tips] = (fingers[:, ::-1, ::-1] * _MIRROR).reshape(count, -1)
    base = 2 * tips
    for start in (base, base + _BASE):
        found[:, start + 1 : start + 3] *= -1.0  # y and yaw
    for start, turn in ((base + 2 * _BASE, _HAND_RAD), (base + 2 * _BASE + joints, 0.0)):
        own = agent[:, start + 1 : start + joints].reshape(count, arms, -1)[:, ::-1]
        arm, fingers = own[..., : len(_PANDA)] * _PANDA, own[..., len(_PANDA) :][..., ::-1]
        arm[..., -1] += turn
        found[:, start + 1 : start + joints] = np.concatenate((arm, fingers), axis=2).reshape(count, -1)
    return found


def _stretched(points: np.ndarray, masks: np.ndarray, factors: np.ndarray) -> np.ndarray:
    """Return points (B, N, 3) of which those neither in the first mask nor in the last, the robot, have moved.

    They move along the robot's axes, away from the middle of the first mask's points or to it, unless it is empty.
    """
    inside = masks[..., 0] > 0
    count = inside.sum(axis=1)
    middle = (points * inside[..., None]).sum(axis=1) / np.maximum(count, 1)[:, None]
    moves = ~inside & (masks[..., -1] == 0) & (count > 0)[:, None]
    found = middle[:, None] + (points - middle[:, None]) * factors
    return np.where(moves[..., None], found, points)


def _varied(
    rows: np.ndarray,
    vary: Callable[[ObservationArrays, np.ndarray], tuple[ObservationArrays, np.ndarray]],
    seen: ObservationArrays,
    labels: np.ndarray,
) -> tuple[ObservationArrays, np.ndarray]:
    """Return steps of which those in these rows are varied."""
    if not len(rows):
        return seen, labels
    others, other_labels = vary(ObservationArrays(*(part[rows] for part in seen)), labels[rows])
    parts = (part.copy() for part in seen)
    found, found_labels = ObservationArrays(*parts), labels.copy()
    for part, other in zip((*found, found_labels), (*others, other_labels), strict=True):
        part[rows] = other
    return found, found_labels

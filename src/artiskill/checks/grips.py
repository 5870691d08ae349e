"""Trying the gripper on one handle: closing the fingers across it, putting them behind it."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Handle
from artiskill.checks.config import GripConfig
from artiskill.checks.gripper import FINGERS, GripperProbe, Touch
from artiskill.geometry.meshes import depth_inside
from artiskill.geometry.rotations import (
    quat_conjugate,
    quat_from_matrix,
    quat_multiply,
    quat_rotate,
    quat_to_matrix,
    transform_points,
)

# where a hook is tried: leaning of the fingers out of the panel's plane, places along the handle (shares of its
# half length), how far the tips reach in behind it, and how finely the room behind it is searched
_LEANS_RAD = np.radians((0.0, 15.0, 25.0, 40.0, 60.0))
_PLACES = (0.0, 0.5, -0.5)
_ENGAGEMENTS_M = (0.010, 0.020, 0.035)
_LEVEL_M = 0.002
_PULL_STEP_M = 0.002
# Where the wide-open gripper does not fit, into a hollow say, each pad starts this far beside the handle.
_CLEARANCE_M = 0.018


@dataclass(frozen=True, eq=False)
class PlacedHandle:
    """A handle in the object frame.

    Attributes:
        handle: in its link's frame.
        link: index of the link.
        position: (3,) of the link.
        quaternion: (4,) of the link.
    """

    handle: Handle
    link: int
    position: np.ndarray
    quaternion: np.ndarray

    @property
    def grasps(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Position between the pads and orientation of the hand, of each grasp pose."""
        handle = self.handle
        places = transform_points(self.position, self.quaternion, handle.grasp_positions)
        turns = quat_multiply(self.quaternion, handle.grasp_quaternions)
        return list(zip(places, turns, strict=True))

    @property
    def points(self) -> np.ndarray:
        """Samples of its surface, (N, 3)."""
        return transform_points(self.position, self.quaternion, self.handle.points)

    def is_touched(self, touch: Touch, near_m: float) -> bool:
        """Whether a contact is one with the handle: with its link, inside of its hull or nearly so."""
        local = quat_rotate(quat_conjugate(self.quaternion), touch.position - self.position)
        return touch.link == self.link and bool(depth_inside(self.handle.planes, local[None])[0] > -near_m)


def place_handle(
    obj: ArticulatedObject, handle: Handle, positions: np.ndarray, quaternions: np.ndarray
) -> PlacedHandle:
    """A handle of an object whose links' poses are given."""
    link = obj.link_index(handle.link)
    return PlacedHandle(handle, link, positions[link], quaternions[link])


@dataclass(frozen=True)
class Attempt:
    """What came of trying to grip.

    Attributes:
        depth_m: how deep the open gripper is in something, in the best pose.
        gripped: whether both pads met the handle from there.
        problem: what was in the way, or nothing.
        width_m: distance of the pads where they met it.
    """

    depth_m: float
    gripped: bool
    problem: str
    width_m: float = 0.0


def try_grasps(probe: GripperProbe, placed: PlacedHandle, config: GripConfig, names: list[str]) -> Attempt:
    """The best of the handle's grasp poses; `names` are those of the object's links."""
    narrow = min(config.opening_m, placed.handle.grasp_width_m / 2 + _CLEARANCE_M)
    attempts = [
        _try_grasp(probe, placed, config, names, *pose, opening)
        for opening in (config.opening_m, narrow)
        for pose in placed.grasps
    ]
    return min(attempts, key=lambda a: (not a.gripped, a.depth_m))


def _try_grasp(
    probe: GripperProbe,
    placed: PlacedHandle,
    config: GripConfig,
    names: list[str],
    position: np.ndarray,
    quaternion: np.ndarray,
    open_m: float,
) -> Attempt:
    worst = max(probe.touches(position, quaternion, open_m), key=lambda t: t.depth_m, default=None)
    depth = 0.0 if worst is None else worst.depth_m
    if worst is not None and depth > config.penetration_m:
        return Attempt(depth, False, f"the open gripper runs {1e3 * depth:.0f} mm into {_name(worst, names)}")
    met: dict[int, float] = {}
    for opening in np.arange(open_m, -config.step_m / 2, -config.step_m):
        for touch in probe.touches(position, quaternion, max(float(opening), 0.0)):
            if touch.part in FINGERS and touch.part not in met:
                if not placed.is_touched(touch, config.near_handle_m):
                    return Attempt(depth, False, f"a closing finger meets {_name(touch, names)} beside the handle")
                met[touch.part] = float(opening)
        if len(met) == len(FINGERS):
            return Attempt(depth, True, "", sum(met.values()))
    return Attempt(depth, False, f"{2 - len(met)} of 2 pads close without meeting it")


def try_hook(probe: GripperProbe, placed: PlacedHandle, config: GripConfig) -> str:
    """From where closed fingers can hook the handle, or nothing."""
    outward = -quat_to_matrix(placed.grasps[0][1])[:, 2]
    for name, position, quaternion in _hooks(probe, placed, outward):
        touches = probe.touches(position, quaternion, 0.0)
        if all(touch.depth_m <= config.penetration_m for touch in touches):
            for way in np.arange(_PULL_STEP_M, config.pull_m + _PULL_STEP_M / 2, _PULL_STEP_M):
                touches = probe.touches(position + way * outward, quaternion, 0.0)
                if any(t.part in FINGERS and placed.is_touched(t, config.near_handle_m) for t in touches):
                    return name
    return ""


def _hooks(
    probe: GripperProbe, placed: PlacedHandle, outward: np.ndarray
) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Poses of the closed gripper whose tips reach behind the handle: from which side, position, orientation."""
    frame = quat_to_matrix(placed.grasps[0][1])
    points = placed.points
    levels = points @ outward
    depths = np.arange(levels.max() - _LEVEL_M, levels.min(), -_LEVEL_M)
    for way in (frame[:, 1], -frame[:, 1], frame[:, 0], -frame[:, 0]):
        beside = np.cross(way, outward)
        near, reach = float((points @ way).min()), points @ beside
        middle, half = (reach.max() + reach.min()) / 2, (reach.max() - reach.min()) / 2
        for lean in _LEANS_RAD:
            towards = np.cos(lean) * way - np.sin(lean) * outward
            turn = quat_from_matrix(np.stack((np.cross(beside, towards), beside, towards), axis=1))
            for depth in depths:
                for place in _PLACES:
                    for engagement in _ENGAGEMENTS_M:
                        tip = (near + engagement) * way + depth * outward + (middle + place * half) * beside
                        yield _side(way), tip - probe.tip_m * towards, turn


def _side(way: np.ndarray) -> str:
    """Where fingers that point this way come from."""
    axis = int(np.argmax(np.abs(way)))
    sides = (("front", "behind"), ("the right", "the left"), ("below", "above"))
    return sides[axis][int(way[axis] < 0)]


def _name(touch: Touch, names: list[str]) -> str:
    return "the ground" if touch.link < 0 else names[touch.link]

"""How much of what could be visited demonstrations do visit: shares of bins, comparable from set to set."""

import numpy as np

from artiskill.geometry.rotations import quat_to_matrix

# The base's place on the floor in the frame of the object's root, and a free object's in the world, whose origin
# is where it shall go: squares of this size, out to this distance along each axis.
BIN_M = 0.25
REACH_M = 2.5
# The target joint's share of its range, closed to fully open.
JOINT_BINS = 20


class Visits:
    """Which bins were visited.

    Args:
        is_fixed: whether the object stands still but for its joints.
    """

    def __init__(self, is_fixed: bool) -> None:
        side = round(2 * REACH_M / BIN_M)
        self._is_fixed = is_fixed
        self._base = np.zeros((side, side), dtype=bool)
        self._object: dict[str, np.ndarray] = {}
        self._floor = np.zeros((side, side), dtype=bool)

    def add(self, states: dict[str, np.ndarray], target: str, joint: int, limits: tuple[float, float]) -> None:
        """Count a trajectory.

        Args:
            states: as `Trajectory.states`.
            target: link.
            joint: its joint's number; ignored for an object that is free to move.
            limits: of this joint.
        """
        base, root = states["robot_qpos"][:, :2], states["root_position_w"][:, :2]
        turn = quat_to_matrix(states["root_quaternion_w"].astype(np.float64))[:, :2, :2]
        _mark(self._base, np.einsum("tji,tj->ti", turn, base - root))
        if not self._is_fixed:
            _mark(self._floor, root)
            return
        bins = self._object.setdefault(target, np.zeros(JOINT_BINS, dtype=bool))
        share = (states["object_qpos"][:, joint] - limits[0]) / (limits[1] - limits[0])
        bins[np.clip((share * JOINT_BINS).astype(int), 0, JOINT_BINS - 1)] = True

    @property
    def base(self) -> float:
        """Share of the squares around the object that the robot's base was in."""
        return float(self._base.mean())

    @property
    def object(self) -> float:
        """Share of the target joints' ranges, or of the squares of the floor, that the object was in."""
        if not self._is_fixed:
            return float(self._floor.mean())
        return float(np.mean([bins.mean() for bins in self._object.values()])) if self._object else 0.0


def _mark(bins: np.ndarray, points: np.ndarray) -> None:
    """Mark the squares of (T, 2) points; those out of reach are left out."""
    cells = np.floor((points + REACH_M) / BIN_M).astype(int)
    inside = ((cells >= 0) & (cells < len(bins))).all(axis=1)
    bins[cells[inside, 0], cells[inside, 1]] = True

"""How a hand is turned against a handle's grasp poses: a question of every step's reward, so it has a kernel."""

from typing import Any

import numpy as np

from artiskill.geometry.arrays import Array, amax, arccos, clip, dot, matmul, namespace
from artiskill.geometry.kernel import kernel
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.open_cabinet.goal import OpenGoal


def hand_angle(snapshot: Snapshot, goal: OpenGoal) -> Array:
    """Angle between the first hand and the nearest of the handle's grasp poses, over pi: (B,) in [0, 1]."""
    xp = namespace(snapshot.tool_rotation_w)
    link, hand = snapshot.link_rotation_w[goal.row, goal.link], snapshot.tool_rotation_w[:, 0]
    if isinstance(hand, np.ndarray):
        trace = np.empty(len(hand))
        for_each_environment(link, np.ascontiguousarray(hand), goal.grasp_rotations, trace)
    else:
        trace = by_array_calls(link, hand, goal.grasp_rotations)
    return arccos(clip(0.5 * trace - 0.5, -1.0, 1.0)) / xp.pi


def by_array_calls(link_w: Array, hand_w: Array, grasps: Array) -> Array:
    """Greatest trace of the rotations between a hand and grasp poses, for any array library: (B,).

    Args:
        link_w: (B, 3, 3) of the link that carries the handle.
        hand_w: (B, 3, 3).
        grasps: (B, G, 3, 3) in the link's frame.
    """
    xp = namespace(hand_w)
    hand = matmul(xp.matrix_transpose(link_w), hand_w)  # in the link's frame
    return amax(dot(xp.reshape(hand, (-1, 1, 9)), xp.reshape(grasps, (*grasps.shape[:2], 9))))


def load_kernel() -> None:
    """Compile the kernel, or read it from the disk's cache, now: no reset or step has to wait for it later."""
    one = np.ones((1, 3, 3))
    for_each_environment(one, one, one[None], np.empty(1))


@kernel
def for_each_environment(link_w: Any, hand_w: Any, grasps: Any, trace: Any) -> None:
    """Fill `trace` (B,); the other arguments as in `by_array_calls`."""
    hand = np.empty((3, 3))
    for b in range(link_w.shape[0]):
        for i in range(3):
            for j in range(3):
                hand[i, j] = 0.0
                for k in range(3):
                    hand[i, j] += link_w[b, k, i] * hand_w[b, k, j]
        trace[b] = -np.inf
        for g in range(grasps.shape[1]):
            total = 0.0
            for i in range(3):
                for j in range(3):
                    total += hand[i, j] * grasps[b, g, i, j]
            trace[b] = max(trace[b], total)

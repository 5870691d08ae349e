"""What networks and algorithms see: observations and batches of steps, as tensors on one device.

Torch is needed for types only, so that training sets can be made and looked at without it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from torch import Tensor


class Observation(NamedTuple):
    """A batch of B point clouds of N points with K masks, and what the robot knows of itself (S numbers)."""

    points: Tensor  # (B, N, 3) float32, metres, in the frame of the training set
    colors: Tensor  # (B, N, 3) float32 in [0, 1]
    masks: Tensor  # (B, N, K) float32, 0 or 1
    valid: Tensor  # (B, N) bool; False in rows of padding, whose other values mean nothing
    agent: Tensor  # (B, S) float32, as observed


class Batch(NamedTuple):
    """B steps."""

    observation: Observation
    action: Tensor  # (B, A) float32 in [-1, 1]
    weight: Tensor  # (B,) float32; 0 where the action is not to be imitated: the demonstration was disturbed
    reward: Tensor  # (B,) float32, dense, never above 0
    terminated: Tensor  # (B,) float32; 1 where the step ended the episode solved: what follows is worth 0
    next_observation: Observation | None  # None unless the algorithm asks for it


@dataclass(frozen=True)
class Sizes:
    """Sizes of arrays that a network is built for."""

    points: int  # N
    masks: int  # K
    agent: int  # S
    action: int  # A


class Statistics(NamedTuple):
    """Normalisation, computed once over a training set; saved in it and in every network."""

    point_mean: np.ndarray  # (3,) float32, metres
    point_std: np.ndarray  # (3,) float32, > 0
    agent_mean: np.ndarray  # (S,) float32
    agent_std: np.ndarray  # (S,) float32, > 0; 1 where an entry never changes
    # (A,) float32, > 0, of the actions to imitate; () for all alike
    action_std: np.ndarray = np.ones((), np.float32)

"""Dense reward of the cabinet tasks: named terms, four stages.

Stages: 0 approach, 1 close to the handle, 2 open enough, 3 open enough and still. With the weights that come with
the package, any state of a later stage earns more than any state of an earlier one: every term is bounded, and a
term that a stage does not ask for takes a fixed value there.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from artiskill.config import check, check_positive, check_value, check_vector
from artiskill.geometry.arrays import Array, clamp, columns, greatest, namespace
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.open_cabinet.goal import OpenGoal
from artiskill.tasks.open_cabinet.proximity import handle_proximity

_STAGES = 4


class Term(NamedTuple):
    """A term is `clip((measured - start) / width, low, high)` in the stages that ask for it.

    Attributes:
        start: measured value at which the term is 0.
        width: change of the measured value that makes 1.
        low: least value.
        high: greatest value.
        asked_in: stages that ask for it.
        elsewhere: its value in each stage that does not.
    """

    start: float
    width: float
    low: float
    high: float
    asked_in: tuple[int, ...]
    elsewhere: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)


# What is measured: angle to the nearest grasp pose over pi; mean distance of the fingers' lines to the handle (m);
# depth of their mid-line in the handle's hull (m); nothing; the joint's velocity (m/s or rad/s); how far it is
# open, 0 to 1; speed of the target link (m/s) plus half its angular speed (rad/s).
TERMS = {
    "hand_angle": Term(0.0, 1.0, 0.0, 1.0, (0,)),
    "handle_distance": Term(0.0, 1.0, 0.0, 2.0, (0, 1)),
    "enclosure": Term(0.004, 0.014, -1.0, 0.0, (0, 1)),
    "stage": Term(0.0, 1.0, 0.0, 0.0, ()),  # its values are RewardConfig.stage_bonus
    "opening_speed": Term(-0.1, 0.6, 0.0, 1.0, (1,)),
    "opening": Term(0.0, 1.0, 0.0, 1.0, (1,), (0.0, 0.0, 1.0, 1.0)),
    "link_speed": Term(0.0, 1.0, 0.0, 1.0, (2, 3)),
}
# The same as arrays: one entry per term, in order; and which stage asks for which term, (stages, terms).
_START, _WIDTH, _LOW, _HIGH = (np.array(column) for column in list(zip(*TERMS.values(), strict=True))[:4])
_ASKED = np.array([[stage in term.asked_in for term in TERMS.values()] for stage in range(_STAGES)])
_STAGE_TERM = list(TERMS).index("stage")


@dataclass(frozen=True)
class RewardConfig:
    """Weights and stage values.

    Attributes:
        close_distance_m: the hand is close where both finger lines are this near to the handle, and the handle
            lies between them.
        stage_bonus: value of the `stage` term in each of the four stages, rising.
        weights: term name -> weight; a term that is missing is reported with weight 0.
    """

    close_distance_m: float
    stage_bonus: tuple[float, float, float, float]
    weights: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check(
            list(self.stage_bonus) == sorted(set(self.stage_bonus)),
            f"reward.stage_bonus needs {_STAGES} rising numbers, not {list(self.stage_bonus)}",
        )
        check_positive(self, "close_distance_m")
        check_vector(self, "stage_bonus", size=_STAGES)
        finite = all(map(math.isfinite, self.weights.values()))
        check_value(self, "weights", finite, "must be finite numbers")
        unknown = sorted(set(self.weights) - set(TERMS))
        check(not unknown, f"reward.weights: unknown terms {unknown}; legal: {', '.join(TERMS)}")

    @cached_property
    def elsewhere(self) -> np.ndarray:
        """Values of the terms in the stages that do not ask for them, (stages, terms)."""
        values = np.array([term.elsewhere for term in TERMS.values()]).T
        values[:, _STAGE_TERM] = self.stage_bonus
        return values


def open_reward_terms(
    snapshot: Snapshot, goal: OpenGoal, flags: Mapping[str, Array], config: RewardConfig
) -> dict[str, Array]:
    """Unweighted terms, each (B,); `TERMS` has their ranges, `flags` is what `open_flags` says of this instant."""
    xp = namespace(snapshot.object_qpos)
    row, link, joint = goal.row, goal.link, goal.joint
    distance, depth = handle_proximity(snapshot, goal)
    is_close = (xp.maximum(distance[:, 0], distance[:, 1]) <= config.close_distance_m) & (depth > 0)
    stage = xp.where(flags["open_enough"], 2 + flags["cabinet_static"], is_close)  # (B,) 0 to 3
    qpos = snapshot.object_qpos[row, joint]
    measured = (
        hand_angle(snapshot, goal),
        0.5 * (distance[:, 0] + distance[:, 1]),
        depth,
        qpos,
        snapshot.object_qvel[row, joint],
        (qpos - goal.lower) / (goal.open_qpos - goal.lower),
        snapshot.link_speed_m_s[row, link] + 0.5 * snapshot.link_angular_speed_rad_s[row, link],
    )
    start, width, low, high, elsewhere = (
        xp.asarray(c, dtype=qpos.dtype) for c in (_START, _WIDTH, _LOW, _HIGH, config.elsewhere)
    )
    ramps = (columns(measured) - start) / width  # (B, terms)
    values = xp.where(xp.asarray(_ASKED)[stage], xp.minimum(xp.maximum(ramps, low), high), elsewhere[stage])
    return {name: values[:, i] for i, name in enumerate(TERMS)}


def hand_angle(snapshot: Snapshot, goal: OpenGoal) -> Array:
    """Angle between the hand and the nearest of the handle's grasp poses, over pi: (B,) in [0, 1]."""
    xp = namespace(snapshot.tool_rotation_w)
    rotation = snapshot.link_rotation_w[goal.row, goal.link]
    hand = xp.matrix_transpose(rotation) @ snapshot.tool_rotation_w[:, 0]  # in the link's frame
    # traces of the relative rotations, (B, G)
    traces = xp.vecdot(xp.reshape(hand, (-1, 1, 9)), goal.grasp_rotations_flat)
    return xp.acos(clamp(0.5 * greatest(traces) - 0.5, -1.0, 1.0)) / xp.pi

"""From observations to the inputs of a network, of NumPy arrays and of tensors alike. Imports no torch.

Hands and base are found in the robot's state, so coordinates around them need no privileged knowledge. A hand is
where the mean of its two fingertips is; with the robot's kinematics (`InputConfig.body`), its axes are known, too.
"""

import sys
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from artiskill.geometry.arrays import small_product
from artiskill.learning.network_config import InputConfig
from artiskill.learning.observation import ObservationArrays

if TYPE_CHECKING:  # it needs compiled kernels, and training without the engine does not
    from artiskill.robots.kinematics import RobotKinematics

HANDS = {38: 1, 68: 2}  # arms by the length of the robot's state

_FAR = 1e6  # metres: no point is so far away
_STATE_LIMIT = 10.0  # standard deviations
_OPEN_M = 0.02  # of a finger: half of its way
_NEAR_ORIGIN_M = 0.2
# what joints' positions and velocities, and those of hands, are multiplied by: they are then of the order of 1
_ARM, _FINGER_RATE, _YAW_RATE, _HAND_VELOCITY = 0.5, 10.0, 0.5, 2.0


class Scale(NamedTuple):
    """Means and standard deviations, see `artiskill.learning.batch.Statistics`; arrays or tensors."""

    point_mean: Any
    point_std: Any
    agent_mean: Any
    agent_std: Any


class Features(NamedTuple):
    """Inputs of a network; arrays or tensors, float32."""

    points: Any  # (B, N, P); zeros in rows of padding
    state: Any  # (B, S), of cloud and robot
    masks: Any  # (B, N, K); zeros in rows of padding
    valid: Any  # (B, N) bool


def make_features(
    observation: Any,
    config: InputConfig,
    scale: Scale,
    frame: str = "world",
    kinematics: "RobotKinematics | None" = None,
) -> Features:
    """Return the inputs of a network.

    Where coordinates around base or hands are asked for, the state has, too, the places of hands and of the
    world's origin as the base sees them. What cannot be known is left out: base and hands of a robot whose state
    is not laid out as ours, and the base where points are given in the hand's frame.

    Args:
        observation: `Observation` of tensors, or one of arrays with the same fields.
        config: what is computed.
        scale: of the training set, on the observation's device.
        frame: in which the points are given: `world`, `robot` or `end_effector`.
        kinematics: of the robot, where `config.body` asks for it; the points are then in `world` or `robot`.
    """
    xp = np if isinstance(observation.points, np.ndarray) else sys.modules["torch"]
    valid = observation.valid
    real = valid[..., None]
    points = xp.where(real, observation.points, 0.0)  # (B, N, 3)
    masks = xp.where(real, observation.masks, 0.0)  # (B, N, K)
    if config.blind_to_robot and masks.shape[2] > 1:
        masks = xp.concatenate((masks[..., :-1], xp.zeros_like(masks[..., -1:])), 2)
    present = real * xp.ones_like(points[..., :1])  # (B, N, 1) float32
    mean = points.sum(1) / present.sum(1).clip(1)
    if config.body:
        assert kinematics is not None, "forward kinematics is of a robot"
        coordinates, state = _seen_by_body(xp, points, observation.agent, config, kinematics, frame)
    else:
        coordinates, state = _seen_by_state(xp, points, mean, observation.agent, config, scale, frame)
    coordinates["cloud"] = points - mean[:, None]
    parts = [coordinates[name] for name in config.frames if name in coordinates] or [coordinates["cloud"]]
    nearest = parts[-1]
    if config.near_m:
        parts.append(xp.tanh(nearest / config.near_m))
    if config.extents:
        in_none = present - masks.sum(2)[..., None].clip(0, 1)
        extents = _extents(xp, nearest, xp.concatenate((masks, in_none), 2))
        state += [extents, xp.tanh(extents / config.near_m)] if config.near_m else [extents]
    parts += [observation.colors] * config.colors + [masks] * config.masks
    return Features(xp.where(real, xp.concatenate(parts, 2), 0.0), xp.concatenate(state, 1), masks, valid)


def feature_sizes(
    config: InputConfig, masks: int, agent: int, frame: str, kinematics: "RobotKinematics | None" = None
) -> tuple[int, int]:
    """Return how many numbers `make_features` gives of each point, and of cloud and robot."""
    zeros, ones = (lambda *shape: np.zeros(shape, np.float32)), (lambda *shape: np.ones(shape, np.float32))
    observation = ObservationArrays(
        zeros(1, 1, 3), zeros(1, 1, 3), zeros(1, 1, masks), ones(1, 1) > 0, zeros(1, agent)
    )
    scale = Scale(zeros(3), ones(3), zeros(agent), ones(agent))
    features = make_features(observation, config, scale, frame, kinematics)
    return features.points.shape[2], features.state.shape[1]


def _without_velocities(xp: Any, agent: Any) -> Any:
    """Return a robot's state (B, S) without the velocities of fingertips, base and joints, if it is ours."""
    if agent.shape[1] not in HANDS:
        return agent
    tips = 6 * HANDS[agent.shape[1]]  # numbers of all fingertips' positions, and of their velocities
    joints = 2 * tips + 6  # base: three positions, three velocities
    end = (joints + agent.shape[1]) // 2
    return xp.concatenate((agent[:, :tips], agent[:, 2 * tips : 2 * tips + 3], agent[:, joints:end]), 1)


def _seen_by_state(
    xp: Any, points: Any, mean: Any, agent: Any, config: InputConfig, scale: Scale, frame: str
) -> tuple[dict[str, Any], list[Any]]:
    """Return coordinates in frames that the robot's state tells, and numbers of cloud and robot as observed."""
    numbers = ((agent - scale.agent_mean) / scale.agent_std).clip(-_STATE_LIMIT, _STATE_LIMIT)
    if not config.velocities:
        numbers = _without_velocities(xp, numbers)
    state = [numbers, (mean - scale.point_mean) / scale.point_std]
    if frame == "end_effector":
        return {"hand": points}, state
    if config.frames == ("cloud",) or agent.shape[1] not in HANDS:
        return {}, state
    return _robot_coordinates(xp, points, agent, frame, state), state


def _robot_coordinates(xp: Any, points: Any, agent: Any, frame: str, state: list[Any]) -> dict[str, Any]:
    """Return coordinates from base and hands; to `state` go hands and the world's origin as the base sees them."""
    hands = HANDS[agent.shape[1]]
    tips = agent[:, : 6 * hands].reshape(-1, hands, 2, 3)
    floor = xp.zeros_like(agent[:, :1])
    base = xp.concatenate((agent[:, 12 * hands : 12 * hands + 2], floor), 1)[:, None]  # (B, 1, 3)
    turn = _turn_to_base(xp, agent[:, 12 * hands + 2], floor[:, 0])
    seen = points if frame == "robot" else _product(points - base, turn)
    places = _product(tips.sum(2) / 2 - base, turn)  # (B, hands, 3)
    origin = _product(-base, turn)[:, 0, :2]
    state += [places.reshape(-1, 3 * hands), origin, xp.tanh(origin)]
    around = xp.concatenate([seen - places[:, i : i + 1] for i in range(hands)], 2)  # (B, N, 3 * hands)
    return {"robot": seen, "hand": around}


def _seen_by_body(
    xp: Any, points: Any, agent: Any, config: InputConfig, kinematics: "RobotKinematics", frame: str
) -> tuple[dict[str, Any], list[Any]]:
    """Return coordinates in the frames of base and hands, and what the robot knows of itself."""
    hands, count = kinematics.arms, len(agent)
    qpos, qvel = kinematics.joints(agent)
    floor = xp.zeros_like(qpos[:, :1])
    base = xp.concatenate((qpos[:, :2], floor), 1)[:, None]  # (B, 1, 3)
    turn = _turn_to_base(xp, qpos[:, 2], floor[:, 0])
    places, axes = (xp.asarray(one, dtype=agent.dtype) for one in kinematics.tools(qpos))
    state = [qpos[:, 3:4], *_joint_numbers(qpos[:, 4:].reshape(count, hands, -1), _ARM, 1.0 / _OPEN_M, _OPEN_M)]
    state += [one.reshape(count, -1) for one in (places, axes[..., 0], axes[..., 2])]
    if hands > 1:
        state.append(_HAND_VELOCITY * (places[:, 1] - places[:, 0]))
    if config.velocities:
        own = _product(xp.concatenate((qvel[:, :2], floor), 1)[:, None], turn)[:, 0, :2]
        tips = agent[:, 6 * hands : 12 * hands].reshape(-1, hands, 2, 3).sum(2) / 2
        moving = _product(_product(tips, turn)[:, :, None], axes).reshape(count, -1)
        rates = _joint_numbers(qvel[:, 4:].reshape(count, hands, -1), _ARM, _FINGER_RATE)
        state += [own, _YAW_RATE * qvel[:, 2:3], qvel[:, 3:4], *rates, _HAND_VELOCITY * moving]
    if config.origin:
        origin = _product(-base, turn)[:, 0, :2]
        state += [origin, xp.tanh(origin / _NEAR_ORIGIN_M)]
    seen = points if frame == "robot" else _product(points - base, turn)
    around = [_product(seen - places[:, i : i + 1], axes[:, i]) for i in range(hands)]
    return {"robot": seen, "tool": xp.concatenate(around, 2)}, state


def _joint_numbers(values: Any, arm: float, finger: float, middle: float = 0.0) -> list[Any]:
    """Return numbers of the arms' joints and of their fingers, of values (B, A, n + 2)."""
    count = len(values)
    return [(arm * values[..., :-2]).reshape(count, -1), (finger * (values[..., -2:] - middle)).reshape(count, -1)]


def _turn_to_base(xp: Any, yaw: Any, zero: Any) -> Any:
    """Return (B, 3, 3) matrices; a row of world coordinates times one is a row in the base's axes."""
    c, s = xp.cos(yaw), xp.sin(yaw)
    return xp.stack((c, -s, zero, s, c, zero, zero, zero, zero + 1), 1).reshape(-1, 3, 3)


def _extents(xp: Any, points: Any, groups: Any) -> Any:
    """Return mean, least and greatest coordinates (B, 3 G C) of groups of points; zeros for an empty one."""
    inside = groups.swapaxes(1, 2)  # (B, G, N)
    count = inside.sum(2)[..., None]
    spread = points[:, None]  # (B, 1, N, C)
    member = inside[..., None] > 0
    least = xp.amin(xp.where(member, spread, _FAR), 2)  # (B, G, C)
    greatest = xp.amax(xp.where(member, spread, -_FAR), 2)
    found = xp.concatenate((_product(inside, points) / count.clip(1), least, greatest), 2)
    return xp.where(count > 0, found, 0.0).reshape(len(points), -1)


def _product(a: Any, b: Any) -> Any:
    """Return matrix products; of arrays not by BLAS, whose last bits depend on the processor."""
    return small_product(a, b) if isinstance(a, np.ndarray) else a @ b

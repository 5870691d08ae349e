"""Gymnasium wrappers for ArtiSkill's environments, single and vector."""

import math
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector.utils import batch_space

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.envs.vision import PointCloudObserver, sampled_points
from artiskill.errors import ConfigError, shown


class PointCloudDownsample(gym.Wrapper[Any, Any, Any, Any], gym.utils.RecordConstructorArgs):
    """Fewer points: a choice of the cloud's, with or without regard to the masks, in a frame of your choice.

    The environment underneath makes only the chosen points from then on, which is faster than choosing from its
    full cloud; so `restore_state` returns them too. The choice depends on level and step alone: the same instant
    has the same points, in any process.

    Methods, none of which chooses points of the ground (z <= 1 mm):

    - `maniskill`: as in the benchmark's baselines, 50 points of each mask, then masked ones up to 800, then others
      up to 1,200 (`points_per_mask`, `masked_points`, `num_points`);
    - `uniform`: every point alike;
    - `voxel`: one of each cube of `voxel_m`;
    - `fps`: farthest point sampling among `candidates_per_point * num_points` random ones.

    Rows of zeros stand at the end where there are too few points.

    Args:
        env: an environment with `obs_mode="pointcloud"`, wrapped or not, as long as no wrapper below changes
            observations.
        method: see above.
        num_points: rows of `xyz`, `rgb` and `seg`.
        frame: `world`, `robot` or `end_effector`, see `PointCloudObserver`.
        **settings: of the method.

    Raises:
        UnknownNameError: no such method or frame.
        ConfigError: an illegal setting, another observation mode, or a wrapper below that changes observations.
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        method: str = "maniskill",
        num_points: int = 1200,
        frame: str = "world",
        **settings: Any,
    ) -> None:
        gym.utils.RecordConstructorArgs.__init__(
            self, method=method, num_points=num_points, frame=frame, **settings
        )
        gym.Wrapper.__init__(self, env)
        base = _manipulation_env(env)
        base.observe_with(partial(sampled_points, method=method, num_points=num_points, frame=frame, **settings))


class FlattenDict(gym.ObservationWrapper[Any, Any, Any], gym.utils.RecordConstructorArgs):
    """Visual observations as Stable-Baselines3 takes them: one level of keys, images, and vectors for the rest.

    `{"rgbd": {"rgb", "depth", "seg"}, "agent"}` becomes `{"rgb", "depth", "seg", "agent"}`, and likewise
    `pointcloud`. Arrays of height, width and channels in uint8 stay as they are, all others become vectors, row by
    row: `np.reshape` with the shape that the environment underneath has takes them back. No number changes, and
    Stable-Baselines3's own networks would flatten the same arrays.

    Args:
        env: with `obs_mode` `rgbd` or `pointcloud`, down-sampled or not.

    Raises:
        ConfigError: observations that are no dictionary, or in which a key occurs twice.
    """

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        gym.utils.RecordConstructorArgs.__init__(self)
        gym.ObservationWrapper.__init__(self, env)
        if not isinstance(env.observation_space, gym.spaces.Dict):
            raise ConfigError(f"FlattenDict needs observations in a dictionary; {env} has {env.observation_space}")
        spaces = leaves(env.observation_space)
        self._shapes = {key: flat_shape(space) for key, space in spaces.items()}
        self.observation_space = gym.spaces.Dict({key: flat_space(space) for key, space in spaces.items()})

    def observation(self, observation: dict[str, Any]) -> dict[str, np.ndarray]:
        """Of one level."""
        return {key: leaf.reshape(self._shapes[key]) for key, leaf in leaves(observation).items()}


class VectorPointCloudDownsample(gym.vector.VectorWrapper):
    """`PointCloudDownsample` for a vector: the same points as of a single environment.

    Args:
        env: a vector of `ManipulationVectorEnv` with `obs_mode="pointcloud"`.
        method: as in `PointCloudDownsample`, as the rest.
        num_points: rows of `xyz`, `rgb` and `seg`.
        frame: `world`, `robot` or `end_effector`.
        **settings: of the method.

    Raises:
        UnknownNameError: no such method or frame.
        ConfigError: an illegal setting, another observation mode, or a wrapper below that changes observations.
    """

    def __init__(
        self,
        env: gym.vector.VectorEnv[Any, Any, Any],
        method: str = "maniskill",
        num_points: int = 1200,
        frame: str = "world",
        **settings: Any,
    ) -> None:
        super().__init__(env)
        base = env.unwrapped
        if not isinstance(base, ManipulationVectorEnv) or base.obs_mode != "pointcloud":
            raise ConfigError(
                f"down-sampling needs a vector of environments with obs_mode='pointcloud', not {env}"
            )
        if env.single_observation_space != PointCloudObserver(base.task).space:
            raise ConfigError(f"apply down-sampling first, and once: {env} has other observations already")
        base.observe_with(partial(sampled_points, method=method, num_points=num_points, frame=frame, **settings))


class VectorFlattenDict(gym.vector.VectorWrapper):
    """`FlattenDict` for a vector: one level of keys, images as they are, vectors for the rest.

    Args:
        env: a vector whose observations are nested dictionaries.

    Raises:
        ConfigError: observations that are no dictionary, or in which a key occurs twice.
    """

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any]) -> None:
        super().__init__(env)
        if not isinstance(env.single_observation_space, gym.spaces.Dict):
            raise ConfigError(f"VectorFlattenDict needs observations in a dictionary, not those of {env}")
        spaces = leaves(env.single_observation_space)
        self._shapes = {key: flat_shape(space) for key, space in spaces.items()}
        self.single_observation_space = gym.spaces.Dict({k: flat_space(space) for k, space in spaces.items()})
        self.observation_space = batch_space(self.single_observation_space, env.num_envs)

    def observations(self, observations: dict[str, Any]) -> dict[str, np.ndarray]:
        """Of one level."""
        return {key: leaf.reshape(-1, *self._shapes[key]) for key, leaf in leaves(observations).items()}

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """As of the environment."""
        observations, infos = super().reset(seed=seed, options=options)
        return self.observations(observations), infos

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """As of the environment; the observations that episodes ended with are flattened too."""
        observations, rewards, terminations, truncations, infos = super().step(actions)
        for env in np.flatnonzero(infos.get("_final_obs", ())):
            last = leaves(infos["final_obs"][env])
            infos["final_obs"][env] = {key: leaf.reshape(self._shapes[key]) for key, leaf in last.items()}
        return self.observations(observations), rewards, terminations, truncations, infos


def leaves(tree: Any) -> dict[str, Any]:
    """What hangs below a nested dictionary, or `Dict` space, by its own key.

    Raises:
        ConfigError: a key occurs twice.
    """
    found: dict[str, Any] = {}
    for key, value in tree.items():
        below = leaves(value) if isinstance(value, dict | gym.spaces.Dict) else {key: value}
        twice = found.keys() & below.keys()
        if twice:
            raise ConfigError(f"the key {min(twice)!r} occurs twice in {list(tree)}")
        found |= below
    return found


def flat_shape(space: gym.spaces.Box) -> tuple[int, ...]:
    """Its own for an image, else that of a vector."""
    is_image = space.dtype == np.uint8 and len(space.shape) == 3
    return space.shape if is_image else (math.prod(space.shape),)


def flat_space(space: gym.spaces.Box) -> gym.spaces.Box:
    """The space of `flat_shape`."""
    shape = flat_shape(space)
    return gym.spaces.Box(space.low.reshape(shape), space.high.reshape(shape), dtype=space.dtype.type)


def _manipulation_env(env: gym.Env[Any, Any]) -> ManipulationEnv:
    """The environment at the core, if its observations reach `env` unchanged and are full clouds."""
    base = env.unwrapped
    mode = getattr(base, "obs_mode", None)
    if not isinstance(base, ManipulationEnv) or mode != "pointcloud":
        raise ConfigError(
            f"down-sampling needs an environment with obs_mode='pointcloud', not {shown(mode)} of {env}"
        )
    if env.observation_space is not base.observation_space:
        raise ConfigError(f"apply down-sampling before the wrappers that change observations, not to {env}")
    if base.observation_space != PointCloudObserver(base.task).space:
        raise ConfigError(f"{env} is down-sampled already")
    return base

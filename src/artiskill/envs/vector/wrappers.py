"""Gymnasium wrappers for vector environments; they do what those of single environments do."""

from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector.utils import batch_space

from artiskill.envs.vector.env import ManipulationVectorEnv
from artiskill.envs.vision import PointCloudObserver, sampled_points
from artiskill.envs.wrappers import flat_shape, flat_space, leaves
from artiskill.errors import ConfigError


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

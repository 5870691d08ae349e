"""Gymnasium wrappers for ArtiSkill's environments, single and vector."""

import math
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector.utils import batch_space

from artiskill.envs.core import MakeObserver
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.envs.vision import FRAMES, PointCloudObserver, sampled_points
from artiskill.errors import ConfigError, check_name, shown
from artiskill.sensors.observations.sampling import make_sampler


class PointCloudDownsample(gym.Wrapper[Any, Any, Any, Any], gym.utils.RecordConstructorArgs):
    """Fewer points: a choice of the cloud's, with or without regard to the masks, in a frame of your choice.

    The environment underneath makes only the chosen points from then on, which is faster than choosing from its
    full cloud; so `restore_state` returns them too. The choice depends on level and step alone: the same step has
    the same points, in any process.

    Methods, none of which chooses points of the ground (z <= 1 mm):

    - `maniskill`: as in the benchmark's baselines, 50 points of each mask, then masked ones up to 800, then others
      up to 1,200 (`points_per_mask`, `masked_points`, `num_points`);
    - `shares`: fixed numbers of points (`shares`) of each mask and of those in none;
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
        make_observer = partial(sampled_points, method=method, num_points=num_points, frame=frame, **settings)
        _observe_points(env, ManipulationEnv, "observation_space", make_observer)


@dataclass(frozen=True)
class Sampling:
    """Which points of a cloud are kept, see `PointCloudDownsample`."""

    num_points: int = 1200  # in all
    method: str = "maniskill"  # `maniskill`, `shares`, `uniform`, `voxel` or `fps`
    frame: str = "world"  # `world`, `robot` or `end_effector`
    settings: dict[str, Any] = field(default_factory=dict)  # of the method

    def __post_init__(self) -> None:
        check_name("frame", self.frame, FRAMES)
        make_sampler(self.method, self.num_points, self.all_settings)

    @property
    def all_settings(self) -> dict[str, Any]:
        """The method's settings; those that were not given, in proportion to those for 1,200 points."""
        shares = {"masked_points": 2 * self.num_points // 3, "points_per_mask": self.num_points // 24}
        return (shares if self.method == "maniskill" else {}) | self.settings

    def wrap(self, env: Any) -> PointCloudDownsample:
        """Return an environment with fewer points."""
        return PointCloudDownsample(env, self.method, self.num_points, self.frame, **self.all_settings)


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
        self._flattener = _Flattener(env, env.observation_space)
        self.observation_space = self._flattener.space

    def observation(self, observation: dict[str, Any]) -> dict[str, np.ndarray]:
        """Return the observation with one level of keys."""
        return self._flattener.flatten(observation)


class VectorPointCloudDownsample(gym.vector.VectorWrapper):
    """`PointCloudDownsample` for a vector: the same points as of a single environment.

    Args:
        env: a vector of `ManipulationVectorEnv` with `obs_mode="pointcloud"`.
        method: see `PointCloudDownsample`, as for all others.

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
        make_observer = partial(sampled_points, method=method, num_points=num_points, frame=frame, **settings)
        _observe_points(env, ManipulationVectorEnv, "single_observation_space", make_observer)


class VectorFlattenDict(gym.vector.VectorWrapper):
    """`FlattenDict` for a vector: one level of keys, images as they are, vectors for the rest.

    Args:
        env: a vector whose observations are nested dictionaries.

    Raises:
        ConfigError: observations that are no dictionary, or in which a key occurs twice.
    """

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any]) -> None:
        super().__init__(env)
        self._flattener = _Flattener(env, env.single_observation_space)
        self.single_observation_space = self._flattener.space
        self.observation_space = batch_space(self.single_observation_space, env.num_envs)

    def observations(self, observations: dict[str, Any]) -> dict[str, np.ndarray]:
        """Return the observations with one level of keys."""
        return self._flattener.flatten(observations, self.num_envs)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Reset the environment; see `ManipulationVectorEnv.reset`."""
        observations, infos = super().reset(seed=seed, options=options)
        return self.observations(observations), infos

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step the environment; the observations that episodes ended with are flattened, too."""
        observations, rewards, terminations, truncations, infos = super().step(actions)
        for env in np.flatnonzero(infos.get("_final_obs", ())):
            infos["final_obs"][env] = self._flattener.flatten(infos["final_obs"][env])
        return self.observations(observations), rewards, terminations, truncations, infos


def _observe_points(env: Any, kind: type[Any], space: str, make_observer: MakeObserver) -> None:
    """Have the environment at the core, of this kind, observe in another way.

    Raises:
        ConfigError: its observations do not reach `env` unchanged in the attribute `space`, or are no full clouds.
    """
    base = env.unwrapped
    mode = getattr(base, "obs_mode", None)
    if not isinstance(base, kind) or mode != "pointcloud":
        raise ConfigError(
            f"down-sampling needs a {kind.__name__} with obs_mode='pointcloud', not {shown(mode)} of {env}"
        )
    if getattr(env, space) is not getattr(base, space):
        raise ConfigError(f"apply down-sampling before the wrappers that change observations, not to {env}")
    if getattr(base, space) != PointCloudObserver(base.task).space:
        raise ConfigError(f"{env} is down-sampled already")
    base.observe_with(make_observer)


class _Flattener:
    """Takes nested observations to one level of keys; see `FlattenDict`.

    Args:
        env: for messages.
        space: of one environment's observations.

    Attributes:
        space: of one environment's flat observations.
    """

    def __init__(self, env: Any, space: gym.Space[Any]) -> None:
        if not isinstance(space, gym.spaces.Dict):
            raise ConfigError(f"flattening needs observations in a dictionary; {env} has {space}")
        self._shapes: dict[str, tuple[int, ...]] = {}
        boxes: dict[str, gym.Space[Any]] = {}
        for key, box in _leaves(space).items():
            is_image = box.dtype == np.uint8 and len(box.shape) == 3
            self._shapes[key] = shape = box.shape if is_image else (math.prod(box.shape),)
            boxes[key] = gym.spaces.Box(box.low.reshape(shape), box.high.reshape(shape), dtype=box.dtype.type)
        self.space = gym.spaces.Dict(boxes)

    def flatten(self, observations: dict[str, Any], *batch: int) -> dict[str, np.ndarray]:
        """Return observations, or a batch of them, with one level of keys."""
        return {key: leaf.reshape(*batch, *self._shapes[key]) for key, leaf in _leaves(observations).items()}


def _leaves(tree: Any) -> dict[str, Any]:
    """Return what hangs below a nested dictionary, or `Dict` space, by its own key.

    Raises:
        ConfigError: a key occurs twice.
    """
    found: dict[str, Any] = {}
    for key, value in tree.items():
        below = _leaves(value) if isinstance(value, dict | gym.spaces.Dict) else {key: value}
        twice = found.keys() & below.keys()
        if twice:
            raise ConfigError(f"the key {min(twice)!r} occurs twice in {list(tree)}")
        found |= below
    return found

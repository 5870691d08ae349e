"""A vector environment as Stable-Baselines3 wants one; its extra is `rl`."""

from functools import cache
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode

from artiskill.errors import ConfigError, MissingExtraError

VectorEnv = gym.vector.VectorEnv[Any, Any, Any]


def as_sb3(env: VectorEnv) -> Any:
    """A `stable_baselines3.common.vec_env.VecEnv` over a vector environment; stepping copies nothing.

    In the step that ends an episode, the environment's info has `terminal_observation`, `TimeLimit.truncated`, and
    what our infos say of that instant: `object`, `level`, `target`, `success`, `flags`. Else infos are empty:
    building B dictionaries a step would take longer than the rest of what is not physics.

    Args:
        env: made with `autoreset_mode="same_step"`; visual observations in `VectorFlattenDict`.

    Raises:
        ConfigError: another autoreset mode, or nested observations.
        MissingExtraError: Stable-Baselines3 is not installed.
    """
    mode, space = env.metadata.get("autoreset_mode"), env.single_observation_space
    if mode is not AutoresetMode.SAME_STEP:
        raise ConfigError(f"make the vector environment with autoreset_mode='same_step', not {mode}")
    if isinstance(space, gym.spaces.Dict) and any(isinstance(s, gym.spaces.Dict) for s in space.values()):
        raise ConfigError("Stable-Baselines3 takes no nested observations: use VectorFlattenDict")
    return _adapter_class()(env)


@cache
def _adapter_class() -> Any:
    """`_Adapter` with the library's base class: the library is optional."""
    try:
        from stable_baselines3.common.vec_env import VecEnv  # type: ignore[import-not-found, unused-ignore]
    except ImportError as error:
        raise MissingExtraError("Stable-Baselines3", "rl") from error
    return type("ArtiSkillVecEnv", (_Adapter, VecEnv), {})


class _Adapter:
    """The methods of a `VecEnv`; see `as_sb3`."""

    _seeds: list[int | None]  # of the base class
    _reset_seeds: Any
    _get_indices: Any

    def __init__(self, env: VectorEnv) -> None:
        self._env, self._actions = env, np.zeros(0)  # first: the base class asks for attributes
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)  # type: ignore[call-arg]

    def reset(self) -> Any:
        seeds: Any = None if all(seed is None for seed in self._seeds) else self._seeds
        observations, _ = self._env.reset(seed=seeds)
        self._reset_seeds()
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        observations, rewards, terminated, truncated, infos = self._env.step(self._actions)
        done = terminated | truncated
        told: list[dict[str, Any]] = [{} for _ in done]
        for i in np.flatnonzero(done).tolist():
            told[i] = _last_info(infos, i) | {"TimeLimit.truncated": bool(truncated[i] and not terminated[i])}
        return observations, rewards.astype(np.float32), done, told

    def close(self) -> None:
        self._env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        values = self._env.unwrapped.get_attr(attr_name)  # type: ignore[attr-defined]
        return [values[i] for i in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        raise ConfigError(f"{attr_name!r} cannot be set: make another environment")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        values = self._env.unwrapped.call(method_name, *args, **kwargs)  # type: ignore[attr-defined]
        return [values[i] for i in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> list[Any]:
        return list(self._env.render() or ())


def _last_info(infos: dict[str, Any], env: int) -> dict[str, Any]:
    """What the infos of a step say of the last instant of an episode."""
    final = infos["final_info"]
    success = bool(final["success"][env])
    return {
        "terminal_observation": infos["final_obs"][env],
        "object": final["object"][env],
        "level": int(final["level"][env]),
        "target": final["target"][env],
        "success": success,
        "is_success": success,  # what the library's own logs look for
        "flags": {name: bool(values[env]) for name, values in final["flags"].items() if name[0] != "_"},
    }

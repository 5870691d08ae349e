"""A vector environment for Stable-Baselines3; its extra is `rl`."""

from functools import cache
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode

from artiskill.envs.core import copied
from artiskill.envs.vector_env import SETTABLE, ManipulationVectorEnv
from artiskill.errors import ConfigError, MissingExtraError, shown
from artiskill.tasks.levels import MAX_LEVEL

VectorEnv = gym.vector.VectorEnv[Any, Any, Any]


def as_sb3(env: VectorEnv) -> Any:
    """Return a `stable_baselines3.common.vec_env.VecEnv` over a vector environment.

    The library keeps observations while it steps on: those of an environment that was made with `copy=False` are
    copied.

    In the step that ends an episode, the environment's info has `terminal_observation`, `TimeLimit.truncated`, and
    what our infos say of that step: `object`, `level`, `target`, `success`, `flags`. Else infos are empty:
    building B dictionaries a step would take longer than the rest of what is not physics.

    Args:
        env: made with `autoreset_mode="same_step"`; visual observations in `VectorFlattenDict`.

    Raises:
        ConfigError: no vector environment of ours, another autoreset mode, or nested observations.
        MissingExtraError: Stable-Baselines3 is not installed.
    """
    if not isinstance(getattr(env, "unwrapped", None), ManipulationVectorEnv):
        raise ConfigError(f"as_sb3 needs a vector environment, as gym.make_vec makes it, not {shown(env)}")
    mode, space = env.metadata.get("autoreset_mode"), env.single_observation_space
    if mode is not AutoresetMode.SAME_STEP:
        raise ConfigError(f"make the vector environment with autoreset_mode='same_step', not {mode}")
    if isinstance(space, gym.spaces.Dict) and any(isinstance(s, gym.spaces.Dict) for s in space.values()):
        raise ConfigError("Stable-Baselines3 takes no nested observations: use VectorFlattenDict")
    return _adapter_class()(env)


@cache
def _adapter_class() -> Any:
    """Return `_Adapter` with the library's base class: the library is optional."""
    try:
        from stable_baselines3.common.vec_env import VecEnv  # type: ignore[import-not-found, unused-ignore]
    except ImportError as error:
        raise MissingExtraError("Stable-Baselines3", "rl") from error
    return type("ArtiSkillVecEnv", (_Adapter, VecEnv), {})


class _Adapter:
    """The methods of a `VecEnv`; see `as_sb3`."""

    _seeds: list[int | None]  # of the base class
    _options: list[dict[str, Any]]
    _reset_seeds: Any
    _reset_options: Any
    _get_indices: Any

    def __init__(self, env: VectorEnv) -> None:
        self._env, self._actions = env, np.zeros(0)  # first: the base class asks for attributes
        self._base: ManipulationVectorEnv = env.unwrapped  # type: ignore[assignment]
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)  # type: ignore[call-arg]

    def reset(self) -> Any:
        # the library's seeds have 32 bits, levels 31
        seeds = [None if seed is None else seed % (MAX_LEVEL + 1) for seed in self._seeds]
        observations, _ = self._env.reset(
            seed=None if all(seed is None for seed in seeds) else seeds,  # type: ignore[arg-type]
            options=_by_name(self._options),
        )
        self._reset_seeds()
        self._reset_options()
        return self._kept(observations)

    def _kept(self, observations: Any) -> Any:
        return observations if self._base.gives_copies else copied(observations)

    def step_async(self, actions: np.ndarray) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        observations, rewards, terminated, truncated, infos = self._env.step(self._actions)
        done = terminated | truncated
        found: list[dict[str, Any]] = [{} for _ in done]
        for i in np.flatnonzero(done).tolist():
            found[i] = _last_info(infos, i) | {"TimeLimit.truncated": bool(truncated[i] and not terminated[i])}
        return self._kept(observations), rewards.astype(np.float32), done, found

    def close(self) -> None:
        self._env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        values = self._base.get_attr(attr_name)
        return [values[i] for i in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        chosen = list(self._base.get_attr(attr_name)) if attr_name in SETTABLE else [None] * self._base.num_envs
        for i in self._get_indices(indices):
            chosen[i] = value
        self._base.set_attr(attr_name, chosen)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        values = self._base.call(method_name, *args, **kwargs)
        return [values[i] for i in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> list[Any]:
        return list(self._env.render() or ())


def _by_name(options: list[dict[str, Any]]) -> dict[str, list[Any]] | None:
    """Return options with a list of values, from a list of options."""
    names = dict.fromkeys(name for one in options for name in one)
    return {name: [one.get(name) for one in options] for name in names} or None


def _last_info(infos: dict[str, Any], env: int) -> dict[str, Any]:
    """Return what the infos of a step say of the last step of an episode."""
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

"""Solutions of 2021's benchmark: `class UserPolicy(BasePolicy)` in a file `user_solution.py`, unchanged.

Such files make an environment by `gym.make(env_name)`, for its spaces, and may import `mani_skill.env`. In the
process of a policy there is no environment; so there is one here that has spaces and blank observations and does
not simulate. Like `evaluation.solution_process`, this file runs where this package is not installed.

Form of the files: ManiSkill's README and its `mani_skill/eval`, first release, 2021.
"""

import importlib.util
import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

_VISUAL = ("pointcloud", "rgbd")
_MODES = ("state", *_VISUAL)


class BasePolicy:
    """What a `UserPolicy` inherits; files of 2021 usually bring their own copy."""

    def __init__(self, opts: Any = None) -> None:
        self.obs_mode = "pointcloud"

    def act(self, observation: Any) -> Any:
        """Return an action."""
        raise NotImplementedError

    def reset(self) -> None:
        """Begin an episode."""


class Adapter:
    """A policy as this benchmark calls it, over a policy as that of 2021 called it.

    Colours become numbers from 0 to 1, as SAPIEN's cameras gave them; all else stays.

    Args:
        policy: with `obs_mode`, `reset()` and `act(observation)`.
    """

    control_mode = "joint"

    def __init__(self, policy: Any) -> None:
        self._policy, self.obs_mode = policy, policy.obs_mode

    def reset(self, observation: Any, info: dict[str, Any]) -> None:
        """Begin an episode."""
        self._policy.reset()

    def act(self, observation: Any) -> Any:
        """Return the policy's action."""
        return self._policy.act(_as_in_2021(observation))


def _as_in_2021(observation: Any) -> Any:
    for mode in _VISUAL:
        if isinstance(observation, dict) and mode in observation:
            seen = observation[mode]
            colours = seen["rgb"].astype(np.float32) / np.float32(255)
            return {"agent": observation["agent"], mode: {**seen, "rgb": colours}}
    return observation


class Environment:
    """What `gym.make` returns: spaces, modes and blank observations, but no simulation.

    Args:
        about: `env_name`; the sizes `action`, `agent` and `state`; the number of `masks`; `cameras`, their number,
            height and width; `episode_steps`.
        obs_mode: `state`, `pointcloud` or `rgbd`.
        reward_type: means nothing here.
    """

    metadata: dict[str, Any] = {}  # noqa: RUF012 - as in Gym
    reward_range = (-np.inf, np.inf)

    def __init__(self, about: dict[str, Any], obs_mode: str = "state", reward_type: str = "dense") -> None:
        self._about, self.reward_type = about, reward_type
        self._max_episode_steps = about["episode_steps"]
        self.spec = SimpleNamespace(id=about["env_name"], max_episode_steps=self._max_episode_steps)
        self.action_space = _box(-1.0, 1.0, (about["action"],), np.float32)
        self.set_env_mode(obs_mode)

    @property
    def unwrapped(self) -> "Environment":
        """The environment itself."""
        return self

    def set_env_mode(self, obs_mode: str | None = None, reward_type: str | None = None) -> None:
        """Change the observation mode."""
        if obs_mode is not None:
            if obs_mode not in _MODES:
                raise ValueError(f"unknown obs_mode {obs_mode!r}; legal: {', '.join(_MODES)}")
            self.obs_mode = obs_mode
            self.observation_space = _space_of(self.reset())
        self.reward_type = reward_type or self.reward_type

    def reset(self, level: int | None = None, **options: Any) -> Any:
        """Return an observation of zeros."""
        about = self._about
        if self.obs_mode == "state":
            return np.zeros(about["state"], np.float32)
        number, height, width = about["cameras"]
        masks = about["masks"]
        rgb: tuple[int, ...]
        seg: tuple[int, ...]
        if self.obs_mode == "rgbd":
            rgb, seg = (height, width, 3 * number), (height, width, masks * number)
            spatial = {"depth": np.zeros((height, width, number), np.float32)}
        else:
            points = number * height * width
            rgb, seg = (points, 3), (points, masks)
            spatial = {"xyz": np.zeros((points, 3), np.float32)}
        seen = {"rgb": np.zeros(rgb, np.float32), "seg": np.zeros(seg, bool), **spatial}
        return {"agent": np.zeros(about["agent"], np.float32), self.obs_mode: seen}

    def get_obs(self) -> Any:
        """Return an observation of zeros."""
        return self.reset()

    def seed(self, seed: int | None = None) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""

    def step(self, action: Any) -> Any:
        """Raise `RuntimeError`."""
        raise RuntimeError(
            "nothing is simulated in a policy's process: an environment from gym.make has only spaces"
        )


def _space_of(observation: Any) -> Any:
    if isinstance(observation, dict):
        return {key: _space_of(value) for key, value in observation.items()}
    return _box(-np.inf, np.inf, observation.shape, observation.dtype)


def _box(low: float, high: float, shape: tuple[int, ...], dtype: Any) -> Any:
    """Return a space whose samples are the same in every process."""
    bounds = (0, 1) if np.dtype(dtype) == np.bool_ else (low, high)
    space = sys.modules["gym.spaces"].Box(*bounds, shape=shape, dtype=dtype)
    space.seed(0)
    return space


class Space:
    """A space of Gym, as far as a policy may need one."""

    def __init__(self, shape: tuple[int, ...] | None = None, dtype: Any = None) -> None:
        self.shape, self.dtype = shape, None if dtype is None else np.dtype(dtype)
        self.seed(0)

    def seed(self, seed: int | None = None) -> None:
        """Begin the random numbers anew."""
        self.np_random = np.random.RandomState(seed)


class Box(Space):
    """Arrays within bounds."""

    def __init__(self, low: Any, high: Any, shape: Any = None, dtype: Any = np.float32) -> None:
        size = np.shape(low) if shape is None else tuple(shape)
        super().__init__(size, dtype)
        self.low, self.high = (np.full(size, bound, dtype) for bound in (low, high))

    def sample(self) -> np.ndarray:
        """Return a uniform array; a normal one without bounds."""
        finite = np.isfinite(self.low).all() and np.isfinite(self.high).all()
        drawn = (
            self.np_random.uniform(self.low, self.high) if finite else self.np_random.standard_normal(self.shape)
        )
        return np.asarray(drawn, self.dtype)

    def contains(self, x: Any) -> bool:
        """Whether an array is in it."""
        return np.shape(x) == self.shape and bool(np.all(x >= self.low) and np.all(x <= self.high))


class Wrapper:
    """An environment around another one."""

    def __init__(self, env: Any) -> None:
        self.env = env

    def __getattr__(self, name: str) -> Any:
        if name == "env":  # not yet there
            raise AttributeError(name)
        return getattr(self.env, name)

    @property
    def unwrapped(self) -> Any:
        """The innermost environment."""
        return self.env.unwrapped


def install(about: dict[str, Any]) -> None:
    """Have `import gym` and `import mani_skill.env` find what a file of 2021 expects.

    An installed Gym is used, except that its `make` makes an `Environment` of that name, or of any of its objects.

    Args:
        about: see `Environment`.
    """
    if importlib.util.find_spec("gym") is None:
        spaces = _module("gym.spaces", Space=Space, Box=Box)
        core = _module("gym.core", Env=Environment, Wrapper=Wrapper)
        same = {"Wrapper": Wrapper, "ObservationWrapper": Wrapper, "ActionWrapper": Wrapper}
        _module("gym", spaces=spaces, core=core, Env=Environment, **same)
        vars(core).update(same)
    else:
        importlib.import_module("gym")
    gym: Any = sys.modules["gym"]
    make_other = getattr(gym, "make", None)
    task = about["env_name"].removesuffix("-v0")

    def make(env_name: Any, *args: Any, **options: Any) -> Any:
        if str(env_name).split("_")[0].removesuffix("-v0") == task:
            return Environment(about | {"env_name": env_name}, *args, **options)
        if make_other is None:
            raise ValueError(f"no environment {env_name!r} here; this policy is asked for {about['env_name']!r}")
        return make_other(env_name, *args, **options)

    gym.make = make
    base = _module("mani_skill.env.base_env", BaseEnv=Environment)
    solution = _module("mani_skill.eval.user_solution", BasePolicy=BasePolicy)
    evaluation = _module("mani_skill.eval", BasePolicy=BasePolicy, user_solution=solution)
    _module("mani_skill", env=_module("mani_skill.env", base_env=base), eval=evaluation)


def _module(name: str, **content: Any) -> ModuleType:
    """Return a module that `import` finds."""
    module = ModuleType(name)
    module.__path__ = []  # it may have submodules
    vars(module).update(content)
    sys.modules[name] = module
    return module

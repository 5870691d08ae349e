"""What callers may ask for: modes by name, options of a reset, and what a vector takes for each environment."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.envs.control import CONTROL_MODES
from artiskill.envs.core import MakeObserver, StateObserver
from artiskill.envs.vision import PointCloudObserver, RgbdObserver
from artiskill.errors import ConfigError, check_name, shown
from artiskill.jobs.parallel import available_cores
from artiskill.tasks.levels import check_level

OBSERVERS: dict[str, MakeObserver] = {
    "state": StateObserver,
    "pointcloud": PointCloudObserver,
    "rgbd": RgbdObserver,
}
OBSERVATION_MODES: tuple[str, ...] = tuple(OBSERVERS)
REWARD_MODES: tuple[str, ...] = ("dense", "sparse")
VECTOR_RENDER_MODES: tuple[str, ...] = ("rgb_array",)
HUMAN = "human"
RENDER_MODES: tuple[str, ...] = (*VECTOR_RENDER_MODES, HUMAN)
MAX_ENVS = 65_536  # each takes about 1 MB
RESET_OPTIONS = ("level", "object", "target", "reset_mask")
_AUTORESET_MODES = {mode.name.lower(): mode for mode in AutoresetMode}


def check_modes(
    observation: str, reward: str, control: str, render: str | None, legal_render: tuple[str, ...] = RENDER_MODES
) -> None:
    """Raise UnknownNameError unless all are legal."""
    check_name("observation mode", observation, OBSERVATION_MODES)
    check_name("reward mode", reward, REWARD_MODES)
    check_name("control mode", control, CONTROL_MODES)
    if render is not None:
        check_name("render mode", render, legal_render)


def check_flag(name: str, given: object) -> bool:
    """Return what is True or False.

    Raises:
        ConfigError: it is neither.
    """
    if not isinstance(given, bool | np.bool_):
        raise ConfigError(f"{name} must be True or False, not {shown(given)}")
    return bool(given)


def checked_options(given: object, legal: tuple[str, ...]) -> dict[str, Any]:
    """Return the options of a `reset` as a new dictionary.

    Raises:
        ConfigError: they are no mapping.
        UnknownNameError: an unknown option.
    """
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise ConfigError(f"reset options are a mapping with the keys {', '.join(legal)}, not {shown(given)}")
    for key in given:
        check_name("reset option", key, legal)
    return dict(given)


def as_autoreset_mode(given: AutoresetMode | str) -> AutoresetMode:
    """Return Gymnasium's mode, given as itself, by its name (`same_step`) or by its value (`SameStep`).

    Raises:
        UnknownNameError: no such mode.
    """
    if isinstance(given, AutoresetMode):
        return given
    if isinstance(given, str) and given in [mode.value for mode in AutoresetMode]:
        return AutoresetMode(given)
    check_name("autoreset mode", given, tuple(_AUTORESET_MODES))
    return _AUTORESET_MODES[given]


def per_env(what: str, given: Any, num_envs: int) -> list[Any]:
    """Return one value for each environment, from a sequence of them or from one for all.

    Raises:
        ConfigError: a sequence of another length.
    """
    given = _unwrapped(given)
    if given is None or isinstance(given, str | int | np.integer | ArticulatedObject):
        return [given] * num_envs
    if isinstance(given, Sequence | np.ndarray) and len(given) == num_envs:
        return list(given)
    count = f"{len(given)} of them" if isinstance(given, Sequence | np.ndarray) else shown(given)
    raise ConfigError(f"{what}: one for all environments or a list of {num_envs} is needed, not {count}")


def _unwrapped(given: Any) -> Any:
    """The number of an array without dimension; anything else as it is."""
    return given.item() if isinstance(given, np.ndarray) and given.ndim == 0 else given


def reset_mask(options: Mapping[str, Any], num_envs: int) -> np.ndarray:
    """Return which environments a reset is about, (B,) bool.

    Raises:
        ConfigError: a mask that is no array of B booleans, or has none set.
    """
    mask = options.get("reset_mask")
    if mask is None:
        return np.ones(num_envs, dtype=bool)
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (num_envs,) or not mask.any():
        raise ConfigError(
            f"reset_mask must be an array of {num_envs} booleans with at least one set, not {shown(mask)}"
        )
    return mask


def reset_seeds(seed: Any, num_envs: int) -> list[int | None]:
    """Return each environment's seed: the given ones, or `seed`, `seed + 1`, ... of a single number.

    Raises:
        ConfigError: a seed that is no level, or a list of another length.
    """
    if seed is None:
        return [None] * num_envs
    seed = _unwrapped(seed)
    if isinstance(seed, int | np.integer) and not isinstance(seed, bool):
        seed = [int(seed) + i for i in range(num_envs)]
    return [None if s is None else check_level(s) for s in per_env("seed", seed, num_envs)]


def env_number(given: Any, num_envs: int) -> int:
    """Return the number of an environment.

    Raises:
        ConfigError: there is none of this number.
    """
    legal = isinstance(given, int | np.integer) and not isinstance(given, bool) and 0 <= given < num_envs
    if not legal:
        raise ConfigError(f"environments are numbered 0 to {num_envs - 1}: there is no {shown(given)}")
    return int(given)


def env_count(given: Any, name: str = "num_envs") -> int:
    """Return a number of environments, which errors call `name`.

    Raises:
        ConfigError: no whole number, less than 1, or more than memory could hold.
    """
    count = _at_least_one(name, given)
    if count > MAX_ENVS:
        raise ConfigError(f"{name} must be at most {MAX_ENVS}, not {shown(count)}")
    return count


def thread_count(given: Any, num_envs: int) -> int:
    """Return the number of threads: the given one, or the number of cores; at most one per environment.

    Raises:
        ConfigError: no whole number, or less than 1.
    """
    return min(available_cores() if given is None else _at_least_one("num_threads", given), num_envs)


def _at_least_one(name: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise ConfigError(f"{name} must be a whole number of at least 1, not {shown(value)}")
    return int(value)

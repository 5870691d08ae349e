"""What a vector says about its single environments, and what of them may be changed."""

from collections.abc import Callable, Mapping
from typing import Any

from artiskill.envs.options import per_env
from artiskill.envs.vector.episodes import Episodes
from artiskill.errors import ConfigError, ResetNeededError

# Gymnasium's names of what one environment has -> ours of the vector's
SINGLE = {"action_space": "single_action_space", "observation_space": "single_observation_space"}
SETTABLE = ("objects",)


class EnvAttributes:
    """Attributes of single environments that the vector keeps elsewhere.

    Args:
        episodes: of the vector.
    """

    def __init__(self, episodes: Episodes) -> None:
        self._episodes = episodes
        self._of_env: Mapping[str, Callable[[int], Any]] = {
            "object": lambda env: episodes.objects[env],
            "level": lambda env: int(episodes.levels[env]),
            "target": lambda env: episodes.targets[env],
            "scene": episodes.fleet.scene_of,
            "goal": episodes.fleet.goal_of,
            "snapshot": episodes.fleet.snapshot_of,
        }

    def __contains__(self, name: str) -> bool:
        """Whether there is one of this name."""
        return name in self._of_env or name in SETTABLE

    def get(self, name: str) -> tuple[Any, ...]:
        """Of all environments.

        Raises:
            ResetNeededError: no episode has begun yet.
        """
        envs = range(len(self._episodes.levels))
        if name == "objects":
            return tuple(self._episodes.choices_of(env) for env in envs)
        if not self._episodes.begun:
            raise ResetNeededError(f"call reset() before asking for {name!r}")
        return tuple(map(self._of_env[name], envs))

    def set(self, name: str, values: Any) -> None:
        """What environments draw their next objects from.

        Args:
            name: `objects`.
            values: one choice for all, or a list or tuple of one for each.

        Raises:
            ConfigError: another name, or a list of another length.
            UnknownNameError: an unknown object or split.
            AssetError: an object that does not fit the task.
        """
        if name not in SETTABLE:
            raise ConfigError(f"{name!r} cannot be set, only {', '.join(SETTABLE)}: make another environment")
        self._episodes.draw_from(per_env(name, values, len(self._episodes.levels)))

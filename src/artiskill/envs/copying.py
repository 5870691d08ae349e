"""Copies of environments: made anew from the constructor's arguments, then put where the original is.

The engine's memory can be neither pickled nor copied, but all that the future depends on can: the saved states of
episodes, and the generators that later ones are drawn from.
"""

import copy
from collections.abc import Callable, Iterator
from typing import Any, Self

import gymnasium as gym

from artiskill.envs.observation import Observer
from artiskill.envs.sampling import EpisodeSampler
from artiskill.tasks.task import Task


class CopiedByState:
    """An environment that `pickle` and `copy` take: the same actions give the same bits in the copy.

    Attributes that neither the constructor nor the episode brings back travel as they are: Gymnasium's `spec` and
    generator, and what a subclass or a user has added.
    """

    _remade: frozenset[str]  # names of the attributes that the constructor makes
    _make_observer: Callable[[Task], Observer]
    observe_with: Callable[[Callable[[Task], Observer]], None]

    def _arguments(self) -> dict[str, Any]:
        """What the constructor has to be given for an environment such as this one, whatever files are there."""
        raise NotImplementedError

    def _save_episodes(self) -> dict[str, Any]:
        """Where all episodes are, and what the next ones are drawn from.

        Raises:
            DivergedError: the physics of an episode ran away: there is no state to go on from.
        """
        raise NotImplementedError

    def _restore_episodes(self, saved: dict[str, Any]) -> None:
        """Go to what `_save_episodes` told."""
        raise NotImplementedError

    def _castings(self) -> tuple[EpisodeSampler, ...]:
        """What draws the objects, each once."""
        raise NotImplementedError

    def __getstate__(self) -> dict[str, Any]:
        return {
            "arguments": self._arguments(),
            "observer": self._make_observer,
            "kept": {name: value for name, value in vars(self).items() if name not in self._remade},
            "samplers": [space._np_random for space in _spaces(self)],
            "episodes": self._save_episodes(),
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        # not `self.__init__`: that of a subclass may take other arguments
        constructed: Any = next(cls for cls in type(self).__mro__ if "_arguments" in vars(cls))
        constructed.__init__(self, **state["arguments"])
        if state["observer"] is not self._make_observer:
            self.observe_with(state["observer"])
        vars(self).update(state["kept"])
        for space, sampler in zip(_spaces(self), state["samplers"], strict=True):
            space._np_random = sampler
        self._restore_episodes(state["episodes"])

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        made = type(self).__new__(type(self))
        memo[id(self)] = made
        for casting in self._castings():  # objects are read-only, and shared as by any environments
            memo.update({id(one): one for one in (*casting.choices, *casting.handed_in)})
        made.__setstate__(copy.deepcopy(self.__getstate__(), memo))
        return made

    def __copy__(self) -> Self:
        """A copy that steps on its own, too: two environments cannot share one episode."""
        return copy.deepcopy(self)


def _spaces(env: Any) -> Iterator[gym.Space[Any]]:
    """All spaces of an environment, or of a vector, that may be sampled from."""
    for name in ("observation_space", "action_space", "single_observation_space", "single_action_space"):
        if name in vars(env):
            yield from _with_parts(vars(env)[name])


def _with_parts(space: gym.Space[Any]) -> Iterator[gym.Space[Any]]:
    """A space and all below it; each has a generator of its own."""
    yield space
    if isinstance(space, gym.spaces.Dict):
        for part in space.values():
            yield from _with_parts(part)

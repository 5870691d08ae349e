"""`EnvBase`: what the single and the vector environment share, their copies included.

A copy is made anew from the constructor's arguments, then put where the original is. The engine's memory can be
neither pickled nor copied, but everything that the future depends on can: the saved states of episodes, and the
generators that later ones are drawn from.
"""

import copy
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Self

import gymnasium as gym

from artiskill.envs.control import Control
from artiskill.envs.core import Episodes, MakeObserver, ObservationBuffers
from artiskill.envs.options import check_flag
from artiskill.envs.rendering import WorldViews
from artiskill.envs.sampling import EpisodeSampler, ObjectChoice
from artiskill.envs.state import EnvState, restore_episodes, save_all
from artiskill.tasks.registry import make_task


class EnvBase:
    """A view of `Episodes`, which `pickle` and `copy` take: the same actions give the same bits in the copy.

    Attributes that neither the constructor nor the episodes bring back are copied as they are: Gymnasium's `spec`
    and generator, and what a subclass or a user has added.
    """

    obs_mode: str
    reward_mode: str
    render_mode: str | None
    num_threads = 1
    gives_copies = True
    _remade: frozenset[str]  # names of the attributes that the constructor makes

    def _make_episodes(
        self,
        task: str,
        config: Mapping[str, Any] | None,
        control_mode: str,
        choices: Sequence[ObjectChoice],
        target: str | None,
        terminate_on_success: bool,
        num_envs: int = 1,
    ) -> None:
        """Make the task and its episodes; `choices` is of every environment, or one that all share."""
        self.task = make_task(task, config)
        self._config = copy.deepcopy(config)
        self.control = Control(self.task.robot, control_mode)
        samplers = [EpisodeSampler(self.task, choice, target) for choice in choices]
        samplers *= num_envs // len(samplers)
        ends = check_flag("terminate_on_success", terminate_on_success)
        self._episodes = Episodes(self.task, self.control, samplers, self.num_threads, ends)
        self._views = WorldViews()

    def observe_with(self, make_observer: MakeObserver) -> None:
        """Observe in another way from the next `reset` or `step` on; for wrappers.

        Args:
            make_observer: called for each environment, and again in every copy: it must pickle for copies to.
        """
        self._make_observer = make_observer
        self._observations = ObservationBuffers(self._episodes, make_observer, self.num_threads, self.gives_copies)
        self._set_observation_space(self._observations.space)

    def _set_observation_space(self, space: gym.Space[Any]) -> None:
        raise NotImplementedError

    def _start(
        self, envs: Sequence[int], levels: Sequence[int], objects: Sequence[Any], targets: Sequence[str | None]
    ) -> None:
        for env in self._episodes.start(envs, levels, objects, targets):
            self._observations.enter(env)

    def _restore(self, envs: Sequence[int], states: Sequence[EnvState]) -> None:
        for env in restore_episodes(self._episodes, envs, states):
            self._observations.enter(env)
        self._observations.stale[list(envs)] = True
        self._episodes.evaluate()

    # -- copies --------------------------------------------------------------------------------------------------

    def _arguments(self) -> dict[str, Any]:
        """Return what the constructor has to be given for an environment such as this one."""
        sampler = self._episodes.samplers[0]
        return {
            "task": self.task.name,
            "objects": sampler.choices,
            "target": sampler.fixed_target,
            "obs_mode": self.obs_mode,
            "reward_mode": self.reward_mode,
            "control_mode": self.control.mode,
            "render_mode": self.render_mode,
            "config": self._config,
            "terminate_on_success": self._episodes.end_at_success,
        }

    def _save_episodes(self) -> dict[str, Any]:
        """Return where all episodes are.

        Raises:
            DivergedError: the physics of an episode diverged: there is no state to go on from.
        """
        handed_in = [sampler.handed_in for sampler in self._episodes.samplers]
        return {"handed_in": handed_in, "states": save_all(self._episodes)}

    def _restore_episodes(self, saved: dict[str, Any]) -> None:
        """Restore what `_save_episodes` returned."""
        for sampler, objects in zip(self._episodes.samplers, saved["handed_in"], strict=True):
            for obj in objects:
                sampler.remember(obj)
        if saved["states"]:
            self._restore(range(self._episodes.count), saved["states"])

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
        constructed: Any = next(cls for cls in type(self).__mro__ if EnvBase in cls.__bases__)
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
        for sampler in self._episodes.samplers:  # objects are read-only, and shared as by any environments
            memo.update({id(one): one for one in (*sampler.choices, *sampler.handed_in)})
        made.__setstate__(copy.deepcopy(self.__getstate__(), memo))
        return made

    def __copy__(self) -> Self:
        """Return a copy that steps on its own, too: two environments cannot share one episode."""
        return copy.deepcopy(self)


def _spaces(env: Any) -> Iterator[gym.Space[Any]]:
    """Yield all spaces of an environment, single or vector, that may be sampled from."""
    for name in ("observation_space", "action_space", "single_observation_space", "single_action_space"):
        if name in vars(env):
            yield from _with_parts(vars(env)[name])


def _with_parts(space: gym.Space[Any]) -> Iterator[gym.Space[Any]]:
    """Yield a space and all below it; each has a generator of its own."""
    yield space
    if isinstance(space, gym.spaces.Dict):
        for part in space.values():
            yield from _with_parts(part)

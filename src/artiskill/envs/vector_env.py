"""`ManipulationVectorEnv`: many episodes of a task at once, as one of Gymnasium's vector environments."""

import copy as copying
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from artiskill.envs.control import JOINT, Control, check_actions
from artiskill.envs.copying import CopiedByState
from artiskill.envs.observation import Observer, StateObserver
from artiskill.envs.options import (
    OBSERVERS,
    RESET_OPTIONS,
    VECTOR_RENDER_MODES,
    as_autoreset_mode,
    check_modes,
    checked_options,
    env_count,
    env_number,
    per_env,
    reset_mask,
    reset_seeds,
    thread_count,
)
from artiskill.envs.sampling import EpisodeSampler, ObjectChoice
from artiskill.envs.state import EnvState
from artiskill.envs.vector.attributes import SINGLE, EnvAttributes
from artiskill.envs.vector.episodes import Episodes
from artiskill.envs.vector.info import only, with_masks
from artiskill.envs.vector.observation import VectorObserver, VectorStateObserver, VectorVisionObserver
from artiskill.envs.vector.sight import Sight
from artiskill.envs.vector.state import restore_all, restore_env, save_all, save_env
from artiskill.envs.vector.views import WorldViews
from artiskill.errors import Cause, ConfigError, DivergedError, ResetNeededError
from artiskill.tasks.levels import check_level
from artiskill.tasks.registry import make_task
from artiskill.tasks.task import Task


class ManipulationVectorEnv(CopiedByState, gym.vector.VectorEnv[Any, Any, Any]):
    """B episodes of one task, over one object or many, stepped as one batch.

    Each environment does bit for bit what a `ManipulationEnv` does with the same level and actions, for any number
    of environments and threads and in any order of resets. Spaces, rewards, modes and options are those of
    `ManipulationEnv`, with a leading dimension B; `reset(seed=s)` starts the levels s, s + 1, ....

    `info` has what a single environment's has, as arrays with Gymnasium's masks beside them.

    Args:
        num_envs: B.
        task, objects, target, obs_mode, reward_mode, control_mode, config: as of `ManipulationEnv`.
        render_mode: None or `rgb_array`; a window is for single environments.
        env_objects: what each environment draws from, if not all from the same: B choices.
        num_threads: threads that step and draw; None for one per core, but no more than B.
        copy: whether observations are the caller's to keep. Else each call writes into the same arrays.
        autoreset_mode: what happens after an episode's end: `next_step` (the next `step` resets), `same_step`
            (reset at once; the last observation and info go to `info["final_obs"]` and `info["final_info"]`) or
            `disabled` (call `reset(options={"reset_mask": done})`).

    Raises:
        UnknownNameError, ConfigError: as `ManipulationEnv`; also fewer than one environment or thread.
    """

    metadata: dict[str, Any] = {"render_modes": list(VECTOR_RENDER_MODES), "render_fps": 20}  # noqa: RUF012 - as in Gymnasium

    def __init__(
        self,
        num_envs: int = 1,
        task: str = "OpenCabinetDrawer",
        objects: ObjectChoice = "train",
        target: str | None = None,
        obs_mode: str = "state",
        reward_mode: str = "dense",
        control_mode: str = JOINT,
        render_mode: str | None = None,
        config: Mapping[str, Any] | None = None,
        env_objects: Sequence[ObjectChoice] | None = None,
        num_threads: int | None = None,
        copy: bool = True,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    ) -> None:
        already = frozenset(vars(self))
        check_modes(obs_mode, reward_mode, control_mode, render_mode, VECTOR_RENDER_MODES)
        self.num_envs = env_count(num_envs)
        self.num_threads = thread_count(num_threads, num_envs)
        self.task = make_task(task, config)
        self.obs_mode, self.reward_mode, self.render_mode = obs_mode, reward_mode, render_mode
        self._config = copying.deepcopy(config)
        self.gives_copies = copy
        self.autoreset_mode = as_autoreset_mode(autoreset_mode)
        self.metadata = self.metadata | {"autoreset_mode": self.autoreset_mode}
        each = [objects] if env_objects is None else per_env("env_objects", env_objects, num_envs)
        castings = [EpisodeSampler(self.task, choice, target) for choice in each]
        self.control = Control(self.task.robot, control_mode)
        self.single_action_space = self.control.space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._episodes = Episodes(self.task, castings * (num_envs // len(castings)), self.num_threads)
        self._done, self._all = np.zeros(num_envs, dtype=bool), np.ones(num_envs, dtype=bool)
        self._views, self._attributes = WorldViews(self._episodes), EnvAttributes(self._episodes)
        self.observe_with(OBSERVERS[obs_mode])
        self._remade = frozenset(vars(self)) - already

    # -- episodes ------------------------------------------------------------------------------------------------

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start episodes in all environments, or in those of `options["reset_mask"]`.

        Args:
            seed: a level for the first environment (the others have the next ones), or a list of B, or of Nones.
            options: `level`, `object` and `target`, each one for all or a list of B; `reset_mask`, (B,) bool.

        Raises:
            ConfigError: a level that is no integer in range, a list of another length, an illegal mask.
            UnknownNameError: an unknown option, object or target link.
        """
        self._sight.check_open()
        given = checked_options(options, RESET_OPTIONS)
        mask = reset_mask(given, self.num_envs)
        if not mask.all() and not self._episodes.begun:
            raise ResetNeededError("the first reset() must be of all environments")
        seeds = reset_seeds(seed, self.num_envs)
        levels, objects, targets = (
            per_env(key, given.get(key), self.num_envs) for key in ("level", "object", "target")
        )
        envs = np.flatnonzero(mask).tolist()
        chosen = [None if levels[env] is None else check_level(levels[env]) for env in envs]
        drawn = [self._episodes.level_of(env, seeds[env], level) for env, level in zip(envs, chosen, strict=True)]
        self._start(envs, drawn, [objects[env] for env in envs], [targets[env] for env in envs])
        self._episodes.evaluate()
        self._done[envs] = False
        self._sight.renew()
        info = self._sight.look(mask | self._sight.stale, told=mask)
        return self._sight.arrays, with_masks(info, mask)

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One environment step of 0.05 s of all environments.

        Args:
            actions: (B, A).

        Returns:
            Observations, rewards (B,), terminations (B,), truncations (B,) and infos. With `next_step`, an
            environment whose episode was over starts the next one instead: no action, reward 0.

        Raises:
            ActionError: actions of the wrong shape or with values that are not finite.
            ResetNeededError: called before the first `reset`, or, without automatic resets, with an episode over.
            DivergedError: physics ran away; docs/vector.md says where the others are then.
        """
        actions = check_actions(actions, self.num_envs, self.control.size)
        self._sight.check_open()
        self._check_begun("step()")
        resting = self._done
        if self.autoreset_mode is AutoresetMode.DISABLED and resting.any():
            over = np.flatnonzero(resting).tolist()
            raise ResetNeededError(f"the episodes of environments {over} are over; reset them by a reset_mask")
        diverged = self._advance(actions, resting)
        rewards, terminated, truncated = self._episodes.outcome(self.reward_mode == "dense", resting)
        self._done = terminated | truncated
        if diverged:
            self._sight.stale[:] = True
            raise DivergedError(diverged)
        self._sight.renew()
        at_once = self.autoreset_mode is AutoresetMode.SAME_STEP and self._done.any()
        final = self._restart_at_once() if at_once else {}
        info = with_masks(self._sight.look(), self._all)
        return self._sight.arrays, rewards, terminated, truncated, info | final

    def _advance(self, actions: np.ndarray, resting: np.ndarray) -> dict[int, Cause]:
        """Step the environments that do not rest, start new episodes in those that do; who diverged, and why."""
        episodes, targets = self._episodes, []
        for squad, taken, members in episodes.fleet:
            rows = np.zeros((len(squad.members), actions.shape[1]))
            rows[taken] = actions[members]
            targets.append((squad, self.control.to_targets(rows, squad.snapshot)))
        diverged = episodes.fleet.step(targets, resting)
        if resting.any():
            self._restart(resting)
        episodes.evaluate()
        episodes.progress.advance(episodes.flags, ~resting)
        return diverged

    def _restart_at_once(self) -> dict[str, Any]:
        """Report the last instant of the episodes that are over, for the step's infos, and start new ones."""
        over = self._done
        last = only(self._sight.look(over), over)
        final = {"final_obs": self._sight.last_of(over), "final_info": with_masks(last, over)}
        self._restart(over)
        self._episodes.evaluate()
        self._done = np.zeros(self.num_envs, dtype=bool)
        return final | {"_final_obs": over, "_final_info": over.copy()}

    def _restart(self, over: np.ndarray) -> None:
        envs = np.flatnonzero(over).tolist()
        nothing = [None] * len(envs)
        self._start(envs, list(map(self._episodes.next_level, envs)), nothing, nothing)

    def _check_begun(self, what: str) -> None:
        if not self._episodes.begun:
            raise ResetNeededError(f"call reset() before {what}")

    def _start(
        self, envs: list[int], levels: Sequence[int], objects: Sequence[Any], targets: Sequence[Any]
    ) -> None:
        for env in self._episodes.start(envs, levels, objects, targets):
            self._enter(env)

    def _enter(self, env: int) -> None:
        self._sight.enter(env)
        self._views.forget(env)

    # -- observations --------------------------------------------------------------------------------------------

    def observe_with(self, make_observer: Callable[[Task], Observer]) -> None:
        """Observe in another way from the next `reset` or `step` on; for wrappers.

        Args:
            make_observer: called for each environment, and again in copies: what pickles, if those shall.
        """
        self._make_observer = make_observer
        observer: VectorObserver
        if make_observer is StateObserver:
            observer = VectorStateObserver(self.task)
        else:
            observer = VectorVisionObserver(partial(make_observer, self.task), self.num_envs, self.num_threads)
        self.single_observation_space = observer.space
        self.observation_space = batch_space(observer.space, self.num_envs)
        self._sight = Sight(self._episodes, observer, self.gives_copies)

    def render(self) -> tuple[np.ndarray, ...]:
        """Every scene from the world camera, B of (480, 640, 3) uint8.

        Raises:
            ResetNeededError: called before the first `reset`.
            ConfigError: the environment was made without `render_mode="rgb_array"`.
        """
        if self.render_mode is None:
            raise ConfigError("this environment was made without a render mode; pass render_mode='rgb_array'")
        self._check_begun("render()")
        return self._views.draw()

    # -- single environments -------------------------------------------------------------------------------------

    def save_state(self, env: int) -> EnvState:
        """The instant of one environment, as a `ManipulationEnv` has it.

        Raises:
            ConfigError: no environment of this number.
        """
        return save_env(self._episodes, env_number(env, self.num_envs))

    def restore_state(self, env: int, state: EnvState) -> None:
        """Take back an instant, of this or a single environment; what it observes comes with the next `step`.

        Raises:
            StateError: as `ManipulationEnv.restore_state`.
            ConfigError: as `save_state`.
        """
        restore_env(self._episodes, env_number(env, self.num_envs), state)
        self._enter(env)
        self._done[env] = False

    def close_extras(self, **kwargs: Any) -> None:
        """Stop the threads that draw."""
        self._sight.close()

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of every environment.

        Args:
            name: `object`, `level`, `target`, `objects` (what it draws from), `scene`, `snapshot`, `goal`, its
                spaces, or what all share, such as `task`.

        Raises:
            AttributeError: there is none of this name.
            ResetNeededError: it is of an episode, and none has begun.
        """
        if name in self._attributes:
            return self._attributes.get(name)
        return (getattr(self, SINGLE.get(name, name)),) * self.num_envs

    def set_attr(self, name: str, values: Any) -> None:
        """Have environments draw their next objects from elsewhere; episodes under way go on.

        Args:
            name: `objects`.
            values: a choice for all, or a list of one for each environment.

        Raises:
            ConfigError: another name, which would need another environment; a list of another length.
            UnknownNameError, AssetError: as of a new environment.
        """
        self._attributes.set(name, values)

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """`save_state` or `render` of every environment, or an attribute as `get_attr` has it.

        Raises:
            AttributeError: there is none of this name.
            ConfigError: another method: it would not be of one environment.
        """
        if name in ("save_state", "render"):
            return self.render() if name == "render" else tuple(map(self.save_state, range(self.num_envs)))
        found = self.get_attr(name)
        if callable(found[0]):
            raise ConfigError(f"{name!r} is no method of one environment; legal: save_state, render")
        return found

    # -- copies, see `CopiedByState` -----------------------------------------------------------------------------

    def _arguments(self) -> dict[str, Any]:
        first, *others = self._castings()
        choices = [casting.choices for casting in self._episodes.castings]
        return {
            "num_envs": self.num_envs,
            "task": self.task.name,
            "objects": first.choices,
            "target": first.fixed_target,
            "obs_mode": self.obs_mode,
            "reward_mode": self.reward_mode,
            "control_mode": self.control.mode,
            "render_mode": self.render_mode,
            "config": self._config,
            "env_objects": choices if others else None,
            "num_threads": self.num_threads,
            "copy": self.gives_copies,
            "autoreset_mode": self.autoreset_mode,
        }

    def _save_episodes(self) -> dict[str, Any]:
        return save_all(self._episodes) | {"done": self._done, "closed": self._sight.is_closed}

    def _restore_episodes(self, saved: dict[str, Any]) -> None:
        for env in restore_all(self._episodes, saved):
            self._enter(env)
        self._done = saved["done"].copy()
        if saved["closed"]:
            self._sight.close()

    def _castings(self) -> tuple[EpisodeSampler, ...]:
        return tuple({id(casting): casting for casting in self._episodes.castings}.values())

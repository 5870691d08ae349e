"""`ManipulationVectorEnv`: many episodes of a task at once, as one of Gymnasium's vector environments."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from artiskill.envs.base import EnvBase
from artiskill.envs.control import JOINT, check_actions
from artiskill.envs.core import Episodes, copied, row_of
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
from artiskill.envs.sampling import EpisodeSampler, ObjectChoice, draw_level
from artiskill.envs.state import EnvState, save_episode
from artiskill.errors import ConfigError, DivergedError, ResetNeededError
from artiskill.tasks.levels import check_level

SETTABLE = ("objects",)  # attributes of single environments that may be changed
# Gymnasium's names of what one environment has -> ours of the vector's
_SINGLE = {"action_space": "single_action_space", "observation_space": "single_observation_space"}
# attributes of single environments that exist only while they have episodes
_OF_EPISODE: Mapping[str, Callable[[Episodes, int], Any]] = {
    "object": lambda episodes, env: episodes.objects[env],
    "level": lambda episodes, env: int(episodes.levels[env]),
    "target": lambda episodes, env: episodes.targets[env],
    "scene": lambda episodes, env: episodes.group.scene_of(env),
    "goal": lambda episodes, env: episodes.group.goal_of(env),
    "snapshot": lambda episodes, env: episodes.group.snapshot_of(env),
}


class ManipulationVectorEnv(EnvBase, gym.vector.VectorEnv[Any, Any, Any]):
    """B episodes of one task, over one object or many, stepped as one batch.

    Each environment does bit for bit what a `ManipulationEnv` does with the same level and actions, for any number
    of environments and threads and in any order of resets. Spaces, rewards, modes and options are those of
    `ManipulationEnv`, with a leading dimension B; `reset(seed=s)` starts the levels s, s + 1, ....

    `info` has what a single environment's has, as arrays with Gymnasium's masks beside them.

    Args:
        num_envs: B.
        task, objects, target, obs_mode, reward_mode, control_mode, config, terminate_on_success: as of
            `ManipulationEnv`.
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
        terminate_on_success: bool = True,
    ) -> None:
        already = frozenset(vars(self))
        check_modes(obs_mode, reward_mode, control_mode, render_mode, VECTOR_RENDER_MODES)
        self.num_envs = env_count(num_envs)
        self.num_threads = thread_count(num_threads, num_envs)
        self.obs_mode, self.reward_mode, self.render_mode = obs_mode, reward_mode, render_mode
        self.gives_copies = copy
        self.autoreset_mode = as_autoreset_mode(autoreset_mode)
        self.metadata = self.metadata | {"autoreset_mode": self.autoreset_mode}
        choices = [objects] if env_objects is None else per_env("env_objects", env_objects, num_envs)
        self._make_episodes(task, config, control_mode, choices, target, terminate_on_success, num_envs)
        self.single_action_space = self.control.space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._done, self._all = np.zeros(num_envs, dtype=bool), np.ones(num_envs, dtype=bool)
        self._generators: list[np.random.Generator | None] = [None] * num_envs  # of the next levels
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
        self._observations.check_open()
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
        drawn = [self._level_of(env, seeds[env], level) for env, level in zip(envs, chosen, strict=True)]
        self._start(envs, drawn, [objects[env] for env in envs], [targets[env] for env in envs])
        self._episodes.evaluate()
        self._done[envs] = False
        self._observations.renew()
        info = self._observe(mask | self._observations.stale, asked=mask)
        return self._observations.arrays, with_masks(info, mask)

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Take one environment step of 0.05 s in all environments.

        Args:
            actions: (B, A).

        Returns:
            Observations, rewards (B,), terminations (B,), truncations (B,) and infos. With `next_step`, an
            environment whose episode was over starts the next one instead: no action, reward 0.

        Raises:
            ActionError: actions of the wrong shape or with values that are not finite.
            ResetNeededError: called before the first `reset`, or, without automatic resets, with an episode over.
            DivergedError: the physics diverged; docs/vector.md says where the others are then.
        """
        actions = check_actions(actions, self.num_envs, self.control.size)
        self._observations.check_open()
        episodes = self._episodes
        episodes.check_begun("step()")
        resting = self._done if self._done.any() else None
        if self.autoreset_mode is AutoresetMode.DISABLED and resting is not None:
            over = np.flatnonzero(resting).tolist()
            raise ResetNeededError(f"the episodes of environments {over} are over; reset them by a reset_mask")
        diverged = episodes.step(actions, resting)
        if resting is not None:
            self._restart(resting)
        episodes.evaluate()
        episodes.advance(None if resting is None else ~resting)
        rewards, terminated, truncated = episodes.outcome(self.reward_mode == "dense", resting)
        self._done = terminated | truncated
        if diverged:
            self._observations.stale[:] = True
            raise DivergedError(diverged)
        self._observations.renew()
        at_once = self.autoreset_mode is AutoresetMode.SAME_STEP and self._done.any()
        final = self._restart_at_once() if at_once else {}
        info = with_masks(self._observe(), self._all)
        return self._observations.arrays, rewards, terminated, truncated, info | final

    def _restart_at_once(self) -> dict[str, Any]:
        """Start new episodes where they are over; return the last observations and infos, for the step's infos."""
        over = self._done
        last = only(self._observe(over), over)
        observations = np.full(self.num_envs, None, dtype=object)
        for env in np.flatnonzero(over).tolist():
            observations[env] = copied(row_of(self._observations.arrays, env))
        self._restart(over)
        self._episodes.evaluate()
        self._done = np.zeros(self.num_envs, dtype=bool)
        return {
            "final_obs": observations.view(ObjectArray),
            "final_info": with_masks(last, over),
            "_final_obs": over,
            "_final_info": over.copy(),
        }

    def _restart(self, over: np.ndarray) -> None:
        envs = np.flatnonzero(over).tolist()
        nothing = [None] * len(envs)
        self._start(envs, [self._level_of(env) for env in envs], nothing, nothing)

    def _level_of(self, env: int, seed: int | None = None, chosen: int | None = None) -> int:
        """Return the level of a reset: what the options say, else the seed, else the next one that is drawn."""
        if seed is not None:
            self._generators[env], _ = seeding.np_random(seed)
        if chosen is not None:
            return chosen
        if seed is not None:
            return seed
        generator = self._generators[env]
        if generator is None:
            generator = self._generators[env] = seeding.np_random()[0]
        return draw_level(generator)

    def _observe(self, envs: np.ndarray | None = None, asked: np.ndarray | None = None) -> dict[str, Any]:
        """Observe environments, (B,) bool, all by default; return their infos as arrays (B, ...).

        Args:
            envs: who observes.
            asked: (B,) bool, of whom the observation mode's own infos are wanted; None for all that observe.
        """
        added = self._observations.observe(envs)
        wanted = {env: info for env, info in added.items() if asked is None or asked[env]}
        return self._episodes.info() | stacked(wanted, self.num_envs)

    def _set_observation_space(self, space: gym.Space[Any]) -> None:
        self.single_observation_space = space
        self.observation_space = batch_space(space, self.num_envs)

    def render(self) -> tuple[np.ndarray, ...]:
        """Return every scene from the world camera, B of (480, 640, 3) uint8.

        Raises:
            ResetNeededError: called before the first `reset`.
            ConfigError: the environment was made without `render_mode="rgb_array"`.
        """
        if self.render_mode is None:
            raise ConfigError("this environment was made without a render mode; pass render_mode='rgb_array'")
        self._episodes.check_begun("render()")
        return tuple(self._views.draw(self._episodes, env) for env in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Stop the threads that render."""
        self._observations.close()

    # -- single environments -------------------------------------------------------------------------------------

    def save_state(self, env: int) -> EnvState:
        """Return the state of one environment, as a `ManipulationEnv` has it.

        Raises:
            ConfigError: no environment of this number.
            ResetNeededError: called before the first `reset`.
        """
        return save_episode(self._episodes, env_number(env, self.num_envs))

    def restore_state(self, env: int, state: EnvState) -> None:
        """Restore a state of this or a single environment; what it observes comes with the next `step`.

        Raises:
            StateError: as `ManipulationEnv.restore_state`.
            ConfigError: as `save_state`.
            ResetNeededError: called before the first `reset`.
        """
        env = env_number(env, self.num_envs)
        self._episodes.check_begun("restore_state()")
        self._restore([env], [state])
        self._done[env] = False

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Return an attribute of every environment.

        Args:
            name: `object`, `level`, `target`, `objects` (what it draws from), `scene`, `snapshot`, `goal`, its
                spaces, or what all share, such as `task`.

        Raises:
            AttributeError: there is none of this name.
            ResetNeededError: it is of an episode, and none has begun.
        """
        if name == "objects":
            return tuple(sampler.choices for sampler in self._episodes.samplers)
        if name in _OF_EPISODE:
            self._episodes.check_begun(f"asking for {name!r}")
            return tuple(_OF_EPISODE[name](self._episodes, env) for env in range(self.num_envs))
        return (getattr(self, _SINGLE.get(name, name)),) * self.num_envs

    def set_attr(self, name: str, values: Any) -> None:
        """Have environments draw their next objects from elsewhere; episodes under way go on.

        Args:
            name: `objects`.
            values: a choice for all, or a list of one for each environment.

        Raises:
            ConfigError: another name, which would need another environment; a list of another length.
            UnknownNameError, AssetError: as of a new environment.
        """
        if name not in SETTABLE:
            raise ConfigError(f"{name!r} cannot be set, only {', '.join(SETTABLE)}: make another environment")
        samplers = zip(self._episodes.samplers, per_env(name, values, self.num_envs), strict=True)
        self._episodes.samplers = [EpisodeSampler(self.task, choice, old.fixed_target) for old, choice in samplers]

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Call `save_state` or `render` of every environment, or return an attribute as `get_attr` does.

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

    # -- copies, see `EnvBase` -----------------------------------------------------------------------------------

    def _arguments(self) -> dict[str, Any]:
        samplers = self._episodes.samplers
        are_shared = all(sampler is samplers[0] for sampler in samplers)
        return super()._arguments() | {
            "num_envs": self.num_envs,
            "env_objects": None if are_shared else [sampler.choices for sampler in samplers],
            "num_threads": self.num_threads,
            "copy": self.gives_copies,
            "autoreset_mode": self.autoreset_mode,
        }

    def _save_episodes(self) -> dict[str, Any]:
        own = {"generators": self._generators, "done": self._done, "closed": self._observations.is_closed}
        return super()._save_episodes() | own

    def _restore_episodes(self, saved: dict[str, Any]) -> None:
        super()._restore_episodes(saved)
        self._generators, self._done = list(saved["generators"]), saved["done"].copy()
        if saved["closed"]:
            self._observations.close()


class ObjectArray(np.ndarray):
    """An array (B,) of names, or of observations, or of None; a type of its own for `ArrayConversion`'s sake."""


def _register_conversion() -> None:
    """Register a conversion for Gymnasium's `ArrayConversion` (`NumpyToTorch`, ...), which takes numbers only."""
    try:
        from gymnasium.wrappers.array_conversion import array_conversion
    except ImportError:  # Gymnasium before 1.2 has other wrappers
        return

    def convert(values: ObjectArray, xp: Any, device: Any = None) -> ObjectArray:
        converted = np.full_like(values, None)
        for i, value in enumerate(values):
            converted[i] = value if isinstance(value, str) else array_conversion(value, xp, device)
        return converted

    array_conversion.register(ObjectArray, convert)


_register_conversion()


def with_masks(values: Mapping[str, Any], mask: np.ndarray) -> dict[str, Any]:
    """Return arrays (B, ...) and nested mappings of them with the (B,) mask `_k` beside each key `k`."""
    out: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            out[key] = with_masks(value, mask)
        else:
            out[key] = value.view(ObjectArray) if value.dtype == object else value
        out[f"_{key}"] = mask.copy()
    return out


def only(values: Mapping[str, Any], mask: np.ndarray) -> dict[str, Any]:
    """Return copies of the arrays, zero (None for objects) outside the mask."""
    out: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            out[key] = only(value, mask)
        else:
            kept = np.full_like(value, None) if value.dtype == object else np.zeros_like(value)
            kept[mask] = value[mask]
            out[key] = kept
    return out


def stacked(infos: Mapping[int, Mapping[str, Any]], num_envs: int) -> dict[str, Any]:
    """Return mappings of each environment as arrays (B, ...), zero where an environment has none."""
    out: dict[str, Any] = {}
    for env, info in infos.items():
        _write(info, env, num_envs, out)
    return out


def _write(info: Mapping[str, Any], env: int, num_envs: int, out: dict[str, Any]) -> None:
    for key, value in info.items():
        if isinstance(value, Mapping):
            _write(value, env, num_envs, out.setdefault(key, {}))
        else:
            array = np.asarray(value)
            out.setdefault(key, np.zeros((num_envs, *array.shape), array.dtype))[env] = array

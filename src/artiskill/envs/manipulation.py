"""`ManipulationEnv`: a task as a Gymnasium environment, one episode at a time."""

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np

from artiskill.envs.base import EnvBase
from artiskill.envs.control import JOINT, check_action
from artiskill.envs.core import row_of
from artiskill.envs.options import HUMAN, OBSERVERS, RENDER_MODES, check_modes, checked_options
from artiskill.envs.rendering import Window, render_modes_here
from artiskill.envs.sampling import ObjectChoice, draw_level
from artiskill.envs.state import EnvState, save_episode
from artiskill.errors import ConfigError, DivergedError
from artiskill.scene.scene import Scene
from artiskill.sim.simulation import Simulation
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.levels import check_level
from artiskill.tasks.task import Goal


class ManipulationEnv(EnvBase, gym.Env[Any, np.ndarray]):
    """One task, over one object or many, as a Gymnasium environment.

    ## Action space

    `Box(-1, 1, (13,), float32)`, or 22 with two arms: one number per joint; values outside are clipped.

    | Numbers | Controls | -1 .. +1 means |
    |---|---|---|
    | 0-1 | base velocity x, y in the robot's own frame | -0.5 .. 0.5 m/s |
    | 2 | base yaw rate | -3.14 .. 3.14 rad/s |
    | 3 | lift velocity | -0.5 .. 0.5 m/s |
    | 4-10 | velocities of the arm's joints | -3.14 .. 3.14 rad/s |
    | 11-12 | position of each finger | 0 .. 0.04 m |

    A second arm's nine follow. `control_mode="operational_space"` has hand twists for arm joints: docs/control.md.

    ## Observation space

    By `obs_mode`; docs/observations.md says more. `agent` is the robot's part of the state, its last A numbers: 38
    with one arm, 68 with two. K masks: target handle, target link and robot in the cabinet tasks; the robot alone
    in PushChair and MoveBucket.

    - `state`: `Box` of float32 with finite bounds; `task.state_fields` lists every run of numbers with its unit.
    - `pointcloud`: `{"pointcloud": {"xyz": (192000, 3) float32 world, "rgb": (192000, 3) uint8, "seg":
      (192000, K) bool}, "agent": (A,) float32}`.
    - `rgbd`: `{"rgbd": {"rgb": (160, 400, 9) uint8, "depth": (160, 400, 3) float32, "seg": (160, 400, 3K) bool},
      "agent": (A,) float32}`; three cameras.

    ## Rewards

    `dense`: the weighted sum of the task's reward terms, all of them in `info["reward_terms"]` (unweighted); never
    above 0, so that solving the task early is best.
    `sparse`: 1 in a step in which the task is solved, else 0.

    ## Episodes

    A *level* is the integer that determines everything about an episode. `reset(seed=s)` starts level s; `reset()`
    draws the next level; `reset(options={"level": ..., "object": ..., "target": ...})` is explicit. An episode
    is `terminated` when the task is solved and `truncated` after `task.episode_steps` steps. With
    `terminate_on_success=False` it goes on to those steps in any case.

    `info` has `object`, `level`, `target`, `success`, `flags` (condition -> has it held for half a second by now)
    and `reward_terms`; in visual modes also `cameras`, their intrinsics and extrinsics. To branch an episode use
    `save_state`, which pickles. `copy.deepcopy` and `pickle` make another environment in the same state.

    Args:
        task: name of the task.
        objects: a split (`train`, `test`, `all`), an object's id, a list of ids, or `ArticulatedObject`s.
        target: fix the target link; by default the level draws one.
        obs_mode: `state`, `pointcloud` or `rgbd`.
        reward_mode: `dense` or `sparse`.
        control_mode: `joint` or `operational_space`.
        render_mode: None, `rgb_array`, or `human`: a window, drawn at every `reset` and `step`, in real time.
        config: values of the task's YAML to change, `{"episode_steps": 100}`; keys may be dotted.
        terminate_on_success: whether an episode is over once it is solved.

    Raises:
        UnknownNameError: an unknown task, object, split, mode or target link.
        ConfigError: an unknown or illegal configuration value; no display for `human`.
        MissingExtraError: `human` without the extra `viewer`.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 20}  # noqa: RUF012 - as in Gymnasium

    def __init__(
        self,
        task: str = "OpenCabinetDrawer",
        objects: ObjectChoice = "train",
        target: str | None = None,
        obs_mode: str = "state",
        reward_mode: str = "dense",
        control_mode: str = JOINT,
        render_mode: str | None = None,
        config: Mapping[str, Any] | None = None,
        terminate_on_success: bool = True,
    ) -> None:
        already = frozenset(vars(self))
        check_modes(obs_mode, reward_mode, control_mode, render_mode)
        self.obs_mode, self.reward_mode, self.render_mode = obs_mode, reward_mode, render_mode
        self._make_episodes(task, config, control_mode, [objects], target, terminate_on_success)
        self.action_space = self.control.space
        self.observe_with(OBSERVERS[obs_mode])
        fps = self.metadata["render_fps"]
        self._window = Window(f"ArtiSkill: {task}", fps) if render_mode == HUMAN else None
        self.metadata = self.metadata | {"render_modes": render_modes_here(render_mode)}
        self._remade = frozenset(vars(self)) - already

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode; see the class.

        Raises:
            ConfigError: a level that is no integer in range, or options that are no mapping.
            UnknownNameError: an unknown option, object or target link.
        """
        options = checked_options(options, ("level", "object", "target"))
        level = options.get("level")
        level = seed if level is None else level
        if level is not None:
            level = check_level(level)
        super().reset(seed=seed)
        level = draw_level(self.np_random) if level is None else level
        self._start([0], [level], [options.get("object")], [options.get("target")])
        self._episodes.evaluate()
        return self._observe()

    def step(self, action: np.ndarray) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Take one environment step of 0.05 s.

        Raises:
            ActionError: the action has the wrong shape or values that are not finite.
            ResetNeededError: called before the first `reset`.
            DivergedError: the physics diverged; reset the environment.
        """
        action = check_action(action, self.control.size)
        episodes = self._episodes
        episodes.check_begun("step()")
        diverged = episodes.step(action[None])
        if diverged:
            raise DivergedError(diverged)
        episodes.evaluate()
        episodes.advance()
        rewards, terminated, truncated = episodes.outcome(self.reward_mode == "dense")
        observation, info = self._observe()
        return observation, rewards.item(), terminated.item(), truncated.item(), info

    def render(self) -> Any:
        """Return the scene from the world camera, (480, 640, 3) uint8; None with `human`, whose window shows it.

        Raises:
            ResetNeededError: called before the first `reset`.
            ConfigError: the environment was made without a render mode.
        """
        if self.render_mode is None:
            raise ConfigError("this environment was made without a render mode; pass render_mode='rgb_array'")
        self._episodes.check_begun("render()")
        picture = self._views.draw(self._episodes, 0)
        return picture if self._window is None else self._window.show(picture)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()

    def save_state(self) -> EnvState:
        """Return the state of the episode, detached from the environment.

        Raises:
            ResetNeededError: called before the first `reset`.
        """
        return save_episode(self._episodes, 0)

    def restore_state(self, state: EnvState) -> tuple[Any, dict[str, Any]]:
        """Restore a saved state; the same actions then give the same bits.

        Its object may be any of the catalogue, or one that this environment has had. What counts as success and
        what is rewarded stays the environment's own.

        Returns:
            The observation and info of that state.

        Raises:
            StateError: the state is of another task, object, robot, physics configuration or props, or damaged.
            UnknownNameError: there is no such object or target link. In either case the episode goes on as if
                nothing had happened.
        """
        self._restore([0], [state])
        return self._observe()

    @property
    def simulation(self) -> Simulation:
        """The physics of the episode, with B = 1."""
        self._episodes.check_begun("asking for the simulation")
        return self._episodes.group.batch_of(0).simulation

    @property
    def scene(self) -> Scene:
        """What is simulated now: object, robot, props."""
        return self.simulation.scene

    @property
    def snapshot(self) -> Snapshot:
        """The values of the present state, with B = 1: what privileged policies read."""
        self._episodes.check_begun("asking for the snapshot")
        return self._episodes.group.snapshot_of(0)

    @property
    def goal(self) -> Goal:
        """The episode's goal, with B = 1."""
        self._episodes.check_begun("asking for the goal")
        return self._episodes.group.goal_of(0)

    def _set_observation_space(self, space: gym.Space[Any]) -> None:
        self.observation_space = space

    def _observe(self) -> tuple[Any, dict[str, Any]]:
        """Return the observation and info of the present state; the window shows it, too."""
        if self._window is not None:
            self._window.show(self._views.draw(self._episodes, 0))
        self._observations.renew()
        added = self._observations.observe()
        info = self._episodes.info_of(0)
        return row_of(self._observations.arrays, 0), info | added.get(0, {})

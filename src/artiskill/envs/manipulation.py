"""`ManipulationEnv`: the Gymnasium face of a task, one episode at a time."""

import copy
from collections.abc import Callable, Mapping
from typing import Any

import gymnasium as gym
import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.envs.control import JOINT, Control, check_action
from artiskill.envs.copying import CopiedByState
from artiskill.envs.observation import ObservationContext, Observer, empty_observation
from artiskill.envs.options import OBSERVERS, RENDER_MODES, check_modes, checked_options
from artiskill.envs.rendering import Viewpoint, WorldView
from artiskill.envs.sampling import EpisodeSampler, ObjectChoice
from artiskill.envs.state import EnvState, check_episode
from artiskill.envs.window import open_window, render_modes_here
from artiskill.errors import ConfigError, DivergedError, ResetNeededError
from artiskill.scene.scene import Scene, cached_scene
from artiskill.sim.simulation import Simulation
from artiskill.sim.snapshot import Snapshot
from artiskill.sim.states import check_state
from artiskill.tasks.levels import MAX_LEVEL, RngStream, check_level, level_generator
from artiskill.tasks.progress import EpisodeProgress
from artiskill.tasks.registry import make_task
from artiskill.tasks.task import Flags, Goal, Task


class ManipulationEnv(CopiedByState, gym.Env[Any, np.ndarray]):
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

    A *level* is the integer that fixes everything about an episode. `reset(seed=s)` starts level s; `reset()`
    draws the next level; `reset(options={"level": ..., "object": ..., "target": ...})` is explicit. An episode
    is `terminated` when the task is solved and `truncated` after `task.episode_steps` steps.

    `info` has `object`, `level`, `target`, `success`, `flags` (condition -> has it held for half a second by now)
    and `reward_terms`; in visual modes also `cameras`, their intrinsics and extrinsics. To branch an episode use
    `save_state`, which pickles. `copy.deepcopy` and `pickle` make another environment at the same instant.

    Args:
        task: name of the task.
        objects: a split (`train`, `test`, `all`), an object's id, a list of ids, or `ArticulatedObject`s.
        target: fix the target link; by default the level draws one.
        obs_mode: `state`, `pointcloud` or `rgbd`.
        reward_mode: `dense` or `sparse`.
        control_mode: `joint` or `operational_space`.
        render_mode: None, `rgb_array`, or `human`: a window, drawn at every `reset` and `step`, in real time.
        config: values of the task's YAML to change, `{"episode_steps": 100}`; keys may be dotted.

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
    ) -> None:
        already = frozenset(vars(self))
        check_modes(obs_mode, reward_mode, control_mode, render_mode)
        self.task = make_task(task, config)
        self._config = copy.deepcopy(config)
        self.obs_mode, self.reward_mode, self.render_mode = obs_mode, reward_mode, render_mode
        self._casting = EpisodeSampler(self.task, objects, target)
        self.control = Control(self.task.robot, control_mode)
        self.action_space = self.control.space
        self._simulation: Simulation | None = None
        self.observe_with(OBSERVERS[obs_mode])
        self._view: WorldView | None = None
        self._window = open_window(render_mode, f"ArtiSkill: {task}", self.metadata["render_fps"])
        self.metadata = self.metadata | {"render_modes": render_modes_here(render_mode)}
        self._progress = EpisodeProgress(1, self.task.flag_names, self.task.hold_steps)
        self._goal: Goal = None
        self._snapshot: Snapshot | None = None
        self._target = ""
        self._level = -1
        self._remade = frozenset(vars(self)) - already

    # -- episodes ------------------------------------------------------------------------------------------------

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
        level = int(self.np_random.integers(MAX_LEVEL + 1)) if level is None else level
        obj, target = self._casting.draw(level, options.get("object"), options.get("target"))
        simulation = self._simulation_of(obj)
        self._enter(simulation, target)
        self._level = level
        generator = level_generator(level, RngStream.INITIAL_STATE)
        simulation.reset([self.task.sample_initial_state(obj, generator)])
        self._snapshot = simulation.snapshot()
        self._progress.restart()
        return self._observe(self._info()[0])

    def step(self, action: np.ndarray) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One environment step of 0.05 s.

        Raises:
            ActionError: the action has the wrong shape or values that are not finite.
            ResetNeededError: called before the first `reset`.
        """
        action = check_action(action, self.control.size)
        simulation = self._simulation
        if simulation is None:
            raise ResetNeededError("call reset() before step()")
        simulation.step(self.control.to_targets(action[None], self.snapshot))
        self._snapshot = snapshot = simulation.snapshot()
        flags = self.task.flags(snapshot, self._goal)
        self._progress.advance(flags)
        info, dense = self._info(flags)
        success = info["success"]
        reward = dense if self.reward_mode == "dense" else float(success)
        truncated = bool(self._progress.elapsed[0] >= self.task.episode_steps) and not success
        observation, info = self._observe(info)
        return observation, reward, success, truncated, info

    def render(self) -> Any:
        """The scene from the world camera, (480, 640, 3) uint8; None with `human`, whose window shows it.

        Raises:
            ResetNeededError: called before the first `reset`.
            ConfigError: the environment was made without a render mode.
        """
        if self.render_mode is None:
            raise ConfigError("this environment was made without a render mode; pass render_mode='rgb_array'")
        picture = self._picture()
        if self._window is None:
            return picture
        return self._window.show(picture)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()

    def _picture(self) -> np.ndarray:
        if self._view is None:
            if self._simulation is None:
                raise ResetNeededError("call reset() before render()")
            self._view = WorldView(self._simulation.scene, Viewpoint().camera(self.task.world_camera))
        return self._view.draw(self.snapshot)

    def observe_with(self, make_observer: Callable[[Task], Observer]) -> None:
        """Observe in another way from the next `reset`, `step` or `restore_state` on; for wrappers.

        Args:
            make_observer: called once, and again in every copy of the environment: what pickles, if those shall.
        """
        self._make_observer = make_observer
        self._observer = make_observer(self.task)
        self.observation_space = self._observer.space
        if self._simulation is not None:
            self._observer.enter(self._simulation.scene, self._target)

    # -- state ---------------------------------------------------------------------------------------------------

    def save_state(self) -> EnvState:
        """The instant, detached from the environment."""
        if self._simulation is None:
            raise ResetNeededError("call reset() before save_state()")
        return EnvState(
            task=self.task.name,
            object=self._simulation.scene.object.id,
            target=self._target,
            level=self._level,
            simulation=self._simulation.save(),
            elapsed=int(self._progress.elapsed[0]),
            streaks=self._progress.streaks[0].copy(),
        )

    def restore_state(self, state: EnvState) -> tuple[Any, dict[str, Any]]:
        """Take back an instant; the same actions then give the same bits.

        Its object may be any of the catalogue, or one that this environment has had. What counts as success and
        what is rewarded stays the environment's own.

        Returns:
            The observation and info of that instant.

        Raises:
            StateError: the state is of another task, object, robot, physics configuration or props, or damaged.
            UnknownNameError: there is no such object or target link. In either case the episode goes on as if
                nothing had happened.
        """
        check_episode(state, self.task.name, len(self.task.flag_names))
        obj = self._casting.find(state.object)
        self._casting.check_target(obj, state.target)
        simulation = self._simulation_of(obj)
        check_state(state.simulation, [simulation.scene])
        self._enter(simulation, state.target)  # all is well: from here on nothing fails
        simulation.restore(state.simulation, is_checked=True)
        self._snapshot = simulation.snapshot()
        self._level = state.level
        self._progress.elapsed[:] = state.elapsed
        self._progress.streaks[:] = state.streaks
        return self._observe(self._info()[0])

    @property
    def simulation(self) -> Simulation:
        """The physics of the episode, with B = 1."""
        if self._simulation is None:
            raise ResetNeededError("call reset() first")
        return self._simulation

    @property
    def scene(self) -> Scene:
        """What is simulated now: object, robot, props."""
        return self.simulation.scene

    @property
    def snapshot(self) -> Snapshot:
        """What is true now, with B = 1: what privileged policies read."""
        if self._snapshot is None:
            raise ResetNeededError("call reset() first")
        return self._snapshot

    @property
    def goal(self) -> Goal:
        """The episode's goal, with B = 1."""
        if self._goal is None:
            raise ResetNeededError("call reset() first")
        return self._goal

    # -- copies, see `CopiedByState` -----------------------------------------------------------------------------

    def _arguments(self) -> dict[str, Any]:
        return {
            "task": self.task.name,
            "objects": self._casting.choices,
            "target": self._casting.fixed_target,
            "obs_mode": self.obs_mode,
            "reward_mode": self.reward_mode,
            "control_mode": self.control.mode,
            "render_mode": self.render_mode,
            "config": self._config,
        }

    def _save_episodes(self) -> dict[str, Any]:
        if self._simulation is not None and (causes := self._simulation.diverged()):
            raise DivergedError(causes)
        state = None if self._simulation is None else self.save_state()
        return {"handed_in": self._casting.handed_in, "state": state}

    def _restore_episodes(self, saved: dict[str, Any]) -> None:
        for obj in saved["handed_in"]:
            self._casting.remember(obj)
        if saved["state"] is not None:
            self.restore_state(saved["state"])

    def _castings(self) -> tuple[EpisodeSampler, ...]:
        return (self._casting,)

    # -- inside --------------------------------------------------------------------------------------------------

    def _simulation_of(self, obj: ArticulatedObject) -> Simulation:
        """The present simulation where it has this object, else a new one."""
        if self._simulation is not None and self._simulation.scene.object is obj:
            return self._simulation
        return Simulation(cached_scene(self.task.robot, obj, self.task.physics, self.task.props))

    def _enter(self, simulation: Simulation, target: str) -> None:
        """Go over to a simulation and a target."""
        if self._simulation is simulation and self._target == target:
            return
        goal = self.task.make_goal(simulation.scene.object, target)
        self._observer.enter(simulation.scene, target)
        if self._simulation is not simulation:
            self._view = None
        self._simulation, self._target, self._goal = simulation, target, goal

    def _observe(self, info: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
        """The observation of this instant, and `info` with what its mode adds; the window shows it, too."""
        instant = ObservationContext(self.snapshot, self._goal, 0, self._level, int(self._progress.elapsed[0]))
        if self._window is not None:
            self._window.show(self._picture())
        observation = empty_observation(self._observer.space)
        return observation, info | self._observer.observe(instant, observation)

    def _info(self, flags: Flags | None = None) -> tuple[dict[str, Any], float]:
        """Info of this instant, and the dense reward that its terms add up to."""
        flags = self.task.flags(self.snapshot, self._goal) if flags is None else flags
        terms = self.task.reward_terms(self.snapshot, self._goal, flags)
        values = {name: value.item() for name, value in terms.items()}
        counted = self._progress.counted[0].tolist()
        assert self._simulation is not None
        info = {
            "object": self._simulation.scene.object.id,
            "level": self._level,
            "target": self._target,
            "success": all(counted),
            "flags": dict(zip(self._progress.flag_names, counted, strict=True)),
            "reward_terms": values,
        }
        return info, self.task.dense_reward(values)

"""Environments as LeRobot's evaluation wants them; LeRobot itself is not needed here.

The distribution `lerobot_env_artiskill`, in `plugins/` of the repository, tells LeRobot of them. Observations have
the names that `artiskill demos export --format lerobot` gives to a data set, so that policies trained on one fit.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode

from artiskill.assets.catalog import resolve_objects
from artiskill.compat.observations import picture_names, pictures_of
from artiskill.demos.lerobot import instruction_of
from artiskill.envs.control import JOINT
from artiskill.envs.manipulation import ManipulationEnv, ObjectChoice
from artiskill.envs.wrappers import Sampling
from artiskill.errors import DivergedError

SUITE = "OpenCabinetDrawer"  # the task unless another is asked for
Observation = dict[str, Any]


class LeRobotEnv(gym.Env[Observation, np.ndarray]):
    """A task in LeRobot's words: a seed is a level, `info["is_success"]` says whether it is solved.

    Observations by `obs_mode`:

    - `rgbd`: `pixels` with `front`, `front_masks`, `left`, ... (H, W, 3) uint8, masks white where they are;
      `agent_pos` (A,) float32, the robot's proprioception; `depth` (H, W, C) float32.
    - `pointcloud`: `agent_pos`; `pointcloud.xyz`, `pointcloud.rgb` and `pointcloud.seg` (N, ...).
    - `state`: `agent_pos` (D,) float32, the whole state.

    An episode whose physics diverges is cut off.

    Args:
        task: name of the task.
        objects: a split, an id, or a list of ids; a level draws one of them.
        target: fix the target link; by default the level draws one.
        obs_mode: `rgbd`, `pointcloud` or `state`.
        control_mode: `joint` or `operational_space`.
        render_mode: `rgb_array` or None.
        config: values of the task's YAML to change.
        sampling: values of `Sampling`, for fewer points; None for the full cloud.

    Attributes:
        task: its name.
        task_description: a sentence.
        _max_episode_steps: after which an episode is cut off.

    Raises:
        ArtiSkillError: as `ManipulationEnv`.
    """

    metadata = ManipulationEnv.metadata

    def __init__(
        self,
        task: str = SUITE,
        objects: ObjectChoice = "test",
        target: str | None = None,
        obs_mode: str = "rgbd",
        control_mode: str = JOINT,
        render_mode: str | None = "rgb_array",
        config: Mapping[str, Any] | None = None,
        sampling: Mapping[str, Any] | None = None,
    ) -> None:
        self._env = env = ManipulationEnv(
            task, objects, target, obs_mode, "dense", control_mode, render_mode, config
        )
        if sampling is not None:
            Sampling(**sampling).wrap(env)  # it changes the environment itself
        self.task, self.task_description = env.task.name, instruction_of(env.task.name)
        self._max_episode_steps = env.task.episode_steps
        self.render_mode, self.action_space = render_mode, env.action_space
        self.observation_space = self._space()
        self._last: Observation = {}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode: level `seed`, or the next one that is drawn."""
        super().reset(seed=seed)
        observation, info = self._env.reset(seed=seed, options=options)
        self._last = self._told(observation)
        return self._last, _info(info)

    def step(self, action: np.ndarray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Take one environment step.

        Raises:
            ActionError: the action has the wrong shape or values that are not finite.
        """
        try:
            observation, reward, terminated, truncated, info = self._env.step(action)
        except DivergedError:
            return self._last, 0.0, False, True, {"is_success": False}
        self._last = self._told(observation)
        return self._last, reward, terminated, truncated, _info(info)

    def render(self) -> Any:
        """Return the scene from the world camera, (480, 640, 3) uint8."""
        return self._env.render()

    def close(self) -> None:
        """Release what the environment has."""
        self._env.close()

    def _told(self, observation: Any) -> Observation:
        """Return an observation under LeRobot's names."""
        if not isinstance(observation, Mapping):
            return {"agent_pos": observation}
        found: Observation = {"agent_pos": observation["agent"]}
        if "rgbd" in observation:
            found["pixels"] = pictures_of(observation["rgbd"], self._env.task)
            found["depth"] = observation["rgbd"]["depth"]
        else:
            found |= {f"pointcloud.{key}": array for key, array in observation["pointcloud"].items()}
        return found

    def _space(self) -> gym.spaces.Dict:
        given = self._env.observation_space
        if not isinstance(given, gym.spaces.Dict):
            return gym.spaces.Dict({"agent_pos": given})
        parts: dict[str, Any] = given.spaces
        spaces: dict[str, gym.Space[Any]] = {"agent_pos": parts["agent"]}
        if "rgbd" in parts:
            cameras = self._env.task.cameras
            picture = gym.spaces.Box(0, 255, (cameras.height, cameras.width, 3), np.uint8)
            spaces["pixels"] = gym.spaces.Dict(dict.fromkeys(picture_names(self._env.task), picture))
            spaces["depth"] = parts["rgbd"]["depth"]
        else:
            spaces |= {f"pointcloud.{key}": space for key, space in parts["pointcloud"].items()}
        return gym.spaces.Dict(spaces)


def _info(info: Mapping[str, Any]) -> dict[str, Any]:
    return {"is_success": info["success"]} | {key: info[key] for key in ("object", "target", "level")}


def make_envs(
    n_envs: int = 1,
    use_async_envs: bool = False,
    task: str = SUITE,
    objects: ObjectChoice = "test",
    **options: Any,
) -> dict[str, dict[int, gym.vector.VectorEnv[Any, Any, Any]]]:
    """Return vector environments as LeRobot's `make_env` does, one of each object.

    So its evaluation says the success of every object, on the levels that it has for seeds.

    Args:
        n_envs: environments side by side, of each object.
        use_async_envs: in processes of their own.
        task: name of the task.
        objects: a split, an id, or a list of ids.
        **options: of `LeRobotEnv`.

    Returns:
        Task -> number of the object -> its environments.
    """
    make_vector = gym.vector.AsyncVectorEnv if use_async_envs else gym.vector.SyncVectorEnv
    chosen: Sequence[Any] = resolve_objects(objects, task=task)
    makers = [partial(LeRobotEnv, task, [one], **options) for one in chosen]
    vectors = [make_vector([make] * n_envs, autoreset_mode=AutoresetMode.SAME_STEP) for make in makers]
    return {task: dict(enumerate(vectors))}

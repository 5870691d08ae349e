"""A benchmark for vla-eval, which loads it by `artiskill.compat.vla_eval:ArtiSkillBenchmark`; its extra is `vla`.

vla-eval plays episodes against a model server of its own protocol. Interface: its `benchmarks/base.py`, 0.8.0.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from artiskill.assets.catalog import resolve_objects
from artiskill.compat.observations import picture_names, pictures_of
from artiskill.demos.lerobot import instruction_of
from artiskill.envs.control import JOINT
from artiskill.envs.manipulation import ManipulationEnv, ObjectChoice
from artiskill.envs.wrappers import Sampling
from artiskill.errors import ConfigError, DivergedError, MissingExtraError
from artiskill.tasks.state_vector import robot_fields

BENCHMARK = "ArtiSkillBenchmark"
_ARM, _FINGERS = 7, 2  # numbers of an action
_ARM_FORMATS = {JOINT: "joint_velocity", "operational_space": "hand_twist6_null1"}


def __getattr__(name: str) -> Any:
    if name == BENCHMARK:
        return _benchmark_class()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}; public: {BENCHMARK}")


@cache
def _benchmark_class() -> Any:
    """Return `_Benchmark` with the library's base class: the library is optional."""
    try:
        from vla_eval.benchmarks.base import StepBenchmark
    except ImportError as error:
        raise MissingExtraError("vla-eval", "vla") from error
    methods = {"__doc__": _Benchmark.__doc__, "__module__": __name__}
    return type(BENCHMARK, (_Benchmark, StepBenchmark), methods)


class _Benchmark:
    """Tasks of ArtiSkill: one of vla-eval's is one of ours, and its episodes go round the objects.

    Episode k plays level `first_level + k // n` of object k mod n, of n. So `episodes_per_task` of 10 n plays what
    `artiskill evaluate --episodes 10` does. The model server is told the task, k, and nothing of object or level.

    Observations have `images` (`front`, `front_masks`, `left`, ...; with `obs_mode` `pointcloud` instead
    `pointcloud`, its `xyz`, `rgb` and `seg`), `state`, the robot's proprioception, and `task_description`. Actions
    are (A,) numbers in [-1, 1]. No GPU is needed.

    Args:
        tasks: names of tasks.
        objects: a split, an id, or a list of ids, of each task.
        first_level: of each object.
        obs_mode: `rgbd`, `pointcloud` or `state`, which is no observation of a robot.
        control_mode: `joint` or `operational_space`.
        config: values of the tasks' YAML to change.
        sampling: values of `Sampling`, for fewer points; None for the full cloud.
    """

    render_backends = frozenset({"cpu"})
    _ALL_RECORD_FIELDS = frozenset({"reward", "done", "success"})

    _recorder: Any  # of the base class

    def __init__(
        self,
        tasks: Sequence[str] = ("OpenCabinetDrawer",),
        objects: ObjectChoice = "test",
        first_level: int = 0,
        obs_mode: str = "rgbd",
        control_mode: str = JOINT,
        config: Mapping[str, Any] | None = None,
        sampling: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__()
        if isinstance(tasks, str) or not tasks:
            raise ConfigError(f"tasks must be a list of names, not {tasks!r}")
        self._objects = {name: resolve_objects(objects, task=name) for name in tasks}
        self._first_level, self._obs_mode, self._control_mode = first_level, obs_mode, control_mode
        self._config, self._sampling = config, sampling
        self._envs: dict[tuple[str, int], ManipulationEnv] = {}
        self._env = self._env_of(tasks[0], 0)

    @classmethod
    def configure_render(cls, mode: str) -> dict[str, str]:
        """Return no environment variables: images are drawn by the package itself, on the CPU."""
        return {}

    def get_tasks(self) -> list[dict[str, Any]]:
        """Return the tasks."""
        return [{"name": name, "suite": "ArtiSkill"} for name in self._objects]

    def reset(self, task: Mapping[str, Any]) -> Any:
        """Start episode `task["episode_idx"]` of a task, and return the environment's observation."""
        number, episode = len(self._objects[task["name"]]), int(task.get("episode_idx", 0))
        self._env = self._env_of(task["name"], episode % number)
        observation, info = self._env.reset(options={"level": self._first_level + episode // number})
        self._last = observation, info
        self._recorder.record_video(self._frame(observation))
        return observation

    def step(self, action: Mapping[str, Any]) -> Any:
        """Take one environment step; an episode whose physics diverges ends as a failure.

        Returns:
            A `StepResult` of vla-eval.

        Raises:
            ActionError: the action has the wrong shape or values that are not finite.
        """
        from vla_eval.benchmarks.base import StepResult

        values = np.asarray(action["actions"] if "actions" in action else action["action"], np.float64)
        try:
            observation, reward, terminated, truncated, info = self._env.step(values)
            done = terminated or truncated
            self._last = observation, info
        except DivergedError:
            (observation, info), reward, done = self._last, 0.0, True
        self._recorder.record_video(self._frame(observation))
        self._recorder.record_step(reward=reward, done=done, success=info["success"])
        return StepResult(obs=observation, reward=reward, done=done, info=info)

    def make_obs(self, raw_obs: Any, task: Mapping[str, Any]) -> dict[str, Any]:
        """Return an observation as model servers get it."""
        told: dict[str, Any] = {"task_description": instruction_of(task["name"])}
        if not isinstance(raw_obs, Mapping):
            return told | {"state": raw_obs}
        told["state"] = raw_obs["agent"]
        if "rgbd" in raw_obs:
            return told | {"images": pictures_of(raw_obs["rgbd"], self._env.task)}
        return told | {"pointcloud": dict(raw_obs["pointcloud"])}

    def get_step_result(self, step_result: Any) -> dict[str, Any]:
        """Return success and the conditions of an episode that has ended."""
        info = step_result.info
        return {"success": bool(info["success"]), **{name: bool(held) for name, held in info["flags"].items()}}

    def get_metric_keys(self) -> dict[str, str]:
        """Return that success and conditions are averaged; tasks have different conditions."""
        flags = self._env.task.flag_names if len(self._objects) == 1 else ()
        return dict.fromkeys(("success", *flags), "mean")

    def get_metadata(self) -> dict[str, Any]:
        """Return the length of an episode."""
        return {"max_steps": max(self._env_of(name, 0).task.episode_steps for name in self._objects)}

    def get_action_spec(self) -> dict[str, Any]:
        """Return what the numbers of an action are: base and lift, then arm and fingers of each arm."""
        from vla_eval.specs import BASE_MOTION, DimSpec

        spec = {"base_motion": BASE_MOTION}
        for k in range(len(self._env.task.robot.mounts)):
            end = "" if k == 0 else f"_{k + 1}"
            spec[f"arm{end}"] = DimSpec(f"arm{end}", _ARM, _ARM_FORMATS[self._control_mode], (-1.0, 1.0))
            spec[f"gripper{end}"] = DimSpec(f"gripper{end}", _FINGERS, "finger_positions", (-1.0, 1.0))
        return spec

    def get_observation_spec(self) -> dict[str, Any]:
        """Return what an observation has."""
        from vla_eval.specs import IMAGE_RGB, LANGUAGE, RAW, DimSpec

        task = self._env.task
        fields = task.state_fields if self._obs_mode == "state" else robot_fields(len(task.robot.mounts))
        spec = {
            "state": DimSpec("state", sum(field.size for field in fields), "artiskill"),
            "language": LANGUAGE,
        }
        if self._obs_mode == "rgbd":
            spec |= dict.fromkeys(picture_names(task), IMAGE_RGB)
        if self._obs_mode == "pointcloud":
            spec["pointcloud"] = RAW
        return spec

    def get_hold_action(self, last_action: Any) -> dict[str, Any]:
        """Return the action that stops base and arms and keeps the fingers where the last one had them."""
        size = self._env.control.size
        held = np.zeros(size, np.float32)
        if last_action is not None:
            last = np.asarray(last_action.get("actions", last_action.get("action")), np.float32).reshape(-1)
            for start in range(4 + _ARM, size, _ARM + _FINGERS):
                held[start : start + _FINGERS] = last[start : start + _FINGERS]
        return {"actions": held}

    def render(self) -> np.ndarray | None:
        """Return the scene from the world camera."""
        return self._env.render()

    def cleanup(self) -> None:
        """Close all environments."""
        for env in self._envs.values():
            env.close()
        self._envs.clear()

    def _env_of(self, task: str, number: int) -> ManipulationEnv:
        """Return the environment of a task's object, made when it is first needed."""
        if (task, number) not in self._envs:
            env = ManipulationEnv(
                task,
                [self._objects[task][number]],
                obs_mode=self._obs_mode,
                control_mode=self._control_mode,
                render_mode="rgb_array",
                config=self._config,
            )
            if self._sampling is not None:
                Sampling(**self._sampling).wrap(env)
            self._envs[task, number] = env
        return self._envs[task, number]

    def _frame(self, observation: Any) -> np.ndarray | None:
        """Return what the first camera sees, for recorded videos."""
        seen = observation.get("rgbd") if isinstance(observation, Mapping) else None
        return None if seen is None else np.ascontiguousarray(seen["rgb"][..., :3])

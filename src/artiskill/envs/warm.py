"""Build and compile what environments share, before the clock runs."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from artiskill.assets.catalog import object_of
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.options import CONTROL_MODES
from artiskill.envs.sampling import EpisodeSampler, ObjectChoice
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.envs.wrappers import PointCloudDownsample
from artiskill.scene.scene import CAPACITY, cached_scene
from artiskill.sensors.observations.sampling import SAMPLERS
from artiskill.tasks.registry import make_task, task_names

_VISUAL_TASK = "PushChair"
_QUALITIES: tuple[dict[str, Any], ...] = ({}, {"render.quality": "picture"})


def warm_scenes(task: str, objects: ObjectChoice = "train", config: Mapping[str, Any] | None = None) -> int:
    """Build the objects and scenes of a task and keep them, so that no reset of this process has to.

    All environments of a process share them, and so do processes that are forked from it. A split of cabinets
    takes about a second.

    Args:
        task: name of the task.
        objects: as for an environment.
        config: as for an environment.

    Returns:
        How many scenes were built: no more than are kept (`scene.scene.CAPACITY`).

    Raises:
        UnknownNameError: an unknown task, object or split.
        ConfigError: an unknown or illegal configuration value.
    """
    made = make_task(task, config)
    choices = EpisodeSampler(made, objects).choices[:CAPACITY]
    for choice in choices:
        obj = object_of(choice)
        cached_scene(made.robot, obj, made.physics, made.props)
    return len(choices)


def first_uses() -> list[Callable[[], None]]:
    """Return calls that together compile every kernel that environments use.

    Each makes an environment and takes a step: what is compiled depends on the arrays that a kernel is given.
    """
    visual: list[dict[str, Any]] = [
        {"obs_mode": mode, "config": quality} for quality in _QUALITIES for mode in ("pointcloud", "rgbd")
    ]
    return [
        *(partial(_use, task, control_mode=mode) for task in task_names() for mode in CONTROL_MODES),
        *(partial(_use, _VISUAL_TASK, **mode) for mode in visual),
        *(partial(_use_sampler, method, quality) for quality in _QUALITIES for method in SAMPLERS),
        *(partial(_use_vector, **mode) for mode in ({"obs_mode": "state"}, *visual)),
    ]


def _use(task: str, **arguments: Any) -> None:
    env = ManipulationEnv(task, render_mode="rgb_array", **arguments)
    env.reset(seed=0)
    env.step(env.action_space.sample())
    env.render()
    env.close()


def _use_sampler(method: str, quality: dict[str, Any]) -> None:
    env = PointCloudDownsample(
        ManipulationEnv(_VISUAL_TASK, obs_mode="pointcloud", config=quality), method=method, frame="robot"
    )
    env.reset(seed=0)
    env.close()


def _use_vector(**arguments: Any) -> None:
    env = ManipulationVectorEnv(2, _VISUAL_TASK, num_threads=1, **arguments)
    env.reset(seed=0)
    env.step(env.action_space.sample())
    env.close()

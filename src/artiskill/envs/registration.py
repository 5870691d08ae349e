"""Gymnasium ids: `ArtiSkill/<Task>-v0`, `..._<object>-v0` and `..._<object>_link_<k>-v0`."""

import gymnasium as gym

from artiskill.assets.catalog import list_objects, read_catalog
from artiskill.assets.needs import task_needs
from artiskill.tasks.registry import task_names

NAMESPACE = "ArtiSkill"
_ENTRY_POINT = "artiskill.envs.manipulation:ManipulationEnv"
_VECTOR_ENTRY_POINT = "artiskill.envs.vector_env:ManipulationVectorEnv"


def register_envs() -> None:
    """Register every id of the catalogue; registering twice changes nothing."""
    for task in task_names():
        _register(task, {"task": task})
        motion = task_needs(task).motion
        for object_id in (*list_objects(task=task), *list_objects(split="ood", task=task)):
            _register(f"{task}_{object_id}", {"task": task, "objects": object_id})
            for link in () if motion is None else read_catalog()[object_id][1].targets(motion):
                _register(f"{task}_{object_id}_{link}", {"task": task, "objects": object_id, "target": link})


def _register(name: str, kwargs: dict[str, str]) -> None:
    env_id = f"{NAMESPACE}/{name}-v0"
    if env_id not in gym.registry:
        gym.register(id=env_id, entry_point=_ENTRY_POINT, vector_entry_point=_VECTOR_ENTRY_POINT, kwargs=kwargs)

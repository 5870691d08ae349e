"""Build what environments share, before the clock runs."""

from collections.abc import Mapping
from typing import Any

from artiskill.assets.catalog import load_object
from artiskill.envs.casting import Casting, ObjectChoice
from artiskill.scene.cache import CAPACITY, cached_scene
from artiskill.tasks.registry import make_task


def warm_scenes(task: str, objects: ObjectChoice = "train", config: Mapping[str, Any] | None = None) -> int:
    """Build objects and scenes of a task and keep them: no reset of this process has to wait for one.

    All environments of a process share them, and so do processes that are forked from it. A split of cabinets
    takes about a second.

    Args:
        task: name of the task.
        objects: as of an environment.
        config: likewise.

    Returns:
        How many scenes were built: no more than are kept (`scene.cache.CAPACITY`).

    Raises:
        UnknownNameError: an unknown task, object or split.
        ConfigError: an unknown or illegal configuration value.
    """
    made = make_task(task, config)
    choices = Casting(made, objects).choices[:CAPACITY]
    for choice in choices:
        obj = load_object(choice) if isinstance(choice, str) else choice
        cached_scene(made.robot, obj, made.physics, made.props)
    return len(choices)

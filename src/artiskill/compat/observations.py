"""Observations and tasks as other frameworks want them told: pictures by camera, a sentence, sizes."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from artiskill.demos.lerobot import camera_names, mask_picture
from artiskill.envs.control import JOINT, Control
from artiskill.tasks.registry import make_task
from artiskill.tasks.state_vector import robot_fields
from artiskill.tasks.task import Task

_CHANNELS = 3


def pictures_of(rgbd: Mapping[str, np.ndarray], task: Task) -> dict[str, np.ndarray]:
    """Return each camera's colours and masks, (H, W, 3) uint8, by the names that exported data sets have.

    Args:
        rgbd: `rgb` (H, W, 3 C) and `seg` (H, W, k C) of C cameras.
        task: that was observed.
    """
    found = {}
    masks = len(task.mask_names)
    for k, name in enumerate(camera_names(task.cameras.number)):
        found[name] = rgbd["rgb"][..., _CHANNELS * k : _CHANNELS * (k + 1)]
        if masks <= _CHANNELS:
            found[f"{name}_masks"] = mask_picture(rgbd["seg"][..., masks * k : masks * (k + 1)])
    return found


def picture_names(task: Task) -> list[str]:
    """Return the keys of `pictures_of`."""
    kinds = ("", "_masks") if len(task.mask_names) <= _CHANNELS else ("",)
    return [name + kind for name in camera_names(task.cameras.number) for kind in kinds]


def describe_for_2021(task: str) -> dict[str, Any]:
    """Return what `user_policy.Environment` is told of a task: nothing that differs from object to object."""
    made = make_task(task)
    cameras = made.cameras
    return {
        "env_name": f"{made.name}-v0",
        "action": Control(made.robot, JOINT).size,
        "agent": sum(field.size for field in robot_fields(len(made.robot.mounts))),
        "state": sum(field.size for field in made.state_fields),
        "masks": len(made.mask_names),
        "cameras": [cameras.number, cameras.height, cameras.width],
        "episode_steps": made.episode_steps,
    }

"""What the configurations of all tasks share, and how they are read."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from artiskill.config import check, from_layers, load_yaml, merge_overrides
from artiskill.robots.config import LIKE, RobotConfig, robot_mapping
from artiskill.scene.physics import PhysicsConfig
from artiskill.sensors.observations.cameras import CamerasConfig
from artiskill.sensors.pictures.framing import WorldCameraConfig
from artiskill.sensors.render_config import RenderConfig, render_mapping

_MOST_STEPS, _MOST_JOINTS = 1_000_000, 1000  # half a day of an episode; columns of the state vector
OBSERVED_QUALITY = "fast"  # of the cameras on the robot, unless the configuration says otherwise


@dataclass(frozen=True)
class TaskConfig:
    """Values that every task has; a task's own configuration adds its initial states, success and reward.

    Attributes:
        name: of the task.
        robot: who acts; in YAML a name, the path of a YAML file, or values that change a robot.
        episode_steps: environment steps until the episode is cut off.
        max_object_joints: joint slots of the state vector.
        physics: rates, solver, contacts.
        cameras: on the robot's base.
        world_camera: for people.
        render: light, floor and background as the cameras on the robot see them.
    """

    name: str
    robot: RobotConfig
    episode_steps: int
    max_object_joints: int
    physics: PhysicsConfig
    cameras: CamerasConfig
    world_camera: WorldCameraConfig
    render: RenderConfig

    def __post_init__(self) -> None:
        check(
            1 <= self.episode_steps <= _MOST_STEPS,
            f"episode_steps must lie in [1, {_MOST_STEPS}], not {self.episode_steps}",
        )
        check(
            1 <= self.max_object_joints <= _MOST_JOINTS,
            f"max_object_joints must lie in [1, {_MOST_JOINTS}], not {self.max_object_joints}",
        )

    def steps_of(self, duration_s: float) -> int:
        """How many environment steps a duration is, at least one.

        Raises:
            ConfigError: it is more than an episode could have.
        """
        steps = duration_s / self.physics.step_s
        check(
            steps <= _MOST_STEPS,
            f"{duration_s:g} s are more than {_MOST_STEPS} steps of {self.physics.step_s:g} s",
        )
        return max(1, round(steps))


Config = TypeVar("Config", bound=TaskConfig)


def load_task_config(cls: type[Config], path: Path, overrides: Mapping[str, Any] | None = None) -> Config:
    """A task's configuration from its YAML file, with robot and render settings filled in, then overrides.

    Args:
        cls: the task's configuration class.
        path: of the YAML file.
        overrides: values to change, keys dotted or nested.

    Raises:
        UnknownNameError: there is no such robot.
        ConfigError: the file cannot be read, or a value is missing, unknown or illegal.
    """
    own = _with_robot_mapping(load_yaml(path))

    def merge(given: Mapping[str, Any]) -> dict[str, Any]:
        values = merge_overrides(own, _with_robot_mapping(given))
        if "robot" in values:
            values["robot"] = robot_mapping(values["robot"])
        values["render"] = render_mapping(OBSERVED_QUALITY, values.get("render"))
        return values

    return from_layers(cls, merge, overrides, path.name)


def _with_robot_mapping(values: Mapping[str, Any]) -> dict[str, Any]:
    """A robot's name or path as the mapping that it stands for, so that other values can be laid over it."""
    robot = values.get("robot")
    return dict(values) | ({"robot": {LIKE: robot}} if isinstance(robot, str | Path) else {})

"""What the configurations of all tasks share."""

from dataclasses import dataclass

from artiskill.config import check
from artiskill.scene.physics import PhysicsConfig
from artiskill.sensors.framing import WorldCameraConfig
from artiskill.sensors.panorama import CamerasConfig


@dataclass(frozen=True)
class TaskConfig:
    """Values that every task has; a task's own configuration adds its initial states, success and reward.

    Attributes:
        name: of the task.
        robot: name of the robot.
        episode_steps: environment steps until the episode is cut off.
        max_object_joints: joint slots of the state vector.
        physics: rates, solver, contacts.
        cameras: on the robot's base.
        world_camera: for people.
    """

    name: str
    robot: str
    episode_steps: int
    max_object_joints: int
    physics: PhysicsConfig
    cameras: CamerasConfig
    world_camera: WorldCameraConfig

    def __post_init__(self) -> None:
        check(self.episode_steps >= 1, f"episode_steps must be at least 1, not {self.episode_steps}")
        check(self.max_object_joints >= 1, f"max_object_joints must be at least 1, not {self.max_object_joints}")

    def steps_of(self, duration_s: float) -> int:
        """How many environment steps a duration is, at least one."""
        return max(1, round(duration_s / self.physics.step_s))

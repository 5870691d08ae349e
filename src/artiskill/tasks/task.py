"""`Task`: the functions that make up a task, assembled by a `make_<task>(config)`."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Category
from artiskill.geometry.arrays import Array, total
from artiskill.robots.config import RobotConfig
from artiskill.scene.physics import PhysicsConfig
from artiskill.scene.props import Prop
from artiskill.scene.scene import Scene
from artiskill.sensors.observations.cameras import CamerasConfig
from artiskill.sensors.pictures.framing import WorldCameraConfig
from artiskill.sensors.render_config import RenderConfig
from artiskill.sim.snapshot import Snapshot
from artiskill.sim.states import InitialState
from artiskill.tasks.fields import ObservationField
from artiskill.tasks.staged_reward import StageTable

Goal = Any  # each task has its own frozen dataclass, whose arrays have the batch dimension first
Flags = dict[str, Array]


@dataclass(frozen=True, eq=False)
class Task:
    """A family of episodes; B is the batch dimension of snapshots and goals.

    Attributes:
        name: as in environment ids, `OpenCabinetDrawer`.
        config: the resolved configuration (a frozen dataclass).
        category: of its objects.
        robot: who acts.
        physics: how it is simulated.
        props: what stands or lies beside robot and object.
        episode_steps: environment steps until an episode is cut off.
        hold_steps: consecutive steps that a flag must hold before it counts.
        targets: object -> legal target links (possibly none), in a fixed order.
        make_goal: (object, target) -> goal with B = 1.
        sample_initial_state: (object, generator) -> where an episode starts.
        flag_names: the conditions of success.
        flags: (snapshot, goal) -> name -> (B,) bool, each condition as it is at this instant.
        reward_terms: (snapshot, goal, flags) -> name -> (B,) unweighted terms of the dense reward.
        reward_weights: name -> weight; the dense reward is the weighted sum.
        reward_table: the terms and stages that the reward is made of.
        observe_state: (snapshot, goal) -> (B, D) float32.
        state_fields: what the D numbers are.
        cameras: what the robot sees through.
        world_camera: what people look through.
        render: light, floor and background as the robot sees them.
        mask_names: of the k masks that come with what it sees.
        masks: (scene, target) -> (k, G) bool, which of `Scene.visuals` belong to each mask.
    """

    name: str
    config: Any
    category: Category
    robot: RobotConfig
    physics: PhysicsConfig
    props: tuple[Prop, ...]
    episode_steps: int
    hold_steps: int
    targets: Callable[[ArticulatedObject], tuple[str, ...]]
    make_goal: Callable[[ArticulatedObject, str], Goal]
    sample_initial_state: Callable[[ArticulatedObject, np.random.Generator], InitialState]
    flag_names: tuple[str, ...]
    flags: Callable[[Snapshot, Goal], Flags]
    reward_terms: Callable[[Snapshot, Goal, Flags], dict[str, Array]]
    reward_weights: Mapping[str, float]
    reward_table: StageTable
    observe_state: Callable[[Snapshot, Goal], Array]
    state_fields: tuple[ObservationField, ...]
    cameras: CamerasConfig
    world_camera: WorldCameraConfig
    render: RenderConfig
    mask_names: tuple[str, ...]
    masks: Callable[[Scene, str], np.ndarray]

    def dense_reward(self, terms: Mapping[str, Array]) -> Array:
        """Return the weighted sum of reward terms: (B,) of such arrays, a number of numbers, the same bits."""
        return total(weight * terms[name] for name, weight in self.reward_weights.items())

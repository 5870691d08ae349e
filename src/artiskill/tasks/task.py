"""`Task` and `TaskConfig`: what a task is made of, how its YAML is read, goals of a batch."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from numbers import Real
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Category
from artiskill.config import CONFIG_DIR, check, from_layers, load_yaml, merge_overrides, to_mapping
from artiskill.errors import ConfigError, shown
from artiskill.geometry.arrays import Array, total
from artiskill.robots.config import LIKE, RobotConfig, robot_mapping
from artiskill.scene.physics import PhysicsConfig
from artiskill.scene.props import Prop
from artiskill.scene.scene import Scene
from artiskill.sensors.observations.cameras import CamerasConfig
from artiskill.sensors.pictures.framing import WorldCameraConfig
from artiskill.sensors.render_config import RenderConfig, render_mapping
from artiskill.sim.snapshot import Snapshot
from artiskill.sim.states import InitialState
from artiskill.tasks.registry import as_overrides
from artiskill.tasks.staged_reward import StageTable
from artiskill.tasks.state_vector import ObservationField
from artiskill.tasks.validation import check_flags, check_parts, check_terms

Goal = Any  # each task has its own frozen dataclass, whose arrays have the batch dimension first
Flags = dict[str, Array]

_MOST_STEPS, _MOST_JOINTS = 1_000_000, 1000  # half a day of an episode; columns of the state vector
_TASK_FOLDER = CONFIG_DIR / "tasks"
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
        """Return how many environment steps a duration is, at least one.

        Raises:
            ConfigError: it is more than an episode could have.
        """
        steps = duration_s / self.physics.step_s
        check(
            steps <= _MOST_STEPS,
            f"{duration_s:g} s are more than {_MOST_STEPS} steps of {self.physics.step_s:g} s",
        )
        return max(1, round(steps))


class Evaluation(NamedTuple):
    """Flags and unweighted reward terms of one step: name -> (B,)."""

    flags: Flags
    reward_terms: dict[str, Array]


@dataclass(frozen=True, eq=False)
class Task:
    """A family of episodes: pure functions of snapshots; B is the batch dimension of snapshots and goals.

    Attributes:
        config: the resolved configuration.
        category: of its objects.
        props: what stands or lies beside robot and object.
        hold_steps: consecutive steps that a flag must hold before it counts.
        targets: object -> legal target links (possibly none), in a fixed order.
        make_goal: (object, target) -> goal with B = 1.
        sample_initial_state: (object, generator) -> where an episode starts.
        flag_names: the conditions of success.
        flags: (snapshot, goal) -> name -> (B,) bool, each condition as it is in this step.
        reward_terms: (snapshot, goal, flags) -> name -> (B,) unweighted terms of the dense reward.
        reward_weights: name -> weight; the dense reward is the weighted sum.
        reward_table: the terms and stages of the reward, for tests and pictures of it; not a term that was added.
        observe_state: (snapshot, goal) -> (B, D) float32.
        state_fields: what the D numbers are.
        mask_names: of the k masks that come with what the robot sees.
        masks: (scene, target) -> (k, G) bool, which of `Scene.visuals` belong to each mask.
        describe_progress: (snapshot, goal), B = 1 -> how far an episode has come, as captions of films say it:
            "40 % open"; None where they say nothing of it.
    """

    config: Any  # of a subclass of `TaskConfig`, whose own sections vary
    category: Category
    props: tuple[Prop, ...]
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
    mask_names: tuple[str, ...]
    masks: Callable[[Scene, str], np.ndarray]
    describe_progress: Callable[[Snapshot, Goal], str] | None = None

    def __post_init__(self) -> None:
        check(
            isinstance(self.config, TaskConfig), f"a task's config must be a TaskConfig, not {shown(self.config)}"
        )
        TaskConfig.__post_init__(self.config)  # a subclass that is made in Python may check other things only
        check_parts(self)

    @property
    def name(self) -> str:
        """Name of the task, as in environment ids: `OpenCabinetDrawer`."""
        return cast(str, self.config.name)

    @property
    def overrides(self) -> dict[str, Any]:
        """All values of the configuration, as `make_task` takes them."""
        return as_overrides(to_mapping(self.config))

    @property
    def robot(self) -> RobotConfig:
        """Who acts."""
        return cast(RobotConfig, self.config.robot)

    @property
    def physics(self) -> PhysicsConfig:
        """How it is simulated."""
        return cast(PhysicsConfig, self.config.physics)

    @property
    def episode_steps(self) -> int:
        """Environment steps until an episode is cut off."""
        return cast(int, self.config.episode_steps)

    @property
    def cameras(self) -> CamerasConfig:
        """What the robot sees through."""
        return cast(CamerasConfig, self.config.cameras)

    @property
    def world_camera(self) -> WorldCameraConfig:
        """What people look through."""
        return cast(WorldCameraConfig, self.config.world_camera)

    @property
    def render(self) -> RenderConfig:
        """Light, floor and background as the robot sees them."""
        return cast(RenderConfig, self.config.render)

    def with_reward_term(self, name: str, term: Callable[[Snapshot, Goal, Flags], Array], weight: float) -> "Task":
        """Return the same task with one more term in its dense reward, outside of its stages.

        Args:
            name: of the term, in `info["reward_terms"]`.
            term: (snapshot, goal, flags) -> (B,) unweighted. At most 0, or waiting may pay.
            weight: of the term.

        Raises:
            ConfigError: there is such a term already, or the weight is no number of at least 0.
        """
        taken = {*self.reward_table.terms, *self.reward_weights}
        check(name not in taken, f"there is a reward term {name!r} already")
        legal = isinstance(weight, Real) and 0 <= weight < math.inf
        check(legal, f"the weight of {name!r} must be a finite number of at least 0, not {shown(weight)}")

        def reward_terms(snapshot: Snapshot, goal: Goal, flags: Flags) -> dict[str, Array]:
            return self.reward_terms(snapshot, goal, flags) | {name: term(snapshot, goal, flags)}

        return replace(self, reward_terms=reward_terms, reward_weights={**self.reward_weights, name: weight})

    def evaluate(self, snapshot: Snapshot, goal: Goal) -> Evaluation:
        """Return flags and reward terms of a step."""
        flags = self.flags(snapshot, goal)
        return Evaluation(flags, self.reward_terms(snapshot, goal, flags))

    def evaluate_checked(self, snapshot: Snapshot, goal: Goal) -> Evaluation:
        """Return what `evaluate` does, once it is certain that the task's functions return what they should.

        Raises:
            ConfigError: they return something else; the message names flag or term, and what is legal.
        """
        flags = self.flags(snapshot, goal)
        check_flags(self, flags, len(snapshot.time_s))
        terms = self.reward_terms(snapshot, goal, flags)
        check_terms(self, terms, len(snapshot.time_s))
        return Evaluation(flags, terms)

    def dense_reward(self, terms: Mapping[str, Array]) -> Array:
        """Return the weighted sum of reward terms: (B,) of such arrays, a number of numbers, the same bits."""
        return total(weight * terms[name] for name, weight in self.reward_weights.items())


Config = TypeVar("Config", bound=TaskConfig)


def load_task_config(cls: type[Config], path: Path, overrides: Mapping[str, Any] | None = None) -> Config:
    """Read a task's configuration from its YAML file, fill in robot and render settings, apply overrides.

    Args:
        cls: the task's configuration class.
        path: of the YAML file. Its key `like` names another task's file whose values count where it says nothing
            else: one of this package (`free_object`), or the path of a YAML file from where this one is.
        overrides: values to change, keys dotted or nested.

    Raises:
        UnknownNameError: there is no such robot.
        ConfigError: the file cannot be read, or a value is missing, unknown or illegal.
    """
    own = _file_values(path, ())

    def merge(given: Mapping[str, Any]) -> dict[str, Any]:
        values = merge_overrides(own, _with_robot_mapping(given))
        if "robot" in values:
            values["robot"] = robot_mapping(values["robot"])
        values["render"] = render_mapping(OBSERVED_QUALITY, values.get("render"))
        return values

    return from_layers(cls, merge, overrides, path.name)


def _file_values(path: Path, seen: tuple[Path, ...]) -> dict[str, Any]:
    """Return a task file's values, laid over those of the file that it is like."""
    if path in seen:
        raise ConfigError(f"{path.name} is like itself: {' -> '.join(file.name for file in (*seen, path))}")
    values = _with_robot_mapping(load_yaml(path))
    base = values.pop(LIKE, None)
    if base is None:
        return values
    if not isinstance(base, str):
        raise ConfigError(f"{path.name}: {LIKE} must be a name or the path of a YAML file, not {shown(base)}")
    is_path = base.endswith((".yaml", ".yml"))
    base_path = path.parent / base if is_path else _TASK_FOLDER / f"{base}.yaml"
    return merge_overrides(_file_values(base_path, (*seen, path)), values)


def _with_robot_mapping(values: Mapping[str, Any]) -> dict[str, Any]:
    """Put a mapping for a robot's name or path, so that other values can be laid over it."""
    robot = values.get("robot")
    return dict(values) | ({"robot": {LIKE: robot}} if isinstance(robot, str | Path) else {})


ROW = "row"  # the field that numbers the environments
# A goal's class may name, in `PADDING`, fields of which one goal has more entries (along the second axis) than
# another, and what fills them up; None: their first entry again.
_PADDING = "PADDING"


def stack_goals(goals: Sequence[Goal]) -> Goal:
    """Return one goal of B = sum of the goals' batches; fields of unequal length are padded to the longest."""
    kind = type(goals[0])
    columns = {}
    for f in fields(kind):
        values = [getattr(goal, f.name) for goal in goals]
        if f.name in _padding(kind):
            most = max(value.shape[1] for value in values)
            values = [_padded(value, most, _padding(kind)[f.name]) for value in values]
        columns[f.name] = np.concatenate(values)
    columns[ROW] = np.arange(len(columns[ROW]))
    return kind(**columns)


def put_goal(stacked: Goal, slot: int, goal: Goal) -> bool:
    """Write a goal of B = 1 into a slot of a stacked one.

    Returns:
        False, and nothing is written, where a field of the goal is too long: then stack anew.
    """
    padding = _padding(type(goal))
    if any(getattr(goal, name).shape[1] > getattr(stacked, name).shape[1] for name in padding):
        return False
    for f in fields(goal):
        if f.name != ROW:
            value, slots = getattr(goal, f.name), getattr(stacked, f.name)
            if f.name in padding:
                value = _padded(value, slots.shape[1], padding[f.name])
            slots[slot] = value[0]
    return True


def _padding(kind: type) -> Mapping[str, np.ndarray | None]:
    return getattr(kind, _PADDING, {})


def _padded(values: np.ndarray, count: int, padding: np.ndarray | None) -> np.ndarray:
    """Return rows (B, N, ...) with N = `count`, filled up with `padding` or with the first entry."""
    missing = count - values.shape[1]
    fill = values[:, :1] if padding is None else padding
    return np.concatenate((values, np.broadcast_to(fill, (len(values), missing, *values.shape[2:]))), axis=1)

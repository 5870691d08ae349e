"""The settings of a collection: all that demonstrations depend on, besides the objects."""

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from artiskill.config import CONFIG_DIR, check_value, differing, load_config, to_mapping
from artiskill.envs.manipulation import ManipulationEnv, ObjectChoice
from artiskill.errors import ArtiSkillError, ConfigError, DemoError
from artiskill.robots.config import LIKE, RobotConfig
from artiskill.scene.physics import PhysicsConfig
from artiskill.scene.props import Prop
from artiskill.sim.states import touched_props
from artiskill.tasks.registry import as_overrides, make_task
from artiskill.tasks.task import Task
from artiskill.versions import versions

CONTROLLER = "controller"  # the kind of expert that `experts.registry` makes
HUMAN = "human"  # a person who drove the robot
LEARNER = "agent"  # a policy of reinforcement learning
_MOST_BITS = 40  # float32 keeps fewer anyway
MOST_COMPRESSION = 9  # of gzip


@dataclass(frozen=True)
class GiveUpConfig:
    """When the collector gives up a target."""

    attempts: int  # never before this many attempts
    least_rate: float  # from then on, as soon as the success rate is below this

    def __post_init__(self) -> None:
        check_value(self, "attempts", self.attempts >= 1, "must be at least 1")
        check_value(self, "least_rate", 0 < self.least_rate <= 1, "must lie above 0, and at most at 1")

    def gives_up(self, attempts: int, successes: int) -> bool:
        """Return whether a target is given up after this many attempts and successes."""
        return attempts >= self.attempts and successes < self.least_rate * attempts


@dataclass(frozen=True)
class StoreConfig:
    """What is stored of a trajectory."""

    key_frame_steps: int  # the engine's exact state is stored every so many steps, and at the end
    position_bits: int  # positions of every step are rounded to multiples of 2**-position_bits (m or rad)
    velocity_bits: int  # velocities of every step are rounded to multiples of 2**-velocity_bits (m/s or rad/s)
    action_bits: int  # actions are rounded to multiples of 2**-action_bits before they are played
    compression: int  # level of gzip

    def __post_init__(self) -> None:
        check_value(self, "key_frame_steps", self.key_frame_steps >= 1, "must be at least 1")
        limits = dict.fromkeys(("position_bits", "velocity_bits", "action_bits"), _MOST_BITS)
        for name, most in (limits | {"compression": MOST_COMPRESSION}).items():
            check_value(self, name, 0 <= getattr(self, name) <= most, f"must lie in [0, {most}]")


@dataclass(frozen=True)
class DemosConfig:
    """The values of `configs/demos.yaml`."""

    block_levels: int  # attempts in one job of a worker; the result does not depend on it
    patience: GiveUpConfig  # when a target is given up
    store: StoreConfig  # what is stored of a trajectory

    def __post_init__(self) -> None:
        check_value(self, "block_levels", self.block_levels >= 1, "must be at least 1")


def load_demos_config(overrides: Mapping[str, Any] | None = None) -> DemosConfig:
    """Return the package's values, with some of them changed."""
    return load_config(DemosConfig, CONFIG_DIR / "demos.yaml", overrides)


@dataclass(frozen=True)
class ExpertInfo:
    """Who demonstrated."""

    name: str  # of its class
    kind: str  # `controller`, for one that follows rules; `human`, for a person; `agent`, for what was trained
    config_hash: str  # of configuration, variation and disturbance; of an agent's weights; empty of a person


@dataclass(frozen=True)
class Agent:
    """A trained policy that demonstrates instead of the expert."""

    name: str  # of the algorithm
    digest: str  # of its weights
    load: Callable[[], Any]  # returns the policy, which sees the state; it must pickle


@dataclass(frozen=True)
class Settings:
    """All that a collection's trajectories depend on besides the objects; equal settings give equal bits."""

    task: str  # name of the task
    control_mode: str  # of the actions
    per_object: int | None  # successful trajectories wanted of each object; None where `per_target` is given
    per_target: int | None  # successful trajectories wanted of each target; None where `per_object` is given
    first_level: int  # of every object
    targets: tuple[str, ...] | None  # only these links; None for all that the task can be done with
    keep_failures: bool  # whether failed attempts are stored, too
    variety: bool  # whether the expert's style differs from episode to episode, and it is disturbed now and then
    config: dict[str, Any]  # resolved configuration of the task
    config_hash: str  # of the task's configuration and the robot's
    expert: ExpertInfo  # who acted
    store: StoreConfig  # what is stored of a trajectory
    patience: GiveUpConfig  # when a target is given up
    versions: dict[str, str]  # of the package, the engine and the numeric libraries

    def __post_init__(self) -> None:
        robot = self.config.get("robot", {})
        if not isinstance(robot, Mapping) or LIKE in robot or any("." in key for key in (*self.config, *robot)):
            raise ConfigError("config must be resolved: a robot that is like another one is a file to be opened")

    @property
    def overrides(self) -> dict[str, Any]:
        """The task's configuration as `make_task` takes it."""
        return as_overrides(self.config)

    @cached_property
    def setup(self) -> tuple[RobotConfig, PhysicsConfig, tuple[Prop, ...]]:
        """What states depend on besides the object: robot, physics, and the props that can be touched.

        Raises:
            DemoError: this version of the package has no such task.
        """
        task = self._task()
        return task.robot, task.physics, touched_props(task.props)

    def make_task(self) -> Task:
        """Return the task, which must still be the one that was demonstrated.

        Raises:
            DemoError: this version of the package makes another task from the same configuration.
        """
        task = self._task()
        if task_hash(task) != self.config_hash:
            raise DemoError(
                f"this version of artiskill makes another {self.task} of the same configuration: its hash is "
                f"{task_hash(task)}, that of the demonstrations {self.config_hash}"
            )
        return task

    def _task(self) -> Task:
        try:
            return make_task(self.task, self.overrides)
        except ArtiSkillError as error:
            raise DemoError(f"this version of artiskill has no such task as was demonstrated: {error}") from error

    def make_env(self, objects: ObjectChoice, obs_mode: str = "state", **options: Any) -> ManipulationEnv:
        """Return an environment of this task and control mode; arguments as those of `ManipulationEnv`."""
        return ManipulationEnv(
            self.task, objects, obs_mode=obs_mode, control_mode=self.control_mode, config=self.overrides, **options
        )

    def differences(self, other: "Settings") -> str:
        """Return what differs in other settings, as text; empty if nothing does."""
        return "; ".join(differing(to_mapping(self), to_mapping(other)))

    @property
    def other_versions(self) -> str:
        """Which versions differ from those of this process, as text; empty if none does."""
        return "; ".join(differing(self.versions, versions()))


def task_hash(task: Task) -> str:
    """Return the hash of a task's resolved configuration and its robot's."""
    return mapping_hash({"task": to_mapping(task.config), "robot": to_mapping(task.robot)})


def settings_hash(settings: Any) -> str:
    """Return the hash of a dataclass of settings, as a file stores them."""
    return mapping_hash(to_mapping(settings))


def mapping_hash(values: Any) -> str:
    """Return the SHA-256 of plain values, 16 hexadecimal digits."""
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]


def plain(config: Any) -> Any:
    """Return a configuration as JSON gives it back."""
    return json.loads(json.dumps(to_mapping(config)))

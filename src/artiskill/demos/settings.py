"""What a collection of demonstrations is a function of, besides the objects."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from artiskill.config import differing, to_mapping
from artiskill.demos.config import PatienceConfig, StoreConfig
from artiskill.envs.manipulation import ManipulationEnv, ObjectChoice
from artiskill.errors import ArtiSkillError, ConfigError, DemoError
from artiskill.robots.config import LIKE, RobotConfig
from artiskill.scene.physics import PhysicsConfig
from artiskill.scene.props import Prop
from artiskill.sim.states import touched_props
from artiskill.tasks.registry import make_task
from artiskill.tasks.task import Task
from artiskill.versions import versions

CONTROLLER = "controller"  # the kind of expert that `experts.registry` makes
# keys of a task's configuration that make it the one of its name, and that no override may hold
_NAMES = ("name", "motion")


@dataclass(frozen=True)
class ExpertInfo:
    """Who demonstrated.

    Attributes:
        name: of its class.
        kind: `controller`, for one that follows rules.
        config_hash: of its configuration, and of what varies in it and disturbs it.
    """

    name: str
    kind: str
    config_hash: str


@dataclass(frozen=True)
class Settings:
    """All that a collection's trajectories depend on but for the objects; two equal ones give the same bits.

    Attributes:
        task: name of the task.
        control_mode: of the actions.
        per_object: successful trajectories that are wanted of each object; None where they are of each target.
        per_target: successful trajectories that are wanted of each target; else None.
        first_level: of every object.
        targets: only these links; None for all that the task can be done with.
        keep_failures: whether failed attempts are stored, too.
        variety: whether the expert's manner differs from episode to episode, and it is disturbed now and then.
        config: resolved configuration of the task.
        config_hash: of it, and of the robot's.
        expert: who acted.
        store: what is kept of a trajectory.
        patience: when a target is given up.
        versions: of the package, the engine and the numeric libraries.
    """

    task: str
    control_mode: str
    per_object: int | None
    per_target: int | None
    first_level: int
    targets: tuple[str, ...] | None
    keep_failures: bool
    variety: bool
    config: dict[str, Any]
    config_hash: str
    expert: ExpertInfo
    store: StoreConfig
    patience: PatienceConfig
    versions: dict[str, str]

    def __post_init__(self) -> None:
        robot = self.config.get("robot", {})
        if not isinstance(robot, Mapping) or LIKE in robot or any("." in key for key in (*self.config, *robot)):
            raise ConfigError("config must be resolved: a robot that is like another one is a file to be opened")

    @property
    def overrides(self) -> dict[str, Any]:
        """The task's configuration as `make_task` takes it."""
        return {key: value for key, value in self.config.items() if key not in _NAMES}

    @cached_property
    def setup(self) -> tuple[RobotConfig, PhysicsConfig, tuple[Prop, ...]]:
        """What states depend on beside the object: robot, physics, and the props that can be touched.

        Raises:
            DemoError: this version of the package has no such task.
        """
        task = self._task()
        return task.robot, task.physics, touched_props(task.props)

    def make_task(self) -> Task:
        """The task as it was.

        Raises:
            DemoError: this version of the package makes another one of the same configuration.
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
        """An environment of this task and control mode.

        Args:
            objects: as `ManipulationEnv` takes them.
            obs_mode: likewise.
            options: further arguments of `ManipulationEnv`.
        """
        return ManipulationEnv(
            self.task, objects, obs_mode=obs_mode, control_mode=self.control_mode, config=self.overrides, **options
        )

    def differences(self, other: "Settings") -> str:
        """What is not the same in another one's, as text; empty if all is."""
        return "; ".join(differing(to_mapping(self), to_mapping(other)))

    @property
    def other_versions(self) -> str:
        """Which versions are not those of this process, as text; empty if all are."""
        return "; ".join(differing(self.versions, versions()))


def task_hash(task: Task) -> str:
    """Of its resolved configuration and its robot's."""
    return mapping_hash({"task": to_mapping(task.config), "robot": to_mapping(task.robot)})


def settings_hash(settings: Any) -> str:
    """Of a dataclass of settings, as a file keeps them."""
    return mapping_hash(to_mapping(settings))


def mapping_hash(values: Any) -> str:
    """SHA-256 of plain values, 16 hexadecimal digits."""
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]


def plain(config: Any) -> Any:
    """A configuration as it is after a journey through JSON."""
    return json.loads(json.dumps(to_mapping(config)))

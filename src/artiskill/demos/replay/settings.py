"""What training files are a function of, besides the demonstrations that they are made from."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.config import check, differing, to_mapping
from artiskill.demos.settings import Settings
from artiskill.envs.control import CONTROL_MODES
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.options import OBSERVATION_MODES
from artiskill.envs.vision import FRAMES
from artiskill.envs.wrappers import PointCloudDownsample
from artiskill.errors import ConfigError, check_name, shown
from artiskill.sensors.observations.sampling import make_sampler
from artiskill.tasks.registry import make_task
from artiskill.tasks.task import Task

SIMULATE, RESTORE = "simulate", "restore"
WAYS: tuple[str, ...] = (SIMULATE, RESTORE)
# parts of a task's configuration that change what is seen, and nothing of what happens
_SEEN = ("cameras.", "render.")
_MOST_NAMED = 3  # differences


@dataclass(frozen=True)
class Sampling:
    """Which points of a cloud are kept, see `PointCloudDownsample`.

    Attributes:
        num_points: in all.
        method: `maniskill`, `uniform`, `voxel` or `fps`.
        frame: `world`, `robot` or `end_effector`.
        settings: of the method.
    """

    num_points: int = 1200
    method: str = "maniskill"
    frame: str = "world"
    settings: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_name("frame", self.frame, FRAMES)
        make_sampler(self.method, self.num_points, self.all_settings)

    @property
    def all_settings(self) -> dict[str, Any]:
        """The method's, those that were not given as for 1,200 points."""
        shares = {"masked_points": 2 * self.num_points // 3, "points_per_mask": self.num_points // 24}
        return (shares if self.method == "maniskill" else {}) | self.settings


@dataclass(frozen=True)
class ReplaySettings:
    """How training files are made.

    Attributes:
        source: settings of the demonstrations.
        obs_mode: `state`, `pointcloud` or `rgbd`.
        control_mode: of the actions.
        way: `simulate`, play the actions once more, or `restore`, put every recorded state in place.
        sampling: of point clouds; None for the full ones, and in other modes.
        seen: values of the task's sections `cameras` and `render` that are other ones.
        count: trajectories of each object, evenly of its targets; None for all.
        keep_failures: keep what is not solved, too.
        compression: level of gzip.
        versions: of the package, the engine and the numeric libraries.
    """

    source: Settings
    obs_mode: str
    control_mode: str
    way: str
    sampling: Sampling | None
    seen: dict[str, Any]
    count: int | None
    keep_failures: bool
    compression: int
    versions: dict[str, str]

    def __post_init__(self) -> None:
        check_name("observation mode", self.obs_mode, OBSERVATION_MODES)
        check_name("control mode", self.control_mode, CONTROL_MODES)
        check_name("way of replaying", self.way, WAYS)
        is_cloud = self.obs_mode == "pointcloud"
        check(self.sampling is None or is_cloud, f"points are of obs_mode pointcloud, not of {self.obs_mode}")
        check(self.count is None or self.count >= 1, f"the count must be at least 1, not {self.count}")
        check(0 <= self.compression <= 9, f"the compression must lie in [0, 9], not {self.compression}")
        for key in self.seen:
            if not key.startswith(_SEEN):
                seen = ", ".join(f"{name}*" for name in _SEEN)
                raise ConfigError(
                    f"a replay can change what is seen ({seen}), not {shown(key)}: "
                    "the physics, the rewards and what counts as solved are those of the demonstrations"
                )

    @property
    def overrides(self) -> dict[str, Any]:
        """The task's configuration as `make_task` takes it."""
        return self.source.overrides | self.seen

    def make_task(self) -> Task:
        """The demonstrations' task, seen as these settings say.

        Raises:
            DemoError: this version of the package makes another task of the same configuration.
            ConfigError: an illegal value of what is seen.
        """
        self.source.make_task()
        return make_task(self.source.task, self.overrides)

    def make_env(self, obj: ArticulatedObject) -> ManipulationEnv:
        """An environment that observes and is controlled as the training files are.

        Raises:
            ConfigError: an illegal value of what is seen.
        """
        env = ManipulationEnv(
            self.source.task,
            [obj],
            obs_mode=self.obs_mode,
            control_mode=self.control_mode,
            config=self.overrides,
        )
        if self.sampling is not None:  # the wrapper changes the environment itself, and is not needed afterwards
            sampling = self.sampling
            PointCloudDownsample(
                env, sampling.method, sampling.num_points, sampling.frame, **sampling.all_settings
            )
        return env

    def differences(self, other: "ReplaySettings") -> str:
        """What is not the same in another one's, as text: the task, or the first things; empty if all is."""
        if self.source.task != other.source.task:
            return f"task {self.source.task} there, {other.source.task} here"
        found = differing(to_mapping(self), to_mapping(other))
        more = [f"and {len(found) - _MOST_NAMED} more"] if len(found) > _MOST_NAMED else []
        return "; ".join(found[:_MOST_NAMED] + more)


def make_sampling(
    points: int | None, method: str = "maniskill", frame: str = "world", settings: Mapping[str, Any] | None = None
) -> Sampling | None:
    """The sampling of so many points; None for the full cloud, which is in the world's frame.

    Raises:
        UnknownNameError: no such method or frame.
        ConfigError: an illegal number or setting, or a method or frame for the full cloud.
    """
    if points is not None:
        return Sampling(points, method, frame, dict(settings or {}))
    check(method == "maniskill", f"the full cloud has every point; method {method!r} is for fewer points")
    check(frame == "world", f"the full cloud is in the world's frame; {frame!r} is for fewer points")
    return None

"""What is measured: one `Case` per combination of task, observation mode, number of environments and threads."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from artiskill.assets.catalog import resolve_objects
from artiskill.config import check
from artiskill.envs.options import MAX_ENVS, OBSERVATION_MODES
from artiskill.errors import check_name
from artiskill.jobs.parallel import available_cores
from artiskill.tasks.registry import task_names

ALL_TASKS = "all"
# shares of a cloud's points as in the baselines: 800 of 1,200 on masks, 50 of each mask first
_MASKED_SHARE, _PER_MASK_SHARE = 2 / 3, 1 / 24


@dataclass(frozen=True)
class Case:
    """One thing to measure.

    Attributes:
        task: name of the task.
        obs_mode: `state`, `pointcloud` or `rgbd`.
        num_envs: 1 is a `ManipulationEnv`, more a `ManipulationVectorEnv`.
        num_threads: threads that step and draw.
        objects: splits, ids or paths.
        points: rows that a point cloud is down-sampled to; None for all pixels.
        seconds: to spend on timed steps, the engine's included.
    """

    task: str
    obs_mode: str
    num_envs: int
    num_threads: int
    objects: tuple[str, ...]
    points: int | None = None
    seconds: float = 4.0

    def __post_init__(self) -> None:
        check_name("task", self.task, task_names())
        check_name("observation mode", self.obs_mode, OBSERVATION_MODES)
        check(self.num_envs >= 1, f"num_envs must be at least 1, not {self.num_envs}")
        check(self.num_envs <= MAX_ENVS, f"num_envs must be at most {MAX_ENVS}, not {self.num_envs}")
        check(self.num_threads >= 1, f"threads must be at least 1, not {self.num_threads}")
        check(self.seconds > 0, f"seconds must be positive, not {self.seconds}")
        check(self.points is None or self.points >= 1, f"points must be at least 1, not {self.points}")
        resolve_objects(list(self.objects), task=self.task)

    @property
    def mode(self) -> str:
        """The observation mode for people."""
        return self.obs_mode if self.points is None else f"{self.obs_mode} {self.points}"

    @property
    def sampling(self) -> dict[str, Any]:
        """Settings of the sampler `maniskill` for any number of points."""
        points = self.points or 0
        return {"masked_points": int(_MASKED_SHARE * points), "points_per_mask": int(_PER_MASK_SHARE * points)}

    def __str__(self) -> str:
        return f"{self.task}, {self.mode}, {self.num_envs} environments, {self.num_threads} threads"


def make_cases(
    tasks: Sequence[str],
    obs_modes: Sequence[str],
    num_envs: Sequence[int],
    threads: Sequence[int] | None,
    objects: Sequence[str],
    points: int | None = None,
    seconds: float = 4.0,
) -> list[Case]:
    """Return all combinations, without duplicates: there are no more threads than environments.

    Args:
        tasks: names, or `all`.
        obs_modes: names.
        num_envs: numbers of environments.
        threads: numbers of threads; None for one per core.
        objects: see `Case`.
        points: see `Case`; other modes than `pointcloud` disregard it.
        seconds: see `Case`.

    Raises:
        UnknownNameError: an unknown task, mode, split or object.
        ConfigError: a number out of range.
        AssetError: objects that do not fit a task.
    """
    names = task_names() if ALL_TASKS in tasks else tasks
    counts = [available_cores()] if threads is None else threads
    cases = [
        Case(
            task=task,
            obs_mode=mode,
            num_envs=size,
            num_threads=min(count, max(size, 1)),
            objects=tuple(objects),
            points=points if mode == "pointcloud" else None,
            seconds=seconds,
        )
        for task, mode, size, count in product(names, obs_modes, num_envs, counts)
    ]
    return list(dict.fromkeys(cases))

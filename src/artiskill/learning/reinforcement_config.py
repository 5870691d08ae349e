"""`ReinforcementConfig`: all values of a run of reinforcement learning. Importing this imports no torch."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from artiskill.config import (
    check,
    check_inside,
    check_not_negative,
    check_positive,
    check_value,
    from_layers,
    from_mapping,
    load_yaml,
    merge_overrides,
    to_mapping,
)
from artiskill.envs.options import env_count
from artiskill.errors import ConfigError, RunError, check_name
from artiskill.learning.run import CONFIG
from artiskill.learning.train_config import check_same_values, file_values
from artiskill.tasks.levels import check_level
from artiskill.tasks.registry import task_spec

_MOST_STEPS = 10**9
_MOST_ENTROPY = 0.69  # of a number in [-1, 1]: evenly spread


@dataclass(frozen=True)
class SACConfig:
    """Values of soft actor-critic, with the library's names."""

    learning_rate: float
    gamma: float  # discount of a step
    net_arch: tuple[int, ...]  # sizes of hidden layers, of the policy and of each critic
    layer_norm: bool  # after each hidden layer of the critics
    batch_size: int
    buffer_size: int  # steps of all environments
    learning_starts: int  # random steps before the first update
    gradient_steps: int  # after each step of all environments
    n_steps: int  # whose rewards a target adds up
    tau: float  # by which target networks follow
    ent_coef: float | str  # `auto`, or `auto_0.1` to begin with 0.1
    action_entropy: float  # that the policy shall have, for each number of an action; the library's own is -1
    expert_share: float = 0.0  # of the training episodes, those in which an expert takes over if they last so long
    takeover_steps: tuple[int, int] = (0, 100)  # fewest and most steps of these before it does

    def __post_init__(self) -> None:
        check_positive(self, "learning_rate", "batch_size", "buffer_size", "gradient_steps", "n_steps", "tau")
        check_not_negative(self, "learning_starts")
        _check_shared(self.gamma, self.net_arch)
        check_inside("algorithm.action_entropy", self.action_entropy, (-10, _MOST_ENTROPY))
        check_inside("algorithm.expert_share", self.expert_share, (0, 1))
        low, high = self.takeover_steps
        check_value(self, "takeover_steps", 0 <= low <= high, "must be two rising whole numbers from 0 on")
        if not isinstance(self.ent_coef, str):
            check_not_negative(self, "ent_coef")
            return
        start, _, number = self.ent_coef.partition("_")
        check(
            self.ent_coef == "auto" or (start == "auto" and _is_positive(number)),
            f"algorithm.ent_coef must be a number, auto, or auto_0.1, not {self.ent_coef!r}",
        )


def _is_positive(text: str) -> bool:
    try:
        return float(text) > 0
    except ValueError:
        return False


@dataclass(frozen=True)
class PPOConfig:
    """Values of proximal policy optimisation, with the library's names."""

    learning_rate: float
    gamma: float
    net_arch: tuple[int, ...]  # sizes of hidden layers, of the policy and of the critic
    batch_size: int
    n_steps: int  # of each environment between two updates
    n_epochs: int
    gae_lambda: float
    clip_range: float
    ent_coef: float
    max_grad_norm: float
    log_std_init: float

    def __post_init__(self) -> None:
        check_positive(
            self, "learning_rate", "batch_size", "n_steps", "n_epochs", "gae_lambda", "clip_range", "max_grad_norm"
        )
        check_not_negative(self, "ent_coef")
        check_value(self, "n_steps", self.n_steps > 1, "must be at least 2")
        check_value(self, "batch_size", self.batch_size > 1, "must be at least 2")
        _check_shared(self.gamma, self.net_arch)


def _check_shared(gamma: float, sizes: tuple[int, ...]) -> None:
    check(0 <= gamma <= 1, f"algorithm.gamma must lie in [0, 1], not {gamma!r}")
    check(min(sizes, default=1) >= 1, f"algorithm.net_arch must have sizes of at least 1, not {list(sizes)}")


REINFORCEMENT: Mapping[str, type[SACConfig] | type[PPOConfig]] = {"sac": SACConfig, "ppo": PPOConfig}


@dataclass(frozen=True)
class EvaluationConfig:
    """How success is measured while training: on new levels of the objects that are trained on."""

    episodes: int  # in all, shared by the objects; more if there are more objects: one on each
    first_level: int
    every: int  # steps
    success_threshold: float  # share of episodes
    stop_after: int  # measurements in a row that reach it end the run; 0: only its steps do

    def __post_init__(self) -> None:
        check_positive(self, "episodes", "every")
        check_not_negative(self, "stop_after")
        check_inside("evaluation.success_threshold", self.success_threshold, (0, 1))
        check_level(self.first_level)
        check_level(self.first_level + self.episodes - 1)


@dataclass(frozen=True)
class ReinforcementConfig:
    """All values of a run; the same values give the same weights, bit for bit on a CPU."""

    task: str
    name: str  # of the algorithm
    objects: tuple[str, ...]  # as `resolve_objects` takes them
    target: str | None  # link; None: each episode draws one
    steps: int  # of all environments together
    seed: int  # of initial weights, levels and noise
    envs: int
    terminate_on_success: bool
    reward_scale: float
    normalise: bool  # observations, by what has been seen so far
    log_every: int  # steps
    checkpoint_every: int  # steps
    evaluation: EvaluationConfig
    algorithm: dict[str, Any]  # values of `SACConfig` or `PPOConfig`
    config: dict[str, Any] = field(default_factory=dict)  # changed values of the task's configuration

    def __post_init__(self) -> None:
        check_name("algorithm", self.name, REINFORCEMENT)
        task_spec(self.task)
        check(bool(self.objects), "objects must not be empty")
        check_value(self, "steps", 1 <= self.steps <= _MOST_STEPS, f"must lie in [1, {_MOST_STEPS}]")
        check_value(self, "seed", 0 <= self.seed < 2**31, "must lie in [0, 2^31)")
        env_count(self.envs, "envs")
        check_positive(self, "reward_scale", "log_every", "checkpoint_every")

    @property
    def values(self) -> Any:
        """The algorithm's values, checked.

        Raises:
            ConfigError: an unknown key or an illegal value.
        """
        return from_mapping(REINFORCEMENT[self.name], self.algorithm, "algorithm")

    @property
    def expert_share(self) -> float:
        """In which share of training episodes an expert takes over; 0 where the algorithm has no such value."""
        return float(getattr(self.values, "expert_share", 0.0))

    def check_continues(self, other: "ReinforcementConfig", folder: Path) -> None:
        """Raise `RunError` if a run with these values cannot go on with other ones, but for a later end."""
        ours, theirs = to_mapping(self), to_mapping(other)
        theirs["steps"] = min(ours["steps"], theirs["steps"])
        for name in ("success_threshold", "stop_after"):
            theirs["evaluation"][name] = ours["evaluation"][name]
        check_same_values(ours, theirs, folder)


def load_reinforcement_config(
    name: str, task: str, overrides: Mapping[str, Any] | None = None
) -> ReinforcementConfig:
    """Return the values of a run: of the package's files, what they say of the task, and others laid over them.

    Args:
        name: of the algorithm, one of `REINFORCEMENT`.
        task: name of the task.
        overrides: dotted keys and other values, `{"algorithm.gamma": 0.98}`.

    Raises:
        UnknownNameError: no such algorithm or task.
        ConfigError: an unknown key or an illegal value.
    """
    check_name("algorithm", name, REINFORCEMENT)
    task_spec(task)
    values = file_values(("reinforcement", name), task)
    values |= {"task": task, "name": name, "objects": ("train",)}
    config = from_layers(
        ReinforcementConfig, lambda given: merge_overrides(values, given), overrides, f"{name}.yaml"
    )
    return replace(config, algorithm=to_mapping(config.values))


def read_reinforcement_config(folder: Path) -> ReinforcementConfig:
    """Read the resolved configuration of a run.

    Raises:
        RunError: it is missing or damaged.
    """
    try:
        config = from_mapping(ReinforcementConfig, load_yaml(folder / CONFIG), str(folder / CONFIG))
        return replace(config, algorithm=to_mapping(config.values))  # with values that older runs had not
    except ConfigError as error:
        raise RunError(str(error)) from error

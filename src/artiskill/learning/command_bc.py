"""Behaviour cloning of commands: what the hands of the demonstrations do, rather than their joints.

The demonstrations' actions become the commands that amount to them (`ActionReader`). No expert is asked what it
would do; its controller says how commands become actions: the robot's kinematics, the posture of arms, how fast
fingers close. The kinds of a command are what the fingers of the first hand do.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
import torch

from artiskill.config import check, check_not_negative, from_mapping
from artiskill.envs.control import JOINT
from artiskill.learning.augmentation import Augmentation
from artiskill.learning.batch import Batch, Observation
from artiskill.learning.command_learner import CommandLearner, CommandLearnerConfig
from artiskill.learning.commands import (
    GRIP_PHASES,
    ActionReader,
    CommandSpace,
    command_space,
    commanding_expert,
)
from artiskill.learning.loading import BatchLoader, StepSampler
from artiskill.learning.observation import ObservationArrays
from artiskill.learning.train_config import TrainConfig, algorithm_config
from artiskill.learning.trainer import Trainer
from artiskill.learning.training_set import TrainingSet
from artiskill.tasks.registry import make_task

_ARM_GAIN_S = 1.0  # how strongly arms strive for their posture beside what hands do
_HAND = "end_effector"  # the frame in which points cannot be mirrored, nor bases found
_STREAM = 11  # tells the random numbers of variations from others of the same seed


@dataclass(frozen=True)
class CommandBCConfig(CommandLearnerConfig):
    """Values of behaviour cloning of commands."""

    # the last steps of each demonstration, which are not imitated: whoever demonstrates brakes where a joint ends,
    # and a cloud does not show where that is
    end_steps: int = field(default=0, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_not_negative(self, "end_steps")


class CommandBC(CommandLearner):
    """A policy that commands what the demonstrations do."""

    Config = CommandBCConfig

    def __init__(self, config: CommandBCConfig, *arguments: Any, **values: Any) -> None:
        super().__init__(config, *arguments, **values)
        self.end_steps = config.end_steps


def demonstrated_space(task_name: str, control_mode: str, overrides: Mapping[str, Any]) -> CommandSpace:
    """Return the space of commands that demonstrations of a task are told in: its expert's, without phases.

    Raises:
        ConfigError: actions of this control mode tell no commands.
        PolicyError: the task's expert gives no commands.
    """
    check(control_mode == JOINT, f"commands are told by actions of control mode {JOINT!r}, not {control_mode!r}")
    task = make_task(task_name, overrides)
    controller = commanding_expert(task, {}).controller
    return command_space(task, controller, GRIP_PHASES)


def check_demonstrated(config: TrainConfig, space: CommandSpace, training_set: TrainingSet) -> None:
    """Refuse what only shows when batches are made.

    Raises:
        ConfigError: points in the frame of the hand, in which base and hands cannot be found; or variations that
            the robot or the task does not have.
        DemoError: some demonstrations are too short to leave their ends out.
    """
    values, frame = algorithm_config(config), training_set.manifest.sampling["frame"]
    Augmentation(values.augmentation, space, frame, training_set.sizes.masks)
    StepSampler(training_set, config.seed, end_steps=values.end_steps)
    check(frame != _HAND, f"{config.name} needs points in frame 'robot' or 'world', not {frame!r}")


class DemonstratedCommands:
    """The commands that a set's actions amount to; each is computed when it is first asked for.

    Args:
        training_set: with actions of control mode `joint`.
        space: of the commands.
    """

    def __init__(self, training_set: TrainingSet, space: CommandSpace) -> None:
        self._set, self._reader = training_set, ActionReader(space, _ARM_GAIN_S)
        self._known = np.zeros(len(training_set), dtype=bool)
        self._labels = np.zeros((len(training_set), space.label_size), dtype=np.float32)

    def labels(self, rows: np.ndarray) -> np.ndarray:
        """Return the commands (B, V) of steps (B,)."""
        missing = np.unique(rows[~self._known[rows]])
        if len(missing):
            agents = self._set.read(self._set.steps["frame"][missing])["agent"][:, 0]
            self._labels[missing] = self._reader.labels(agents, self._set.steps["action"][missing])
            self._known[missing] = True
        return self._labels[rows]


class CommandBatches:
    """The batches of a loader, with commands for actions, varied as the run's values say.

    Args:
        loader: of the run.
        training_set: that it reads.
        trainer: of the run, from where it stands.
    """

    def __init__(self, loader: BatchLoader, training_set: TrainingSet, trainer: Trainer) -> None:
        space = from_mapping(CommandSpace, trainer.info.commands, "commands")
        self._loader, self._step, self._key = loader, trainer.state.step, trainer.config.seed
        self._rank, self._device = trainer.processes.rank, trainer.processes.device
        self._commands = DemonstratedCommands(training_set, space)
        values, info = algorithm_config(trainer.config), trainer.info
        self._augmentation = Augmentation(values.augmentation, space, info.sampling["frame"], info.sizes["masks"])

    def __iter__(self) -> Self:
        """Return itself."""
        return self

    def __next__(self) -> Batch:
        """Return the next batch."""
        batch = next(self._loader)  # on the CPU
        rng = np.random.Generator(np.random.Philox(key=self._key, counter=[0, _STREAM, self._rank, self._step]))
        labels = self._commands.labels(self._loader.rows(self._step))
        self._step += 1
        seen = ObservationArrays(*(part.numpy() for part in batch.observation))
        seen, labels = self._augmentation(seen, labels, rng)
        *parts, action = (torch.from_numpy(part).to(self._device) for part in (*seen, labels))
        weight, reward, terminated = (one.to(self._device) for one in batch[2:5])
        return Batch(Observation(*parts), action, weight, reward, terminated, None)

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *error: object) -> None:
        """End the loader's threads."""
        self._loader.close()

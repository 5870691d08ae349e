"""Batches of demonstrations whose actions have become commands, for `command_bc`."""

from typing import Any, Self

import numpy as np
import torch

from artiskill.config import check, from_mapping
from artiskill.envs.control import JOINT
from artiskill.experts.registry import make_expert
from artiskill.learning.augmentation import Augmentation
from artiskill.learning.batch import Batch, Observation
from artiskill.learning.commands import GRIP_PHASES, ActionReader, CommandSpace, command_space
from artiskill.learning.loading import BatchLoader
from artiskill.learning.observation import ObservationArrays
from artiskill.learning.train_config import algorithm_config
from artiskill.learning.trainer import Trainer
from artiskill.tasks.registry import make_task

_ARM_GAIN_S = 1.0  # how strongly arms strive for their posture beside what hands do
_STREAM = 11  # tells the random numbers of variations from others of the same seed


def demonstrated_space(task_name: str, control_mode: str) -> CommandSpace:
    """Return the space of commands that demonstrations of a task are told in: its expert's, without phases.

    Raises:
        ConfigError: actions of this control mode tell no commands.
    """
    check(control_mode == JOINT, f"commands are told by actions of control mode {JOINT!r}, not {control_mode!r}")
    task = make_task(task_name)
    expert: Any = make_expert(task.name, task.robot)
    return command_space(task.robot, task.config.physics.step_s, expert.controller, GRIP_PHASES)


class CommandBatches:
    """The batches of a loader, with commands for actions, varied as the run's values say.

    Args:
        loader: of the run.
        trainer: of the run, from where it stands.
    """

    def __init__(self, loader: BatchLoader, trainer: Trainer) -> None:
        space = from_mapping(CommandSpace, trainer.info.commands, "commands")
        self._loader, self._step, self._key = loader, trainer.state.step, trainer.config.seed
        self._rank = trainer.processes.rank
        self._reader = ActionReader(space, _ARM_GAIN_S)
        self._augmentation = Augmentation(algorithm_config(trainer.config).augmentation, space)

    def __iter__(self) -> Self:
        """Return itself."""
        return self

    def __next__(self) -> Batch:
        """Return the next batch."""
        batch = next(self._loader)
        rng = np.random.Generator(np.random.Philox(key=self._key, counter=[0, _STREAM, self._rank, self._step]))
        self._step += 1
        seen = ObservationArrays(*(part.cpu().numpy() for part in batch.observation))
        labels = self._reader.labels(seen.agent, batch.action.cpu().numpy())
        seen, labels = self._augmentation(seen, labels, rng)
        device = batch.action.device
        tensors = [torch.from_numpy(np.ascontiguousarray(part)).to(device) for part in (*seen, labels)]
        return batch._replace(observation=Observation(*tensors[:-1]), action=tensors[-1])

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *error: object) -> None:
        """End the loader's threads."""
        self._loader.close()

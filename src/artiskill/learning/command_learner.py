"""Learning commands: one of each kind, and which kind it is (`learning/commands.py`).

One command for all kinds would be their mean where the kind is not certain, and do nothing. Algorithms made of
this say where the commands come from: `dagger`, `command_bc`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, ClassVar

import torch
from torch import Tensor, nn
from torch.nn.functional import cross_entropy, smooth_l1_loss
from torch.optim import AdamW

from artiskill.config import check_not_negative, check_positive, from_mapping
from artiskill.experts.whole_body import Grip
from artiskill.learning.algorithm import Algorithm, Autocast, MakeNetwork, Sync, descend
from artiskill.learning.augmentation import AugmentationConfig
from artiskill.learning.batch import Batch, Observation, Sizes
from artiskill.learning.commands import GRIPS, CommandSpace


@dataclass(frozen=True)
class CommandLearnerConfig:
    """Values of learning commands."""

    learning_rate: float
    weight_decay: float
    gradient_norm: float  # longer gradients are shortened to it
    error_bend: float  # errors of motions count by their squares up to here, then by their lengths
    width_weight: float  # of the error of open fingers' width, where that of motions has 1
    grip_weight: float  # of the cross-entropy of what fingers do
    kind_weight: float  # of the cross-entropy of kinds
    augmentation: AugmentationConfig = field(default=AugmentationConfig(), kw_only=True)

    def __post_init__(self) -> None:
        check_positive(self, "learning_rate", "gradient_norm", "error_bend")
        check_not_negative(self, "weight_decay", "width_weight", "grip_weight", "kind_weight")


class CommandLearner(Algorithm):
    """A policy that commands; `choose` gives commands as numbers, see `CommandSpace`."""

    Config: ClassVar[type[CommandLearnerConfig]] = CommandLearnerConfig
    needs_next = False

    def __init__(
        self,
        config: CommandLearnerConfig,
        make: MakeNetwork,
        sizes: Sizes,
        action_std: Tensor | None = None,
        commands: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        super().__init__(None, False)
        self.config = config
        self.commands = from_mapping(CommandSpace, commands, "commands")
        self.policy = make(self.commands.output_size, 0)
        rate, decay = config.learning_rate, config.weight_decay
        self.optimizers = {"policy": AdamW(self.policy.parameters(), lr=rate, weight_decay=decay)}

    def update(
        self, batch: Batch, step: int, noise: torch.Generator, sync: Sync, autocast: Autocast
    ) -> dict[str, Tensor]:
        """Take one step down the errors of commands; those of the batch are its `action`."""
        with autocast():
            outputs = self.policy(batch.observation)
        loss, numbers = self.loss(outputs.float(), batch.action)

        def shorten(parameters: Iterable[nn.Parameter]) -> None:
            parameters = list(parameters)
            sync(parameters)
            nn.utils.clip_grad_norm_(parameters, self.config.gradient_norm)

        descend(loss, self.optimizers["policy"], shorten)
        return numbers

    def loss(self, outputs: Tensor, label: Tensor) -> tuple[Tensor, dict[str, Tensor]]:
        """Return the loss of outputs (B, O) for commands (B, V), and its parts to log.

        A motion is compared in the kind that the command has; widths count where fingers are open.
        """
        config, m, a = self.config, self.commands.motion_size, self.commands.arms
        grip, kind = label[:, m + a : m + 2 * a].long(), label[:, -1].long()
        found = self.commands.parts(outputs, kind)
        motion = smooth_l1_loss(found.motion, label[:, :m], beta=config.error_bend)
        width_error = smooth_l1_loss(found.width, label[:, m : m + a], beta=config.error_bend, reduction="none")
        width = (width_error * (grip == Grip.OPEN)).mean()
        grips = cross_entropy(found.grip.reshape(-1, GRIPS), grip.reshape(-1))
        logits = self.commands.logits(outputs)
        kinds = cross_entropy(logits, kind)
        loss = motion + config.width_weight * width + config.grip_weight * grips + config.kind_weight * kinds
        right = (logits.argmax(1) == kind).float().mean()
        numbers = {"imitation_loss": motion, "grip_loss": grips, "kind_loss": kinds, "kind_accuracy": right}
        return loss, {name: number.detach() for name, number in numbers.items()}

    def choose(self, observation: Observation) -> Tensor:
        """Return the commands (B, V) of the likeliest kinds."""
        outputs = self.policy(observation).float().cpu()
        return torch.from_numpy(self.commands.likeliest(outputs.detach().numpy()))

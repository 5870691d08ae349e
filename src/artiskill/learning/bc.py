"""Behaviour cloning: the action of the demonstration, by least squares (Pomerleau, 1989)."""

from dataclasses import dataclass

import torch
from torch import Tensor

from artiskill.config import check_not_negative, check_positive
from artiskill.learning.algorithm import Algorithm, Autocast, MakeNetwork, Sync, adam, descend, weighted_mean
from artiskill.learning.batch import Batch, Observation, Sizes


@dataclass(frozen=True)
class BCConfig:
    """Values of behaviour cloning."""

    learning_rate: float
    weight_decay: float
    standardise_actions: bool  # errors count in standard deviations of the demonstrations

    def __post_init__(self) -> None:
        check_positive(self, "learning_rate")
        check_not_negative(self, "weight_decay")


class BC(Algorithm):
    """A policy that does what the demonstrations do."""

    Config = BCConfig
    needs_next = False

    def __init__(
        self, config: BCConfig, make: MakeNetwork, sizes: Sizes, action_std: Tensor | None = None
    ) -> None:
        super().__init__(action_std, config.standardise_actions)
        self.policy = make(sizes.action, 0)
        self.optimizers = {"policy": adam([self.policy], config.learning_rate, config.weight_decay)}

    def update(
        self, batch: Batch, step: int, noise: torch.Generator, sync: Sync, autocast: Autocast
    ) -> dict[str, Tensor]:
        """Take one step down the squared error of the steps that are to be imitated."""
        with autocast():
            action = self.choose(batch.observation)
        loss = weighted_mean(self.imitation_error(action, batch), batch.weight)
        descend(loss, self.optimizers["policy"], sync)
        return {"imitation_loss": loss.detach()}

    def choose(self, observation: Observation) -> Tensor:
        """Return the policy's actions."""
        return torch.tanh(self.policy(observation).float())

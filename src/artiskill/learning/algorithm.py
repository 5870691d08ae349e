"""What an algorithm is: networks with their optimizers, one step of training, and how it acts.

Each algorithm is one file beside this one, readable alone; here stands what they share. Nothing here draws from
torch's global generator: initial weights come from whoever makes the networks, noise from a generator that is
given to `update`. So (weights, optimizers' state, batch, step, noise) fix the weights after a step.
"""

import copy
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from typing import Any, ClassVar, Protocol

import torch
from torch import Tensor, nn
from torch.optim import Adam, Optimizer

from artiskill.learning.batch import Batch, Observation

Sync = Callable[[Iterable[nn.Parameter]], None]  # averages the gradients of parameters over processes, in place
Autocast = Callable[[], AbstractContextManager[object]]  # forward passes run in it: mixed precision, or nothing

_LEAST_WEIGHT = 1e-8  # a batch without weights gives 0, not 0 / 0


class Network(Protocol):
    """A network on observations and E further numbers (an action, a latent); an `nn.Module` otherwise.

    The observation is the costly part, so it can be encoded once and read out for many candidates.
    """

    def encode(self, observation: Observation) -> Any:
        """Return the features of an observation, whatever `head` reads."""

    def head(self, features: Any, extra: Tensor | None = None) -> Tensor:
        """Return outputs (B, outputs), or (B, M, outputs) for M candidates of each observation.

        Args:
            features: of B observations, from `encode`.
            extra: (B, E) or (B, M, E) float32; None where E is 0.
        """

    def __call__(self, observation: Observation, extra: Tensor | None = None) -> Tensor:
        """Return `head(encode(observation), extra)`; nothing squashes the outputs."""


MakeNetwork = Callable[[int, int], Any]  # (outputs, E) -> a Network with fresh weights


class Algorithm(nn.Module, ABC):
    """Networks, their optimizers, one step of training, and how to act.

    A subclass is made of `(config, make, sizes, action_std)`: its `Config`, what makes its networks (a
    `MakeNetwork`), the `Sizes` of arrays, and the standard deviations (A,) of the demonstrations' actions. What it
    has to remember stands in `state_dict()` and in its optimizers' `state_dict()`.

    Attributes:
        Config: the dataclass of its values.
        action_unit: (A,) in which errors of actions count, or ().
        needs_next: whether batches need `next_observation`.
        end_steps: the last ones of each demonstration, which batches leave out.
        optimizers: by name.
    """

    Config: ClassVar[type]
    needs_next: ClassVar[bool]
    end_steps: int = 0
    optimizers: dict[str, Optimizer]
    action_unit: Tensor

    def __init__(self, action_std: Tensor | None, standardise: bool) -> None:
        super().__init__()
        unit = action_std if standardise and action_std is not None else torch.ones(())
        self.register_buffer("action_unit", unit.clone(), persistent=False)

    def imitation_error(self, action: Tensor, batch: Batch) -> Tensor:
        """Return the mean squared error (B,) of actions (B, A), each number in its own unit.

        That unit is the standard deviation of the demonstrations, else errors of joints that move slowly, those of
        the arm, would vanish beside errors of base and fingers.
        """
        return ((action - batch.action) / self.action_unit).square().mean(-1)

    @abstractmethod
    def update(
        self, batch: Batch, step: int, noise: torch.Generator, sync: Sync, autocast: Autocast
    ) -> dict[str, Tensor]:
        """Take one step of training.

        Args:
            batch: on the device of the networks.
            step: 0 for the first.
            noise: what random numbers of this step are drawn from, on any device.
            sync: is called with the parameters of an optimizer between gradients and step.
            autocast: a new context for each forward pass.

        Returns:
            Numbers to log, detached scalars; `imitation_loss`, the mean of `imitation_error`, is one in each
            algorithm. A name is missing in steps that did not compute it.
        """

    @abstractmethod
    def choose(self, observation: Observation) -> Tensor:
        """Return the actions (B, A) in [-1, 1], as a differentiable function of the weights."""

    @torch.no_grad()
    def act(self, observation: Observation) -> Tensor:
        """Return the actions (B, A) float32 in [-1, 1] of a trained policy: without dropout, deterministic."""
        was_training = self.training
        if was_training:
            self.eval()
        try:
            return self.choose(observation)
        finally:
            if was_training:
                self.train()

    def train(self, mode: bool = True) -> "Algorithm":
        """Set the mode of all networks but targets, which are always evaluated without dropout."""
        super().train(mode)
        for module in self.modules():
            if isinstance(module, Target):
                module.network.eval()
        return self


class QLearning(Algorithm):
    """An algorithm with critics: networks of an observation and an action, which say what that is worth.

    Attributes:
        config: values, `gamma`, `reward_scale` and `largest_value` among them.
        critics: two of them.
    """

    needs_next = True
    config: Any
    critics: nn.ModuleList

    def bootstrap(self, batch: Batch, following: Tensor) -> Tensor:
        """Return (B,) what steps are worth, given the values (B,) of what may follow them."""
        if self.config.largest_value is not None:
            following = following.clamp(max=self.config.largest_value)
        return self.config.reward_scale * batch.reward + self.config.gamma * (1 - batch.terminated) * following

    def critic_loss(self, batch: Batch, wanted: Tensor) -> tuple[Tensor, Tensor]:
        """Return both critics' mean squared errors, summed, and the first one's mean value.

        Disturbed steps count, too: what the demonstration did then has an outcome like any other action.
        """
        values = [critic(batch.observation, batch.action).float().squeeze(-1) for critic in self.critics]
        return sum((value - wanted).square().mean() for value in values), values[0].mean()


class Target(nn.Module):
    """A copy of a network that follows it slowly; no gradient reaches it."""

    def __init__(self, source: nn.Module) -> None:
        super().__init__()
        self.network = copy.deepcopy(source).requires_grad_(False).eval()

    @torch.no_grad()
    def follow(self, source: nn.Module, tau: float) -> None:
        """Move each weight by a share `tau` of its distance to the source's."""
        torch._foreach_lerp_(list(self.network.parameters()), list(source.parameters()), tau)


def adam(networks: Iterable[nn.Module], learning_rate: float, weight_decay: float) -> Adam:
    """Make the optimizer of some networks."""
    parameters = [parameter for network in networks for parameter in network.parameters()]
    return Adam(parameters, lr=learning_rate, weight_decay=weight_decay)


def descend(loss: Tensor, optimizer: Optimizer, sync: Sync) -> None:
    """Step down a loss; the gradients reach the optimizer's parameters only."""
    parameters = [parameter for group in optimizer.param_groups for parameter in group["params"]]
    optimizer.zero_grad()
    loss.backward(inputs=parameters)
    sync([parameter for parameter in parameters if parameter.grad is not None])
    optimizer.step()


def weighted_mean(values: Tensor, weight: Tensor) -> Tensor:
    """Return the mean of (B,) values by their weights; 0 if all weights are 0."""
    return (values * weight).sum() / weight.sum().clamp(min=_LEAST_WEIGHT)


def normal(shape: tuple[int, ...], noise: torch.Generator, like: Tensor) -> Tensor:
    """Draw standard normal numbers, on the device of a tensor: the same on all devices if the generator is."""
    return torch.randn(shape, generator=noise, device=noise.device).to(like.device)

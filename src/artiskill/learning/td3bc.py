"""TD3+BC (Fujimoto and Gu, 2021, arXiv 2106.06860): do what demonstrations do, and a little what is worth more.

With `alpha` 0 the policy is that of behaviour cloning, bit for bit, if it is updated at every step
(`policy_interval` 1) with the same learning rate and weight decay.

By default rewards are multiplied by 1 - gamma, so that values are means of the rewards that follow, not sums, and
values are bounded by 0, for no reward is above it. The paper's code of 2021 did neither: `compat: paper2021`.
"""

from dataclasses import dataclass, replace
from typing import Literal

import torch
from torch import Tensor, nn

from artiskill.config import check_not_negative, check_positive, check_value
from artiskill.learning.algorithm import (
    Autocast,
    MakeNetwork,
    QLearning,
    Sync,
    Target,
    adam,
    descend,
    normal,
    weighted_mean,
)
from artiskill.learning.batch import Batch, Observation, Sizes

_LEAST_VALUE = 1e-6  # the mean size of values counts as at least this much where it divides


@dataclass(frozen=True)
class TD3BCConfig:
    """Values of TD3+BC."""

    critic_learning_rate: float
    policy_learning_rate: float
    weight_decay: float
    standardise_actions: bool  # errors count in standard deviations of the demonstrations
    gamma: float  # discount per step
    tau: float  # share of the way that targets go per step of the policy
    reward_scale: float  # rewards are multiplied by it
    largest_value: float | None  # no next value counts more; None: any may
    alpha: float  # weight of the first critic's value, of mean size 1, beside the squared error
    action_noise: float  # standard deviation of the noise on the next action
    noise_bound: float  # where that noise is cut off
    policy_interval: int  # steps of the critics per step of the policy
    compat: Literal["none", "paper2021"] = "none"  # some values as in the paper's code, see `resolved`

    def __post_init__(self) -> None:
        check_positive(self, "critic_learning_rate", "policy_learning_rate", "policy_interval", "reward_scale")
        check_not_negative(self, "weight_decay", "alpha", "action_noise", "noise_bound")
        check_value(self, "gamma", 0 <= self.gamma < 1, "must be at least 0 and below 1")
        check_value(self, "tau", 0 < self.tau <= 1, "must be above 0, and at most 1")

    def resolved(self) -> "TD3BCConfig":
        """Return the values with those laid over them that `compat` stands for."""
        if self.compat == "none":
            return self
        return replace(
            self,
            critic_learning_rate=5e-4,
            policy_learning_rate=3e-4,
            weight_decay=5e-6,
            standardise_actions=False,
            reward_scale=1.0,
            largest_value=None,
            compat="none",
        )


class TD3BC(QLearning):
    """A policy between the demonstrations' actions and better ones."""

    Config = TD3BCConfig

    def __init__(
        self, config: TD3BCConfig, make: MakeNetwork, sizes: Sizes, action_std: Tensor | None = None
    ) -> None:
        config = config.resolved()
        super().__init__(action_std, config.standardise_actions)
        self.config = config
        self.policy = make(sizes.action, 0)  # first, so that it has the weights that BC's has
        self.critics = nn.ModuleList(make(1, sizes.action) for _ in range(2))
        self.policy_target = Target(self.policy)
        self.critic_targets = nn.ModuleList(Target(critic) for critic in self.critics)
        self.optimizers = {
            "policy": adam([self.policy], config.policy_learning_rate, config.weight_decay),
            "critics": adam(self.critics, config.critic_learning_rate, config.weight_decay),
        }

    def update(
        self, batch: Batch, step: int, noise: torch.Generator, sync: Sync, autocast: Autocast
    ) -> dict[str, Tensor]:
        """Take one step of the critics, and at some steps one of the policy, after which the targets follow."""
        is_policy_step = step % self.config.policy_interval == 0
        if is_policy_step:
            with autocast():  # before the critics, so that dropout draws what it draws in BC
                action = self.choose(batch.observation)

        with autocast():
            wanted = self.target_values(batch, noise)
            critic_loss, mean = self.critic_loss(batch, wanted)
        descend(critic_loss, self.optimizers["critics"], sync)
        logged = {"critic_loss": critic_loss, "value": mean}

        if is_policy_step:
            with autocast():
                imitation, improvement = self.policy_losses(batch, action)
            descend(imitation + improvement, self.optimizers["policy"], sync)
            self.follow()
            logged |= {"imitation_loss": imitation, "improvement_loss": improvement}
        return {name: value.detach() for name, value in logged.items()}

    @torch.no_grad()
    def target_values(self, batch: Batch, noise: torch.Generator) -> Tensor:
        """Return (B,) what the critics should say: an episode that ended solved is worth 0 from there on.

        An episode that ran out of time is not over: its last step is worth what could follow.
        """
        observation = batch.next_observation
        assert observation is not None
        bound = self.config.noise_bound
        moved = normal(batch.action.shape, noise, batch.action) * self.config.action_noise
        action = squashed(self.policy_target.network, observation) + moved.clamp(-bound, bound)
        action = action.clamp(-1, 1)
        values = [target.network(observation, action).float().squeeze(-1) for target in self.critic_targets]
        lower = torch.minimum(*values)  # (B,)
        return self.bootstrap(batch, lower)

    def policy_losses(self, batch: Batch, action: Tensor) -> tuple[Tensor, Tensor]:
        """Return the squared error of the policy's actions (B, A), and minus their value, normalised by its size.

        Where a demonstration was disturbed neither counts: nothing would hold the policy near known actions.
        """
        error = self.imitation_error(action, batch)
        imitation = weighted_mean(error, batch.weight)
        if self.config.alpha == 0:
            return imitation, torch.zeros_like(imitation)
        critic = self.critics[0]
        with torch.no_grad():
            features = critic.encode(batch.observation)  # the gradient goes through the action alone
        values = critic.head(features, action).float().squeeze(-1)  # (B,)
        size = weighted_mean(values.detach().abs(), batch.weight).clamp(min=_LEAST_VALUE)
        return imitation, -self.config.alpha * weighted_mean(values, batch.weight) / size

    def follow(self) -> None:
        """Let all targets follow."""
        self.policy_target.follow(self.policy, self.config.tau)
        for target, critic in zip(self.critic_targets, self.critics, strict=True):
            target.follow(critic, self.config.tau)

    def choose(self, observation: Observation) -> Tensor:
        """Return the policy's actions."""
        return squashed(self.policy, observation)


def squashed(policy: nn.Module, observation: Observation) -> Tensor:
    """Return the actions (B, A) of a policy network."""
    return torch.tanh(policy(observation).float())

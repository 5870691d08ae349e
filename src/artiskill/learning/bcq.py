"""Batch-constrained Q-learning (Fujimoto et al., 2019, arXiv 1812.02900), without its perturbation network.

A variational auto-encoder learns which actions demonstrations take; two critics learn what those are worth. It
acts by decoding many latents and taking the candidate that the first critic likes best.

By default rewards are multiplied by 1 - gamma, so that values are means of the rewards that follow, not sums, and
values are bounded by 0, for no reward is above it. The paper's code of 2021 did neither: `compat: paper2021`.
"""

from dataclasses import dataclass, replace
from typing import Literal

import torch
from torch import Tensor, nn

from artiskill.config import check_inside, check_not_negative, check_positive, check_range, check_value
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


@dataclass(frozen=True)
class BCQConfig:
    """Values of batch-constrained Q-learning."""

    critic_learning_rate: float
    vae_learning_rate: float
    weight_decay: float
    standardise_actions: bool  # errors count in standard deviations of the demonstrations
    gamma: float  # discount per step
    tau: float  # share of the way that targets go per step
    latent_per_action: int  # numbers in a latent per number in an action
    latent_bound: float  # where candidates are decoded, latents are cut off here
    reward_scale: float  # rewards are multiplied by it
    largest_value: float | None  # no next value counts more; None: any may
    kl_weight: float  # of the divergence of latents from the standard normal distribution
    log_std: tuple[float, float]  # what the encoder may say
    min_weight: float  # of the lower of two critics' values; the higher has the rest
    train_candidates: int  # decoded per next observation in training
    act_candidates: int  # decoded per observation in acting
    latent_seed: int  # of the latents of acting, which never change
    compat: Literal["none", "paper2021"] = "none"  # some values as in the paper's code, see `resolved`

    def __post_init__(self) -> None:
        check_positive(self, "critic_learning_rate", "vae_learning_rate", "latent_bound", "reward_scale")
        check_not_negative(self, "weight_decay", "kl_weight")
        check_positive(self, "latent_per_action", "train_candidates", "act_candidates")
        check_value(self, "gamma", 0 <= self.gamma < 1, "must be at least 0 and below 1")
        check_value(self, "tau", 0 < self.tau <= 1, "must be above 0, and at most 1")
        check_inside("min_weight", self.min_weight, (0, 1))
        check_range(self, "log_std")
        check_not_negative(self, "latent_seed")

    def resolved(self) -> "BCQConfig":
        """Return the values with those laid over them that `compat` stands for."""
        if self.compat == "none":
            return self
        return replace(
            self,
            critic_learning_rate=5e-4,
            vae_learning_rate=3e-4,
            weight_decay=5e-6,
            standardise_actions=False,
            reward_scale=1.0,
            largest_value=None,
            compat="none",
        )


class BCQ(QLearning):
    """The best action that demonstrations might take."""

    Config = BCQConfig

    def __init__(
        self, config: BCQConfig, make: MakeNetwork, sizes: Sizes, action_std: Tensor | None = None
    ) -> None:
        config = config.resolved()
        super().__init__(action_std, config.standardise_actions)
        self.config = config
        self.latent_size = config.latent_per_action * sizes.action
        self.decoder = make(sizes.action, self.latent_size)
        self.encoder = make(2 * self.latent_size, sizes.action)
        self.critics = nn.ModuleList(make(1, sizes.action) for _ in range(2))
        self.targets = nn.ModuleList(Target(critic) for critic in self.critics)
        seeded = torch.Generator().manual_seed(config.latent_seed)
        latents = torch.randn((config.act_candidates, self.latent_size), generator=seeded)
        self.register_buffer("latents", latents.clamp(-config.latent_bound, config.latent_bound))
        rate, decay = config.vae_learning_rate, config.weight_decay
        self.optimizers = {
            "vae": adam([self.encoder, self.decoder], rate, decay),
            "critics": adam(self.critics, config.critic_learning_rate, decay),
        }

    def update(
        self, batch: Batch, step: int, noise: torch.Generator, sync: Sync, autocast: Autocast
    ) -> dict[str, Tensor]:
        """Take one step of the auto-encoder, one of the critics, and let the targets follow."""
        with autocast():
            imitation, divergence = self.vae_losses(batch, noise)
        descend(imitation + self.config.kl_weight * divergence, self.optimizers["vae"], sync)

        with autocast():
            wanted = self.target_values(batch, noise)
            critic_loss, mean = self.critic_loss(batch, wanted)
        descend(critic_loss, self.optimizers["critics"], sync)
        for target, critic in zip(self.targets, self.critics, strict=True):
            target.follow(critic, self.config.tau)

        logged = {"imitation_loss": imitation, "divergence": divergence, "critic_loss": critic_loss, "value": mean}
        return {name: value.detach() for name, value in logged.items()}

    def vae_losses(self, batch: Batch, noise: torch.Generator) -> tuple[Tensor, Tensor]:
        """Return the squared error of decoded actions, and the latents' divergence from a normal distribution."""
        mean, log_std = self.encoder(batch.observation, batch.action).float().chunk(2, -1)  # (B, Z) each
        log_std = log_std.clamp(*self.config.log_std)
        latent = mean + log_std.exp() * normal(mean.shape, noise, mean)
        action = torch.tanh(self.decoder(batch.observation, latent).float())
        error = self.imitation_error(action, batch)
        divergence = -0.5 * (1 + 2 * log_std - mean.square() - (2 * log_std).exp()).mean(-1)  # (B,)
        return weighted_mean(error, batch.weight), weighted_mean(divergence, batch.weight)

    @torch.no_grad()
    def target_values(self, batch: Batch, noise: torch.Generator) -> Tensor:
        """Return (B,) what the critics should say: an episode that ended solved is worth 0 from there on.

        An episode that ran out of time is not over: its last step is worth what could follow.
        """
        observation = batch.next_observation
        assert observation is not None
        shape = (len(batch.action), self.config.train_candidates, self.latent_size)
        bound = self.config.latent_bound
        candidates = self.decode(observation, normal(shape, noise, batch.action).clamp(-bound, bound))
        values = [candidate_values(target.network, observation, candidates) for target in self.targets]  # (B, M)
        lower, higher = torch.minimum(*values), torch.maximum(*values)
        weight = self.config.min_weight
        best = (weight * lower + (1 - weight) * higher).amax(-1)  # (B,)
        return self.bootstrap(batch, best)

    def choose(self, observation: Observation) -> Tensor:
        """Return, of the actions that the fixed latents stand for, those that the first critic likes best."""
        candidates = self.decode(observation, self.latents.expand(len(observation.agent), -1, -1))  # (B, M, A)
        values = candidate_values(self.critics[0], observation, candidates)
        rows = torch.arange(len(candidates), device=candidates.device)
        return candidates[rows, values.argmax(-1)]

    def decode(self, observation: Observation, latents: Tensor) -> Tensor:
        """Return the actions (B, M, A) of latents (B, M, Z)."""
        return torch.tanh(self.decoder.head(self.decoder.encode(observation), latents).float())


def candidate_values(critic: nn.Module, observation: Observation, candidates: Tensor) -> Tensor:
    """Return the values (B, M) of actions (B, M, A), looking at each observation once."""
    return critic.head(critic.encode(observation), candidates).float().squeeze(-1)

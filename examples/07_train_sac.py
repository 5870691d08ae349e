"""Learn to open a drawer with soft actor-critic: one file, Gymnasium and torch, no library of algorithms."""

import argparse
import copy
import time

import gymnasium as gym
import numpy as np
import torch
from torch import nn
from torch.nn.functional import mse_loss, softplus

import artiskill  # noqa: F401 - registers the environments

GAMMA, TAU, BATCH, RATE = 0.95, 0.005, 128, 3e-4
ENTROPY = -0.3  # that actions shall have, for each number: a standard deviation of some 0.18
SCALE = 1 - GAMMA  # of rewards: values are then means of rewards
FIRST_STEPS = 4000  # of random actions
NEW_LEVELS = range(1_000_000, 1_000_100)  # to measure on; training draws from 2^31 levels, hardly ever these
LOG_2 = float(np.log(2.0))


def mlp(inputs: int, outputs: int, normalised: bool) -> nn.Sequential:
    """Return a network; critics learn in far fewer steps if their hidden layers are normalised."""
    layers: list[nn.Module] = []
    for size in (inputs, 128):
        layers += [nn.Linear(size, 128), *([nn.LayerNorm(128)] if normalised else []), nn.ReLU()]
    return nn.Sequential(*layers, nn.Linear(128, outputs))


class Scaler:
    """Means and deviations of all observations so far: velocities rarely reach their bound of 100."""

    def __init__(self, size: int) -> None:
        self.count, self.mean, self.var = 1e-4, np.zeros(size), np.ones(size)

    def update(self, values: np.ndarray) -> None:
        """Take in observations (B, D)."""
        total, delta = self.count + len(values), values.mean(0) - self.mean
        spread = self.var * self.count + values.var(0) * len(values) + delta**2 * self.count * len(values) / total
        self.mean, self.var, self.count = self.mean + delta * len(values) / total, spread / total, total

    def __call__(self, values: np.ndarray) -> torch.Tensor:
        """Return them scaled."""
        scaled = (values - self.mean) / np.sqrt(self.var + 1e-8)
        return torch.from_numpy(scaled.clip(-10, 10).astype(np.float32))


class Buffer:
    """The latest transitions: observation, next observation, action, reward, whether it was the end."""

    def __init__(self, size: int, states: int, actions: int) -> None:
        self.parts = np.cumsum([states, states, actions, 1])
        self.rows, self.place, self.count = np.zeros((size, 2 * states + actions + 2), np.float32), 0, 0

    def add(self, *columns: np.ndarray) -> None:
        """Add B transitions, in place of the oldest ones."""
        rows = np.concatenate([column.reshape(len(column), -1) for column in columns], axis=1)
        self.rows[(self.place + np.arange(len(rows))) % len(self.rows)] = rows
        self.place = (self.place + len(rows)) % len(self.rows)
        self.count = min(self.count + len(rows), len(self.rows))

    def sample(self, rng: np.random.Generator) -> list[np.ndarray]:
        """Return the columns of a batch."""
        return np.split(self.rows[rng.integers(0, self.count, BATCH)], self.parts, axis=1)


def act(actor: nn.Module, seen: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Draw actions, and return the logarithms of their densities, too."""
    mean, log_std = actor(seen).chunk(2, dim=1)
    normal = torch.distributions.Normal(mean, log_std.clip(-20, 2).exp())
    drawn = normal.rsample()
    log_density = normal.log_prob(drawn) - 2 * (LOG_2 - drawn - softplus(-2 * drawn))
    return torch.tanh(drawn), log_density.sum(1, keepdim=True)


def make_env(arguments: argparse.Namespace, count: int) -> gym.vector.VectorEnv:
    """Return as many environments side by side, whose states say where the handle is, or what the base sees."""
    says = "state.handle" if arguments.task.startswith("OpenCabinet") else "state.relative"
    return gym.make_vec(
        f"ArtiSkill/{arguments.task}-v0",
        num_envs=count,
        objects=arguments.object,
        target=arguments.target,
        config={says: True},
        autoreset_mode="same_step",
    )


def evaluate(actor: nn.Module, scaler: Scaler, arguments: argparse.Namespace) -> float:
    """Return the share of new levels that actions without noise solve."""
    levels = list(NEW_LEVELS)
    env = make_env(arguments, len(levels))
    seen, _ = env.reset(options={"level": levels})
    solved, over = np.zeros(len(levels), bool), np.zeros(len(levels), bool)
    while not over.all():
        with torch.no_grad():
            actions = torch.tanh(actor(scaler(seen)).chunk(2, dim=1)[0]).numpy()
        seen, _, terminated, truncated, _ = env.step(actions)
        solved |= terminated & ~over
        over |= terminated | truncated
    env.close()
    return float(solved.mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="OpenCabinetDrawer")
    parser.add_argument("--object", default="cabinet-0002")
    parser.add_argument("--target", help="link that is opened (default: each episode draws one)")
    parser.add_argument("--steps", type=int, default=150_000)
    parser.add_argument("--envs", type=int, default=16)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    torch.manual_seed(arguments.seed)
    torch.set_num_threads(1)
    rng = np.random.default_rng(arguments.seed)
    env = make_env(arguments, arguments.envs)
    states, actions = env.single_observation_space.shape[0], env.single_action_space.shape[0]
    actor = mlp(states, 2 * actions, normalised=False)
    critics = nn.ModuleList(mlp(states + actions, 1, normalised=True) for _ in range(2))
    targets = copy.deepcopy(critics).requires_grad_(False)
    log_alpha = torch.tensor(np.log(0.1), dtype=torch.float32, requires_grad=True)
    optimizers = [
        torch.optim.Adam(values, lr=RATE) for values in (actor.parameters(), critics.parameters(), [log_alpha])
    ]
    buffer, scaler = Buffer(max(arguments.steps, arguments.envs), states, actions), Scaler(states)
    seen, _ = env.reset(seed=arguments.seed)
    scaler.update(seen)
    rewards, start = [], time.perf_counter()
    for step in range(0, arguments.steps, arguments.envs):
        if step < FIRST_STEPS:
            chosen = rng.uniform(-1, 1, (arguments.envs, actions)).astype(np.float32)
        else:
            with torch.no_grad():
                chosen = act(actor, scaler(seen))[0].numpy()
        following, reward, terminated, truncated, infos = env.step(chosen)
        final = following.copy()
        for i in np.flatnonzero(terminated | truncated):
            final[i] = infos["final_obs"][i]
        buffer.add(seen, final, chosen, SCALE * reward, terminated)  # a time limit is no end: values go on
        seen = following
        scaler.update(seen)
        rewards.append(reward.mean())
        for _ in range(max(1, arguments.envs // 2) if step >= FIRST_STEPS else 0):
            update(actor, critics, targets, log_alpha, optimizers, buffer.sample(rng), scaler)
        if step // 10_000 != (step + arguments.envs) // 10_000:
            rate = (step + arguments.envs) / (time.perf_counter() - start)
            print(
                f"{step + arguments.envs:8d} steps: reward {np.mean(rewards):6.2f} a step, {rate:.0f}/s",
                flush=True,
            )
            rewards.clear()
    print(f"{evaluate(actor, scaler, arguments):.0%} of {len(NEW_LEVELS)} new levels solved")


def update(
    actor: nn.Module,
    critics: nn.ModuleList,
    targets: nn.ModuleList,
    log_alpha: torch.Tensor,
    optimizers: list[torch.optim.Adam],
    batch: list[np.ndarray],
    scaler: Scaler,
) -> None:
    """One update of everything by one batch."""
    seen, following = scaler(batch[0]), scaler(batch[1])
    chosen, reward, end = (torch.from_numpy(np.ascontiguousarray(one)) for one in batch[2:])
    alpha = log_alpha.exp().detach()
    with torch.no_grad():
        then, log_density = act(actor, following)
        least = torch.min(*(target(torch.cat((following, then), 1)) for target in targets))
        wanted = reward + GAMMA * (1 - end) * (least - alpha * log_density)
    descend(optimizers[1], sum(mse_loss(critic(torch.cat((seen, chosen), 1)), wanted) for critic in critics))
    now, log_density = act(actor, seen)
    least = torch.min(*(critic(torch.cat((seen, now), 1)) for critic in critics))
    descend(optimizers[0], (alpha * log_density - least).mean())
    descend(optimizers[2], -(log_alpha * (log_density.detach() + ENTROPY * now.shape[1]).mean()))
    with torch.no_grad():
        for target, critic in zip(targets.parameters(), critics.parameters(), strict=True):
            target.lerp_(critic, TAU)


def descend(optimizer: torch.optim.Adam, loss: torch.Tensor) -> None:
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()


if __name__ == "__main__":
    main()

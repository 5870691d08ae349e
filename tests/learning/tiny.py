"""Networks, batches and loops so small that algorithms can be followed by hand."""

from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor, nn

from artiskill.learning.algorithm import Algorithm, MakeNetwork
from artiskill.learning.batch import Batch, Observation, Sizes

torch.set_num_threads(1)  # of networks this small, a second thread makes slow ones; and tests share their cores


class TinyNetwork(nn.Module):
    """A perceptron on the robot's state and the extra numbers; without hidden layers, a linear map."""

    def __init__(self, sizes: Sequence[int], generator: torch.Generator, dropout: float = 0.0) -> None:
        super().__init__()
        self.layers = nn.ModuleList(nn.Linear(a, b) for a, b in pairwise(sizes))
        self.dropout = nn.Dropout(dropout)
        for parameter in self.parameters():
            parameter.data.normal_(0, parameter.shape[-1] ** -0.5, generator=generator)

    def encode(self, observation: Observation) -> Tensor:
        return self.dropout(observation.agent)

    def head(self, features: Tensor, extra: Tensor | None = None) -> Tensor:
        values = features
        if extra is not None:
            if extra.ndim > features.ndim:
                values = features[:, None].expand(-1, extra.shape[1], -1)
            values = torch.cat((values, extra), -1)
        for layer in self.layers[:-1]:
            values = torch.relu(layer(values))
        return self.layers[-1](values)

    def forward(self, observation: Observation, extra: Tensor | None = None) -> Tensor:
        return self.head(self.encode(observation), extra)


def tiny_sizes(agent: int, action: int) -> Sizes:
    return Sizes(points=1, masks=1, agent=agent, action=action)


def tiny_maker(sizes: Sizes, seed: int = 0, hidden: Sequence[int] = (), dropout: float = 0.0) -> MakeNetwork:
    generator = torch.Generator().manual_seed(seed)

    def make(outputs: int, extra: int) -> TinyNetwork:
        return TinyNetwork((sizes.agent + extra, *hidden, outputs), generator, dropout)

    return make


def set_linear(network: nn.Module, weight: Sequence[Sequence[float]], bias: Sequence[float]) -> None:
    """Give a network without hidden layers its weights (outputs, S + E) and biases."""
    (layer,) = network.layers
    layer.weight.data.copy_(torch.tensor(weight))
    layer.bias.data.copy_(torch.tensor(bias))


def observe(agent: Any) -> Observation:
    agent = torch.as_tensor(agent, dtype=torch.float32)
    cloud = torch.zeros(len(agent), 1, 3)
    return Observation(cloud, cloud, cloud[..., :1], torch.ones(len(agent), 1, dtype=torch.bool), agent)


def make_batch(
    agent: Any,
    action: Any,
    next_agent: Any = None,
    *,
    reward: Any = None,
    terminated: Any = None,
    weight: Any = None,
) -> Batch:
    def column(given: Any, default: float) -> Tensor:
        return torch.full((len(agent),), default) if given is None else torch.as_tensor(given).float()

    return Batch(
        observe(agent),
        torch.as_tensor(action, dtype=torch.float32),
        column(weight, 1),
        column(reward, 0),
        column(terminated, 0),
        None if next_agent is None else observe(next_agent),
    )


def no_sync(parameters: Iterable[nn.Parameter]) -> None:
    assert all(parameter.grad is not None for parameter in parameters)


def update(algorithm: Algorithm, batch: Batch, step: int = 0, **options: Any) -> dict[str, float]:
    """Take a step as the trainer does: noise from the number of the step."""
    noise = torch.Generator().manual_seed(1000 + step)
    logged = algorithm.update(batch, step, noise, options.get("sync", no_sync), nullcontext)
    return {name: float(value) for name, value in logged.items()}


def train(algorithm: Algorithm, draw: Callable[[torch.Generator], Batch], steps: int, first: int = 0) -> None:
    """Train on batches that the number of the step fixes."""
    for step in range(first, first + steps):
        update(algorithm, draw(torch.Generator().manual_seed(step)), step)


def take(batch: Batch, rows: Any) -> Batch:
    """Return some rows of a batch."""

    def of(value: Any) -> Any:
        return value[rows] if isinstance(value, Tensor) else value and Observation(*map(of, value))

    return Batch(*map(of, batch))


def random_batch(generator: torch.Generator, size: int = 16, agent: int = 3, action: int = 2) -> Batch:
    """A batch of noise with all that an algorithm reads."""

    def uniform(*shape: int) -> Tensor:
        return torch.rand(shape, generator=generator) * 2 - 1

    return make_batch(
        uniform(size, agent),
        uniform(size, action),
        uniform(size, agent),
        reward=uniform(size) - 1,
        terminated=uniform(size) > 0.5,
        weight=uniform(size) > -0.5,
    )


class Chain:
    """A walk on [0, 1] towards 1: an action moves by a fifth of it, each step costs 1, the end is worth 0.

    The demonstrator walks at random, so its mean action goes nowhere.
    """

    sizes = tiny_sizes(agent=1, action=1)

    @staticmethod
    def step(place: Tensor, action: Tensor) -> tuple[Tensor, Tensor]:
        """Return the next places (B, 1), and which of them are the end."""
        moved = (place + 0.2 * action).clamp(0, 1)
        return moved, moved[:, 0] >= 1

    @classmethod
    def draw(cls, generator: torch.Generator) -> Batch:
        """Return random steps."""
        place = torch.rand(64, 1, generator=generator)
        action = torch.rand(64, 1, generator=generator) * 2 - 1
        moved, ended = cls.step(place, action)
        return make_batch(place, action, moved, reward=-torch.ones(64), terminated=ended)

    @classmethod
    def steps_to_end(cls, algorithm: Algorithm, most: int = 20) -> int:
        """Return how many steps a policy takes from 0 to 1, at most `most`."""
        place = torch.zeros(1, 1)
        for count in range(1, most + 1):
            place, ended = cls.step(place, algorithm.act(observe(place)))
            if ended:
                return count
        return most

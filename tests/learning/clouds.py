"""Narrow networks, and random clouds that they see."""

import dataclasses
from typing import Any

import numpy as np
import torch

from artiskill.learning.batch import Observation, Sizes, Statistics
from artiskill.learning.network_config import NetworkConfig, TransformerConfig, load_network_config
from artiskill.learning.networks import make_network

CABINET = Sizes(points=40, masks=3, agent=38, action=13)
CHAIR = Sizes(points=40, masks=1, agent=68, action=22)
NARROW = TransformerConfig(width=16, blocks=2, heads=2, head_width=4, feedforward=24, dropout=0.1)


def plain_statistics(agent: int) -> Statistics:
    return Statistics(np.zeros(3), np.ones(3), np.zeros(agent), np.ones(agent))


def narrow(name: str, **changes: Any) -> NetworkConfig:
    """The values of `name`, but narrow layers, and an output that does not begin with zeros."""
    config = load_network_config(name)
    values = {"point_layers": (16, 32), "head": (16, 8), "transformer": config.transformer and NARROW}
    return dataclasses.replace(config, **{**values, "zero_output": False, **changes})


def make(name: str, sizes: Sizes = CABINET, extra: int = 0, seed: int = 0, **changes: Any) -> Any:
    generator = torch.Generator().manual_seed(seed)
    statistics = plain_statistics(sizes.agent)
    return make_network(narrow(name, **changes), sizes, statistics, sizes.action, extra, generator).eval()


def observe(sizes: Sizes = CABINET, batch: int = 3, seed: int = 0, real: int = 30) -> Observation:
    """Observations with `real` points in random rows; each point in one mask or none."""
    rng = np.random.default_rng(seed)
    n = sizes.points
    groups = rng.integers(sizes.masks + 1, size=(batch, n))
    valid = np.argsort(rng.random((batch, n)), axis=1) < real
    arrays = (
        rng.normal(size=(batch, n, 3)).astype(np.float32),
        rng.random((batch, n, 3), dtype=np.float32),
        (groups[..., None] == np.arange(sizes.masks)).astype(np.float32),
        valid,
        rng.normal(size=(batch, sizes.agent)).astype(np.float32),
    )
    return Observation(*map(torch.as_tensor, arrays))

"""Networks on point clouds: PointNet (Qi et al. 2017), alone or with a transformer, for policies and critics.

A network has two halves. `encode` turns observations into features, the costly part; `head` turns features and
further numbers (an action, a latent) into outputs. Nothing squashes the outputs. Rows of padding never count.
Dropout, in training mode, draws from torch's global generator: who trains seeds it in every step.
"""

from collections.abc import Iterator
from itertools import pairwise, repeat
from typing import TYPE_CHECKING, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn.functional import pad, relu, scaled_dot_product_attention

from artiskill.learning.batch import Observation, Sizes, Statistics
from artiskill.learning.features import Features, Scale, feature_sizes, make_features
from artiskill.learning.network_config import NetworkConfig, TransformerConfig
from artiskill.robots.config import RobotConfig

if TYPE_CHECKING:  # it needs compiled kernels, and training without the engine does not
    from artiskill.robots.kinematics import RobotKinematics

_WORTH_GATHERING = 0.8  # share of points below which the layers are spared the others
_POINTS_AT_ONCE = 2048  # without gradients: their widest features are 2 to 4 MB
_TOKEN_STD = 0.02


def make_network(
    config: NetworkConfig,
    sizes: Sizes,
    statistics: Statistics,
    outputs: int,
    extra: int = 0,
    generator: torch.Generator | None = None,
    frame: str = "world",
    robot: RobotConfig | None = None,
) -> "PointNet | PointNetTransformer":
    """Make a network with fresh weights.

    Args:
        config: its values.
        sizes: of its observations.
        statistics: of the training set; they become buffers.
        outputs: how many numbers come out.
        extra: how many further numbers go in.
        generator: draws the weights; one of the CPU.
        frame: of the training set's points: `world`, `robot` or `end_effector`.
        robot: who acts, where the inputs ask for its kinematics.
    """
    config = config.resolved()
    kinematics = None if robot is None else _kinematics(robot)
    points, state = feature_sizes(config.input, sizes.masks, sizes.agent, frame, kinematics)
    shape = Shape(points, state, sizes.masks, outputs, extra)
    normalise = Inputs(config, statistics, frame, kinematics)
    network: PointNet | PointNetTransformer
    if config.transformer is None:
        network = PointNet(config, shape, normalise)
    else:
        network = PointNetTransformer(config, config.transformer, shape, normalise)
    initialise(network, generator)
    if config.zero_output:
        nn.init.zeros_(network.mlp.output.weight)
        nn.init.zeros_(network.mlp.output.bias)
    return network


def _kinematics(robot: RobotConfig) -> "RobotKinematics":
    from artiskill.robots.kinematics import RobotKinematics

    return RobotKinematics(robot)


class Shape(NamedTuple):
    """How many numbers go in and come out."""

    points: int  # of each point
    state: int  # of cloud and robot
    masks: int
    outputs: int
    extra: int


class Inputs(nn.Module):
    """Computes features of observations; holds the statistics that they are normalised with."""

    def __init__(
        self, config: NetworkConfig, statistics: Statistics, frame: str, kinematics: "RobotKinematics | None"
    ) -> None:
        super().__init__()
        self.config, self.frame, self.kinematics = config.input, frame, kinematics
        for name in Scale._fields:
            values = getattr(statistics, name)
            self.register_buffer(name, torch.as_tensor(values, dtype=torch.float32).clone())

    def forward(self, observation: Observation) -> Features:
        """Return the features, in float32 also of training in mixed precision; see `make_features`."""
        scale = Scale(*(getattr(self, name) for name in Scale._fields))
        with torch.autocast(observation.points.device.type, enabled=False):
            return make_features(observation, self.config, scale, self.frame, self.kinematics)


class JointLinear(nn.Module):
    """One linear layer on two inputs side by side; rows of the second may be spread over rows of the first."""

    def __init__(self, first: int, second: int, width: int) -> None:
        super().__init__()
        self.first = nn.Linear(first, width)
        self.second = nn.Linear(second, width, bias=False) if second else None

    def forward(self, first: Tensor, second: Tensor | None) -> Tensor:
        """Return the layer's output; the leading dimensions broadcast."""
        if self.second is None or second is None:
            return self.first(first)
        return self.first(first) + self.second(second)


class PointEncoder(nn.Module):
    """Layers that all points share, then pooling over those of a group.

    On a CPU, gradients go through the points only that are the largest in some channel. That is exact, as no
    other point moves a maximum, and spares most of the backward pass.
    """

    def __init__(self, config: NetworkConfig, points: int, state: int) -> None:
        super().__init__()
        widths = config.point_layers
        self.joint = JointLinear(points, state, widths[0])
        self.layers = nn.ModuleList(nn.Linear(a, b) for a, b in pairwise(widths))
        self.norm = nn.LayerNorm(widths[-1]) if config.pool_norm else nn.Identity()
        self.means = widths[-1] // 2 if config.pooling == "max_mean" else 0

    def forward(self, points: Tensor, state: Tensor | None, group: Tensor) -> Tensor:
        """Return pooled features (B, F); zeros, before the norm, where the group is empty.

        Args:
            points: (B, N, P).
            state: (B, S), given to each point, or None.
            group: (B, N), 1 for the points that count.
        """
        state = None if state is None else state[:, None]
        if points.device.type == "cpu":
            points, group = _gather(points, group)
            if not self.means:
                return self.norm(self._maxima(points, state, group))
        each = relu(self._each(points, state)) * group[..., None]
        if not self.means:
            return self.norm(each.amax(1))
        mean = each[..., self.means :].sum(1) / group.sum(1, keepdim=True).clamp(min=1)
        return self.norm(torch.cat((each[..., : self.means].amax(1), mean), 1))

    def _each(self, points: Tensor, state: Tensor | None) -> Tensor:
        """Return features (B, N, F) of each point; what is below 0 counts as 0."""
        in_place = not torch.is_grad_enabled()
        x = self.joint(points, state)
        for layer in self.layers:
            x = layer(relu(x, in_place))
        return x

    def _maxima(self, points: Tensor, state: Tensor | None, group: Tensor) -> Tensor:
        """Return the largest feature (B, F) of each channel."""
        parts = self._in_parts(points, state, group)
        if not torch.is_grad_enabled():
            return relu(torch.cat([each.amax(1) for each in parts]))
        wins = torch.cat([_find_winners(each) for each in parts])
        index = _gathered(wins.to(points.dtype))
        if index is not None:
            index = torch.where(wins.gather(1, index), index, index[:, :1])  # a winner twice moves no maximum
            points, group = _pick(points, index), wins.any(1, keepdim=True)
        each = self._each(points, state)
        return relu((each if group.all() else each * group[..., None]).max(1).values)

    @torch.no_grad()
    def _in_parts(self, points: Tensor, state: Tensor | None, group: Tensor) -> Iterator[Tensor]:
        """Give the features of a few clouds at a time, zeros outside of the group: they stay in the cache."""
        size = max(1, _POINTS_AT_ONCE // points.shape[1])
        states = repeat(None) if state is None else state.split(size)
        for some, its_state, inside in zip(points.split(size), states, group.split(size), strict=False):
            yield self._each(some, its_state).mul_(inside[..., None])


def _find_winners(each: Tensor) -> Tensor:
    """Return (B, N), whether a point has the maximum, above 0, of some channel of (B, N, F); overwrites those."""
    best = each.amax(1, keepdim=True)
    return each.sub_(torch.where(best > 0, best, torch.inf)).amax(2) == 0


def _gather(points: Tensor, group: Tensor) -> tuple[Tensor, Tensor]:
    """Return as many points (B, M, P) as hold all of each cloud's group, and (B, M) which are in it."""
    index = _gathered(group)
    return (points, group) if index is None else (_pick(points, index), group.gather(1, index))


def _gathered(chosen: Tensor) -> Tensor | None:
    """Return which points (B, M) hold all chosen ones (B, N) of each cloud; None where that spares too few."""
    most = max(1, int(chosen.sum(1).max()))
    return chosen.topk(most, 1).indices if most <= _WORTH_GATHERING * chosen.shape[1] else None


def _pick(points: Tensor, index: Tensor) -> Tensor:
    """Return the points (B, M, P) that `index` (B, M) names of each cloud."""
    return points.gather(1, index[..., None].expand(-1, -1, points.shape[2]))


class Mlp(nn.Module):
    """Hidden layers and an output, of features and further numbers."""

    def __init__(self, inputs: int, extra: int, hidden: tuple[int, ...], outputs: int, norm: bool) -> None:
        super().__init__()
        self.joint = JointLinear(inputs, extra, hidden[0])
        self.layers = nn.ModuleList(nn.Linear(a, b) for a, b in pairwise(hidden))
        self.norms = nn.ModuleList(nn.LayerNorm(width) if norm else nn.Identity() for width in hidden)
        self.output = nn.Linear(hidden[-1], outputs)

    def forward(self, features: Tensor, extra: Tensor | None = None) -> Tensor:
        """Return outputs (B, O), or (B, M, O) for `extra` (B, M, E)."""
        if extra is not None and extra.ndim > features.ndim:
            features = features[:, None]
        x = relu(self.norms[0](self.joint(features, extra)))
        for layer, norm in zip(self.layers, self.norms[1:], strict=True):
            x = relu(norm(layer(x)))
        return self.output(x)


class PointNet(nn.Module):
    """Points, each by itself; the pooled ones, and the robot's state, to the head."""

    def __init__(self, config: NetworkConfig, shape: Shape, inputs: Inputs) -> None:
        super().__init__()
        self.config, self.inputs = config.input, inputs
        self.points = PointEncoder(config, shape.points, shape.state * config.input.state_per_point)
        pooled = config.point_layers[-1] + shape.state * config.input.state_in_head
        self.mlp = Mlp(pooled, shape.extra, config.head, shape.outputs, config.head_norm)

    def encode(self, observation: Observation) -> Tensor:
        """Return features (B, F) of observations."""
        seen = self.inputs(observation)
        group = seen.valid.to(seen.points.dtype)
        pooled = self.points(seen.points, _if(self.config.state_per_point, seen.state), group)
        return torch.cat((pooled, seen.state), 1) if self.config.state_in_head else pooled

    def head(self, features: Tensor, extra: Tensor | None = None) -> Tensor:
        """Return outputs (B, O) of features and numbers (B, E), or (B, M, O) of M candidates (B, M, E)."""
        return self.mlp(features, extra)

    def forward(self, observation: Observation, extra: Tensor | None = None) -> Tensor:
        """Return `head(encode(observation), extra)`."""
        return self.head(self.encode(observation), extra)


class PointNetTransformer(nn.Module):
    """A PointNet for each mask, one for the points in none, one for all; a transformer on what they found.

    Tokens, in this order: masks, unmasked points, all points, robot's state, a trained vector. A group without
    points has no token.
    """

    def __init__(self, config: NetworkConfig, inner: TransformerConfig, shape: Shape, inputs: Inputs) -> None:
        super().__init__()
        self.config, self.inputs = config.input, inputs
        state = shape.state * config.input.state_per_point
        self.points = nn.ModuleList(PointEncoder(config, shape.points, state) for _ in range(shape.masks + 2))
        pooled, width = config.point_layers[-1], inner.width
        self.tokens = nn.ModuleList(Mlp(pooled, 0, (width,), width, norm=False) for _ in self.points)
        self.state = Mlp(shape.state, 0, (width,), width, norm=False)
        self.task = nn.Parameter(torch.empty(width))
        self.blocks = nn.ModuleList(Block(inner) for _ in range(inner.blocks))
        self.query = nn.Parameter(torch.empty(width))
        self.pool = Attention(inner)
        features = width + shape.state * config.input.state_in_head
        self.mlp = Mlp(features, shape.extra, config.head, shape.outputs, config.head_norm)

    def encode(self, observation: Observation) -> Tensor:
        """Return features (B, F) of observations."""
        seen = self.inputs(observation)
        everything = seen.valid.to(seen.points.dtype)[..., None]
        unmasked = everything - seen.masks.sum(2, keepdim=True).clamp(0, 1)
        groups = torch.cat((seen.masks, unmasked, everything), 2)  # (B, N, K + 2)
        state = _if(self.config.state_per_point, seen.state)
        tokens = [
            token(points(seen.points, state, groups[..., i]))
            for i, (points, token) in enumerate(zip(self.points, self.tokens, strict=True))
        ]
        tokens += [self.state(seen.state), self.task.expand(len(everything), -1)]
        x = torch.stack(tokens, 1)  # (B, T, D)
        counts = pad(groups.amax(1) > 0, (0, 2), value=True)  # (B, T)
        for block in self.blocks:
            x = block(x, counts)
        pooled = self.pool(self.query.expand(len(x), 1, -1), x, counts)[:, 0]
        return torch.cat((pooled, seen.state), 1) if self.config.state_in_head else pooled

    def head(self, features: Tensor, extra: Tensor | None = None) -> Tensor:
        """Return outputs (B, O) of features and numbers (B, E), or (B, M, O) of M candidates (B, M, E)."""
        return self.mlp(features, extra)

    def forward(self, observation: Observation, extra: Tensor | None = None) -> Tensor:
        """Return `head(encode(observation), extra)`."""
        return self.head(self.encode(observation), extra)


class Attention(nn.Module):
    """Attention of several heads (Vaswani et al. 2017) whose total width need not be that of the tokens."""

    def __init__(self, config: TransformerConfig) -> None:
        super().__init__()
        self.heads, inner = config.heads, config.heads * config.head_width
        self.query = nn.Linear(config.width, inner)
        self.key = nn.Linear(config.width, inner)
        self.value = nn.Linear(config.width, inner)
        self.output = nn.Linear(inner, config.width)
        self.dropout = nn.Dropout(config.dropout)

    def forward(self, asking: Tensor, tokens: Tensor, counts: Tensor) -> Tensor:
        """Return (B, Q, D) what `asking` (B, Q, D) finds in the tokens (B, T, D) that count, by (B, T)."""
        query, key, value = (
            layer(x).unflatten(2, (self.heads, -1)).transpose(1, 2)
            for layer, x in ((self.query, asking), (self.key, tokens), (self.value, tokens))
        )
        found = scaled_dot_product_attention(query, key, value, attn_mask=counts[:, None, None])
        return self.dropout(self.output(found.transpose(1, 2).flatten(2)))


class Block(nn.Module):
    """Attention and two layers on each token, each added to its input and normalised after that."""

    def __init__(self, config: TransformerConfig) -> None:
        super().__init__()
        self.attention = Attention(config)
        self.first = nn.Linear(config.width, config.feedforward)
        self.second = nn.Linear(config.feedforward, config.width)
        self.norms = nn.ModuleList(nn.LayerNorm(config.width) for _ in range(2))
        self.dropout = nn.Dropout(config.dropout)

    def forward(self, x: Tensor, counts: Tensor) -> Tensor:
        """Return tokens (B, T, D) from tokens; `counts` (B, T) says which others see."""
        x = self.norms[0](x + self.attention(x, x, counts))
        return self.norms[1](x + self.dropout(self.second(relu(self.first(x)))))


def initialise(network: nn.Module, generator: torch.Generator | None) -> None:
    """Draw all weights: of a layer uniformly within +- 1 / sqrt(its inputs), as torch does; vectors normally."""
    for module in network.modules():
        if isinstance(module, JointLinear):
            inputs = sum(part.in_features for part in (module.first, module.second) if part is not None)
            for part in (module.first, module.second):
                _draw(part, inputs, generator)
    inside = {id(part) for m in network.modules() if isinstance(m, JointLinear) for part in m.children()}
    for module in network.modules():
        if isinstance(module, nn.Linear) and id(module) not in inside:
            _draw(module, module.in_features, generator)
    if isinstance(network, PointNetTransformer):
        for vector in (network.task, network.query):
            nn.init.normal_(vector, std=_TOKEN_STD, generator=generator)


def _draw(layer: nn.Linear | None, inputs: int, generator: torch.Generator | None) -> None:
    for values in () if layer is None else layer.parameters():
        nn.init.uniform_(values, -(inputs**-0.5), inputs**-0.5, generator=generator)


def _if(wanted: bool, state: Tensor) -> Tensor | None:
    return state if wanted else None

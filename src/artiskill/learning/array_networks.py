"""The networks of `learning/networks.py` in NumPy, for one observation at a time, in the same names and order.

Padding and tokens of empty groups are left out here, not masked. Products are summed in a fixed order, not by
BLAS, so that a policy acts with the same bits on every processor. Imports no torch.
"""

from collections.abc import Mapping
from itertools import count

import numpy as np

from artiskill.geometry.arrays import small_product
from artiskill.geometry.kernel import kernel
from artiskill.learning.features import Features, Scale
from artiskill.learning.network_config import NetworkConfig

_NORM_EPSILON = np.float32(1e-5)  # torch's


class Weights:
    """Weights of a module, as its `state_dict` names them.

    Args:
        values: of the whole model.
        prefix: of the module's names.

    Raises:
        KeyError: from every method, where a name is missing.
    """

    def __init__(self, values: Mapping[str, np.ndarray], prefix: str = "") -> None:
        self._values, self._prefix = values, prefix

    def __getitem__(self, name: str) -> np.ndarray:
        return self._values[self._prefix + name]

    def __contains__(self, name: str) -> bool:
        return self._prefix + name in self._values

    def part(self, name: str) -> "Weights":
        """Return the weights of a part."""
        return Weights(self._values, f"{self._prefix}{name}.")

    def parts(self, name: str) -> list["Weights"]:
        """Return the weights of the members of a list."""
        start = f"{self._prefix}{name}."
        found = {key[len(start) :].split(".")[0] for key in self._values if key.startswith(start)}
        return [self.part(f"{name}.{i}") for i, _ in zip(count(), found, strict=False)]

    @property
    def scale(self) -> Scale:
        """What inputs are normalised with."""
        return Scale(*(self[f"inputs.{name}"] for name in Scale._fields))


class Linear:
    """A linear layer; without a bias, zeros are added."""

    def __init__(self, weights: Weights) -> None:
        self._weight = np.ascontiguousarray(weights["weight"].T)  # (inputs, outputs)
        self._bias = weights["bias"] if "bias" in weights else np.float32(0.0)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Return the layer's output.

        Raises:
            ValueError: rows of another length.
        """
        if x.shape[-1] != len(self._weight):
            raise ValueError(f"a layer of {len(self._weight)} inputs is given {x.shape[-1]}")
        rows = np.ascontiguousarray(x.reshape(-1, len(self._weight)))
        found = np.empty((len(rows), self._weight.shape[1]), dtype=np.float32)
        found[:] = self._bias
        _add_product(rows, self._weight, found, np.empty(len(self._weight), dtype=np.int64))
        return found.reshape(*x.shape[:-1], -1)


@kernel
def _add_product(x: np.ndarray, weight: np.ndarray, out: np.ndarray, places: np.ndarray) -> None:
    """Add x (N, K) times weight (K, M) to out (N, M), one product after the other; `places` (K,) is overwritten.

    Zeros, of which the layer before leaves many, are left out; of the others, four are added in one pass.
    """
    for i in range(x.shape[0]):
        count = 0
        for k in range(x.shape[1]):
            if x[i, k] != 0.0:
                places[count] = k
                count += 1
        whole = count - count % 4
        for n in range(0, whole, 4):
            a, b, c, d = places[n], places[n + 1], places[n + 2], places[n + 3]
            x_a, x_b, x_c, x_d = x[i, a], x[i, b], x[i, c], x[i, d]
            for j in range(weight.shape[1]):
                found = out[i, j] + x_a * weight[a, j] + x_b * weight[b, j]
                out[i, j] = found + x_c * weight[c, j] + x_d * weight[d, j]
        for n in range(whole, count):
            k = places[n]
            for j in range(weight.shape[1]):
                out[i, j] += x[i, k] * weight[k, j]


class JointLinear:
    """One linear layer on two inputs side by side, of which the second may be missing."""

    def __init__(self, weights: Weights) -> None:
        self._first = Linear(weights.part("first"))
        self._second = Linear(weights.part("second")) if "second.weight" in weights else None

    def __call__(self, first: np.ndarray, second: np.ndarray | None) -> np.ndarray:
        """Return the layer's output; the leading dimensions broadcast."""
        x = self._first(first)
        return x if self._second is None or second is None else x + self._second(second)


class Norm:
    """LayerNorm, or nothing where it has no weights."""

    def __init__(self, weights: Weights) -> None:
        self._values = (weights["weight"], weights["bias"]) if "weight" in weights else None

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Return rows of mean 0 and variance 1, scaled and shifted."""
        if self._values is None:
            return x
        centred = x - x.mean(-1, keepdims=True)
        variance = (centred * centred).mean(-1, keepdims=True)
        return centred / np.sqrt(variance + _NORM_EPSILON) * self._values[0] + self._values[1]


class PointEncoder:
    """Layers that all points share, then pooling."""

    def __init__(self, config: NetworkConfig, weights: Weights) -> None:
        self._joint = JointLinear(weights.part("joint"))
        self._layers = [Linear(part) for part in weights.parts("layers")]
        self._norm = Norm(weights.part("norm"))
        self._width = config.point_layers[-1]
        self._means = self._width // 2 if config.pooling == "max_mean" else 0

    def __call__(self, points: np.ndarray, state: np.ndarray | None) -> np.ndarray:
        """Return pooled features (F,) of points (M, P)."""
        if len(points) == 0:
            return self._norm(np.zeros(self._width, dtype=np.float32))
        x = _relu(self._joint(points, state))
        for layer in self._layers:
            x = _relu(layer(x))
        if not self._means:
            return self._norm(x.max(0))
        return self._norm(np.concatenate((x[:, : self._means].max(0), x[:, self._means :].mean(0))))


class Mlp:
    """Hidden layers and an output, of features and further numbers."""

    def __init__(self, weights: Weights, depth: int) -> None:
        self._joint = JointLinear(weights.part("joint"))
        self._layers = [Linear(part) for part in weights.parts("layers")]
        self._norms = [Norm(weights.part(f"norms.{i}")) for i in range(depth)]
        self._output = Linear(weights.part("output"))

    def __call__(self, features: np.ndarray, extra: np.ndarray | None = None) -> np.ndarray:
        """Return outputs (O,), or (M, O) for `extra` (M, E)."""
        x = _relu(self._norms[0](self._joint(features, extra)))
        for layer, norm in zip(self._layers, self._norms[1:], strict=True):
            x = _relu(norm(layer(x)))
        return self._output(x)


class Attention:
    """Attention of several heads."""

    def __init__(self, heads: int, weights: Weights) -> None:
        self._heads = heads
        self._query, self._key, self._value, self._output = (
            Linear(weights.part(name)) for name in ("query", "key", "value", "output")
        )

    def __call__(self, asking: np.ndarray, tokens: np.ndarray) -> np.ndarray:
        """Return (Q, D) what `asking` (Q, D) finds in the tokens (T, D)."""
        query, key, value = (
            layer(x).reshape(len(x), self._heads, -1).swapaxes(0, 1)
            for layer, x in ((self._query, asking), (self._key, tokens), (self._value, tokens))
        )
        scores = small_product(query, key.swapaxes(1, 2)) / np.float32(np.sqrt(query.shape[2]))  # (H, Q, T)
        likely = np.exp(scores - scores.max(2, keepdims=True))
        found = small_product(likely / likely.sum(2, keepdims=True), value)
        return self._output(found.swapaxes(0, 1).reshape(len(asking), -1))


class Block:
    """Attention and two layers on each token."""

    def __init__(self, heads: int, weights: Weights) -> None:
        self._attention = Attention(heads, weights.part("attention"))
        self._first, self._second = Linear(weights.part("first")), Linear(weights.part("second"))
        self._norms = [Norm(part) for part in weights.parts("norms")]

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Return tokens (T, D) from tokens."""
        x = self._norms[0](x + self._attention(x, x))
        return self._norms[1](x + self._second(_relu(self._first(x))))


class ArrayPointNet:
    """See `learning/networks.py`."""

    def __init__(self, config: NetworkConfig, weights: Weights) -> None:
        self._input = config.input
        self._points = PointEncoder(config, weights.part("points"))
        self.head = Mlp(weights.part("mlp"), len(config.head))

    def encode(self, seen: Features) -> np.ndarray:
        """Return features (F,) of one observation."""
        points, state = seen.points[0][seen.valid[0]], seen.state[0]
        pooled = self._points(points, state if self._input.state_per_point else None)
        return np.concatenate((pooled, state)) if self._input.state_in_head else pooled


class ArrayPointNetTransformer:
    """See `learning/networks.py`."""

    def __init__(self, config: NetworkConfig, weights: Weights) -> None:
        assert config.transformer is not None
        self._input, heads = config.input, config.transformer.heads
        self._points = [PointEncoder(config, part) for part in weights.parts("points")]
        self._tokens = [Mlp(part, 1) for part in weights.parts("tokens")]
        self._state = Mlp(weights.part("state"), 1)
        self._task, self._query = weights["task"], weights["query"]
        self._blocks = [Block(heads, part) for part in weights.parts("blocks")]
        self._pool = Attention(heads, weights.part("pool"))
        self.head = Mlp(weights.part("mlp"), len(config.head))

    def encode(self, seen: Features) -> np.ndarray:
        """Return features (F,) of one observation."""
        points, state, masks = seen.points[0], seen.state[0], seen.masks[0] > 0
        groups = [*masks.T, seen.valid[0] & ~masks.any(1), seen.valid[0]]
        given = state if self._input.state_per_point else None
        tokens = [
            token(encoder(points[group], given))
            for group, encoder, token in zip(groups, self._points, self._tokens, strict=True)
            if group.any()
        ]
        x = np.stack([*tokens, self._state(state), self._task])
        for block in self._blocks:
            x = block(x)
        pooled = self._pool(self._query[None], x)[0]
        return np.concatenate((pooled, state)) if self._input.state_in_head else pooled


ArrayNetwork = ArrayPointNet | ArrayPointNetTransformer


def make_array_network(config: NetworkConfig, weights: Weights) -> ArrayNetwork:
    """Return the network of a configuration with these weights.

    Raises:
        KeyError: weights are missing.
    """
    config = config.resolved()
    return (
        ArrayPointNet(config, weights) if config.transformer is None else ArrayPointNetTransformer(config, weights)
    )


def _relu(x: np.ndarray) -> np.ndarray:
    return np.maximum(x, np.float32(0.0), out=x)  # of what has just been computed

"""The networks: padding, order of points, gradients, sizes, and values that can be computed by hand."""
# ruff: noqa: E402

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from tests.learning.clouds import CABINET, CHAIR, make, observe, plain_statistics

from artiskill.learning import networks
from artiskill.learning.batch import Observation, Sizes
from artiskill.learning.network_config import NETWORKS, load_network_config
from artiskill.learning.networks import PointEncoder, make_network

VARIANTS = [(name, compat) for name in NETWORKS for compat in ("none", "paper2021")]


@pytest.mark.parametrize(("name", "compat"), VARIANTS)
def test_padding_never_counts(name: str, compat: str) -> None:
    network, seen = make(name, compat=compat), observe()
    padding = ~seen.valid[..., None]
    other = seen._replace(
        points=seen.points.masked_fill(padding, np.nan),
        colors=seen.colors.masked_fill(padding, 1e30),
        masks=seen.masks.masked_fill(padding, 1.0),
    )
    with torch.no_grad():
        assert torch.equal(network(seen), network(other))


@pytest.mark.parametrize(("name", "compat"), VARIANTS)
def test_order_of_points_does_not_matter(name: str, compat: str) -> None:
    network, seen = make(name, compat=compat), observe()
    order = torch.randperm(CABINET.points, generator=torch.Generator().manual_seed(1))
    points, colors, masks, valid = (part[:, order] for part in seen[:4])
    with torch.no_grad():
        found = network(Observation(points, colors, masks, valid, seen.agent))
        torch.testing.assert_close(found, network(seen), atol=1e-5, rtol=1e-5)


def test_mixed_precision_sees_what_single_precision_sees() -> None:
    """Who acts does so in float32, so hands and points must not be elsewhere in training."""
    inputs, seen = make("small").inputs, observe()
    with torch.autocast("cpu", torch.bfloat16):
        mixed = inputs(seen)
    single = inputs(seen)
    assert torch.equal(mixed.points, single.points)
    assert torch.equal(mixed.state, single.state)


@pytest.mark.parametrize("sizes", [CABINET, CHAIR], ids=["cabinet", "chair"])
@pytest.mark.parametrize("name", NETWORKS)
def test_output_without_any_point_is_finite(name: str, sizes: Sizes) -> None:
    network = make(name, sizes)
    with torch.no_grad():
        assert network(observe(sizes, real=0)).isfinite().all()


@pytest.mark.parametrize("name", NETWORKS)
def test_gradients_equal_those_of_all_points(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    network, seen = make(name), observe()
    seen = seen._replace(points=seen.points[:, [0, *range(39)]])  # a point twice: a tie in every channel

    def gradients() -> list[torch.Tensor]:
        network.zero_grad()
        network(seen).square().sum().backward()
        return [parameter.grad.clone() for parameter in network.parameters()]

    found = gradients()
    monkeypatch.setattr(
        PointEncoder, "_maxima", lambda self, *seen: (self._each(*seen[:2]).relu() * seen[2][..., None]).amax(1)
    )
    for mine, plain in zip(found, gradients(), strict=True):
        torch.testing.assert_close(mine, plain, atol=2e-5, rtol=1e-4)


def test_clouds_are_searched_a_few_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    network, seen = make("small"), observe(batch=7)
    whole = network(seen)
    monkeypatch.setattr(networks, "_POINTS_AT_ONCE", 64)  # two clouds of those points that count
    torch.testing.assert_close(network(seen), whole)
    with torch.no_grad():
        torch.testing.assert_close(network(seen), whole)


@pytest.mark.parametrize("name", NETWORKS)
def test_weights_come_from_the_generator_alone(name: str) -> None:
    first = make(name, seed=4).state_dict()
    torch.rand(1)
    again, other = make(name, seed=4).state_dict(), make(name, seed=5).state_dict()
    assert all(torch.equal(first[key], again[key]) for key in first)
    assert not torch.equal(first["mlp.output.weight"], other["mlp.output.weight"])


@pytest.mark.parametrize("name", NETWORKS)
def test_output_begins_with_zeros(name: str) -> None:
    assert not make(name, zero_output=True)(observe()).any()


@pytest.mark.parametrize("name", NETWORKS)
def test_candidates_are_read_out_like_single_ones(name: str) -> None:
    network, seen = make(name, extra=2), observe()
    candidates = torch.randn(3, 4, 2, generator=torch.Generator().manual_seed(1))
    with torch.no_grad():
        together = network.head(network.encode(seen), candidates)
        assert together.shape == (3, 4, 13)
        for i in range(4):
            torch.testing.assert_close(together[:, i], network(seen, candidates[:, i]), atol=1e-5, rtol=1e-5)


def layer(inputs: int, outputs: int) -> int:
    return inputs * outputs + outputs


def count_parameters(name: str) -> int:
    network = make_network(load_network_config(name), CABINET, plain_statistics(38), 13)
    return sum(parameter.numel() for parameter in network.parameters())


def test_parameter_counts() -> None:
    counts = {name: count_parameters(name) for name in NETWORKS}
    state = 38 + 3
    assert counts["pointnet"] == (
        layer(3 + 3 + 3 + state, 256)
        + layer(256, 512)
        + 2 * 512
        + layer(512, 512)
        + layer(512, 256)
        + layer(256, 13)
    )
    each = layer(3 + 3 + state, 256) + layer(256, 256) + 2 * 256 + 2 * layer(256, 256)
    attention = 3 * layer(256, 128) + layer(128, 256)
    block = attention + layer(256, 1024) + layer(1024, 256) + 4 * 256
    head = layer(256, 256) + layer(256, 128) + layer(128, 13)
    assert counts["pointnet_transformer"] == (
        5 * each + layer(state, 256) + layer(256, 256) + 6 * block + attention + 2 * 256 + head
    )
    extents, places, velocities = 4 * 3 * 3, 3 + 2 + 2, 6 + 3 + 10
    inputs = 256 + state - velocities + places + 2 * extents
    points = layer(3 * 3 + 3 + 3, 64) + layer(64, 128) + layer(128, 256) + 2 * 256
    assert counts["small"] == points + layer(inputs, 512) + 2 * 512 + layer(512, 256) + 2 * 256 + layer(256, 13)


def fill(parameter: torch.Tensor, values: list[float] | list[list[float]]) -> None:
    with torch.no_grad():
        parameter.copy_(torch.tensor(values))


@pytest.mark.parametrize(("pooling", "second_channel"), [("max", 2.5), ("max_mean", 1.25)])
def test_a_network_by_hand(pooling: str, second_channel: float) -> None:
    """Two points, centred at x = -1 and x = 1, and padding; features max(x, 0) and max(0.5 - 2 x, 0)."""
    plain = {"frames": ["cloud"], "near_m": 0, "colors": False, "masks": False, "extents": False}
    changes = {f"input.{key}": value for key, value in plain.items()}
    changes |= {"point_layers": [2], "head": [1], "pool_norm": False, "head_norm": False, "pooling": pooling}
    sizes = Sizes(points=3, masks=1, agent=1, action=1)
    network = make_network(load_network_config("small", changes), sizes, plain_statistics(1), outputs=1, extra=1)
    fill(network.points.joint.first.weight, [[1.0, 0.0, 0.0], [-2.0, 0.0, 0.0]])
    fill(network.points.joint.first.bias, [0.0, 0.5])
    fill(network.mlp.joint.first.weight, [[1.0, 1.0, 2.0, 0.25, 0.0, 0.0]])  # of pooled channels, state, mean
    fill(network.mlp.joint.first.bias, [-1.0])
    fill(network.mlp.joint.second.weight, [[10.0]])
    fill(network.mlp.output.weight, [[3.0]])
    fill(network.mlp.output.bias, [0.5])
    seen = Observation(
        points=torch.tensor([[[1.0, 0, 0], [3.0, 0, 0], [9.0, 0, 0]]]),
        colors=torch.zeros(1, 3, 3),
        masks=torch.zeros(1, 3, 1),
        valid=torch.tensor([[True, True, False]]),
        agent=torch.tensor([[0.5]]),
    )
    hidden = 1 + second_channel + 2 * 0.5 + 0.25 * 2 - 1
    for extra in (0.0, 0.2, -9.0):
        expected = 3 * max(hidden + 10 * extra, 0) + 0.5
        assert network(seen, torch.tensor([[extra]])).item() == pytest.approx(expected)


def test_groups_without_points_have_no_token() -> None:
    """What the encoder of an empty mask would say does not matter."""
    network, seen = make("pointnet_transformer"), observe()
    empty = seen._replace(masks=seen.masks * torch.tensor([0.0, 1.0, 1.0]))
    with torch.no_grad():
        before = network(empty), network(seen)
        network.tokens[0].output.bias += 1.0
        after = network(empty), network(seen)
    assert torch.equal(before[0], after[0])
    assert not torch.equal(before[1], after[1])

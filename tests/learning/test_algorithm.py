# ruff: noqa: E402
"""What holds for every algorithm, as it comes."""

from collections.abc import Callable
from typing import Any

import pytest

torch = pytest.importorskip("torch")

from tests.learning.clouds import CABINET, narrow, observe, plain_statistics
from tests.learning.tiny import TinyNetwork, random_batch, tiny_maker, tiny_sizes, train, update

from artiskill.config import CONFIG_DIR, from_mapping, load_yaml
from artiskill.learning.algorithm import Algorithm, Target, adam, descend, normal, weighted_mean
from artiskill.learning.batch import Batch
from artiskill.learning.bc import BC
from artiskill.learning.bcq import BCQ
from artiskill.learning.network_config import NETWORKS
from artiskill.learning.networks import make_network
from artiskill.learning.td3bc import TD3BC

ALGORITHMS = {"bc": BC, "bcq": BCQ, "td3bc": TD3BC}
SIZES = tiny_sizes(agent=3, action=2)
Make = Callable[[], Algorithm]


def read_config(name: str, **changes: object) -> Any:
    values = load_yaml(CONFIG_DIR / "learning" / f"{name}.yaml")["algorithm"]
    return from_mapping(ALGORITHMS[name].Config, values | changes)


@pytest.fixture(params=ALGORITHMS)
def name(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def make(name: str) -> Make:
    return lambda: ALGORITHMS[name](read_config(name), tiny_maker(SIZES, hidden=(16,)), SIZES)


def test_training_goes_on_bit_for_bit(make: Make) -> None:
    whole, first, second = make(), make(), make()
    train(whole, random_batch, 7)
    train(first, random_batch, 3)
    second.load_state_dict(first.state_dict())
    for name, optimizer in second.optimizers.items():
        optimizer.load_state_dict(first.optimizers[name].state_dict())
    train(second, random_batch, 4, first=3)
    expected, found = whole.state_dict(), second.state_dict()
    assert all(torch.equal(expected[name], found[name]) for name in expected)


def test_every_weight_is_trained(make: Make) -> None:
    algorithm, untrained = make(), make().state_dict()
    train(algorithm, random_batch, 2)
    trained = algorithm.state_dict()
    assert [name for name in trained if torch.equal(trained[name], untrained[name])] in ([], ["latents"])
    assert set(dict(algorithm.named_parameters())) == {name for name in trained if name != "latents"}


def test_an_update_leaves_the_global_generator_alone(make: Make) -> None:
    algorithm = make()
    before = torch.get_rng_state()
    logged = update(algorithm, random_batch(torch.Generator().manual_seed(0)))
    assert torch.equal(before, torch.get_rng_state())
    assert "imitation_loss" in logged


def test_nothing_is_imitated_without_weights(make: Make) -> None:
    """The policy and what imitates stay as they are; everything stays a number."""
    algorithm = make()
    batch = random_batch(torch.Generator().manual_seed(0))._replace(weight=torch.zeros(16))
    imitating = algorithm.optimizers[next(name for name in ("policy", "vae") if name in algorithm.optimizers)]
    before = [p.clone() for group in imitating.param_groups for p in group["params"]]
    logged = update(algorithm, batch)
    after = [p for group in imitating.param_groups for p in group["params"]]
    assert all(map(torch.equal, before, after))
    assert logged["imitation_loss"] == 0
    assert all(value == value for value in logged.values())


def test_it_acts_in_range_and_again_alike(make: Make) -> None:
    algorithm = make()
    observation = random_batch(torch.Generator().manual_seed(0)).observation
    action = algorithm.act(observation)
    assert action.shape == (16, 2)
    assert action.dtype == torch.float32
    assert not action.requires_grad
    assert action.abs().max() <= 1
    assert torch.equal(action, algorithm.act(observation))
    assert algorithm.training


def test_it_says_whether_it_needs_what_follows(make: Make) -> None:
    algorithm = make()
    batch = random_batch(torch.Generator().manual_seed(0))._replace(next_observation=None)
    if algorithm.needs_next:
        with pytest.raises(AssertionError):
            update(algorithm, batch)
    else:
        update(algorithm, batch)


@pytest.mark.parametrize(("name", "slow"), [("bcq", "vae"), ("td3bc", "policy")])
def test_values_of_2021(name: str, slow: str) -> None:
    config = read_config(name, compat="paper2021")
    optimizers = ALGORITHMS[name](config, tiny_maker(SIZES), SIZES).optimizers
    groups = {name: optimizer.param_groups[0] for name, optimizer in optimizers.items()}
    assert {name: group["lr"] for name, group in groups.items()} == {slow: 3e-4, "critics": 5e-4}
    assert {group["weight_decay"] for group in groups.values()} == {5e-6}
    assert config.resolved().largest_value is None
    assert config.resolved().reward_scale == 1


def test_acting_knows_no_dropout() -> None:
    bc = BC(BC.Config(1e-3, 0, True), tiny_maker(SIZES, dropout=0.5), SIZES)
    observation = random_batch(torch.Generator().manual_seed(0)).observation
    assert torch.equal(bc.act(observation), bc.act(observation))
    assert bc.policy.training
    assert not bc.eval().policy.training


def network(seed: int = 0, dropout: float = 0.0) -> TinyNetwork:
    return TinyNetwork((3, 2), torch.Generator().manual_seed(seed), dropout)


def test_a_target_follows_by_a_share_of_the_way() -> None:
    source, other = network(0), network(1)
    target = Target(source)
    target.follow(other, 0.25)
    expected = 0.75 * source.layers[0].weight + 0.25 * other.layers[0].weight
    torch.testing.assert_close(target.network.layers[0].weight.data, expected.data)
    assert not any(parameter.requires_grad for parameter in target.parameters())
    assert all(parameter.requires_grad for parameter in source.parameters())


def test_targets_know_no_dropout() -> None:
    td3bc = TD3BC(read_config("td3bc"), tiny_maker(SIZES, dropout=0.5), SIZES).train()
    assert td3bc.policy.dropout.training
    assert not td3bc.policy_target.network.dropout.training


def test_gradients_reach_the_optimizers_parameters_only() -> None:
    ours, other = network(0), network(1)
    observation = random_batch(torch.Generator().manual_seed(0)).observation
    given = []
    descend((ours(observation) * other(observation)).sum(), adam([ours], 0.1, 0), given.extend)
    assert [id(p) for p in given] == [id(p) for p in ours.parameters()]
    assert all(parameter.grad is None for parameter in other.parameters())


def test_weighted_means() -> None:
    values = torch.tensor([1.0, 2.0, 5.0])
    assert float(weighted_mean(values, torch.tensor([1.0, 1.0, 0.0]))) == pytest.approx(1.5)
    assert float(weighted_mean(values, torch.tensor([0.5, 0.0, 0.5]))) == pytest.approx(3)
    assert float(weighted_mean(values, torch.zeros(3))) == 0


def test_noise_follows_from_its_generator() -> None:
    like = torch.zeros(1)
    draws = [normal((2, 3), torch.Generator().manual_seed(7), like) for _ in range(2)]
    assert torch.equal(*draws)
    assert draws[0].shape == (2, 3)


def test_each_optimizer_has_its_gradients_averaged(make: Make) -> None:
    algorithm = make()
    given = []
    update(algorithm, random_batch(torch.Generator().manual_seed(0)), sync=given.append)
    of_optimizers = [
        [id(p) for group in optimizer.param_groups for p in group["params"]]
        for optimizer in algorithm.optimizers.values()
    ]
    assert sorted([id(p) for p in call] for call in given) == sorted(of_optimizers)


@pytest.mark.parametrize("network_name", NETWORKS)
@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
def test_every_network_trains(name: str, network_name: str, precision: str) -> None:
    """All weights get gradients, in mixed precision, too; actions are single."""
    generator = torch.Generator().manual_seed(0)
    values, statistics = narrow(network_name), plain_statistics(CABINET.agent)

    def make(outputs: int, extra: int) -> Any:
        return make_network(values, CABINET, statistics, outputs, extra, generator)

    algorithm = ALGORITHMS[name](read_config(name), make, CABINET)
    seen, following = observe(seed=1), observe(seed=2)
    action = torch.zeros(3, CABINET.action)
    batch = Batch(seen, action, torch.ones(3), -torch.ones(3), torch.zeros(3), following)

    def autocast() -> torch.autocast:
        return torch.autocast("cpu", torch.bfloat16, enabled=precision == "bfloat16")

    logged = algorithm.update(batch, 0, generator, list, autocast)
    assert all(value.dtype == torch.float32 and value.isfinite() for value in logged.values())
    assert not [name for name, p in algorithm.named_parameters() if p.requires_grad and p.grad is None]
    assert algorithm.act(seen).dtype == torch.float32

# ruff: noqa: E402
import math
from dataclasses import replace
from typing import Any

import pytest

torch = pytest.importorskip("torch")

from tests.learning.clouds import CABINET, narrow, observe, plain_statistics
from tests.learning.tiny import (
    Chain,
    make_batch,
    random_batch,
    set_linear,
    take,
    tiny_maker,
    tiny_sizes,
    train,
    update,
)

from artiskill.errors import ConfigError
from artiskill.learning.batch import Batch
from artiskill.learning.bc import BC, BCConfig
from artiskill.learning.networks import make_network
from artiskill.learning.td3bc import TD3BC, TD3BCConfig

SIZES = tiny_sizes(agent=1, action=1)
CONFIG = TD3BCConfig(
    critic_learning_rate=0.1,
    policy_learning_rate=0.1,
    weight_decay=0,
    standardise_actions=True,
    gamma=0.5,
    tau=0.1,
    reward_scale=0.5,
    largest_value=0.0,
    alpha=0.02,
    action_noise=0.2,
    noise_bound=0.5,
    policy_interval=2,
)


def linear_td3bc(config: TD3BCConfig = CONFIG) -> TD3BC:
    """The policy says tanh(s); critics and their targets, the action less 2 and the action less 3."""
    td3bc = TD3BC(config, tiny_maker(SIZES), SIZES)
    for policy in (td3bc.policy, td3bc.policy_target.network):
        set_linear(policy, [[1.0]], [0.0])
    for i, bias in enumerate((-2.0, -3.0)):
        for critic in (td3bc.critics[i], td3bc.critic_targets[i].network):
            set_linear(critic, [[0.0, 1.0]], [bias])
    return td3bc


def target_values(td3bc: TD3BC, next_agent: list[float], **columns: list[float]) -> list[float]:
    rows = [[value] for value in next_agent]
    batch = make_batch(rows, rows, rows, **columns)
    return td3bc.target_values(batch, torch.Generator().manual_seed(0)).tolist()


def test_targets_take_the_lower_value() -> None:
    """(1 - .5) r + .5 (a - 3), without noise; the end is worth 0."""
    td3bc = linear_td3bc(replace(CONFIG, action_noise=0))
    wanted = target_values(td3bc, [0.3, 0.3], reward=[-0.2, -0.2], terminated=[0.0, 1.0])
    assert wanted == pytest.approx([-0.1 + 0.5 * (math.tanh(0.3) - 3), -0.1])


def test_noise_on_next_actions_is_cut_off() -> None:
    """Noise of any size moves by half at most, and actions stay in [-1, 1]."""
    drawn = torch.randn(2, 1, generator=torch.Generator().manual_seed(0))[:, 0].sign().tolist()
    wanted = target_values(linear_td3bc(replace(CONFIG, action_noise=1e9)), [0.0, 100.0])
    actions = [0.5 * drawn[0], min(1.0, 1 + 0.5 * drawn[1])]
    assert wanted == pytest.approx([0.5 * (action - 3) for action in actions])


def test_targets_are_bounded_unless_as_in_2021() -> None:
    for compat, expected in (("none", -0.1), ("paper2021", -0.2 + 0.5 * 4)):
        td3bc = linear_td3bc(replace(CONFIG, action_noise=0, compat=compat))
        for target in td3bc.critic_targets:
            set_linear(target.network, [[0.0, 0.0]], [4.0])
        assert target_values(td3bc, [0.0], reward=[-0.2]) == pytest.approx([expected])


def policy_losses(td3bc: TD3BC, actions: list[float], weight: list[float]) -> list[float]:
    batch = make_batch([[0.0]] * len(actions), [[0.0]] * len(actions), weight=weight)
    return [loss.item() for loss in td3bc.policy_losses(batch, torch.tensor(actions)[:, None])]


def test_the_loss_of_the_policy() -> None:
    """The squared error, and the first critic's value (a - 2) of mean size 1, by alpha; disturbed steps: none."""
    imitation, improvement = policy_losses(linear_td3bc(replace(CONFIG, alpha=0.5)), [0.5, -0.5, 1], [1, 1, 0])
    assert imitation == pytest.approx(0.25)
    assert improvement == pytest.approx(-0.5 * -1)  # all values are below 0


def test_the_gradient_of_the_value() -> None:
    """alpha / mean |Q| * dQ/da: at s = 0, .5 / 2 * 1, upwards; its learning rate shows its sign."""
    td3bc = linear_td3bc(replace(CONFIG, alpha=0.5))
    action = torch.zeros(1, 1, requires_grad=True)
    imitation, improvement = td3bc.policy_losses(make_batch([[0.0]], [[0.0]]), action)
    (imitation + improvement).backward()
    assert float(action.grad) == pytest.approx(-0.5 / 2)


def test_policy_and_targets_wait_for_their_step() -> None:
    td3bc = linear_td3bc()
    batch = make_batch([[0.5]], [[-0.5]], [[0.5]], reward=[-1.0])
    slow = (td3bc.policy, td3bc.policy_target, td3bc.critic_targets)

    def weights() -> list[torch.Tensor]:
        return [parameter.clone() for module in slow for parameter in module.parameters()]

    before = weights()
    assert set(update(td3bc, batch, step=1)) == {"critic_loss", "value"}
    assert all(map(torch.equal, before, weights()))
    assert "imitation_loss" in update(td3bc, batch, step=2)
    assert not any(map(torch.equal, before, weights()))
    critic, target = td3bc.critics[0].layers[0].bias, td3bc.critic_targets[0].network.layers[0].bias
    torch.testing.assert_close(target.data, 0.9 * torch.tensor([-2.0]) + 0.1 * critic.data)


def test_processes_that_average_gradients_are_one_process() -> None:
    """Critics on two halves of a batch of equal weight, as two processes see them; noise would be their own."""
    batch = random_batch(torch.Generator().manual_seed(0), agent=1, action=1)
    gradients = []
    for rows in (slice(None), slice(0, 8), slice(8, 16)):
        td3bc = linear_td3bc(replace(CONFIG, action_noise=0))
        calls = []
        update(td3bc, take(batch, rows), sync=lambda ps, calls=calls: calls.append([p.grad.clone() for p in ps]))
        gradients.append(calls[0])
    for whole, one, other in zip(*gradients, strict=True):
        torch.testing.assert_close(whole, (one + other) / 2)


@pytest.mark.parametrize("interval", [1, 2])
def test_without_alpha_it_is_bc(interval: int) -> None:
    """Equal learning rates, weight decay, weights and batches; BC sees the batches that the policy is trained on.

    Dropout draws from torch's global generator, which is seeded at each step.
    """
    statistics, first = plain_statistics(CABINET.agent), torch.Generator()

    def make(outputs: int, extra: int) -> Any:
        return make_network(narrow("pointnet_transformer"), CABINET, statistics, outputs, extra, first)

    config = replace(CONFIG, alpha=0, policy_interval=interval, weight_decay=1e-3)
    td3bc = TD3BC(config, make, CABINET)
    first.manual_seed(first.initial_seed())
    bc = BC(BCConfig(0.1, 1e-3, True), make, CABINET)
    for step in range(6):
        draws = torch.Generator().manual_seed(step)
        action = torch.rand(3, CABINET.action, generator=draws) * 2 - 1
        weight = torch.tensor([1.0, 1.0, 0.0])
        batch = Batch(observe(seed=step), action, weight, -torch.ones(3), torch.zeros(3), observe(seed=step + 9))
        for algorithm in (td3bc, *([bc] if step % interval == 0 else [])):
            with torch.random.fork_rng():
                torch.manual_seed(step)
                update(algorithm, batch, step)
    ours, theirs = td3bc.policy.state_dict(), bc.policy.state_dict()
    assert ours.keys() == theirs.keys()
    assert all(torch.equal(ours[name], theirs[name]) for name in ours)


def test_it_finds_the_way_where_its_imitation_does_not() -> None:
    config = replace(
        CONFIG,
        critic_learning_rate=3e-3,
        policy_learning_rate=3e-3,
        gamma=0.8,
        reward_scale=0.2,
        tau=0.05,
        policy_interval=1,
    )
    steps = {}
    for alpha in (0.0, 5.0):
        maker = tiny_maker(Chain.sizes, hidden=(32, 32))
        td3bc = TD3BC(replace(config, alpha=alpha), maker, Chain.sizes)
        train(td3bc, Chain.draw, 500)
        steps[alpha] = Chain.steps_to_end(td3bc)
    assert steps[0.0] == 20
    assert steps[5.0] <= 14


def test_values_are_checked() -> None:
    with pytest.raises(ConfigError, match="policy_interval must be positive"):
        replace(CONFIG, policy_interval=0)
    with pytest.raises(ConfigError, match="gamma must be at least 0 and below 1"):
        replace(CONFIG, gamma=1.5)

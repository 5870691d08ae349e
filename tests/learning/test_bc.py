# ruff: noqa: E402
import math

import pytest

torch = pytest.importorskip("torch")

from tests.learning.tiny import make_batch, observe, set_linear, take, tiny_maker, tiny_sizes, train, update

from artiskill.errors import ConfigError
from artiskill.learning.bc import BC, BCConfig

SIZES = tiny_sizes(agent=1, action=2)
CONFIG = BCConfig(learning_rate=0.1, weight_decay=0, standardise_actions=True)


def linear_bc() -> BC:
    """The policy (tanh(s), tanh(-s))."""
    bc = BC(CONFIG, tiny_maker(SIZES), SIZES)
    set_linear(bc.policy, [[1.0], [-1.0]], [0.0, 0.0])
    return bc


def test_the_policy_is_squashed() -> None:
    action = linear_bc().act(observe([[0.5], [100.0]]))
    expected = torch.tensor([[math.tanh(0.5), -math.tanh(0.5)], [1.0, -1.0]])
    torch.testing.assert_close(action, expected)


def test_the_loss_is_the_mean_squared_error() -> None:
    logged = update(linear_bc(), make_batch([[0.0], [0.5]], [[0.5, 1.0], [0.0, 0.0]]))
    first, second = (0.25 + 1) / 2, math.tanh(0.5) ** 2
    assert logged == {"imitation_loss": pytest.approx((first + second) / 2)}


@pytest.mark.parametrize(("standardise", "error"), [(True, (2.0**2 + 0.5**2) / 2), (False, (1 + 1) / 2)])
def test_errors_count_in_standard_deviations(standardise: bool, error: float) -> None:
    """The policy does (0, 0) where (1, -1) was done."""
    config = BCConfig(learning_rate=0.1, weight_decay=0, standardise_actions=standardise)
    bc = BC(config, tiny_maker(SIZES), SIZES, torch.tensor([0.5, 2.0]))
    set_linear(bc.policy, [[1.0], [-1.0]], [0.0, 0.0])
    assert update(bc, make_batch([[0.0]], [[1.0, -1.0]])) == {"imitation_loss": pytest.approx(error)}
    assert "action_unit" not in bc.state_dict(), "it follows from the run's statistics"


def test_a_step_follows_the_gradient() -> None:
    """At s = 0 only biases have gradients; the first step of Adam is the learning rate, against their signs."""
    bc = linear_bc()
    update(bc, make_batch([[0.0]], [[0.5, -1.0]]))
    (layer,) = bc.policy.layers
    torch.testing.assert_close(layer.bias.data, torch.tensor([0.1, -0.1]))
    torch.testing.assert_close(layer.weight.data, torch.tensor([[1.0], [-1.0]]))


def test_disturbed_steps_are_not_imitated() -> None:
    batch = make_batch([[0.3], [0.7], [-0.2]], [[0.5, 0.1], [-1.0, 1.0], [0.2, 0.2]], weight=[1.0, 0.0, 1.0])
    whole, part = linear_bc(), linear_bc()
    assert update(whole, batch) == update(part, take(batch, [0, 2]))
    assert torch.equal(whole.policy.layers[0].weight, part.policy.layers[0].weight)


def test_processes_that_average_gradients_are_one_process() -> None:
    """Two halves of a batch, of equal weight, as two processes see them."""
    batch = make_batch(torch.linspace(-1, 1, 8)[:, None], torch.linspace(-1, 1, 16).reshape(8, 2))
    whole, halves = linear_bc(), [linear_bc(), linear_bc()]
    update(whole, batch)
    gradients = []
    for bc, rows in zip(halves, (slice(0, 4), slice(4, 8)), strict=True):
        update(bc, take(batch, rows), sync=lambda ps: gradients.append([p.grad.clone() for p in ps]))

    def average(parameters: list[torch.nn.Parameter]) -> None:
        for parameter, *given in zip(parameters, *gradients, strict=True):
            parameter.grad.copy_((given[0] + given[1]) / 2)

    together = linear_bc()
    update(together, take(batch, slice(0, 4)), sync=average)
    torch.testing.assert_close(together.state_dict(), whole.state_dict(), rtol=0, atol=1e-7)


def test_it_learns_to_reach() -> None:
    """A hand at s moves towards a target at t: the action is their difference, which a demonstrator shows."""
    sizes = tiny_sizes(agent=2, action=1)
    bc = BC(BCConfig(3e-3, 0, True), tiny_maker(sizes, hidden=(32,)), sizes)

    def draw(generator: torch.Generator) -> object:
        agent = torch.rand(64, 2, generator=generator)
        return make_batch(agent, agent[:, 1:] - agent[:, :1])

    train(bc, draw, 600)
    assert float((bc.act(observe([[0.2, 0.7], [0.9, 0.1]])) - torch.tensor([[0.5], [-0.8]])).abs().max()) < 0.05


def test_what_it_needs() -> None:
    assert not BC.needs_next
    with pytest.raises(ConfigError, match="learning_rate must be positive"):
        BCConfig(learning_rate=0, weight_decay=0, standardise_actions=True)

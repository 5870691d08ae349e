# ruff: noqa: E402
import math
from dataclasses import replace

import pytest

torch = pytest.importorskip("torch")

from tests.learning.tiny import (
    Chain,
    make_batch,
    observe,
    set_linear,
    take,
    tiny_maker,
    tiny_sizes,
    train,
    update,
)

from artiskill.errors import ConfigError
from artiskill.learning.bc import BC, BCConfig
from artiskill.learning.bcq import BCQ, BCQConfig

SIZES = tiny_sizes(agent=1, action=1)
CONFIG = BCQConfig(
    critic_learning_rate=0.1,
    vae_learning_rate=0.1,
    weight_decay=0,
    standardise_actions=True,
    gamma=0.5,
    tau=0.1,
    reward_scale=0.5,
    largest_value=0.0,
    latent_per_action=2,
    latent_bound=0.5,
    kl_weight=0.5,
    log_std=(-4, 15),
    min_weight=0.75,
    train_candidates=10,
    act_candidates=100,
    latent_seed=0,
)
NONE = (0.0, 0.0, 0.0)  # weights of the state and two latents


def linear_bcq(config: BCQConfig = CONFIG) -> BCQ:
    """Without effect of the state: the decoder says tanh of the first latent, critics say the action."""
    bcq = BCQ(config, tiny_maker(SIZES), SIZES)
    set_linear(bcq.decoder, [[0.0, 1.0, 0.0]], [0.0])
    set_linear(bcq.encoder, [[0.0, 0.0]] * 4, [0.0] * 4)
    for critic in (*bcq.critics, *(target.network for target in bcq.targets)):
        set_linear(critic, [[0.0, 1.0]], [0.0])
    return bcq


def with_target_values(first: float, second: float, config: BCQConfig = CONFIG) -> BCQ:
    bcq = linear_bcq(config)
    for target, value in zip(bcq.targets, (first, second), strict=True):
        set_linear(target.network, [[0.0, 0.0]], [value])
    return bcq


def target_values(bcq: BCQ, **columns: list[float]) -> list[float]:
    size = len(columns["reward"])
    batch = make_batch([[0.0]] * size, [[0.0]] * size, [[0.0]] * size, **columns)
    return bcq.target_values(batch, torch.Generator().manual_seed(0)).tolist()


def test_targets_lean_to_the_lower_value() -> None:
    """(1 - .5) r + .5 (.75 * -3 + .25 * -1); the end is worth 0."""
    wanted = target_values(with_target_values(-1, -3), reward=[-0.2, -0.2], terminated=[0.0, 1.0])
    assert wanted == pytest.approx([-0.1 - 1.25, -0.1])


def test_targets_are_bounded_unless_as_in_2021() -> None:
    """.75 * 1 + .25 * 3 is above 0, which no sum of rewards is."""
    release = replace(CONFIG, compat="paper2021")
    assert target_values(with_target_values(1, 3), reward=[-0.2]) == pytest.approx([-0.1])
    assert target_values(with_target_values(1, 3, release), reward=[-0.2]) == pytest.approx([-0.2 + 0.5 * 1.5])


def test_targets_take_the_best_candidate() -> None:
    """Critics say the action, less 1: the largest of tanh of ten latents, cut off at half."""
    bcq = linear_bcq()
    for target in bcq.targets:
        set_linear(target.network, [[0.0, 1.0]], [-1.0])
    latents = torch.randn(2, 10, 2, generator=torch.Generator().manual_seed(0)).clamp(-0.5, 0.5)
    best = [max(math.tanh(float(z)) - 1 for z in row[:, 0]) for row in latents]
    assert target_values(bcq, reward=[0.0, 0.0]) == pytest.approx([0.5 * value for value in best])


def vae_losses(bcq: BCQ, batch: object) -> list[float]:
    return [loss.item() for loss in bcq.vae_losses(batch, torch.Generator().manual_seed(0))]


def test_divergence_of_latents() -> None:
    """(m^2 + s^2 - 1 - 2 log s) / 2, the mean over latents: of (1, 1) and (0, 2)."""
    bcq = linear_bcq()
    set_linear(bcq.encoder, [[0.0, 0.0]] * 4, [1.0, 0.0, 0.0, math.log(2)])
    divergence = vae_losses(bcq, make_batch([[0.0]], [[0.0]]))[1]
    assert divergence == pytest.approx((1 / 2 + (4 - 1 - 2 * math.log(2)) / 2) / 2)


def test_latents_are_drawn_from_what_the_encoder_says() -> None:
    """Its log of a deviation, -100, counts as -4."""
    bcq = linear_bcq()
    set_linear(bcq.encoder, [[0.0, 1.0], *([[0.0, 0.0]] * 3)], [0.0, 0.0, -100.0, -100.0])
    drawn = float(torch.randn(1, 2, generator=torch.Generator().manual_seed(0))[0, 0])
    error = vae_losses(bcq, make_batch([[0.0]], [[0.5]]))[0]
    assert error == pytest.approx((math.tanh(0.5 + math.exp(-4) * drawn) - 0.5) ** 2, rel=1e-4)


def test_disturbed_steps_teach_critics_alone() -> None:
    bcq = linear_bcq()
    set_linear(bcq.decoder, [NONE], [0.0])
    batch = make_batch([[0.0]] * 3, [[0.4], [-1.0], [0.2]], weight=[1.0, 0.0, 1.0])
    assert vae_losses(bcq, batch)[0] == pytest.approx((0.4**2 + 0.2**2) / 2)
    wanted = torch.tensor([0.4, 0.0, 0.2])
    loss, mean = bcq.critic_loss(batch, wanted)
    assert loss.item() == pytest.approx(2 * 1 / 3)  # two critics are off by 1 at one of three steps
    assert mean.item() == pytest.approx((0.4 - 1 + 0.2) / 3)


def test_targets_follow() -> None:
    bcq = linear_bcq()
    update(bcq, make_batch([[0.5]], [[0.5]], [[0.5]], reward=[-1.0]))
    for target, critic in zip(bcq.targets, bcq.critics, strict=True):
        old, new = torch.tensor([[0.0, 1.0]]), critic.layers[0].weight.data
        assert not torch.equal(old, new)
        torch.testing.assert_close(target.network.layers[0].weight, 0.9 * old + 0.1 * new)


def test_it_acts_as_the_first_critic_likes() -> None:
    bcq = linear_bcq()
    set_linear(bcq.critics[1], [[0.0, -1.0]], [0.0])  # is not asked
    best = torch.tanh(bcq.latents[:, 0].max())
    assert bcq.latents.shape == (100, 2)
    assert bcq.latents.abs().max() <= 0.5
    assert torch.equal(bcq.act(observe([[0.1], [0.9]])), best.expand(2, 1))


def test_the_latents_of_acting_follow_from_their_seed() -> None:
    assert torch.equal(linear_bcq().latents, linear_bcq().latents)
    assert not torch.equal(linear_bcq().latents, linear_bcq(replace(CONFIG, latent_seed=1)).latents)


def test_a_batch_acts_as_its_observations_do_alone() -> None:
    bcq = BCQ(CONFIG, tiny_maker(SIZES, hidden=(8,)), SIZES)
    agents = torch.linspace(-1, 1, 5)[:, None]
    alone = [bcq.act(observe(agent[None])) for agent in agents]
    torch.testing.assert_close(bcq.act(observe(agents)), torch.cat(alone))


def test_it_finds_the_way_where_bc_does_not() -> None:
    bc = BC(BCConfig(3e-3, 0, True), tiny_maker(Chain.sizes, hidden=(32,)), Chain.sizes)
    train(bc, Chain.draw, 200)
    assert Chain.steps_to_end(bc) == 20

    config = replace(CONFIG, gamma=0.8, reward_scale=0.2, tau=0.05, kl_weight=0.05, latent_bound=1)
    config = replace(config, critic_learning_rate=1e-2, vae_learning_rate=1e-2)
    bcq = BCQ(config, tiny_maker(Chain.sizes, hidden=(32, 32)), Chain.sizes)
    train(bcq, Chain.draw, 400)
    assert Chain.steps_to_end(bcq) <= 14


def test_time_that_runs_out_is_no_end() -> None:
    """The same step, cut off and ended: the critics learn that only the one goes on."""
    batch = make_batch([[0.0], [1.0]], [[0.0]] * 2, [[0.0], [1.0]], reward=[-1.0] * 2, terminated=[0.0, 1.0])
    config = replace(CONFIG, critic_learning_rate=0.02, tau=1)
    bcq = BCQ(config, tiny_maker(SIZES), SIZES)
    for step in range(300):
        update(bcq, batch, step)
    values = bcq.critics[0](batch.observation, batch.action)[:, 0].tolist()
    assert values == pytest.approx([-1.0, -0.5], abs=0.05)  # a mean of -1 for ever; -1, then nothing
    assert update(bcq, take(batch, [0]))["value"] == pytest.approx(-1, abs=0.05)


@pytest.mark.parametrize(
    ("name", "value", "rule"),
    [
        ("gamma", 1.0, "gamma must be at least 0 and below 1, not 1.0"),
        ("tau", 0.0, "tau must be above 0"),
        ("log_std", (1.0, 0.0), "log_std must be a lower and a higher number"),
        ("min_weight", 2.0, "min_weight must lie in"),
        ("train_candidates", 0, "train_candidates must be positive"),
    ],
)
def test_values_are_checked(name: str, value: object, rule: str) -> None:
    with pytest.raises(ConfigError, match=rule):
        replace(CONFIG, **{name: value})

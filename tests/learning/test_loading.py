"""Batches: what is in them, that number and seed decide, and that readers do not."""

from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artiskill.errors import ConfigError, DemoError
from artiskill.learning.building import build_training_set
from artiskill.learning.set_sources import SetOptions
from artiskill.learning.training_set import FRAMES, TrainingSet

from .training_files import Episode, write_files

torch = pytest.importorskip("torch")

from artiskill.learning.batch import Batch  # noqa: E402 - they need torch
from artiskill.learning.loading import BatchLoader, StepSampler, decode  # noqa: E402


def make_set(folder: Path, **files: list[Episode]) -> TrainingSet:
    """A set of these files, by default of two objects, three groups and 11 steps of which 3 are disturbed."""
    named = {name.replace("_", "-"): episodes for name, episodes in files.items()}
    source = write_files(folder / "files", named) if named else write_files(folder / "files")
    return build_training_set(source, folder / "set", SetOptions(num_points=4))


@pytest.fixture(scope="module")
def training_set(tmp_path_factory: pytest.TempPathFactory) -> TrainingSet:
    return make_set(tmp_path_factory.mktemp("loading"))


def take(count: int, training_set: TrainingSet, *args: Any, **kwargs: Any) -> list[Batch]:
    with BatchLoader(training_set, *args, **kwargs) as loader:
        return list(islice(loader, count))


def tensors(batch: Batch) -> list[torch.Tensor]:
    observations = [batch.observation, *([batch.next_observation] if batch.next_observation else [])]
    return [*(one for observation in observations for one in observation), *batch[1:5]]


def assert_same(first: Batch, second: Batch) -> None:
    for one, other in zip(tensors(first), tensors(second), strict=True):
        assert torch.equal(one, other)


def test_a_batch_holds_the_steps_that_were_drawn(training_set: TrainingSet) -> None:
    (batch,) = take(1, training_set, 12, seed=3, needs_next=True)
    steps = training_set.steps[StepSampler(training_set, 3, disturbed=True).draw(0, 12)]
    records = training_set.read(steps["frame"], following=1)
    for observation, column in ((batch.observation, 0), (batch.next_observation, 1)):
        assert observation is not None
        for found, wanted in zip(observation, training_set.layout.decode(records[:, column]), strict=True):
            np.testing.assert_array_equal(found.numpy(), wanted)
    np.testing.assert_array_equal(batch.action.numpy(), steps["action"])
    np.testing.assert_array_equal(batch.reward.numpy(), steps["reward"])
    np.testing.assert_array_equal(batch.weight.numpy(), 1.0 - steps["disturbed"])
    np.testing.assert_array_equal(batch.terminated.numpy(), steps["terminated"])
    kinds = {one.dtype for one in tensors(batch)}
    assert kinds == {torch.float32, torch.bool}


def test_a_batch_of_one(training_set: TrainingSet) -> None:
    (batch,) = take(1, training_set, 1, seed=3, needs_next=True)
    assert {len(one) for one in tensors(batch)} == {1}


def test_torch_and_numpy_decode_alike(training_set: TrainingSet) -> None:
    records = training_set.read(np.arange(15))[:, 0]
    found = decode(torch.from_numpy(records.view(np.uint8).reshape(15, -1)), training_set.layout)
    for one, wanted in zip(found, training_set.layout.decode(records), strict=True):
        assert torch.equal(one, torch.from_numpy(wanted))


def test_another_device_gets_the_same_kinds_of_tensors(training_set: TrainingSet) -> None:
    """`meta` has shapes and types, and no values."""
    (there,), (here,) = (take(1, training_set, 8, 0, True, device=device) for device in ("meta", "cpu"))
    for one, other in zip(tensors(there), tensors(here), strict=True):
        assert (one.shape, one.dtype, one.device.type) == (other.shape, other.dtype, "meta")


def test_the_seed_and_the_number_decide(training_set: TrainingSet) -> None:
    batches = take(6, training_set, 8, seed=1)
    for again, resumed in zip(batches[4:], take(2, training_set, 8, seed=1, start_step=4), strict=True):
        assert_same(again, resumed)
    assert not torch.equal(batches[0].action, batches[1].action)
    assert not torch.equal(batches[0].action, take(1, training_set, 8, seed=2)[0].action)


def test_what_is_drawn_stays_what_it_is(training_set: TrainingSet) -> None:
    """In a later version too: a run goes on with the batches that it began with."""
    assert StepSampler(training_set, 7).draw(5, 8).tolist() == [10, 5, 1, 5, 4, 10, 10, 8]


@pytest.mark.parametrize("world_size", [2, 4])
def test_ranks_share_a_batch(training_set: TrainingSet, world_size: int) -> None:
    for number, whole in enumerate(take(2, training_set, 8, seed=1, needs_next=True)):
        parts = [
            take(1, training_set, 8, 1, True, rank, world_size, start_step=number)[0] for rank in range(world_size)
        ]
        for wanted, *shares in zip(tensors(whole), *map(tensors, parts), strict=True):
            assert torch.equal(torch.stack(shares, dim=1).flatten(0, 1), wanted)


def test_groups_are_drawn_alike_however_long_they_are(tmp_path: Path) -> None:
    training_set = make_set(
        tmp_path,
        cabinet_0002=[Episode("link_0", steps=90)],
        cabinet_0020=[Episode("link_0", steps=2), Episode("link_1", steps=9)],
    )
    sampler = StepSampler(training_set, 0)
    group_of_step = training_set.group_of_trajectory[training_set.steps["trajectory"]]
    for number in range(20):
        assert sorted(np.bincount(group_of_step[sampler.draw(number, 10)])) == [3, 3, 4]
    drawn = np.concatenate([sampler.draw(number, 30) for number in range(1000)])
    counts = np.bincount(drawn, minlength=len(training_set))
    assert counts[90:92].tolist() == pytest.approx([5000, 5000], rel=0.05)
    assert counts[:90].min() > 0.5 * 10000 / 90


def test_disturbed_steps_are_left_out_of_imitation(training_set: TrainingSet) -> None:
    disturbed = set(np.flatnonzero(training_set.steps["disturbed"]).tolist())
    drawn = {one for number in range(50) for one in StepSampler(training_set, 0).draw(number, 12).tolist()}
    assert drawn == set(range(11)) - disturbed
    assert all((batch.weight == 1).all() for batch in take(3, training_set, 12, seed=0))


def test_the_ends_of_trajectories_can_be_left_out(tmp_path: Path) -> None:
    """Of each trajectory, however long; one that is shorter has no step left."""
    episodes = [Episode("link_0", steps=steps) for steps in (5, 2, 4)]
    held = make_set(tmp_path, cabinet_0002=episodes)
    drawn = {one for number in range(20) for one in StepSampler(held, 0, end_steps=3).draw(number, 12).tolist()}
    assert drawn == {0, 1, 7}
    batches = take(5, held, 6, seed=0, end_steps=3)
    wanted = held.steps["action"][[0, 1, 7]]
    assert all((wanted == action.numpy()).all(axis=1).any() for batch in batches for action in batch.action)
    with pytest.raises(DemoError, match="no step to learn from without the last 9 of each trajectory"):
        StepSampler(held, 0, end_steps=9)
    two = make_set(
        tmp_path / "two", cabinet_0002=[Episode("link_0", steps=5)], cabinet_0003=[Episode("link_0", steps=3)]
    )
    with pytest.raises(DemoError, match="1 of 2 pairs of object and target have no step without the last 3"):
        StepSampler(two, 0, end_steps=3)


def test_disturbed_steps_are_weighted_0_where_what_follows_counts(training_set: TrainingSet) -> None:
    sampler = StepSampler(training_set, 0, disturbed=True)
    assert {one for number in range(50) for one in sampler.draw(number, 12).tolist()} == set(range(11))
    weights = torch.cat([batch.weight for batch in take(20, training_set, 12, seed=0, needs_next=True)])
    assert set(weights.tolist()) == {0.0, 1.0}


def test_a_set_with_nothing_to_imitate(tmp_path: Path) -> None:
    training_set = make_set(tmp_path, cabinet_0002=[Episode("link_0", steps=2, disturbed=(0, 1))])
    with pytest.raises(DemoError, match="has no step to learn from"):
        BatchLoader(training_set, 4, seed=0)
    assert len(take(1, training_set, 4, seed=0, needs_next=True)[0].action) == 4


def test_an_error_of_a_reader_arrives(tmp_path: Path) -> None:
    training_set = make_set(tmp_path)
    with (training_set.folder / FRAMES).open("r+b") as file:
        file.truncate(10)
    with (
        BatchLoader(training_set, 4, seed=0) as loader,
        pytest.raises(DemoError, match=r"frames\.bin' was truncated while it was read"),
    ):
        next(loader)


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"batch_size": 0}, "the batch size must be at least 1, not 0"),
        ({"rank": 2, "world_size": 2}, r"the rank must lie in \[0, 1\], not 2"),
        ({"world_size": 3}, "a batch of 8 cannot be split among 3 processes alike"),
        ({"start_step": -1}, "the first batch's number must be at least 0, not -1"),
        ({"seed": -1}, "the seed must be at least 0, not -1"),
    ],
)
def test_illegal_numbers(numbers: dict[str, int], message: str, training_set: TrainingSet) -> None:
    with pytest.raises(ConfigError, match=message):
        BatchLoader(training_set, **{"batch_size": 8, "seed": 0, **numbers})

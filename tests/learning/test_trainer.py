# ruff: noqa: E402
import csv
import errno
import math
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

torch = pytest.importorskip("torch")

from tests.learning.tiny_set import tiny_config

from artiskill.errors import RunError
from artiskill.learning import run as run_module
from artiskill.learning.bc import BC
from artiskill.learning.run import BEST, LATEST
from artiskill.learning.stopping import StopSignal
from artiskill.learning.train import TrainData, train
from artiskill.learning.trainer import Trainer

Weights = dict[str, Any]


@pytest.fixture
def go(tiny_set: Path, tmp_path: Path) -> Callable[..., Trainer]:
    """Train in a folder with a name."""

    def start(
        name: str, algorithm: str = "bc", develop: Any = None, on_step: Any = None, **values: Any
    ) -> Trainer:
        return train(
            tiny_config(algorithm, **values),
            TrainData(tiny_set),
            tmp_path / name,
            device="cpu",
            threads=1,
            make_develop=None if develop is None else lambda info: develop,
            on_step=on_step or (lambda step, text: None),
        )

    return start


def stop_at(number: int) -> Callable[[int, str], None]:
    """Ctrl-C after a step."""
    return lambda step, text: os.kill(os.getpid(), signal.SIGINT) if step == number else None


def content(path: Path) -> Weights:
    return torch.load(path, weights_only=True)


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return [{key: value for key, value in row.items() if key != "seconds"} for row in csv.DictReader(file)]


def assert_same(one: Any, other: Any) -> None:
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for key in one:
            assert_same(one[key], other[key])
    elif isinstance(one, torch.Tensor):
        assert torch.equal(one, other)
    else:
        assert one == other


@pytest.mark.parametrize("algorithm", ["bc", "bcq", "td3bc"])
def test_a_stopped_run_goes_on_bit_for_bit(go: Callable[..., Trainer], tmp_path: Path, algorithm: str) -> None:
    values = {"ema": 0.9, "schedule": "cosine"}
    go("whole", algorithm, **values)
    with pytest.raises(KeyboardInterrupt, match="interrupted after step 7, which is saved"):
        go("parts", algorithm, on_step=stop_at(7), **values)
    assert content(tmp_path / "parts" / LATEST)["state"]["step"] == 7
    go("parts", algorithm, **values)
    whole, parts = (content(tmp_path / name / LATEST) for name in ("whole", "parts"))
    for part in ("weights", "average", "optimizers"):
        assert_same(whole[part], parts[part])
    assert rows(tmp_path / "whole" / "metrics.csv") == rows(tmp_path / "parts" / "metrics.csv")
    assert [row["step"] for row in rows(tmp_path / "whole" / "metrics.csv")] == ["5", "10", "15", "20"]


def test_dropout_goes_on_bit_for_bit(go: Callable[..., Trainer], tmp_path: Path) -> None:
    transformer = {"width": 8, "blocks": 1, "heads": 1, "head_width": 8, "feedforward": 8, "dropout": 0.5}
    values = {"network__kind": "pointnet_transformer", "network__transformer": transformer, "steps": 6}
    go("whole", **values)
    with pytest.raises(KeyboardInterrupt):
        go("parts", on_step=stop_at(3), **values)
    go("parts", **values)
    assert_same(*(content(tmp_path / name / LATEST)["weights"] for name in ("whole", "parts")))


def test_more_steps_continue_as_if_they_had_been_asked_for(go: Callable[..., Trainer], tmp_path: Path) -> None:
    go("whole", steps=20)
    go("parts", steps=12)
    go("parts", steps=20)
    assert_same(*(content(tmp_path / name / LATEST)["weights"] for name in ("whole", "parts")))
    assert go("parts", steps=20).state.step == 20  # nothing is left to do
    with pytest.raises(RunError, match=r"steps 20 there, 12 here"):
        go("parts", steps=12)


def test_seeds_differ(go: Callable[..., Trainer]) -> None:
    one, other = (go(f"seed-{seed}", seed=seed).algorithm.state_dict() for seed in (0, 1))
    assert any(not torch.equal(one[name], other[name]) for name in one)


def test_training_learns(go: Callable[..., Trainer], tmp_path: Path) -> None:
    go("run", steps=300, algorithm__learning_rate=0.01, log_every=50)
    losses = [float(row["imitation_loss"]) for row in rows(tmp_path / "run" / "metrics.csv")]
    assert losses[-1] < 0.5 * losses[0]


def test_learning_rates_follow_the_cosine(go: Callable[..., Trainer], tmp_path: Path) -> None:
    go("run", schedule="cosine", steps=4, log_every=1, algorithm__learning_rate=1.0)
    rates = [float(row["learning_rate"]) for row in rows(tmp_path / "run" / "metrics.csv")]
    half = math.sqrt(0.5)
    assert rates == pytest.approx([1.0, (1 + half) / 2, 0.5, (1 - half) / 2])


def test_averaged_weights_follow(go: Callable[..., Trainer], tmp_path: Path) -> None:
    start = {
        name: one.clone()
        for name, one in go("zero", steps=1, algorithm__learning_rate=1e-30).algorithm.state_dict().items()
    }
    go("run", steps=1, ema=0.75, algorithm__learning_rate=0.1)
    found = content(tmp_path / "run" / LATEST)
    for name, value in found["average"].items():
        torch.testing.assert_close(value, 0.75 * start[name] + 0.25 * found["weights"][name])


class Successes:
    """Development objects whose successes are given, by step."""

    def __init__(self, **by_step: int) -> None:
        self.by_step, self.seen = by_step, []

    def __call__(self, weights: Path, stop: StopSignal) -> list[tuple[str, int, int]]:
        step = content(weights)["state"]["step"]
        self.seen.append(step)
        return [("generated-cabinet-1", 4, self.by_step[f"at_{step}"])]


def test_success_on_development_objects_picks_the_checkpoint(go: Callable[..., Trainer], tmp_path: Path) -> None:
    develop = Successes(at_6=1, at_12=3, at_18=2, at_20=3)
    state = go("run", develop=develop, development__every=6).state
    assert develop.seen == [6, 12, 18, 20]
    assert (state.best_step, state.best_successes) == (20, 3)  # of equal ones the latest
    found = rows(tmp_path / "run" / "development.csv")
    assert [(row["step"], row["successes"]) for row in found] == [
        ("6", "1"),
        ("12", "3"),
        ("18", "2"),
        ("20", "3"),
    ]
    again = go("run", develop=Successes(at_26=2, at_24=0), development__every=6, steps=26).state
    assert (again.best_step, again.best_successes) == (20, 3)
    assert content(tmp_path / "run" / BEST)["state"]["step"] == 20


def test_an_interrupted_measurement_is_made_anew(go: Callable[..., Trainer], tmp_path: Path) -> None:
    def develop(weights: Path, stop: StopSignal) -> list[tuple[str, int, int]]:
        os.kill(os.getpid(), signal.SIGTERM)
        stop.check()
        raise AssertionError

    with pytest.raises(KeyboardInterrupt, match="after step 6"):
        go("run", develop=develop, development__every=6)
    finished = Successes(at_6=1, at_12=0, at_18=0, at_20=0)
    go("run", develop=finished, development__every=6)
    assert finished.seen == [6, 12, 18, 20]


def test_a_loss_that_is_no_number_ends_the_run(
    go: Callable[..., Trainer], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    update = BC.update

    def spoilt(self: BC, batch: Any, step: int, *rest: Any) -> Any:
        found = update(self, batch, step, *rest)
        return found | {"imitation_loss": found["imitation_loss"] * math.nan} if step == 13 else found

    monkeypatch.setattr(BC, "update", spoilt)
    with pytest.raises(RunError, match=r"a loss is not finite in step 14.*the checkpoint of step 10 is kept"):
        go("run")
    assert content(tmp_path / "run" / LATEST)["state"]["step"] == 10


def test_a_full_disk_loses_nothing(
    go: Callable[..., Trainer], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fsync = os.fsync

    def full(handle: int) -> None:
        if "checkpoints" in os.readlink(f"/proc/self/fd/{handle}") and calls.pop(0):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        fsync(handle)

    calls = [False, True]
    monkeypatch.setattr(run_module.os, "fsync", full)
    with pytest.raises(RunError, match=r"cannot write to '.*run': No space left on device; what was saved"):
        go("run")
    assert sorted(path.name for path in (tmp_path / "run" / "checkpoints").iterdir()) == ["latest.pt"]
    assert content(tmp_path / "run" / LATEST)["state"]["step"] == 10
    monkeypatch.undo()
    assert go("run").state.step == 20

"""Minutes of cells: by tables until a cell of the same row has been trained on the same machine."""

import json
from pathlib import Path

import pytest

from learning_tables.cells import A, B, Cell, Method, Resources, Settings, place_of
from learning_tables.estimates import ACT_S, CORE_RATES, LENGTH, STEP_S, Estimator, describe_machine

SMALL = Method("small", "bc")
RESOURCES = Resources("cpu", "float32", workers=2, threads=1)
FIRST, SECOND = Cell(A, SMALL, "10", 0), Cell(A, SMALL, "30", 0)


@pytest.fixture
def estimator(tmp_path: Path, settings: Settings) -> Estimator:
    return Estimator([FIRST, SECOND], settings, tmp_path, RESOURCES)


def test_rates_of_elsewhere_hold_until_there_are_own_ones(
    tmp_path: Path, settings: Settings, estimator: Estimator
) -> None:
    before = estimator.estimate(SECOND)
    assert before.training == pytest.approx(20 * 8 / CORE_RATES["small"]["bc"] / 60)
    assert before.measuring == pytest.approx(5 * LENGTH * (STEP_S + ACT_S["small"]) / 2 / 60)
    assert before.data > 0
    assert not before.is_measured

    noted = {"seconds": 40.0, "samples": 80, "machine": "1 core"}
    trained = place_of(FIRST, tmp_path).trained
    trained.parent.mkdir(parents=True)
    trained.write_text(json.dumps(noted))
    estimator.learn(FIRST)
    after = estimator.estimate(SECOND)
    assert after.training == pytest.approx(20 * 8 / 2.0 / 60)
    assert after.is_measured

    left = estimator.estimate(FIRST)
    assert (left.training, left.data) == (0.0, 0.0)
    assert left.measuring > 0


def test_a_machine_is_described_by_the_cores_that_train() -> None:
    assert describe_machine(RESOURCES) == "1 core"
    assert describe_machine(RESOURCES._replace(threads=3)) == "3 cores"


def test_rates_of_another_machine_are_not_own_ones(tmp_path: Path, estimator: Estimator) -> None:
    trained = place_of(FIRST, tmp_path).trained
    trained.parent.mkdir(parents=True)
    trained.write_text(json.dumps({"seconds": 40.0, "samples": 80, "machine": "a large GPU"}))
    estimator.learn(FIRST)
    assert not estimator.estimate(SECOND).is_measured


def test_a_task_has_demonstrations_of_every_training_object(settings: Settings, estimator: Estimator) -> None:
    chair = estimator.estimate(Cell(B, SMALL, "PushChair", 0))  # one object, three demonstrations
    drawer = estimator.estimate(SECOND)
    assert chair.data == pytest.approx(drawer.data * 3 / 30)

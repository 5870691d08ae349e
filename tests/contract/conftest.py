"""The tasks and objects that the contract runs over: a sample in `make test`, all of them in `make test-slow`."""

import os
from pathlib import Path

import pytest

from artiskill.assets.catalog import list_objects
from artiskill.tasks.registry import task_names


def first(task: str, split: str) -> str:
    return list_objects(split=split, task=task)[0]


# of each task an object that policies train on or one that they never see, and some that are in no catalogue
SAMPLE = (
    ("OpenCabinetDrawer", first("OpenCabinetDrawer", "train")),
    ("OpenCabinetDrawer", first("OpenCabinetDrawer", "test")),
    ("OpenCabinetDrawer", "generated:5"),
    ("OpenCabinetDoor", first("OpenCabinetDoor", "test")),
    ("PushChair", first("PushChair", "train")),
    ("PushChair", "generated:2"),
    ("MoveBucket", first("MoveBucket", "train")),
    ("MoveBucket", first("MoveBucket", "ood")),
)


# real objects of PartNet-Mobility, for who has them: the data set may not be handed on
REAL = (("OpenCabinetDoor", "partnet:40147"), ("OpenCabinetDrawer", "partnet:40147"), ("PushChair", "partnet:179"))
DATASET = "PARTNET_MOBILITY_DATASET"
_beside = Path(__file__).resolve().parents[3] / "shared" / "partnet_mobility"
if (_beside / "40147").is_dir():
    os.environ.setdefault(DATASET, str(_beside))


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Tests that take `task` and `object_id` run over the sample, and over all else when slow ones run."""
    if "object_id" in metafunc.fixturenames:
        every = [
            (t, i) for t in task_names() for split in ("all", "ood") for i in list_objects(split=split, task=t)
        ]
        rest = [pytest.param(*case, marks=pytest.mark.slow) for case in every if case not in SAMPLE]
        missing = pytest.mark.skipif(
            DATASET not in os.environ, reason=f"set {DATASET} to try objects 40147 and 179"
        )
        rest += [pytest.param(*case, marks=[pytest.mark.slow, missing]) for case in REAL]
        metafunc.parametrize(("task", "object_id"), [*SAMPLE, *rest])

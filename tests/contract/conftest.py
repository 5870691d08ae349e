"""The objects that the contract runs over: a sample in `make test`, all of them in `make test-slow`."""

import pytest

from artiskill.assets.catalog import list_objects

# a training and a test cabinet, and one that is in no catalogue
SAMPLE = (
    *list_objects(split="train", task="OpenCabinetDrawer")[:1],
    *list_objects(split="test", task="OpenCabinetDrawer")[:1],
    "generated:7",
)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Tests that take `object_id` run over the sample, and over the rest of the catalogue when slow ones run."""
    if "object_id" in metafunc.fixturenames:
        rest = [i for i in list_objects(task="OpenCabinetDrawer") if i not in SAMPLE]
        slow = [pytest.param(i, marks=pytest.mark.slow) for i in rest]
        metafunc.parametrize("object_id", [*SAMPLE, *slow])

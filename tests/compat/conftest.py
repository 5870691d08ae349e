"""Episodes that are known: an expert's, with their actions."""

import pytest

import artiskill
from artiskill.evaluation.report import Report

TASK, OBJECTS, LEVELS = "OpenCabinetDrawer", ["cabinet-0002", "cabinet-0007"], 2


@pytest.fixture(scope="package")
def report() -> Report:
    """Of the expert; its episodes are in the order of objects, then levels."""
    return artiskill.evaluate(TASK, "expert", OBJECTS, LEVELS, config={"episode_steps": 60})

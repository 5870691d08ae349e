"""A server without a browser, and episodes."""

from collections.abc import Iterator
from typing import Any

import pytest

from artiskill.evaluation.pictures import EpisodeChoice
from artiskill.viewer import serving


@pytest.fixture
def server() -> Iterator[Any]:
    pytest.importorskip("viser")
    with serving(port=0) as started:
        yield started


@pytest.fixture
def choice() -> EpisodeChoice:
    return EpisodeChoice("OpenCabinetDrawer", "cabinet-0002", level=3)

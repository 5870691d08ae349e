"""A server without a browser, and episodes."""

import gc
import warnings
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
    started._websock_server._server_thread.join(60)
    with warnings.catch_warnings():  # viser leaves sockets to the collector, which would blame a later test
        warnings.simplefilter("ignore", ResourceWarning)
        del started
        gc.collect()


@pytest.fixture
def choice() -> EpisodeChoice:
    return EpisodeChoice("OpenCabinetDrawer", "cabinet-0002", level=3)

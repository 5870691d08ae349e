"""Fixtures of the tests that need torch."""

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def tiny_set(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tiny training set; to be read only."""
    from tests.learning.tiny_set import write_tiny_set

    return write_tiny_set(tmp_path_factory.mktemp("learning") / "set")

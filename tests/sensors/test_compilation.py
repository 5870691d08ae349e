import logging
import time

import pytest

from artiskill.sensors import compilation
from artiskill.sensors.compilation import announce_compilation


@pytest.fixture
def impatient(monkeypatch, caplog):
    """A process in which nothing is compiled yet and whose patience is short."""
    monkeypatch.setattr(compilation, "_PATIENCE_S", 0.01)
    monkeypatch.setattr(compilation, "_ready", set())
    caplog.set_level(logging.INFO, "artiskill.sensors")
    return caplog


def test_a_long_first_call_says_what_it_is_doing(impatient):
    with announce_compilation("a thing"):
        time.sleep(0.2)
    assert [record.getMessage()[:17] for record in impatient.records] == ["compiling a thing"]
    with announce_compilation("a thing"):
        time.sleep(0.1)
    assert len(impatient.records) == 1


def test_a_call_that_fails_is_not_counted(impatient):
    with pytest.raises(ValueError, match="broken"), announce_compilation("a thing"):
        raise ValueError("broken")
    with announce_compilation("a thing"):
        time.sleep(0.2)
    assert len(impatient.records) == 1

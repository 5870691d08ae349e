import pickle
from collections.abc import Callable

import pytest

from artiskill.errors import PolicyError
from artiskill.jobs.ray_driver import NodeOutcome, do_at_node, facts
from artiskill.jobs.worker import pack
from artiskill.versions import versions

Send = Callable[[object], None]


def count_down(job: int, send: Send) -> str:
    for number in range(job, 0, -1):
        send(number)
    return "lift-off"


def stumble(job: int, send: Send) -> None:
    send("before")
    raise PolicyError(f"job {job} stumbled")


def played(packed: bytes, expected: dict[str, str]) -> NodeOutcome:
    return pickle.loads(do_at_node(packed, expected))


def test_a_job_is_done() -> None:
    outcome = played(pack(count_down, 3), facts())
    assert (outcome.kind, outcome.value, outcome.messages) == ("done", "lift-off", [3, 2, 1])
    assert outcome.node


def test_a_job_fails() -> None:
    outcome = played(pack(stumble, 7), facts())
    error, text = outcome.value
    assert (outcome.kind, outcome.messages) == ("failed", ["before"])
    assert isinstance(error, PolicyError)
    assert str(error) == "job 7 stumbled"
    assert "in stumble\n" in text


def test_a_job_that_cannot_be_unpacked_fails() -> None:
    packed = pack(count_down, 3).replace(b"count_down", b"count_abcd")
    outcome = played(packed, facts())
    assert outcome.kind == "failed"
    assert isinstance(outcome.value[0], AttributeError)


def test_another_installation_does_nothing() -> None:
    """Not even unpack, which may need what is not there."""
    expected = facts() | {"numpy": "1.0", "code of artiskill": "0" * 12}
    outcome = played(b"no pickle", expected)
    assert outcome.kind == "different"
    assert outcome.value == (
        f"code of artiskill {facts()['code of artiskill']} there, {'0' * 12} here, "
        f"numpy {facts()['numpy']} there, 1.0 here"
    )
    outcome = played(b"no pickle", facts() | {"torch": "3.0"})
    assert outcome.value == "torch None there, 3.0 here"


def test_facts_are_versions_and_the_code(monkeypatch: pytest.MonkeyPatch) -> None:
    assert versions().items() < facts().items()
    facts.cache_clear()
    before = facts()
    facts.cache_clear()
    monkeypatch.setattr("artiskill.jobs.ray_driver._SOURCES", (".yaml",))
    assert facts() != before
    facts.cache_clear()

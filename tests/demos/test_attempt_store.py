"""Attempts on their way into a file: whose they are, and what is wrong with them."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from artiskill.assets.catalog import load_object
from artiskill.demos.collect import AttemptStore, collect
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demonstrator import DemoAttempt
from artiskill.demos.demos import UNFINISHED
from artiskill.demos.plan import CollectionPlan
from artiskill.errors import DemoError

from .conftest import begin, contents

MakePlan = Callable[..., CollectionPlan]


def restage(folder: Path, **changes: object) -> None:
    """Change what a staged attempt says about itself."""
    path = sorted((folder / UNFINISHED / "cabinet-0002").glob("*.npz"))[0]
    with np.load(path) as file:
        arrays = dict(file)
    arrays["about"] = np.array(json.dumps(json.loads(str(arrays["about"])) | changes))
    np.savez(path, **arrays)


@pytest.mark.parametrize(
    "changes",
    [
        *({"target": "../../up"}, {"level": -2}, {"object": "cabinet-0026"}),
        *({"level": "x"}, {"success": "yes"}, {"steps": 1.5}, {"fault": None}, {"target": 3}),
    ],
)
def test_attempts_that_nobody_would_make_count_for_nothing(
    drawers: Path, plan: MakePlan, tmp_path: Path, changes: dict[str, object]
) -> None:
    begin(plan(), tmp_path, 2)
    restage(tmp_path, **changes)
    collect(plan(), tmp_path)
    assert contents(tmp_path) == contents(drawers)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("settings_hash", "attempts made with other settings: their hash was 0000, now it is [0-9a-f]{16};"),
        ("content_hash", "attempts made with another 'cabinet-0002': its content hash was 0000, now it is"),
    ],
)
def test_attempts_of_others_are_refused(plan: MakePlan, tmp_path: Path, change: str, message: str) -> None:
    begin(plan(), tmp_path, 2)
    restage(tmp_path, **{change: "0000"})
    with pytest.raises(DemoError, match=message):
        collect(plan(), tmp_path)


def test_two_objects_of_one_name_do_not_mix(plan: MakePlan, tmp_path: Path) -> None:
    """An imported object that was changed between two runs keeps its id."""
    mine = dataclasses.replace(load_object("cabinet-0002"), id="mine")
    changed = dataclasses.replace(mine, metadata=dict(mine.metadata) | {"edition": 2})
    begin(plan(objects=[mine]), tmp_path, 2)
    with pytest.raises(DemoError, match=r"mine' holds attempts made with another 'mine': its content hash was"):
        collect(plan(objects=[changed]), tmp_path)
    assert collect(plan(objects=[mine]), tmp_path).files["mine.h5"].content_hash == mine.content_hash


def test_a_spoilt_attempt_is_made_again(plan: MakePlan, drawers: Path, tmp_path: Path) -> None:
    """Spoilt before the next run, or between an attempt and the end of its object."""
    spoilt = []

    def spoil(attempt: object) -> None:
        if not spoilt:
            spoilt.extend((tmp_path / UNFINISHED / "cabinet-0002").glob("*.npz"))
            spoilt[0].write_bytes(spoilt[0].read_bytes()[:100])

    with pytest.raises(DemoError, match=r"1 of 3 attempts at 'cabinet-0002' were damaged.*makes them again"):
        collect(plan(), tmp_path, on_attempt=spoil)
    collect(plan(), tmp_path)
    assert contents(tmp_path) == contents(drawers)


def test_whatever_is_wrong_with_a_staged_file_it_was_never_made(drawers: Path, tmp_path: Path) -> None:
    store = AttemptStore(tmp_path, "settings")
    with DemoFile(drawers / "cabinet-0002.h5") as file:
        first = file[0]
    attempt = DemoAttempt("cabinet-0002", first.target, first.level, True, len(first), "", first.recording)
    store.save(attempt, "object")
    (path,) = (tmp_path / UNFINISHED).rglob("*.npz")
    whole, rng = path.read_bytes(), np.random.default_rng(0)
    (found,) = store.load("cabinet-0002", "object")
    np.testing.assert_array_equal(found.recording.states, first.recording.states)
    for k in range(900):
        data = bytearray(whole)
        if k % 4 == 0:
            data = data[: rng.integers(len(data))]
        else:  # anywhere, in the first header, or in the directory at the end
            where = (int(rng.integers(len(data))), int(rng.integers(900)), len(data) - 1 - int(rng.integers(900)))
            data[where[k % 4 - 1]] ^= 1 << int(rng.integers(8))
        path.write_bytes(data)
        for one in store.load("cabinet-0002", "object"):
            assert one.recording is not None
            told = (one.target, one.level, one.success, one.steps)
            assert told == (first.target, first.level, True, len(first))
            np.testing.assert_array_equal(one.recording.actions, first.actions)


def test_a_success_that_was_not_recorded_is_none(tmp_path: Path) -> None:
    store = AttemptStore(tmp_path, "settings")
    for level, success in enumerate((False, True)):
        store.save(DemoAttempt("cabinet-0002", "link_0", level, success, 9, "", None), "object")
    assert [one.level for one in store.load("cabinet-0002", "object")] == [0]

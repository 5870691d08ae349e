"""The replays that the documents link: there, small, and what the expert does today."""

import re
from pathlib import Path
from typing import Any

import pytest
from tests.viewer.test_pages import recording_of
from tools.make_pictures import REPLAYS, STRIPS, make_replay, snake

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("task", STRIPS)
def test_every_task_has_a_small_replay_that_is_linked(task: str) -> None:
    name, (object_id, level) = f"{snake(task)}.html", STRIPS[task]
    page = (REPLAYS / name).read_text(encoding="utf-8")
    assert len(page) < 3e6
    assert re.search(f"<title>{task}: {object_id}, .*level {level}, expert</title>", page)
    assert f"docs/replays/{name}" in (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"replays/{name}" in (ROOT / "docs" / "viewer.md").read_text(encoding="utf-8")


def test_replays_are_small_together() -> None:
    assert sum(path.stat().st_size for path in REPLAYS.iterdir()) < 4.5e6
    assert {path.name for path in REPLAYS.iterdir()} == {f"{snake(task)}.html" for task in STRIPS}


@pytest.mark.slow
@pytest.mark.parametrize("task", STRIPS)
def test_replays_are_current(task: str, tmp_path: Path) -> None:
    """What is played must be the same, but for its last bits, which another processor gives otherwise."""
    pytest.importorskip("viser")
    made, stored = (played(path) for path in (make_replay(task, tmp_path), REPLAYS / f"{snake(task)}.html"))
    again = "run `python tools/make_pictures.py replays`"
    assert made.keys() == stored.keys(), again
    for name, values in made.items():
        assert len(values) == len(stored[name]), again
        for value, other in zip(values, stored[name], strict=True):
            assert value == pytest.approx(other, abs=0.002), f"{name}: {again}"


def played(path: Path) -> dict[str, list[Any]]:
    """Return what a page plays: its length, and every node's times, poses and captions."""
    recording = recording_of(path.read_text(encoding="utf-8"))
    found: dict[str, list[Any]] = {"seconds": [recording["durationSeconds"]]}
    for time_s, message in recording["messages"]:
        for what in ("position", "wxyz"):
            if message["type"].startswith("Set") and what in message:
                found.setdefault(f"{message.get('name', message['type'])} {what}", []).append(
                    [time_s, *message[what]]
                )
        if "text" in message.get("updates", {}):
            found.setdefault("caption", []).append(message["updates"]["text"])
    return found

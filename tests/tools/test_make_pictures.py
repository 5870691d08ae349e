"""The replays that the documents link: there, small, and what the expert does today."""

import re
from pathlib import Path

import pytest
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
    """Another version of viser may bring another client; what is played must be the same."""
    pytest.importorskip("viser")
    made, stored = (played(path) for path in (make_replay(task, tmp_path), REPLAYS / f"{snake(task)}.html"))
    assert made == stored, "run `python tools/make_pictures.py replays`"


def played(path: Path) -> str:
    """Return the recording in a page, as it is packed."""
    found = re.search(r'__VISER_EMBED_DATA__="([^"]+)"', path.read_text(encoding="utf-8"))
    assert found is not None
    return found[1]

"""A small collection of drawers, made once."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artiskill.demos.collect import collect
from artiskill.demos.plan import CollectionOptions, CollectionPlan, make_plan
from artiskill.demos.settings import load_demos_config

OBJECTS = ["cabinet-0002", "cabinet-0026"]  # with one drawer, and with two
PER_OBJECT = 3
CONFIG = load_demos_config({"store.key_frame_steps": 30, "patience.attempts": 4, "block_levels": 2})


def drawer_plan(**changes: Any) -> CollectionPlan:
    """A plan of the small collection, or one that differs from it."""
    values = {"task": "OpenCabinetDrawer", "objects": OBJECTS, "per_object": PER_OBJECT, "demos_config": CONFIG}
    values |= changes
    of_plan = {name: values.pop(name) for name in ("task", "objects", "config", "demos_config") if name in values}
    return make_plan(**of_plan, options=CollectionOptions(**values))


@pytest.fixture(scope="session")
def drawers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small collection; to be read only."""
    folder = tmp_path_factory.mktemp("demos") / "drawers"
    collect(drawer_plan(), folder)
    return folder


@pytest.fixture
def own_drawers(drawers: Path, tmp_path: Path) -> Path:
    """A copy of it for whoever changes it."""
    return Path(shutil.copytree(drawers, tmp_path / "drawers"))


@pytest.fixture
def plan() -> Callable[..., CollectionPlan]:
    """`drawer_plan`."""
    return drawer_plan


def contents(folder: Path) -> dict[str, bytes]:
    """All files of a folder."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


class Stop(Exception):  # noqa: N818 - no error
    """Ends a collection."""


def begin(made: CollectionPlan, folder: Path, attempts: int) -> None:
    """Collect, and stop after so many attempts."""
    heard = []

    def on_attempt(attempt: object) -> None:
        heard.append(attempt)
        if len(heard) == attempts:
            raise Stop

    with pytest.raises(Stop):
        collect(made, folder, on_attempt=on_attempt)


def put(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Any], None]:
    """What changes one array of a trajectory's group in a file."""

    def do(group: Any) -> None:
        values = change(group[name][()])
        del group[name]
        group[name] = values

    return do

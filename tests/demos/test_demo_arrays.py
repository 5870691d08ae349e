"""Demonstrations that somebody has changed and signed again: what their arrays must be."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artiskill.demos.demo_file import DemoFile
from artiskill.demos.hdf5 import load_h5py
from artiskill.errors import DemoError

from .conftest import put

ARRAYS = ("actions", "disturbed", "rewards", "flags", "digests", "states", "key_frames")


def wrong(values: np.ndarray) -> np.ndarray:
    values[1] = np.nan
    return values


@pytest.mark.parametrize(
    ("change", "message"),
    [
        *((put(name, lambda values: values[:1]), r"\w+ are \w+ \(.*\), not") for name in ARRAYS),
        *((put(name, lambda values: values.astype(np.int8)), rf"{name} are int8") for name in ARRAYS),
        *(
            (put(name, wrong), f"{name} have numbers that are not finite")
            for name in ("actions", "rewards", "states", "key_frames")
        ),
        (
            put("actions", lambda values: values[:, :-1]),
            r"actions are float32 \(\d+, 12\), not float32 \(\d+, 13\)",
        ),
        (lambda group: group.attrs.__setitem__("level", -5), "a level is an integer from 0 to .*, not .*-5"),
        (lambda group: group.attrs.__setitem__("target", "link_99"), "unknown target 'link_99'; did you mean"),
    ],
)
def test_trajectories_are_checked(own_drawers: Path, change: Callable[[Any], None], message: str) -> None:
    path = own_drawers / "cabinet-0002.h5"
    with load_h5py().File(path, "r+") as file:
        change(file["traj_1"])
    with DemoFile(path) as demos:
        demos.trajectory(0)
        with pytest.raises(DemoError, match=rf"cabinet-0002.h5' is damaged: cannot read trajectory 1 \({message}"):
            demos.trajectory(1)

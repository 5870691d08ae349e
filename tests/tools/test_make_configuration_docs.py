"""docs/configuration.md says what is true: its tables are those of the code, and its own code runs."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium as gym
import numpy as np
import pytest


@pytest.fixture
def tool(load_tool: Callable[[str], ModuleType]) -> ModuleType:
    return load_tool("make_configuration_docs")


def test_the_page_is_up_to_date(tool: ModuleType) -> None:
    assert tool.main(["--check"]) == 0, "run python tools/make_configuration_docs.py"


def test_an_old_page_is_noticed(tool: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = tmp_path / "configuration.md"
    page.write_text(tool.PAGE.read_text(encoding="utf-8").replace("| 0.002 |", "| 0.003 |"), encoding="utf-8")
    monkeypatch.setattr(tool, "PAGE", page)
    assert tool.main(["--check"]) == 1
    assert tool.main([]) == 0
    assert tool.main(["--check"]) == 0


def test_every_row_is_whole(tool: ModuleType) -> None:
    made = tool.made_part()
    rows = [row.strip("|").split("|") for row in made.splitlines() if row.startswith("| `")]
    assert len(rows) > 120
    for key, kind, _, _, meaning in rows:
        assert kind.strip(), key
        assert meaning.strip(), key
    for key in (
        "robot.drives.arm_damping",
        "render.sun.strength",
        "physics.solver",
        "initial.lift_m",
        "reward.weights",
    ):
        assert f"| `{key}` |" in made
    assert "| `physics.timestep_s` | number | s | 0.002 |" in made
    assert "| `robot.drives.base_damping` | number | N s/m | 1000 |" in made


def test_a_key_without_meaning_is_refused(tool: ModuleType) -> None:
    @dataclass(frozen=True)
    class Silent:
        """Nothing is said.

        Attributes:
            told: something,
                on two lines.
        """

        told: float
        untold: float

    with pytest.raises(KeyError, match="Silent says nothing of untold"):
        tool.meanings_of(Silent)

    @dataclass(frozen=True)
    class Loud(Silent):
        """Adds what was missing.

        Attributes:
            untold: now it is.
        """

    assert tool.meanings_of(Loud) == {"told": "something, on two lines.", "untold": "now it is."}


def test_the_code_of_the_page_runs(tool: ModuleType) -> None:
    names: dict[str, Any] = {"gym": gym}
    blocks = re.findall(r"```python\n(.*?)```", tool.PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 2
    exec(blocks[0], names)
    assert names["env"].unwrapped.task.physics.timestep_s == 0.001
    exec(blocks[1], names)
    env = names["env"].unwrapped
    seen, _ = env.reset(seed=0)
    env = gym.make("ArtiSkill/OpenCabinetDrawer-v0", objects=[names["cabinet"]], obs_mode="rgbd")
    plain, _ = env.reset(seed=0)
    np.testing.assert_array_equal(seen["rgbd"]["depth"], plain["rgbd"]["depth"])
    link = plain["rgbd"]["seg"][..., 1]
    front = seen["rgbd"]["rgb"][..., :3][link]
    assert len(front) > 50
    assert (front[:, 0] > 1.5 * front[:, 1]).mean() > 0.9, "the drawer is red now"
    assert (plain["rgbd"]["rgb"][..., :3][link] != front).any()

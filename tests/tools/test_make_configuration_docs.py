"""docs/data/configuration.csv says what is true."""

import csv
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture
def tool(load_tool: Callable[[str], ModuleType]) -> ModuleType:
    return load_tool("make_configuration_docs")


def test_the_page_is_up_to_date(tool: ModuleType) -> None:
    assert tool.main(["--check"]) == 0, "run python tools/make_configuration_docs.py"


def test_an_old_table_is_noticed(tool: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = tmp_path / "configuration.csv"
    page.write_text(tool.PAGE.read_text(encoding="utf-8").replace(",0.002,", ",0.003,"), encoding="utf-8")
    monkeypatch.setattr(tool, "PAGE", page)
    assert tool.main(["--check"]) == 1
    assert tool.main([]) == 0
    assert tool.main(["--check"]) == 0


def test_every_row_is_whole(tool: ModuleType) -> None:
    rows = {row["key"]: row for row in csv.DictReader(tool.table_text().splitlines())}
    assert len(rows) > 120
    for key, row in rows.items():
        assert row["type"].strip(), key
        assert row["meaning"].strip(), key
    for key in ("robot.drives.arm_damping", "render.sun.strength", "initial.lift_m", "reward.weights"):
        assert rows[key]["tasks"] == "all"
    assert rows["physics.timestep_s"]["default"] == "0.002"
    assert rows["physics.timestep_s"]["unit"] == "s"
    assert rows["robot.drives.base_damping"]["unit"] == "N s/m"
    assert rows["success.open_fraction"]["tasks"] == "OpenCabinetDoor, OpenCabinetDrawer"


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

"""`make_scaled_objects.py`: objects of other sizes, each by its own factor."""

from pathlib import Path

import pytest
from tests.tools.conftest import LoadTool

from artiskill.assets.catalog import load_object, resolve_objects
from artiskill.assets.scaling import scaled

CHAIRS = ["generated:chair:3000000", "generated:chair:3000001"]


def run(load_tool: LoadTool, out: Path, *objects: str, scale: tuple[str, str] = ("1.1", "1.3")) -> int:
    tool = load_tool("make_scaled_objects")
    options = ["--objects", *objects, "--task", "PushChair", "--scale", *scale, "--out", str(out)]
    return int(tool.main(options))


def test_the_list_names_what_evaluation_takes(load_tool: LoadTool, tmp_path: Path) -> None:
    assert run(load_tool, tmp_path / "both", *CHAIRS) == 0
    found = resolve_objects([str(tmp_path / "both" / "objects.yaml")], task="PushChair")
    factors = []
    for name, one in zip(CHAIRS, found, strict=True):
        assert not isinstance(one, str)
        factors.append(one.metadata["scale"])
        assert one.content_hash == scaled(load_object(name), factors[-1]).content_hash
    assert factors[0] != factors[1]
    assert all(1.1 <= factor <= 1.3 for factor in factors)

    assert run(load_tool, tmp_path / "one", CHAIRS[1]) == 0
    (alone,) = resolve_objects([str(tmp_path / "one" / "objects.yaml")], task="PushChair")
    assert not isinstance(alone, str)
    assert alone.metadata["scale"] == factors[1], "whatever else is named"


def test_a_range_of_one_factor(load_tool: LoadTool, tmp_path: Path) -> None:
    assert run(load_tool, tmp_path, CHAIRS[0], scale=("1.234", "1.234")) == 0
    (found,) = resolve_objects([str(tmp_path / "objects.yaml")], task="PushChair")
    assert not isinstance(found, str)
    assert (found.id, found.metadata["scale"]) == ("scaled-generated-chair-3000000-123.4", 1.234)


@pytest.mark.parametrize(
    ("scale", "said"), [(("1.3", "1.1"), "1.3 1.1"), (("0", "1"), "0 1"), (("nan", "1"), "nan 1")]
)
def test_illegal_ranges(
    load_tool: LoadTool,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    scale: tuple[str, str],
    said: str,
) -> None:
    assert run(load_tool, tmp_path, *CHAIRS, scale=scale) == 2
    assert f"LOW <= HIGH, not {said}" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_objects_of_another_task(load_tool: LoadTool, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(load_tool, tmp_path, "generated:bucket:3000000") == 2
    assert "bucket" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())

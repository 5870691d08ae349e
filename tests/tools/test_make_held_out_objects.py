"""`make_held_out_objects.py`: objects of the families of `ood` that are not in the catalogue."""

from pathlib import Path

import pytest
from tests.tools.conftest import LoadTool

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import list_objects, load_object, resolve_objects


def test_they_are_of_held_out_families_and_not_of_the_catalogue(
    load_tool: LoadTool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tool = load_tool("make_held_out_objects")
    assert tool.main(["--task", "OpenCabinetDoor", "--seeds", "0..5", "--out", str(tmp_path)]) == 0
    found = resolve_objects([str(tmp_path / tool.LIST)], task="OpenCabinetDoor")
    assert found, "some have doors"
    assert capsys.readouterr().out == f"{len(found)} objects: {tmp_path / tool.LIST}\n"
    of_catalogue = [load_object(name) for name in list_objects(split="ood", task="OpenCabinetDoor")]
    families = {one.metadata["family"] for one in of_catalogue}
    for one in found:
        assert isinstance(one, ArticulatedObject)
        assert one.id.startswith("held-out-cabinet-")
        assert one.metadata["family"] in families
        assert one.content_hash not in {other.content_hash for other in of_catalogue}


@pytest.mark.parametrize(
    ("options", "says"),
    [(("--task", "PushChairs"), "PushChair"), (("--task", "PushChair", "--seeds", "3..1"), "3..1")],
)
def test_what_is_not_legal(
    options: tuple[str, ...], says: str, load_tool: LoadTool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tool = load_tool("make_held_out_objects")
    assert tool.main([*options, "--out", str(tmp_path / "out")]) == 2
    assert says in capsys.readouterr().err
    assert not (tmp_path / "out").exists()

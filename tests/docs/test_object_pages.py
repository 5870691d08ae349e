"""The pages about objects: what their examples make is sound, and they describe every check and format."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object, resolve_objects
from artiskill.checks.runner import check_object
from artiskill.exports.export import FORMATS

DOCS = Path(__file__).resolve().parents[2] / "docs"


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (DOCS / page).read_text(encoding="utf-8"), re.DOTALL)


def rows(page: str) -> list[str]:
    return [line for line in (DOCS / page).read_text(encoding="utf-8").splitlines() if line.startswith("| `")]


@pytest.mark.slow
def test_the_own_object_passes_the_checks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    making, bucket, using, _ = blocks("own_objects.md", "python")
    for block in (making, bucket):
        exec(compile(block, "own_objects.md", "exec"), names)
    mine = names["mine"]
    assert isinstance(mine, ArticulatedObject)
    assert mine.id in capsys.readouterr().out
    exec(compile(using, "own_objects.md", "exec"), names)
    assert capsys.readouterr().out == "", "the page prints checks that fail"
    again = load_object("./my_box")
    assert again.target_links("prismatic") == mine.target_links("prismatic")
    np.testing.assert_allclose(again.bounds, mine.bounds, atol=1e-6)
    assert len(again.handles) == 1, "bar and posts are one handle"


@pytest.mark.slow
def test_chosen_seeds_are_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    chosen: dict[str, list[str]] = {}
    exec(compile(blocks("objects.md", "python")[1], "objects.md", "exec"), chosen)
    assert 0 < len(resolve_objects(chosen["chosen"], "MoveBucket")) < 40


def test_the_split_file_is_read(tmp_path: Path) -> None:
    (text,) = blocks("objects.md", "yaml")
    assert "./my_cabinet" in text
    path = tmp_path / "my_split.yaml"
    path.write_text(text.replace(", ./my_cabinet", ""))
    found = resolve_objects(str(path))
    assert len(found) == 2 + 20
    assert found[0] == "cabinet-0004"
    assert 2 < len(resolve_objects(str(path), "OpenCabinetDrawer")) < len(found), "a range is like a split"


def test_every_format_and_check_is_described() -> None:
    for name in FORMATS:
        assert any(row.startswith(f"| `{name}` |") for row in rows("own_objects.md")), name
    named = {word for row in rows("checks.md") for word in re.findall(r"`([a-z]+)`", row.split("|")[1])}
    reported = {
        result.check
        for name in ("cabinet-0003", "chair-0001", "bucket-0001")
        for result in check_object(load_object(name))
    }
    assert len(reported) > 10
    assert reported <= named


@pytest.mark.slow
def test_the_tables_are_those_of_the_catalogue() -> None:
    tool = DOCS.parent / "tools" / "make_object_docs.py"
    done = subprocess.run([sys.executable, str(tool), "--check"], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr

"""docs/objects.md says what the code does: its examples run, and what it names exists."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object, resolve_objects
from artiskill.checks.runner import CHECKS, DUPLICATES, LOADS, check_object
from artiskill.exports.export import FORMATS


@pytest.fixture(scope="module")
def page(root: Path) -> str:
    return (root / "docs" / "objects.md").read_text(encoding="utf-8")


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page, re.DOTALL)


@pytest.mark.slow
def test_examples_run_and_the_own_object_passes_the_checks(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    first, choosing, second, third = blocks(page, "python")
    exec(compile(first, "docs/objects.md", "exec"), {})
    chosen: dict[str, list[str]] = {}
    exec(compile(choosing, "docs/objects.md", "exec"), chosen)
    assert 0 < len(resolve_objects(chosen["chosen"], "MoveBucket")) < 40
    names: dict[str, object] = {}
    exec(compile(second, "docs/objects.md", "exec"), names)
    mine = names["mine"]
    assert isinstance(mine, ArticulatedObject)
    assert not [result for result in check_object(mine) if not result.passed]
    exec(compile(third, "docs/objects.md", "exec"), names)
    again = load_object("./my_box")
    assert again.target_links("prismatic") == mine.target_links("prismatic")
    np.testing.assert_allclose(again.bounds, mine.bounds, atol=1e-6)
    assert len(again.handles) == 1, "bar and posts are one handle"


def test_the_split_file_is_read(page: str, tmp_path: Path) -> None:
    (text,) = blocks(page, "yaml")
    assert "./my_cabinet" in text
    path = tmp_path / "my_split.yaml"
    path.write_text(text.replace(", ./my_cabinet", ""))
    found = resolve_objects(str(path))
    assert len(found) == 2 + 20
    assert found[0] == "cabinet-0004"
    assert 2 < len(resolve_objects(str(path), "OpenCabinetDrawer")) < len(found), "a range is like a split"


def test_every_format_and_check_is_described(page: str) -> None:
    rows = [line for line in page.splitlines() if line.startswith("| `")]
    for name in FORMATS:
        assert any(row.startswith(f"| `{name}` |") for row in rows), name
    named = {word for row in rows for word in re.findall(r"`([a-z]+)`", row.split("|")[1])}
    assert {*CHECKS, LOADS, DUPLICATES} <= named


def test_links_lead_somewhere(page: str, root: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", page):
        assert (root / "docs" / target).exists(), target
    headings = {
        re.sub(r"[^a-z0-9 -]", "", h.lower()).replace(" ", "-") for h in re.findall(r"^#+ (.*)$", page, re.M)
    }
    for anchor in re.findall(r"\]\(#([^)]+)\)", page):
        assert anchor in headings, anchor


@pytest.mark.slow
def test_the_tables_are_those_of_the_catalogue(root: Path) -> None:
    tool = root / "tools" / "make_object_docs.py"
    done = subprocess.run([sys.executable, str(tool), "--check"], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr

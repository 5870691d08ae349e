"""Every page of the documentation says what works: code runs, commands are legal, links lead somewhere.

A comment in the page, in the line before a block, says what else is to be done with it:

    <!-- not run: needs torch -->     the code is compiled only; commands are parsed only
    <!-- slow -->                     a slow test of `LOOKED_AT` runs it, and looks at what it made
"""

import importlib
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import artiskill
from artiskill.cli.main import make_parser

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
FOLLOWED = {"adding_a_task.md"}  # a test of its own does what these pages say
LOOKED_AT = {"docs/objects.md", "docs/own_objects.md"}  # test_object_pages.py
BLOCK = re.compile(
    r"(?:^<!-- (?P<mark>slow|not run: [^>]+) -->\n)?^```(?P<language>\w+)\n(?P<text>.*?)^```$", re.M | re.S
)
COMMANDS_RUN_S = 600


@dataclass(frozen=True)
class Block:
    """One fenced block of a page: its language, its text, and what a comment says of it."""

    language: str
    text: str
    mark: str


def blocks_of(page: Path, *languages: str) -> list[Block]:
    found = BLOCK.finditer(page.read_text(encoding="utf-8"))
    blocks = [Block(one["language"], one["text"], one["mark"] or "") for one in found]
    return [block for block in blocks if block.language in languages]


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def commands_of(block: Block) -> list[list[str]]:
    """Every `artiskill` command of a block, comments removed."""
    lines = block.text.replace("\\\n", " ").splitlines()
    return [
        words[1:] for words in (shlex.split(line, comments=True) for line in lines) if words[:1] == ["artiskill"]
    ]


def pages_with(*languages: str) -> list[Any]:
    pages = [page for page in PAGES if page.name not in FOLLOWED and blocks_of(page, *languages)]
    return [pytest.param(page, id=name_of(page)) for page in pages]


@pytest.mark.parametrize("page", pages_with("python"))
def test_code_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The blocks of a page, in order, in one namespace."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "page"}
    for block in blocks_of(page, "python"):
        code = compile(block.text, name_of(page), "exec")
        if not block.mark:
            exec(code, names)


def test_slow_code_is_looked_at() -> None:
    slow = {name_of(page) for page in PAGES for block in blocks_of(page, "python") if block.mark == "slow"}
    assert slow == LOOKED_AT


@pytest.mark.parametrize("page", pages_with("sh"))
def test_commands_are_legal(page: Path) -> None:
    for block in blocks_of(page, "sh"):
        for command in commands_of(block):
            make_parser().parse_strictly(command)
        for script in re.findall(r"^python (\S+\.py)", block.text, re.M):
            assert (ROOT / script).exists(), script
        for target in re.findall(r"^make ([a-z-]+)", block.text, re.M):
            assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), re.M), target


@pytest.mark.slow
@pytest.mark.parametrize("page", pages_with("sh"))
def test_commands_run(page: Path, tmp_path: Path) -> None:
    (tmp_path / "my_solution.py").write_text((ROOT / "examples" / "solution_example.py").read_text())
    for block in blocks_of(page, "sh"):
        for command in commands_of(block) if not block.mark.startswith("not run") else ():
            arguments = [sys.executable, "-m", "artiskill", *command]
            done = subprocess.run(arguments, cwd=tmp_path, capture_output=True, text=True, timeout=COMMANDS_RUN_S)
            assert done.returncode == 0, (command, done.stdout[-2000:], done.stderr[-2000:])


def anchors_of(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub and MyST make them."""
    headings = re.findall(r"^#+ (.*)$", BLOCK.sub("", page.read_text(encoding="utf-8")), re.M)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", [pytest.param(page, id=name_of(page)) for page in PAGES])
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", BLOCK.sub("", page.read_text(encoding="utf-8"))):
        if target.startswith(("http://", "https://")):
            continue
        name, _, anchor = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        assert path.exists(), target
        assert not anchor or anchor in anchors_of(path), target


def test_the_reference_has_every_public_name() -> None:
    reference = (ROOT / "docs" / "api" / "index.md").read_text(encoding="utf-8")
    documented = re.findall(r"^\.\. auto\w+:: (\w+)$", reference, re.M)
    assert sorted(documented) == sorted(set(artiskill.__all__) - {"__version__"})


def test_the_reference_names_what_there_is() -> None:
    reference = (ROOT / "docs" / "api" / "index.md").read_text(encoding="utf-8")
    names = re.findall(r"^\.\. auto\w+:: artiskill\.([\w.]+)$", reference, re.M)
    assert len(names) > 20
    for module, _, name in (f"artiskill.{name}".rpartition(".") for name in names):
        assert getattr(importlib.import_module(module), name).__doc__, name


def test_every_page_is_in_the_table_of_contents() -> None:
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    for page in (ROOT / "docs").rglob("*.md"):
        name = page.relative_to(ROOT / "docs").with_suffix("").as_posix()
        assert name == "index" or f"\n{name}\n" in index, name

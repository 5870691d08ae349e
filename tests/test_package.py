"""What the package says about itself, in all the places where it says it."""

import re
import tomllib
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
import yaml

import artiskill


@pytest.fixture(scope="module")
def project(root: Path) -> dict[str, Any]:
    with (root / "pyproject.toml").open("rb") as file:
        return tomllib.load(file)["project"]


def test_versions_agree(root: Path, project: dict[str, Any]) -> None:
    citation = yaml.safe_load((root / "CITATION.cff").read_text())
    assert artiskill.__version__ == version("artiskill") == project["version"] == citation["version"]
    assert f"## [{project['version']}]" in (root / "CHANGELOG.md").read_text()


def test_citation_has_what_the_format_demands(root: Path, project: dict[str, Any]) -> None:
    citation = yaml.safe_load((root / "CITATION.cff").read_text())
    assert citation["cff-version"] == "1.2.0"
    assert {"message", "title", "authors"} <= citation.keys()
    assert citation["license"] == project["license"]
    assert all("name" in author or "family-names" in author for author in citation["authors"])


def test_the_core_does_without_the_large_and_the_optional(project: dict[str, Any]) -> None:
    names = {re.split(r"[<>=!~\[ ;]", name)[0] for name in project["dependencies"]}
    assert names.isdisjoint({"torch", "jax", "ray", "coacd", "trimesh", "mujoco", "sapien"})
    assert all("<" in name for name in project["dependencies"]), "an upper bound keeps a later major version out"


def test_types_are_published() -> None:
    assert (Path(artiskill.__file__).parent / "py.typed").exists()


def test_make_says_what_it_can_do(root: Path) -> None:
    text = (root / "Makefile").read_text()
    targets = set(re.findall(r"^([a-z-]+):.*## \S", text, flags=re.MULTILINE))
    assert {"setup", "demo", "test", "test-slow", "lint", "types", "format", "bench", "clean"} <= targets
    phony = re.search(r"^\.PHONY: (.*)$", text, flags=re.MULTILINE)
    assert phony is not None
    assert set(phony[1].split()) == targets

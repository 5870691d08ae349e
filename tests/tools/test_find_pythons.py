"""`tools/find_pythons.py`: the oldest and the newest Python that runs, wherever it lies."""

import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture
def tool(load_tool: Callable[[str], ModuleType]) -> ModuleType:
    return load_tool("find_pythons")


def put(folder: Path, version: str, answer: str | None = None, status: int = 0) -> Path:
    """Put a file there that answers like a Python."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"python{version}"
    path.write_text(f"#!/bin/sh\necho {answer or version.replace('.', ' ')}\nexit {status}\n")
    path.chmod(0o755)
    return path


def test_supported_versions_are_those_of_the_classifiers(tool: ModuleType, root: Path) -> None:
    text = (root / "pyproject.toml").read_text()
    assert tool.supported_versions(text) == [(3, 11), (3, 12), (3, 13)]


def test_path_and_version_managers_are_searched(tool: ModuleType, tmp_path: Path) -> None:
    oldest = put(tmp_path / "bin", "3.50")
    newest = put(tmp_path / ".pyenv" / "versions" / "3.52.1" / "bin", "3.52")
    environ = {"PATH": str(tmp_path / "bin"), "HOME": str(tmp_path)}
    supported = [(3, 50), (3, 51), (3, 52)]
    assert tool.find(supported, tool.search_folders(environ)) == {(3, 50): oldest, (3, 52): newest}
    moved = put(tmp_path / "elsewhere" / "versions" / "3.51" / "bin", "3.51")
    environ["PYENV_ROOT"] = str(tmp_path / "elsewhere")
    assert tool.find(supported, tool.search_folders(environ)) == {(3, 50): oldest, (3, 51): moved}


def test_what_does_not_run_is_passed_over(tool: ModuleType, tmp_path: Path) -> None:
    """A version manager's stand-in exists for versions that are not switched on, too."""
    put(tmp_path / "a", "3.50", status=127)
    put(tmp_path / "b", "3.50", answer="3 49")
    (tmp_path / "c" / "python3.50").mkdir(parents=True)
    good = put(tmp_path / "d", "3.50")
    assert tool.find([(3, 50)], [tmp_path / name for name in "abcd"]) == {(3, 50): good}


def test_the_running_python_counts(tool: ModuleType) -> None:
    assert tool.find([sys.version_info[:2]], []) == {sys.version_info[:2]: Path(sys.executable)}


def test_two_lines_or_one(
    tool: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = [put(tmp_path, version) for version in ("3.50", "3.51", "3.52")]
    monkeypatch.setattr(tool, "search_folders", lambda environ: [tmp_path])
    for supported, expected in (([(3, 50), (3, 51), (3, 52)], [paths[0], paths[2]]), ([(3, 51)], [paths[1]])):
        monkeypatch.setattr(tool, "supported_versions", lambda text, supported=supported: supported)
        assert tool.main() == 0
        assert capsys.readouterr().out.splitlines() == [str(path) for path in expected]
    monkeypatch.setattr(tool, "supported_versions", lambda text: [(3, 60)])
    assert tool.main() == 1
    assert "no supported Python (3.60)" in capsys.readouterr().err

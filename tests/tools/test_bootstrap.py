"""`tools/bootstrap.py`: what it says and refuses, without network; every CI run tries the rest."""

import hashlib
import json
import sys
import urllib.error
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest


@pytest.fixture
def bootstrap(load_tool: Callable[[str], ModuleType]) -> ModuleType:
    return load_tool("bootstrap")


@pytest.fixture
def checkout(tmp_path: Path, bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """A checkout whose environment is made of thin air; `steps` tells what was done to it."""
    (tmp_path / "pyproject.toml").write_text("[project]\n")
    state = SimpleNamespace(root=tmp_path, venv=tmp_path / ".venv", steps=[], healthy=False)

    def create(venv: Path) -> None:
        venv.mkdir(exist_ok=True)
        state.steps.append("create")
        state.healthy = True

    def run_pip(pip: list[str], arguments: list[str], folder: Path) -> None:
        state.steps.append(arguments[-1])

    monkeypatch.setattr(bootstrap, "create", create)
    monkeypatch.setattr(bootstrap, "run_pip", run_pip)
    monkeypatch.setattr(bootstrap, "is_healthy", lambda venv: state.healthy)
    monkeypatch.setattr(bootstrap, "is_installed", lambda venv: True)

    def ensure(*extras: str) -> list[str]:
        state.steps.clear()
        bootstrap.ensure_environment(state.root, state.venv, extras)
        return list(state.steps)

    state.ensure = ensure
    return state


def test_old_python_is_named(bootstrap: ModuleType) -> None:
    with pytest.raises(bootstrap.BootstrapError, match=r"needs Python 3\.11 or newer, and .* is 3\.9"):
        bootstrap.check_python((3, 9, 18))
    assert bootstrap.check_python(sys.version_info) is None


def test_the_second_time_nothing_happens(checkout: SimpleNamespace) -> None:
    assert checkout.ensure() == ["create", "."]
    assert checkout.ensure() == []


def test_extras_add_up(checkout: SimpleNamespace) -> None:
    checkout.ensure()
    assert checkout.ensure("test") == [".[test]"]
    assert checkout.ensure("dev") == [".[dev,test]"]
    assert checkout.ensure("test") == []
    assert checkout.ensure() == []


def test_changed_requirements_are_installed(checkout: SimpleNamespace) -> None:
    checkout.ensure("test")
    (checkout.root / "pyproject.toml").write_text("[project]\nname = 'x'\n")
    assert checkout.ensure() == [".[test]"]


def test_a_broken_environment_is_made_anew(checkout: SimpleNamespace) -> None:
    checkout.ensure("test")
    checkout.healthy = False
    assert checkout.ensure() == ["create", "."]


def test_an_install_cut_short_is_begun_again(
    checkout: SimpleNamespace, bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(*arguments: Any) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(bootstrap, "run_pip", killed)
        with pytest.raises(KeyboardInterrupt):
            checkout.ensure()
    assert checkout.ensure() == ["create", "."]


def test_a_failed_extension_leaves_what_was_there(
    checkout: SimpleNamespace, bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    def offline(*arguments: Any) -> None:
        raise bootstrap.BootstrapError(bootstrap.NO_NETWORK)

    checkout.ensure()
    with monkeypatch.context() as patch:
        patch.setattr(bootstrap, "run_pip", offline)
        with pytest.raises(bootstrap.BootstrapError, match="network"):
            checkout.ensure("test")
    assert checkout.ensure() == []


def test_a_foreign_folder_is_left_alone(tmp_path: Path, bootstrap: ModuleType) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(bootstrap.BootstrapError, match="is no virtual environment"):
        bootstrap.create(tmp_path)
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


def test_health_of_real_environments(tmp_path: Path, bootstrap: ModuleType) -> None:
    assert not bootstrap.is_healthy(tmp_path / "missing")
    python = tmp_path / "bin" / "python"
    python.parent.mkdir()
    python.write_text("#!/bin/sh\nexit 0\n")
    python.chmod(0o755)
    assert not bootstrap.is_healthy(tmp_path)


@pytest.mark.parametrize("content", ["", "{", "[1]", "null"])
def test_a_damaged_stamp_is_no_stamp(tmp_path: Path, bootstrap: ModuleType, content: str) -> None:
    (tmp_path / "artiskill-stamp.json").write_text(content)
    assert bootstrap.read_stamp(tmp_path) == {}


def serve(bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch, wheel: bytes, page: str) -> list[str]:
    asked: list[str] = []

    def fetch(url: str) -> bytes:
        asked.append(url)
        return wheel if url.endswith(".whl") else page.encode()

    monkeypatch.setattr(bootstrap, "fetch", fetch)
    monkeypatch.setenv("PIP_INDEX_URL", "https://example.org/simple/")
    return asked


def test_pip_is_found_in_the_index(bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    link = f"../../files/{bootstrap.PIP_WHEEL}"
    page = f'<a href="{link}.metadata">m</a> <a href="{link}">w</a>'
    asked = serve(bootstrap, monkeypatch, b"pip", page)
    monkeypatch.setattr(bootstrap, "PIP_WHEEL_SHA256", hashlib.sha256(b"pip").hexdigest())
    assert bootstrap.fetch_pip() == b"pip"
    assert asked == ["https://example.org/simple/pip/", f"https://example.org/files/{bootstrap.PIP_WHEEL}"]


def test_a_forged_pip_is_refused(bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    page = f'<a href="/{bootstrap.PIP_WHEEL}#sha256={hashlib.sha256(b"evil").hexdigest()}">'
    serve(bootstrap, monkeypatch, b"evil", page)
    with pytest.raises(bootstrap.BootstrapError, match="SHA-256 differs"):
        bootstrap.fetch_pip()


def test_an_index_without_pip(bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    serve(bootstrap, monkeypatch, b"", "<a href='pip-1.0-py3-none-any.whl'>")
    with pytest.raises(bootstrap.BootstrapError, match=r"example\.org/simple/pip/ does not offer pip-"):
        bootstrap.fetch_pip()


def test_no_network_is_said_so(bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    def unreachable(request: Any, context: Any) -> bytes:
        raise urllib.error.URLError("Name or service not known")

    monkeypatch.setattr(bootstrap, "read", unreachable)
    with pytest.raises(bootstrap.BootstrapError, match="cannot reach the package index at https://a/: Name or"):
        bootstrap.fetch("https://a/")


@pytest.mark.parametrize(
    ("words", "meaning"),
    [
        ("... CERTIFICATE_VERIFY_FAILED ...", "PIP_CERT"),
        ("NewConnectionError: x", "is there a network"),
        ("OSError: No space left on device", "disk is full"),
        ("ERROR: something new", "in its own words above"),
    ],
)
def test_pip_is_translated(
    bootstrap: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, words: str, meaning: str
) -> None:
    pip = [sys.executable, "-c", f"import sys; sys.exit({words!r})"]
    with pytest.raises(bootstrap.BootstrapError, match=meaning):
        bootstrap.run_pip(pip, [], tmp_path)


def test_the_stamp_is_readable(checkout: SimpleNamespace, bootstrap: ModuleType) -> None:
    checkout.ensure("test")
    stamp = json.loads((checkout.venv / "artiskill-stamp.json").read_text())
    assert stamp == {"key": bootstrap.environment_key(checkout.root), "extras": ["test"]}


def test_the_files_of_a_commit(tmp_path: Path, load_tool: Callable[[str], ModuleType]) -> None:
    check_text = load_tool("check_text")
    path = tmp_path / "a.txt"
    for data, fault in [
        (b"fine\n", None),
        (b"", None),
        (b"no end", "one line end"),
        (b"two\n\n", "one line end"),
        (b"blank \n", ":1: trailing blanks"),
        (b"dos\r\n", "CR LF"),
        (b"a\n<<<<<<< HEAD\n", ":2: a mark left by a merge"),
        (b"x" * 1_000_001, "1000001 bytes"),
    ]:
        path.write_bytes(data)
        found = check_text.faults(path)
        assert (not found) if fault is None else any(fault in line for line in found)

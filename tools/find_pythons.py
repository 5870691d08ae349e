"""Print the oldest and the newest supported Python of this machine, one path a line; standard library only.

    python3 tools/find_pythons.py

Supported are the versions that pyproject.toml's classifiers name. Looked through are the search path, folders of
version managers, and the Python that runs this. One line is printed where one version alone is found.
"""

import os
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TIMEOUT_S = 20

Version = tuple[int, int]


def main() -> int:
    """Print what was found; returns the exit status."""
    supported = supported_versions((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    found = find(supported, search_folders(os.environ))
    if not found:
        names = ", ".join(f"{major}.{minor}" for major, minor in supported)
        print(f"find_pythons: no supported Python ({names}) on the path", file=sys.stderr)
        return 1
    for version in sorted({min(found), max(found)}):
        print(found[version])
    return 0


def supported_versions(pyproject: str) -> list[Version]:
    """Return the versions that the classifiers name, oldest first."""
    named = re.findall(r'"Programming Language :: Python :: (\d+)\.(\d+)"', pyproject)
    return sorted((int(major), int(minor)) for major, minor in named)


def search_folders(environ: Mapping[str, str]) -> list[Path]:
    """Return the folders in which Pythons may lie: those of the search path, then those of version managers."""
    home = Path(environ.get("HOME", "/nonexistent"))
    managers = (
        Path(environ.get("PYENV_ROOT", home / ".pyenv")) / "versions",
        Path(environ.get("UV_PYTHON_INSTALL_DIR", home / ".local/share/uv/python")),
        home / ".local/share/mise/installs/python",
        home / ".asdf/installs/python",
        home / "miniconda3/envs",
    )
    managed = [folder for manager in managers for folder in sorted(manager.glob("*/bin"))]
    return [Path(name) for name in environ.get("PATH", "").split(os.pathsep) if name] + managed


def find(supported: list[Version], folders: list[Path]) -> dict[Version, Path]:
    """Return version -> the first Python of it that runs; the one that runs this counts last."""
    found: dict[Version, Path] = {}
    for version in supported:
        name = "python{}.{}".format(*version)
        candidates = [folder / name for folder in folders]
        if sys.version_info[:2] == version:
            candidates.append(Path(sys.executable))
        for candidate in candidates:
            if runs(candidate, version):
                found[version] = candidate
                break
    return found


def runs(candidate: Path, version: Version) -> bool:
    """Whether a file is a Python of this version that starts: a version manager's stand-in may not."""
    if not os.access(candidate, os.X_OK) or candidate.is_dir():
        return False
    command = [str(candidate), "-I", "-c", "import sys, venv; print(*sys.version_info[:2])"]
    try:
        answer = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return answer.returncode == 0 and answer.stdout.split() == [str(number) for number in version]


if __name__ == "__main__":
    sys.exit(main())

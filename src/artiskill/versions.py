"""What the numbers depend on, and the machine that they were made on."""

import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

# Distributions on which the numbers depend.
_DISTRIBUTIONS = (
    "artiskill",
    "mujoco-core",
    "numpy",
    "scipy",
    "numba",
    "llvmlite",
    "array-api-compat",
    "gymnasium",
)


def versions() -> dict[str, str]:
    """Return the versions of Python and of the distributions that results depend on."""
    found = {"python": platform.python_version()}
    for name in _DISTRIBUTIONS:
        try:
            found[name] = version(name)
        except PackageNotFoundError:  # run from a source tree that is not installed
            found[name] = "unknown"
    return found


def processor_name() -> str | None:
    """Return what the processor calls itself; None where the system does not say."""
    return entry_of(Path("/proc/cpuinfo"), "model name") or platform.processor() or None


def entry_of(path: Path, key: str) -> str | None:
    """Return the value of the first line `key: value` of one of Linux's files."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError:  # another system
        return None
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith(key)), None)

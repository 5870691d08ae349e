"""What the numbers depend on."""

import platform
from importlib.metadata import PackageNotFoundError, version

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

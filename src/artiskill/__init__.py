"""ArtiSkill: does a manipulation policy generalise to objects it has never seen?"""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("artiskill")
except PackageNotFoundError:  # run from a source tree that is not installed
    __version__ = "0+unknown"

"""ArtiSkill: does a manipulation policy generalise to objects it has never seen?

Importing registers tasks and their environments, those of installed packages too, and does nothing else.
"""

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from artiskill.envs.registration import register_all, register_task

try:
    __version__ = version("artiskill")
except PackageNotFoundError:  # run from a source tree that is not installed
    __version__ = "0+unknown"

# name -> module; looked up on first use, so that importing stays light
_PUBLIC = {
    "ArticulatedObject": "artiskill.assets.articulated_object",
    "import_partnet": "artiskill.assets.partnet.importer",
    "list_objects": "artiskill.assets.catalog",
    "load_demo_pack": "artiskill.demos.demos",
    "load_object": "artiskill.assets.catalog",
    "load_policy": "artiskill.learning.array_policy",
    "evaluate": "artiskill.evaluation.evaluate",
    "ManipulationEnv": "artiskill.envs.manipulation",
    "ManipulationVectorEnv": "artiskill.envs.vector_env",
    "FlattenDict": "artiskill.envs.wrappers",
    "PointCloudDownsample": "artiskill.envs.wrappers",
    "VectorFlattenDict": "artiskill.envs.wrappers",
    "VectorPointCloudDownsample": "artiskill.envs.wrappers",
    "as_sb3": "artiskill.envs.stable_baselines",
    "warm_scenes": "artiskill.envs.warm",
}
__all__ = ["__version__", "register_task", *sorted(_PUBLIC)]  # noqa: PLE0604 - names resolved by __getattr__


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'artiskill' has no attribute {name!r}; public: {', '.join(__all__)}")


register_all()

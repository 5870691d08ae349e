"""PartNet-Mobility: a folder or zip of the data set becomes an `ArticulatedObject` like any other."""

from artiskill.assets.partnet.folder import find_partnet_folder
from artiskill.assets.partnet.importer import import_partnet

__all__ = ["find_partnet_folder", "import_partnet"]

"""OpenCabinetDrawer and OpenCabinetDoor, one task family: they differ in configuration only."""

from artiskill.tasks.open_cabinet.task import OpenCabinetConfig, make_open_cabinet

__all__ = ["OpenCabinetConfig", "make_open_cabinet"]

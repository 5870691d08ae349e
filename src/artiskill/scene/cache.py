"""Scenes by object: compiled once per process, a bounded number kept."""

from functools import lru_cache

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.robots.config import RobotConfig
from artiskill.scene.physics import PhysicsConfig
from artiskill.scene.props import Prop
from artiskill.scene.scene import Scene, build_scene

CAPACITY = 256  # scenes; one takes a fifth to half a megabyte


@lru_cache(maxsize=CAPACITY)
def cached_scene(
    robot: RobotConfig, obj: ArticulatedObject, physics: PhysicsConfig, props: tuple[Prop, ...] = ()
) -> Scene:
    """`build_scene`, remembered. Objects are told apart by identity: loading one twice gives the same instance."""
    return build_scene(robot, obj, physics, props)

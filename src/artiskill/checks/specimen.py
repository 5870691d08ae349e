"""What the checks look at: an object, and the models of it that several checks need, compiled once each."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mujoco
import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Joint
from artiskill.checks.config import CategoryConfig, ChecksConfig, DynamicsConfig
from artiskill.checks.contacts import ContactProbe
from artiskill.scene.object_model import WHEEL_PART
from artiskill.scene.object_scene import ObjectScene, build_object_scene
from artiskill.scene.physics import ContactConfig, PhysicsConfig

FREE = DynamicsConfig(0.0, 0.0)


@dataclass(eq=False)
class Specimen:
    """One object under examination."""

    object: ArticulatedObject
    config: ChecksConfig

    @property
    def limits(self) -> CategoryConfig:
        """What holds for objects of its category."""
        return self.config.of(self.object.category)

    @property
    def physics(self) -> PhysicsConfig:
        """The benchmark's physics, with the friction of the category's task."""
        limits = self.limits
        contact = ContactConfig(object_friction=limits.object_friction, ground_friction=limits.ground_friction)
        return PhysicsConfig(contact=contact)

    @cached_property
    def scene(self) -> ObjectScene:
        """Object and ground as the simulation has them.

        Raises:
            ValueError: the engine refuses the object.
        """
        return build_object_scene(self.object, self.physics)

    @cached_property
    def probe(self) -> ContactProbe:
        """The links' shapes, all of which can meet one another."""
        return ContactProbe(self.object)

    @property
    def joints(self) -> tuple[Joint, ...]:
        """All joints."""
        return self.object.joints

    @property
    def rest(self) -> np.ndarray:
        """Joint values at rest, (J,)."""
        return self.object.rest_qpos

    @cached_property
    def rolling(self) -> np.ndarray:
        """For each joint, whether it belongs to a wheel: no link from there on touches with anything else.

        The swivel of a caster is one too: what hangs from it is a fork and its wheels.
        """
        obj = self.object
        return np.array([self._carries_wheels(i) for i in obj.jointed_links], dtype=bool)

    def _carries_wheels(self, index: int) -> bool:
        """Whether the links from this one on have wheels, all at the end: a seat has them nowhere."""
        obj = self.object
        carried = {index}
        for i, link in enumerate(obj.links):
            if link.parent in carried:
                carried.add(i)
        return any(shape.part == WHEEL_PART for i in carried for shape in obj.links[i].collisions)

    def with_dynamics(self, scene: ObjectScene, joints: DynamicsConfig, wheels: DynamicsConfig) -> Any:
        """A copy of a scene's model with friction and damping in its joints."""
        model = mujoco.MjModel.__copy__(scene.model)
        for column, name in (("friction", "dof_frictionloss"), ("damping", "dof_damping")):
            values = np.where(self.rolling, getattr(wheels, column), getattr(joints, column))
            target = getattr(model, name)
            target[scene.dofs] = values if target.ndim == 1 else values[:, None]
        return model

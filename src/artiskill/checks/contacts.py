"""Which links of an object run into one another for given joint values: geometry only, nothing moves by itself."""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.scene.object_scene import object_spec, resolve_object_scene
from artiskill.scene.physics import PhysicsConfig


@dataclass(frozen=True)
class Overlap:
    """Two links that share space.

    Attributes:
        links: indices of both, the lower first.
        depth_m: of the deepest pair of their shapes.
        parts: names of the parts that these shapes belong to.
    """

    links: tuple[int, int]
    depth_m: float
    parts: tuple[str, str]


class ContactProbe:
    """The links' shapes in a model of its own, where all can meet, parents and children included."""

    def __init__(self, obj: ArticulatedObject) -> None:
        """Compile the model.

        Raises:
            ValueError: the engine refuses the object.
        """
        spec, part = object_spec(obj, PhysicsConfig(), ground=False, hold=True)
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT)
        for geom in spec.geoms:
            geom.contype = geom.conaffinity = 1
        self._scene = resolve_object_scene(spec.compile(), obj, part)
        model = self._scene.model
        self._data = mujoco.MjData(model)
        link_of_body = {int(body): i for i, body in enumerate(self._scene.bodies)}
        self._links = [link_of_body[int(body)] for body in model.geom_bodyid]
        self._parts = [shape.part for link in obj.links for shape in link.collisions]

    def overlaps(self, qpos: np.ndarray) -> list[Overlap]:
        """Pairs of links that overlap, each with its deepest pair of shapes, the deepest first.

        Args:
            qpos: (J,) joint values.
        """
        model, data = self._scene.model, self._data
        data.qpos[self._scene.qpos] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        deepest: dict[tuple[int, int], Overlap] = {}
        for overlap in self._contacts():
            known = deepest.get(overlap.links)
            if known is None or overlap.depth_m > known.depth_m:
                deepest[overlap.links] = overlap
        return sorted(deepest.values(), key=lambda o: (-o.depth_m, o.links))

    def _contacts(self) -> list[Overlap]:
        contact: Any = self._data.contact
        found = []
        for (first, second), distance in zip(contact.geom.tolist(), contact.dist.tolist(), strict=True):
            if distance < 0:
                a, b = sorted((first, second), key=lambda g: self._links[g])
                links = (self._links[a], self._links[b])
                found.append(Overlap(links, -distance, (self._parts[a], self._parts[b])))
        return found

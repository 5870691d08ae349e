"""Props: what a task puts into its scene beside the robot, the object and the ground."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from artiskill.assets.articulated_object import Material, VisualMesh
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import box, cylinder, sphere
from artiskill.robots.model import add_shape
from artiskill.scene.physics import Group, PhysicsConfig, set_contact

PROP_PREFIX = "prop/"
_SEGMENTS, _BEVEL_M = 24, 0.003
_UPRIGHT = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Prop:
    """A simple body of a task.

    Attributes:
        name: unique within the scene.
        kind: its shape.
        size: as in `assets.articulated_object.CollisionShape`.
        motion: `fixed` to the world, `free` to move, or only `drawn`: nothing touches it.
        position_m: of its centre, in the world; of a free one the initial state decides.
        rgba: linear colour.
        density_kg_m3: of a free one.
        friction: sliding friction.
    """

    name: str
    kind: Literal["box", "cylinder", "sphere"]
    size: tuple[float, ...]
    motion: Literal["fixed", "free", "drawn"]
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rgba: tuple[float, float, float, float] = (0.5, 0.5, 0.5, 1.0)
    density_kg_m3: float = 1000.0
    friction: float = 1.0

    @property
    def body(self) -> str:
        """Its body's name in the model."""
        return PROP_PREFIX + self.name

    def visual(self) -> VisualMesh:
        """What is drawn, in the body's frame."""
        return VisualMesh(_MESHES[self.kind](self.size), Material(self.name, self.rgba), self.name)


_MESHES: dict[str, Any] = {
    "box": lambda size: box(size, _BEVEL_M),
    "cylinder": lambda size: cylinder(size[0], size[1], _SEGMENTS, _BEVEL_M),
    "sphere": lambda size: _ball(size[0]),
}


def _ball(radius: float) -> TriMesh:
    return sphere(radius, _SEGMENTS, rings=9)


def add_props(spec: Any, props: tuple[Prop, ...], physics: PhysicsConfig) -> None:
    """Add bodies, joints and shapes of props to a `mujoco.MjSpec`: those fixed or drawn first, then the free ones.

    So free joints are the last of the model, one after the other.
    """
    for prop in sorted(props, key=lambda prop: prop.motion == "free"):
        body = spec.worldbody.add_body(name=prop.body, pos=np.asarray(prop.position_m, dtype=float))
        if prop.motion == "free":
            body.add_freejoint(name=prop.body)
        if prop.motion == "drawn":
            continue
        geom = add_shape(body, f"{prop.body}_shape", prop.kind, prop.size, (0, 0, 0), _UPRIGHT)
        geom.density = prop.density_kg_m3
        if prop.motion == "free":
            touched = Group.ROBOT | Group.OBJECT | Group.GROUND | Group.LOOSE | Group.TRUNK
            set_contact(geom, Group.LOOSE, touched, prop.friction, physics)
        else:  # whatever touches the ground touches it, and the robot's trunk does too
            set_contact(geom, Group.GROUND, Group.LOOSE | Group.TRUNK, prop.friction, physics)

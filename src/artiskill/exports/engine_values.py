"""Masses, inertias and contact parameters as the engine has them: compiled once, so that exports agree with it."""

from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.errors import AssetError
from artiskill.scene.object_model import OBJECT_PREFIX
from artiskill.scene.object_scene import build_object_scene
from artiskill.scene.physics import PhysicsConfig


@dataclass(frozen=True, eq=False)
class Inertial:
    """Of a link, in its frame.

    Attributes:
        mass_kg: 0 where a link that does not move has no collision shapes.
        position: (3,) centre of mass.
        quaternion: (4,) of the principal axes.
        moments_kg_m2: (3,) about them.
    """

    mass_kg: float
    position: np.ndarray
    quaternion: np.ndarray
    moments_kg_m2: np.ndarray


@dataclass(frozen=True, eq=False)
class ShapeContact:
    """Contact parameters of a collision shape, in MuJoCo's terms."""

    group: int
    collides_with: int
    friction: np.ndarray
    solref: np.ndarray
    solimp: np.ndarray


@dataclass(frozen=True, eq=False)
class EngineValues:
    """What the engine makes of an object.

    Attributes:
        inertials: of each link, in the object's order.
        contacts: of each link, of each of its shapes.
        limit_solref: how stiff the joints' limits are; empty for an object without joints.
        limit_solimp: likewise.
    """

    inertials: tuple[Inertial, ...]
    contacts: tuple[tuple[ShapeContact, ...], ...]
    limit_solref: np.ndarray
    limit_solimp: np.ndarray


def engine_values(obj: ArticulatedObject, physics: PhysicsConfig) -> EngineValues:
    """Compile the object alone, as scenes have it.

    Raises:
        AssetError: the engine refuses it.
    """
    try:
        scene = build_object_scene(obj, physics, ground=False)
    except ValueError as error:
        raise AssetError(f"object {obj.id!r} does not compile: {error}") from error
    model = scene.model
    inertials, contacts = [], []
    for link, index in zip(obj.links, scene.bodies, strict=True):
        body = model.body(index)
        inertials.append(Inertial(float(body.mass[0]), body.ipos.copy(), body.iquat.copy(), body.inertia.copy()))
        geoms = (model.geom(f"{OBJECT_PREFIX}{link.name}_shape{i}") for i in range(len(link.collisions)))
        contacts.append(
            tuple(
                ShapeContact(
                    int(g.contype[0]), int(g.conaffinity[0]), g.friction.copy(), g.solref.copy(), g.solimp.copy()
                )
                for g in geoms
            )
        )
    solref, solimp = (v[scene.joints[:1]].ravel() for v in (model.jnt_solref, model.jnt_solimp))
    return EngineValues(tuple(inertials), tuple(contacts), solref, solimp)

"""Builds a handle of any kind and brings it to its place on a front."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.cabinets.pulls.bars import build_bar, build_bow
from artiskill.assets.cabinets.pulls.cups import build_cup
from artiskill.assets.cabinets.pulls.edges import build_lip, build_slot
from artiskill.assets.cabinets.pulls.knobs import build_knob, build_ring
from artiskill.assets.cabinets.pulls.pull import Pull, Sinks
from artiskill.assets.cabinets.spec import HandleModel, HandlePlace
from artiskill.assets.handles import HandleGrasp
from artiskill.assets.parts import IDENTITY
from artiskill.geometry.rotations import quat_from_axis_angle, quat_multiply, quat_rotate

BUILDERS: dict[str, Callable[[HandleModel, float, Sinks], Pull]] = {
    "bar": build_bar,
    "bow": build_bow,
    "knob": build_knob,
    "ring": build_ring,
    "lip": build_lip,
    "slot": build_slot,
    "cup": build_cup,
}
# How many shapes are touched, by kind and shape; `arch` and `hooked` have one for each piece of their path.
_SHAPES = {"bar": 3, "bow": 3, "knob": 2, "ring": 7, "lip": 1, "slot": 2, "cup": 6, "arch": 5, "hooked": 2}
_LYING = quat_from_axis_angle((1, 0, 0), -np.pi / 2)  # z onto y: lower becomes right


def pull_shapes(model: HandleModel) -> int:
    """How many collision shapes a handle has."""
    return _SHAPES.get(model.shape, _SHAPES[model.kind])


def build_pull(model: HandleModel, place: HandlePlace, face: np.ndarray, sinks: Sinks) -> Pull:
    """Build a handle of any kind.

    Args:
        model: the handle.
        place: where it sits; only its length and direction are used.
        face: (3,) the point of the front's outer face behind the handle's centre, in the link's frame.
        sinks: how far behind that face the surface lies under the handle, as in `pull.Sinks`.
    """
    pull = BUILDERS[model.kind](model, place.length_m, sinks)
    mirror = np.array((1.0, -1.0 if place.mirrored else 1.0, 1.0))
    # rings hang and knobs stand the same way on all fronts
    turn = IDENTITY if place.vertical or place.length_m == 0 else _LYING

    def moved(point: np.ndarray) -> np.ndarray:
        return face + np.asarray(quat_rotate(turn, point * mirror))

    def put(shape: CollisionShape) -> CollisionShape:
        return replace(shape, position=moved(shape.position), quaternion=quat_multiply(turn, shape.quaternion))

    grasp = HandleGrasp(
        moved(pull.grasp.position),
        np.stack([quat_rotate(turn, across) for across in pull.grasp.across]),
        pull.grasp.width_m,
    )
    recess = None if pull.recess is None else pull.recess.scaled(mirror).transformed(face, turn)
    mesh = pull.mesh.scaled(mirror).transformed(face, turn)
    return Pull(mesh, tuple(put(shape) for shape in pull.collisions), grasp, pull.hookable, recess)

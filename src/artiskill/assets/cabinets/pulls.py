"""Handles of cabinets: what they look like and what the hand touches, one builder per kind."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.cabinets.parts import IDENTITY
from artiskill.assets.cabinets.spec import HandleModel, HandlePlace
from artiskill.geometry.meshes import TriMesh, box, cylinder, merge
from artiskill.geometry.rotations import quat_from_axis_angle

_BAR_SEGMENTS = 16
_POST_SEGMENTS = 10
_BEVEL_M = 0.001
# Turns a shape's z axis onto another axis of the object frame.
_TURN = {
    "x": quat_from_axis_angle((0, 1, 0), np.pi / 2),
    "y": quat_from_axis_angle((1, 0, 0), np.pi / 2),
    "z": IDENTITY,
}


@dataclass(frozen=True, eq=False)
class Pull:
    """A built handle in the link's frame."""

    mesh: TriMesh
    collisions: tuple[CollisionShape, ...]
    hookable: bool


def build_pull(model: HandleModel, place: HandlePlace, face: np.ndarray, sink_m: tuple[float, float]) -> Pull:
    """Build a handle of any kind.

    Args:
        model: the cabinet's handle.
        place: where it sits; only its posts' distance and direction are used.
        face: (3,) the point of the front's outer face behind the handle's centre, in the link's frame.
        sink_m: how far behind that face the surface lies under the lower (right) and the upper (left) post.
    """
    return BUILDERS[model.kind](model, place, face, sink_m)


def build_bar(model: HandleModel, place: HandlePlace, face: np.ndarray, sink_m: tuple[float, float]) -> Pull:
    """A straight bar on two posts; arguments as in `build_pull`."""
    radius = model.diameter_m / 2
    axis = "z" if place.vertical else "y"
    along = np.array((0.0, 0.0, 1.0) if place.vertical else (0.0, 1.0, 0.0))
    centre = face - np.array((model.projection_m - radius, 0.0, 0.0))
    half_length = place.centres_m / 2 + model.overhang_m
    half = np.where(along > 0, half_length, radius)
    if model.section == "square":
        meshes = [box(half, _BEVEL_M).transformed(centre)]
        shapes = [CollisionShape("box", tuple(half.tolist()), centre, IDENTITY, part="handle")]
    else:
        meshes = [cylinder(radius, half_length, _BAR_SEGMENTS, _BEVEL_M).transformed(centre, _TURN[axis])]
        shapes = [_capsule(radius, half_length - radius, centre, axis)]
    post = model.post_m / 2
    for sign, sink in zip((-1, 1), sink_m, strict=True):
        foot = face + sign * place.centres_m / 2 * along
        length = model.projection_m - radius + sink
        middle = foot + np.array((sink - length / 2, 0.0, 0.0))
        meshes.append(cylinder(post, length / 2, _POST_SEGMENTS).transformed(middle, _TURN["x"]))
        shapes.append(_capsule(post, length / 2, middle, "x"))
    hookable = model.projection_m - model.diameter_m >= 0.02
    return Pull(merge(meshes), tuple(shapes), hookable)


BUILDERS: dict[str, Callable[[HandleModel, HandlePlace, np.ndarray, tuple[float, float]], Pull]] = {
    "bar": build_bar
}


def _capsule(radius: float, half_length: float, centre: np.ndarray, axis: str) -> CollisionShape:
    return CollisionShape("capsule", (radius, half_length), centre, _TURN[axis], part="handle")

"""Volumes of collision shapes: with a link's density they give its mass in the engine."""

import math
from collections.abc import Iterable

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.geometry.arrays import total
from artiskill.geometry.meshes import convex_hull
from artiskill.geometry.rotations import quat_rotate


def shape_volume_m3(shape: CollisionShape) -> float:
    """Volume of one convex shape."""
    if shape.kind == "hull":
        return convex_hull(shape.vertices).volume_m3
    if shape.kind == "box":
        return 8.0 * math.prod(shape.size)
    radius = shape.size[0]
    ball = 4.0 / 3.0 * math.pi * math.pow(radius, 3)
    if shape.kind == "sphere":
        return ball
    barrel = 2.0 * math.pi * radius**2 * shape.size[1]
    return barrel if shape.kind == "cylinder" else barrel + ball


def shapes_volume_m3(shapes: Iterable[CollisionShape]) -> float:
    """Sum of volumes, as the engine counts it: where shapes overlap, twice."""
    return total(shape_volume_m3(shape) for shape in shapes)


def first_moment_m4(shapes: Iterable[CollisionShape]) -> np.ndarray:
    """(3,) sum of volume times centre, in the link's frame; times density it is mass times centre of mass.

    A hull's centre is taken to be the mean of its corners.
    """
    total = np.zeros(3)
    for shape in shapes:
        centre = np.asarray(shape.position, dtype=float)
        if shape.vertices is not None:
            centre = centre + quat_rotate(shape.quaternion, shape.vertices.mean(axis=0))
        total += shape_volume_m3(shape) * centre
    return total


def density_for_mass(mass_kg: float, shapes: Iterable[CollisionShape]) -> float:
    """The density at which the shapes weigh so much, kg/m3, to a tenth."""
    return round(mass_kg / shapes_volume_m3(shapes), 1)

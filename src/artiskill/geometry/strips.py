"""Bars along a path, rings, prisms and frustums: what handles and fronts of furniture are made of."""

from typing import Any

import numpy as np

from artiskill.geometry.arrays import dot, norm
from artiskill.geometry.meshes import TriMesh, lathe, loft


def strip(path: Any, across: Any, half_width: float, half_thickness: float, sides: int = 4) -> TriMesh:
    """A bar along a path in a plane: round (elliptic) for many sides, flat for four.

    Args:
        path: (P, 3) points in a plane.
        across: (3,) unit normal of that plane; the width runs along it.
        half_width: of the section, along `across`.
        half_thickness: of the section, in the plane.
        sides: corners of the section, at least 3.
    """
    points, normal = np.asarray(path, dtype=float), np.asarray(across, dtype=float)
    steps = np.diff(points, axis=0)
    steps /= norm(steps)[:, None]
    ends = np.concatenate((steps[:1], steps, steps[-1:]))
    tangents = ends[:-1] + ends[1:]  # halfway between the two pieces that meet
    tangents /= norm(tangents)[:, None]
    stretch = 1.0 / dot(tangents, ends[1:])  # mitred: pieces keep their thickness
    inwards = np.cross(tangents, normal)
    angles = (np.arange(sides) + 0.5) * (2 * np.pi / sides)
    scale = np.sqrt(2.0) if sides == 4 else 1.0
    width, thickness = scale * half_width * np.cos(angles), scale * half_thickness * np.sin(angles)
    # (P, S, 3)
    rings = (
        points[:, None]
        + width[None, :, None] * normal
        + (stretch[:, None] * thickness)[..., None] * inwards[:, None]
    )
    return loft(rings)


def torus(radius: float, wire_radius: float, segments: int = 24, sides: int = 8) -> TriMesh:
    """A ring about the z axis, centred on the origin; `radius` is that of the wire's middle."""
    angles = np.linspace(0.0, 2 * np.pi, sides + 1)
    profile = np.stack((radius + wire_radius * np.cos(angles), wire_radius * np.sin(angles)), axis=-1)
    profile[-1] = profile[0]
    return lathe(profile, segments)


def upright_prism(outline: Any, z0: float, z1: float) -> TriMesh:
    """A prism between two heights over a convex outline (P, 2) in x and y, counter-clockwise, edges sharp."""
    xy = np.asarray(outline, dtype=float)
    return loft([np.column_stack((xy, np.full(len(xy), z))) for z in (z0, z1)])


def frustum(low: Any, high: Any, depth: float, height: float) -> TriMesh:
    """A field that rises towards the viewer: a rectangle at `depth` that narrows to another, `height` before it.

    Args:
        low: (2, 2) smallest and largest y, z of the rectangle behind.
        high: likewise, of the one in front.
        depth: x of the rectangle behind.
        height: how far the one in front stands before it, towards -x.
    """
    rings = []
    for (y0, z0), (y1, z1), x in ((*low, depth), (*high, depth - height)):
        rings.append([(x, y0, z0), (x, y0, z1), (x, y1, z1), (x, y1, z0)])
    return loft(rings)

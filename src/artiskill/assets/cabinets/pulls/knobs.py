"""Knobs, which may be gripped at any turn of the hand, and rings on a neck, which are gripped around the ring."""

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.cabinets.pulls.pull import (
    PART,
    TO_ROOM,
    Pull,
    Sinks,
    block,
    capsule_between,
)
from artiskill.assets.cabinets.spec import HandleModel
from artiskill.assets.handles import HandleGrasp, grasp_depth
from artiskill.geometry.meshes import merge
from artiskill.geometry.primitives import box, cylinder, lathe, sphere, torus

_SIDES = 20
_BEVEL_M = 0.0015
_ROUND_TURNS = 4  # grasps of a round knob, each with its half turn: every 45 degrees
# Thickness of a head, relative to its diameter; a cone's is relative to the projection.
HEADS = {"disc": 0.32, "mushroom": 0.5, "ball": 0.92, "cone": 0.78, "square": 0.36}
_RING_SEGMENTS = 6  # capsules of a ring
ROSE_M = (0.014, 0.004)  # radius and thickness of the disc that a ring's neck stands on


def head_thickness(model: HandleModel) -> float:
    """Of a knob, at right angles to the front."""
    return HEADS[model.shape] * (model.projection_m if model.shape == "cone" else model.diameter_m)


def build_knob(model: HandleModel, length_m: float, sinks: Sinks) -> Pull:
    """A knob; its shape is `disc`, `mushroom`, `ball`, `cone` or `square`."""
    radius, out, thick = model.diameter_m / 2, model.projection_m, head_thickness(model)
    foot, neck, back = -sinks[1], model.post_m / 2, out - thick  # heights over the face
    if model.shape == "square":
        middle = np.array((-(back + thick / 2), 0.0, 0.0))
        half = np.array((thick / 2, radius, radius))
        mesh = merge(
            [
                box(half, _BEVEL_M).transformed(middle),
                cylinder(neck, (back - foot) / 2, 12).transformed((-(back + foot) / 2, 0, 0), TO_ROOM),
            ]
        )
        head = block(middle - half, middle + half)
    else:
        profile = [(0.0, foot), (1.25 * neck, foot), (neck, foot + 0.3 * (back - foot))]
        mesh = lathe(profile + _head(model.shape, radius, neck, back, out), _SIDES).transformed((0, 0, 0), TO_ROOM)
        head = _touched_head(model.shape, radius, back, out)
    shapes = (head, capsule_between((-foot - neck / 2, 0, 0), (-back, 0, 0), neck))
    depth = thick / 2 if model.shape == "ball" else grasp_depth(thick)
    turns = np.arange(2 if model.shape == "square" else _ROUND_TURNS)
    angles = turns * np.pi / len(turns)
    across = np.stack((0 * angles, np.cos(angles), np.sin(angles)), axis=-1)
    grasp = HandleGrasp(np.array((-(out - depth), 0.0, 0.0)), across, model.diameter_m)
    return Pull(mesh, shapes, grasp, hookable=radius - neck >= 0.008)


def _head(shape: str, radius: float, neck: float, back: float, out: float) -> list[tuple[float, float]]:
    """Profile from the neck to the front: radius, height."""
    thick = out - back
    if shape == "disc":
        b = _BEVEL_M
        rim = [(radius - b, back), (radius, back + b), (radius, out - b), (radius - b, out), (0.0, out)]
        return [(neck, back), *rim]
    if shape == "cone":
        return [
            (neck, back),
            (radius, out - 0.15 * thick),
            (radius, out - 0.05 * thick),
            (0.9 * radius, out),
            (0.0, out),
        ]
    if shape == "mushroom":
        widest = back + 0.4 * thick
        arc = np.linspace(0, np.pi / 2, 5)[1:]
        dome = [(radius * np.cos(a), widest + (out - widest) * np.sin(a)) for a in arc[:-1]]
        return [(neck, back), (0.85 * radius, back + 0.12 * thick), (radius, widest), *dome, (0.0, out)]
    arc = np.linspace(-0.4 * np.pi, np.pi / 2, 8)
    ball = [(radius * np.cos(a), out - radius + radius * np.sin(a)) for a in arc[:-1]]
    return [*ball, (0.0, out)]


def _touched_head(shape: str, radius: float, back: float, out: float) -> CollisionShape:
    if shape == "ball":
        return CollisionShape("sphere", (radius,), np.array((radius - out, 0.0, 0.0)), TO_ROOM, part=PART)
    thick = out - back
    front = out - 0.2 * thick if shape == "mushroom" else out  # a dome stands out of its cylinder
    back += {"cone": 0.35, "mushroom": 0.1}.get(shape, 0.0) * thick
    centre = np.array((-(front + back) / 2, 0.0, 0.0))
    reduced = 0.93 * radius if shape == "cone" else radius
    return CollisionShape("cylinder", (reduced, (front - back) / 2), centre, TO_ROOM, part=PART)


def build_ring(model: HandleModel, length_m: float, sinks: Sinks) -> Pull:
    """A rigid ring that hangs before the front from a neck on a rose."""
    wire, outer = model.diameter_m / 2, model.size_m / 2
    middle, x = outer - wire, -(model.projection_m - wire)
    ring = torus(middle, wire, 28, 8).transformed((x, 0, 0), TO_ROOM)
    top, foot = np.array((x, 0.0, middle)), np.array((sinks[1], 0.0, middle))
    rose_radius, rose = ROSE_M
    neck = model.post_m / 2
    parts = [
        ring,
        sphere(1.35 * wire + 0.001, 12, 5).transformed(top),
        cylinder(neck, (foot[0] - x) / 2, 12).transformed((top + foot) / 2, TO_ROOM),
        cylinder(rose_radius, rose / 2, 20, 0.001).transformed(foot - (rose / 2, 0, 0), TO_ROOM),
    ]
    # corners of a hexagon halfway between the ring's own inscribed and circumscribed one
    reach = middle * 2 / (1 + np.cos(np.pi / _RING_SEGMENTS))
    angles = np.arange(_RING_SEGMENTS + 1) * (2 * np.pi / _RING_SEGMENTS)
    corners = np.stack((0 * angles + x, reach * np.sin(angles), reach * np.cos(angles)), axis=-1)
    shapes = [capsule_between(corners[k], corners[k + 1], wire) for k in range(_RING_SEGMENTS)]
    shapes.append(capsule_between(foot, top, neck))
    grasp = HandleGrasp(np.array((x, 0.0, 0.0)), np.array(((0.0, 1.0, 0.0),)), model.size_m)
    return Pull(merge(parts), tuple(shapes), grasp, hookable=True)

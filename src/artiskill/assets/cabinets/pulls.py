"""Handles of cabinets ("pulls"): meshes, collision shapes and grasps, one builder per kind.

Builders work in one frame: the origin on the front's outer face behind the handle's middle, the room towards -x,
the handle's long side along z. `build_pull` brings the result to its place.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.cabinets.spec import HandleModel, HandlePlace
from artiskill.assets.handles import HandleGrasp, grasp_depth
from artiskill.assets.parts import IDENTITY, TO_X
from artiskill.geometry.arrays import norm, power
from artiskill.geometry.meshes import TriMesh, merge
from artiskill.geometry.primitives import box, cylinder, lathe, sphere, strip, torus
from artiskill.geometry.rotations import quat_from_axis_angle, quat_multiply, quat_rotate

# How far behind the face the surface lies under the lower (right) foot, the middle and the upper (left) foot.
Sinks = tuple[float, float, float]

FLAT_BAR_M = 0.008  # thickness of a flat bar, at right angles to the front
STRAP_M = 0.004  # thickness of a strap
# Thickness of a knob's head, relative to its diameter; a cone's is relative to the projection.
HEADS = {"disc": 0.32, "mushroom": 0.5, "ball": 0.92, "cone": 0.78, "square": 0.36}

_PART = "handle"
_HOOK_GAP_M = 0.012  # fingers hook where this much room is left between the front and what they hook
# How many collision shapes, by kind and shape; `arch` and `hooked` have one for each piece of their path.
_SHAPES = {"bar": 3, "bow": 3, "knob": 2, "ring": 7, "lip": 1, "slot": 2, "cup": 6, "arch": 5, "hooked": 2}
_TO_ROOM = quat_from_axis_angle((0, 1, 0), -np.pi / 2)  # z onto -x
_LYING = quat_from_axis_angle((1, 0, 0), -np.pi / 2)  # z onto y: lower becomes right
_ACROSS_Y = np.array(((0.0, 1.0, 0.0),))

_BAR_SIDES, _POST_SIDES, _BAR_BEVEL_M = 12, 10, 0.001
_CORNER = 0.55  # a bow's rounded corner, relative to its projection
_CUT_CORNER = 0.35  # how much of it the collision shape cuts off
_STRAP_FOOT_M = 0.003  # radius of the capsules that stand for a strap's feet
_ARCH_POWER = 2.6

_KNOB_SIDES, _KNOB_BEVEL_M = 20, 0.0015
_ROUND_TURNS = 4  # grasps of a round knob, each with its half turn: every 45 degrees
_RING_SEGMENTS = 6  # capsules of a ring
_ROSE_M = (0.014, 0.004)  # radius and thickness of the disc that a ring's neck stands on

_FLANGE_M = 0.0016  # thickness of the sheet that holds a lip on the front's face
_NOSE_M = 0.011  # height of a hooked lip's nose
_LIP_BEVEL_M = 0.0006
_LINING_M = 0.0015  # thickness of the sheet around a flush bar's cavity

_SHEET_M = 0.0022  # thickness of a cup
_ALONG, _AROUND = 17, 9  # points of a cup's mesh
_SECTORS = 3  # collision shapes along a cup, two around each
_POWERS = {"shell": 2.0, "box": 5.0}  # of the superellipse that bounds the cup as seen from the front


@dataclass(frozen=True, eq=False)
class Pull:
    """A built handle.

    Attributes:
        mesh: its surface.
        collisions: its collision shapes.
        grasp: where a hand takes hold.
        hookable: whether a finger fits behind it.
        recess: the lining of the cavity that it lies in, or None.
    """

    mesh: TriMesh
    collisions: tuple[CollisionShape, ...]
    grasp: HandleGrasp
    hookable: bool
    recess: TriMesh | None = None


def pull_shapes(model: HandleModel) -> int:
    """Return how many collision shapes a handle has."""
    return _SHAPES.get(model.shape, _SHAPES[model.kind])


def build_pull(model: HandleModel, place: HandlePlace, face: np.ndarray, sinks: Sinks) -> Pull:
    """Build a handle of any kind.

    Args:
        model: the handle.
        place: where it sits; only its length and direction are used.
        face: (3,) the point of the front's outer face behind the handle's centre, in the link's frame.
        sinks: how far behind that face the surface lies under the handle, see `Sinks`.
    """
    pull = _BUILDERS[model.kind](model, place.length_m, sinks)
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


def _bar_thickness(model: HandleModel) -> float:
    """Return the thickness of a bar or a bow at right angles to the front."""
    return {"flat": FLAT_BAR_M, "strap": STRAP_M}.get(model.shape, model.diameter_m)


def _build_bar(model: HandleModel, length_m: float, sinks: Sinks) -> Pull:
    """Build a straight bar on two posts; its shape is `round`, `square` or `flat`."""
    thick, radius, post = _bar_thickness(model), model.diameter_m / 2, model.post_m / 2
    half_length = length_m / 2 + model.overhang_m
    middle = thick / 2 - model.projection_m
    if model.shape == "round":
        meshes = [cylinder(radius, half_length, _BAR_SIDES, _BAR_BEVEL_M).transformed((middle, 0, 0))]
        end = half_length - radius
        shapes = [_capsule_between((middle, 0, -end), (middle, 0, end), radius)]
    else:
        centre, half = np.array((middle, 0.0, 0.0)), np.array((thick / 2, radius, half_length))
        meshes = [box(half, _BAR_BEVEL_M).transformed(centre)]
        shapes = [_box_between(centre - half, centre + half)]
    for sign, sink in ((-1, sinks[0]), (1, sinks[2])):
        z = sign * length_m / 2
        between = ((sink + middle) / 2, 0.0, z)
        meshes.append(cylinder(post, (sink - middle) / 2, _POST_SIDES).transformed(between, TO_X))
        shapes.append(_capsule_between((sink, 0, z), (middle, 0, z), post))
    grasp = _bar_grasp(model.projection_m, thick, model.diameter_m)
    return Pull(merge(meshes), tuple(shapes), grasp, _is_hookable(model.projection_m, thick))


def _build_bow(model: HandleModel, length_m: float, sinks: Sinks) -> Pull:
    """Build a bow: `arch` (one curve), `d` (straight, with round corners) or `strap` (a flat `d`)."""
    thick, width = _bar_thickness(model), model.diameter_m
    out, half = model.projection_m - thick / 2, length_m / 2
    straight = half - _CUT_CORNER * out
    if model.shape == "arch":
        s = np.linspace(-1.0, 1.0, 15)
        path = np.stack((-out * (1 - power(np.abs(s), _ARCH_POWER)), 0 * s, half * s), axis=-1)
        coarse = path[[0, 3, 5, 9, 11, 14]]
    else:
        path = _d_path(out, half)
        coarse = np.array(((0.0, 0.0, -half), (-out, 0.0, -straight), (-out, 0.0, straight), (0.0, 0.0, half)))
    for points in (path, coarse):
        points[0, 0], points[-1, 0] = sinks[0], sinks[2]
    pieces = list(pairwise(coarse))
    if model.shape == "strap":
        mesh = strip(path, _ACROSS_Y[0], width / 2, thick / 2, 4)
        low, high = (-out - thick / 2, -width / 2, -straight), (-out + thick / 2, width / 2, straight)
        feet = [_capsule_between(*piece, radius=_STRAP_FOOT_M) for piece in (pieces[0], pieces[-1])]
        shapes = [_box_between(low, high), *feet]
    else:
        mesh = strip(path, _ACROSS_Y[0], width / 2, thick / 2, _BAR_SIDES)
        shapes = [_capsule_between(*piece, radius=thick / 2) for piece in pieces]
    grasp = _bar_grasp(model.projection_m, thick, width)
    return Pull(mesh, tuple(shapes), grasp, _is_hookable(model.projection_m, thick))


def _d_path(out: float, half: float) -> np.ndarray:
    """Return a path out, round the corner, along, round the corner and back, (P, 3)."""
    radius = min(_CORNER * out, 0.5 * half)
    turn = np.linspace(0, np.pi / 2, 5)
    x, z = -(out - radius) - radius * np.sin(turn), half - radius + radius * np.cos(turn)
    upper = np.stack((x, 0 * x, z), axis=-1)  # from the leg to the bar
    lower = upper[::-1] * (1, 1, -1)
    return np.concatenate((((0, 0, -half),), lower[::-1], upper[::-1], ((0, 0, half),)))


def _head_thickness(model: HandleModel) -> float:
    """Return the thickness of a knob's head at right angles to the front."""
    return HEADS[model.shape] * (model.projection_m if model.shape == "cone" else model.diameter_m)


def _build_knob(model: HandleModel, length_m: float, sinks: Sinks) -> Pull:
    """Build a knob; its shape is `disc`, `mushroom`, `ball`, `cone` or `square`."""
    radius, out, thick = model.diameter_m / 2, model.projection_m, _head_thickness(model)
    foot, neck, back = -sinks[1], model.post_m / 2, out - thick  # heights over the face
    if model.shape == "square":
        middle = np.array((-(back + thick / 2), 0.0, 0.0))
        half = np.array((thick / 2, radius, radius))
        mesh = merge(
            [
                box(half, _KNOB_BEVEL_M).transformed(middle),
                cylinder(neck, (back - foot) / 2, 12).transformed((-(back + foot) / 2, 0, 0), _TO_ROOM),
            ]
        )
        head = _box_between(middle - half, middle + half)
    else:
        profile = [(0.0, foot), (1.25 * neck, foot), (neck, foot + 0.3 * (back - foot))]
        mesh = lathe(profile + _head(model.shape, radius, neck, back, out), _KNOB_SIDES).transformed(
            (0, 0, 0), _TO_ROOM
        )
        head = _head_shape(model.shape, radius, back, out)
    shapes = (head, _capsule_between((-foot - neck / 2, 0, 0), (-back, 0, 0), neck))
    depth = thick / 2 if model.shape == "ball" else grasp_depth(thick)
    turns = np.arange(2 if model.shape == "square" else _ROUND_TURNS)
    angles = turns * np.pi / len(turns)
    across = np.stack((0 * angles, np.cos(angles), np.sin(angles)), axis=-1)
    grasp = HandleGrasp(np.array((-(out - depth), 0.0, 0.0)), across, model.diameter_m)
    return Pull(mesh, shapes, grasp, hookable=radius - neck >= 0.008)


def _head(shape: str, radius: float, neck: float, back: float, out: float) -> list[tuple[float, float]]:
    """Return the profile of a round head from the neck to the front, as radius and height."""
    thick = out - back
    if shape == "disc":
        b = _KNOB_BEVEL_M
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


def _head_shape(shape: str, radius: float, back: float, out: float) -> CollisionShape:
    if shape == "ball":
        return CollisionShape("sphere", (radius,), np.array((radius - out, 0.0, 0.0)), _TO_ROOM, part=_PART)
    thick = out - back
    front = out - 0.2 * thick if shape == "mushroom" else out  # a dome stands out of its cylinder
    back += {"cone": 0.35, "mushroom": 0.1}.get(shape, 0.0) * thick
    centre = np.array((-(front + back) / 2, 0.0, 0.0))
    reduced = 0.93 * radius if shape == "cone" else radius
    return CollisionShape("cylinder", (reduced, (front - back) / 2), centre, _TO_ROOM, part=_PART)


def _build_ring(model: HandleModel, length_m: float, sinks: Sinks) -> Pull:
    """Build a rigid ring that hangs before the front from a neck on a rose."""
    wire, outer = model.diameter_m / 2, model.size_m / 2
    middle, x = outer - wire, -(model.projection_m - wire)
    ring = torus(middle, wire, 28, 8).transformed((x, 0, 0), _TO_ROOM)
    top, foot = np.array((x, 0.0, middle)), np.array((sinks[1], 0.0, middle))
    rose_radius, rose = _ROSE_M
    neck = model.post_m / 2
    parts = [
        ring,
        sphere(1.35 * wire + 0.001, 12, 5).transformed(top),
        cylinder(neck, (foot[0] - x) / 2, 12).transformed((top + foot) / 2, _TO_ROOM),
        cylinder(rose_radius, rose / 2, 20, 0.001).transformed(foot - (rose / 2, 0, 0), _TO_ROOM),
    ]
    # corners of a hexagon halfway between the ring's own inscribed and circumscribed one
    reach = middle * 2 / (1 + np.cos(np.pi / _RING_SEGMENTS))
    angles = np.arange(_RING_SEGMENTS + 1) * (2 * np.pi / _RING_SEGMENTS)
    corners = np.stack((0 * angles + x, reach * np.sin(angles), reach * np.cos(angles)), axis=-1)
    shapes = [_capsule_between(corners[k], corners[k + 1], wire) for k in range(_RING_SEGMENTS)]
    shapes.append(_capsule_between(foot, top, neck))
    grasp = HandleGrasp(np.array((x, 0.0, 0.0)), _ACROSS_Y, model.size_m)
    return Pull(merge(parts), tuple(shapes), grasp, hookable=True)


def _build_lip(model: HandleModel, length_m: float, sinks: Sinks) -> Pull:
    """Build a board along a front's edge, `flat` or `hooked` (with a nose); its flange is towards +y."""
    half, out, thick = length_m / 2, model.projection_m, model.diameter_m
    edge = -thick / 2
    board = ((-out, edge, -half), (0.0, edge + thick, half))
    flange = ((-_FLANGE_M, edge, -half), (0.0, edge + model.size_m, half))
    pieces, shapes = [board, flange], [_box_between(*board)]
    width = thick
    if model.shape == "hooked":
        width = max(_NOSE_M, thick)
        pieces.append(((-out, edge, -half), (-out + max(thick, 0.004), edge + width, half)))
        shapes.append(_box_between(*pieces[-1]))
    meshes = [_solid(low, high, _LIP_BEVEL_M) for low, high in pieces]
    grasp = HandleGrasp(np.array((-out + grasp_depth(out), edge + width / 2, 0.0)), _ACROSS_Y, width)
    return Pull(merge(meshes), tuple(shapes), grasp, hookable=model.shape == "hooked")


def _build_slot(model: HandleModel, length_m: float, sinks: Sinks) -> Pull:
    """Build a bar across a lined cavity, flush with the front; its shape is `round` or `square`.

    The cavity is open towards the room; the boards of the front around it are its walls as far as they reach.
    """
    half, side, depth, radius = length_m / 2, model.size_m / 2, model.projection_m, model.diameter_m / 2
    middle = np.array((radius, 0.0, 0.0))
    if model.shape == "round":
        bar = cylinder(radius, half, _BAR_SIDES)
        solid: CollisionShape = _capsule_between((radius, 0, -half), (radius, 0, half), radius)
    else:
        bar = box((radius, radius, half), 0.001)
        solid = _box_between((0.0, -radius, -half), (2 * radius, radius, half))
    t = _LINING_M
    walls = (
        ((depth, -side, -half), (depth + t, side, half)),
        ((0.0005, -side - t, -half - t), (depth + t, -side, half + t)),
        ((0.0005, side, -half - t), (depth + t, side + t, half + t)),
        ((0.0005, -side, -half - t), (depth + t, side, -half)),
        ((0.0005, -side, half), (depth + t, side, half + t)),
    )
    back = _box_between((depth, -side, -half), (depth + 0.002, side, half))
    grasp = _bar_grasp(0.0, 2 * radius, model.diameter_m)
    recess = merge([_solid(low, high, 0.0) for low, high in walls])
    return Pull(bar.transformed(middle), (solid, back), grasp, hookable=True, recess=recess)


def _solid(low: Any, high: Any, bevel_m: float) -> TriMesh:
    a, b = np.array(low), np.array(high)
    return box((b - a) / 2, bevel_m).transformed((a + b) / 2)


def _build_cup(model: HandleModel, length_m: float, sinks: Sinks) -> Pull:
    """Build a cup whose opening faces +y; its shape is `shell` (half round) or `box` (nearly square)."""
    outer, inner = (_cup_surface(model, length_m, inset) for inset in (0.0, _SHEET_M))
    shapes = []
    along = np.linspace(0, _ALONG - 1, _SECTORS + 1).astype(int)
    around = (0, _AROUND // 2, _AROUND - 1)
    for k in range(_SECTORS):
        for j in range(2):
            cut = (slice(along[k], along[k + 1] + 1), slice(around[j], around[j + 1] + 1))
            corners = np.concatenate((outer[cut].reshape(-1, 3), inner[cut].reshape(-1, 3)))
            centre = corners.mean(axis=0)
            shapes.append(CollisionShape("hull", (), centre, IDENTITY, corners - centre, _PART))
    grasp = _bar_grasp(model.projection_m, model.projection_m, model.size_m)
    return Pull(_skin(outer, inner), tuple(shapes), grasp, hookable=True)


def _cup_surface(model: HandleModel, length_m: float, inset_m: float) -> np.ndarray:
    """Return points of a cup, `inset_m` within its outer skin, from the face round to the lip: (17, 9, 3)."""
    half = length_m / 2 + model.overhang_m - inset_m
    height, out = model.size_m - inset_m, model.projection_m - inset_m
    s = -np.cos(np.linspace(0.0, np.pi, _ALONG))  # dense at the ends
    bend = _POWERS[model.shape]
    width = power(np.maximum(1.0 - power(np.abs(s), bend), 0.01), 1 / bend)
    angle = np.linspace(0.0, np.pi / 2, _AROUND)
    y = model.size_m / 2 - height * width[:, None] * np.cos(angle)
    x = -out * power(width, 0.7)[:, None] * np.sin(angle)
    z = np.broadcast_to((half * s)[:, None], y.shape)
    return np.stack((x, y, z), axis=-1)


def _skin(outer: np.ndarray, inner: np.ndarray) -> TriMesh:
    """Close two skins, grids (N, M, 3), by the rim between them."""
    n, m = outer.shape[:2]
    index = np.arange(n * m).reshape(n, m)

    def quads(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
        a, b, c, d = (k.ravel() for k in (a, b, c, d))
        return np.concatenate((np.stack((a, b, c), axis=1), np.stack((a, c, d), axis=1)))

    skin = quads(index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
    rim = np.concatenate((index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]))
    after = np.roll(rim, -1)
    shift = n * m
    band = quads(rim, rim + shift, after + shift, after)
    faces = np.concatenate((skin, skin[:, ::-1] + shift, band))
    return TriMesh(np.concatenate((outer.reshape(-1, 3), inner.reshape(-1, 3))), faces)


def _capsule_between(start: Any, end: Any, radius: float) -> CollisionShape:
    """Return a capsule whose caps are centred on two points."""
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    length = float(norm(b - a))
    return CollisionShape("capsule", (radius, length / 2), (a + b) / 2, _turn_onto((b - a) / length), part=_PART)


def _box_between(low: Any, high: Any) -> CollisionShape:
    """Return a box between two corners."""
    a, b = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    return CollisionShape("box", tuple(((b - a) / 2).tolist()), (a + b) / 2, IDENTITY, part=_PART)


def _turn_onto(direction: np.ndarray) -> np.ndarray:
    """Return the least rotation, (4,), of the z axis onto a unit vector."""
    axis = np.cross((0.0, 0.0, 1.0), direction)
    sine = float(norm(axis))
    if sine < 1e-9:
        return IDENTITY
    return quat_from_axis_angle(axis, math.atan2(sine, direction[2]))


def _bar_grasp(projection_m: float, thickness_m: float, width_m: float) -> HandleGrasp:
    """Return the grasp across the middle of a part that stands so far out and is so thick (x) and so wide (y)."""
    centre = np.array((-projection_m + grasp_depth(thickness_m), 0.0, 0.0))
    return HandleGrasp(centre, _ACROSS_Y, width_m)


def _is_hookable(projection_m: float, thickness_m: float) -> bool:
    """Return whether a finger fits behind a part of this projection and thickness."""
    return projection_m - thickness_m >= _HOOK_GAP_M


_BUILDERS: dict[str, Callable[[HandleModel, float, Sinks], Pull]] = {
    "bar": _build_bar,
    "bow": _build_bow,
    "knob": _build_knob,
    "ring": _build_ring,
    "lip": _build_lip,
    "slot": _build_slot,
    "cup": _build_cup,
}

"""Armrests: a pad on a post, a loop, or an arm that comes forward from the back."""

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.chairs.appearance import Skins
from artiskill.assets.chairs.back import BackPlane
from artiskill.assets.chairs.beams import Beam, Tube
from artiskill.assets.chairs.pen import Pen
from artiskill.assets.chairs.spec import ChairSpec
from artiskill.assets.parts import IDENTITY
from artiskill.geometry.primitives import rounded_box

_X, _Y, _Z = np.eye(3)
_BRACKET_M = 0.009
_CLEAR_OF_BOX_M = 0.008
_POST_M = (0.046, 0.020)  # along x, along y
_LOOP_M = (0.030, 0.016)  # width along y, thickness
_LOOP_TUBE_M = 0.0125
_ARM_X_M = 0.01  # middle of the armrests


def add_arms(pen: Pen, spec: ChairSpec, skins: Skins) -> None:
    """Draw and touch both armrests."""
    builders = {"tee": _add_tee, "loop": _add_loop, "cantilever": _add_cantilever}
    if spec.arms.kind in builders:
        for side in (-1, 1):
            builders[spec.arms.kind](pen, spec, side, skins)


def arm_y_m(spec: ChairSpec) -> float:
    """Distance of the armrests' middles from the middle of the chair."""
    return max(spec.arms.clear_m / 2 + spec.arms.width_m / 2, spec.seat.width_m / 2 + 0.022)


def _top(spec: ChairSpec) -> float:
    return spec.seat.height_m + spec.arms.height_m


def _inner_y(spec: ChairSpec) -> float:
    """Where brackets begin: beside the mechanism, which a tilting seat moves against."""
    return spec.mechanism.width_m / 2 + _CLEAR_OF_BOX_M


def _add_pad(pen: Pen, spec: ChairSpec, x: float, y: float, skins: Skins) -> None:
    arms = spec.arms
    half = (arms.length_m / 2, arms.width_m / 2, arms.thickness_m / 2)
    centre = np.array((x, y, _top(spec) - half[2]))
    pen.mesh(rounded_box(half, 0.45 * arms.width_m, 4, 0.4 * half[2]).transformed(centre), skins.pad, "arm")
    pen.shape(CollisionShape("box", (half[0] - 0.004, half[1] - 0.002, half[2]), centre, IDENTITY, part="arm"))


def _add_tee(pen: Pen, spec: ChairSpec, side: int, skins: Skins) -> None:
    y, x = side * arm_y_m(spec), _ARM_X_M
    under = spec.seat_bottom_m - _BRACKET_M / 2
    bracket = [(x, side * _inner_y(spec), under), (x, y, under)]
    pen.bar(Beam(bracket, 1.1 * _POST_M[0], _BRACKET_M, _X), skins.frame, "arm")
    post = [(x, y, under - _BRACKET_M / 2), (x, y, _top(spec) - 0.8 * spec.arms.thickness_m)]
    pen.bar(Beam(post, _POST_M[0], _POST_M[1], _X), skins.frame, "arm")
    _add_pad(pen, spec, x - 0.015, y, skins)


def _add_loop(pen: Pen, spec: ChairSpec, side: int, skins: Skins) -> None:
    """A loop from under the seat's front to under its rear."""
    y = side * arm_y_m(spec)
    inner = side * _inner_y(spec)
    top = _top(spec) - (0.8 * spec.arms.thickness_m if spec.arms.padded else _LOOP_M[1] / 2)
    half = spec.arms.length_m / 2
    front, rear = _ARM_X_M - half, _ARM_X_M + half
    foot = 0.75 * half
    if skins.frame.material.texture is None and not spec.arms.padded:
        under = spec.seat_bottom_m - _LOOP_TUBE_M
        xs = (_ARM_X_M - foot, _ARM_X_M - foot, front, rear, _ARM_X_M + foot, _ARM_X_M + foot)
        start = inner + side * _LOOP_TUBE_M  # a capsule's end is round
        ys, zs = (start, y, y, y, y, start), (under, under, top, top, under, under)
        pen.bar(Tube(list(zip(xs, ys, zs, strict=True)), _LOOP_TUBE_M), skins.frame, "arm", 0.035, 8)
        return
    under = spec.seat_bottom_m - _BRACKET_M / 2
    corners = [(_ARM_X_M - foot, under), (front, top), (rear, top), (_ARM_X_M + foot, under)]
    pen.bar(Beam([(x, y, z) for x, z in corners], *_LOOP_M, _Y), skins.frame, "arm", 0.035, 8)
    bracket = Beam([(_ARM_X_M, inner, under), (_ARM_X_M, y, under)], 2 * foot + 0.02, _BRACKET_M, _X)
    pen.bar(bracket, skins.frame, "arm")
    if spec.arms.padded:
        _add_pad(pen, spec, _ARM_X_M, y, skins)


def _add_cantilever(pen: Pen, spec: ChairSpec, side: int, skins: Skins) -> None:
    """From the back's edge outwards and forwards."""
    plane, y = BackPlane(spec), side * arm_y_m(spec)
    z = _top(spec) - 0.7 * spec.arms.thickness_m
    u = (z - plane.origin[2]) / plane.axes[0, 2]
    v = side * (spec.back.width_m / 2 - 0.03) * (1.0 - spec.back.taper * u / spec.back.height_m)
    root = plane.point(u, v, plane.forward(u, v) + 0.4 * spec.back.thickness_m)
    tip = _ARM_X_M - spec.arms.length_m / 2
    path = [(root[0], root[1], z), (root[0] - 0.03, y, z), (tip + 0.02, y, z)]
    pen.bar(Beam(path, 0.034, 0.018, _Z), skins.frame, "arm", 0.03, 8)
    _add_pad(pen, spec, _ARM_X_M - 0.01, y, skins)

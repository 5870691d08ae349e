"""Bars on two posts, and bows: handles in one piece from foot to foot."""

from itertools import pairwise

import numpy as np

from artiskill.assets.cabinets.pulls.pull import (
    ROUND_SIDES,
    TO_X,
    Pull,
    Sinks,
    bar_grasp,
    block,
    capsule_between,
    is_hookable,
)
from artiskill.assets.cabinets.spec import HandleModel
from artiskill.geometry.arrays import power
from artiskill.geometry.meshes import merge
from artiskill.geometry.primitives import box, cylinder, strip

_POST_SIDES = 10
_BEVEL_M = 0.001
FLAT_BAR_M = 0.008  # thickness of a flat bar, at right angles to the front
STRAP_M = 0.004  # likewise of a strap
_CORNER = 0.55  # a bow's rounded corner, relative to its projection
_CUT_CORNER = 0.35  # how much of it the touched shape cuts off
_STRAP_FOOT_M = 0.003  # radius of the capsules that stand for a strap's feet
_ARCH_POWER = 2.6
_Y = np.array((0.0, 1.0, 0.0))


def bar_thickness(model: HandleModel) -> float:
    """Of a bar or a bow, at right angles to the front."""
    return {"flat": FLAT_BAR_M, "strap": STRAP_M}.get(model.shape, model.diameter_m)


def build_bar(model: HandleModel, length_m: float, sinks: Sinks) -> Pull:
    """A straight bar on two posts; its shape is `round`, `square` or `flat`."""
    thick, radius, post = bar_thickness(model), model.diameter_m / 2, model.post_m / 2
    half_length = length_m / 2 + model.overhang_m
    middle = thick / 2 - model.projection_m
    if model.shape == "round":
        meshes = [cylinder(radius, half_length, ROUND_SIDES, _BEVEL_M).transformed((middle, 0, 0))]
        end = half_length - radius
        shapes = [capsule_between((middle, 0, -end), (middle, 0, end), radius)]
    else:
        centre, half = np.array((middle, 0.0, 0.0)), np.array((thick / 2, radius, half_length))
        meshes = [box(half, _BEVEL_M).transformed(centre)]
        shapes = [block(centre - half, centre + half)]
    for sign, sink in ((-1, sinks[0]), (1, sinks[2])):
        z = sign * length_m / 2
        between = ((sink + middle) / 2, 0.0, z)
        meshes.append(cylinder(post, (sink - middle) / 2, _POST_SIDES).transformed(between, TO_X))
        shapes.append(capsule_between((sink, 0, z), (middle, 0, z), post))
    grasp = bar_grasp(model.projection_m, thick, model.diameter_m)
    return Pull(merge(meshes), tuple(shapes), grasp, is_hookable(model.projection_m, thick))


def build_bow(model: HandleModel, length_m: float, sinks: Sinks) -> Pull:
    """A bow; its shape is `arch` (one curve), `d` (straight, with round corners) or `strap` (flat, likewise)."""
    thick, width = bar_thickness(model), model.diameter_m
    out, half = model.projection_m - thick / 2, length_m / 2
    straight = half - _CUT_CORNER * out
    if model.shape == "arch":
        s = np.linspace(-1.0, 1.0, 15)
        path = np.stack((-out * (1 - power(np.abs(s), _ARCH_POWER)), 0 * s, half * s), axis=-1)
        touched = path[[0, 3, 5, 9, 11, 14]]
    else:
        path = _d_path(out, half)
        touched = np.array(((0.0, 0.0, -half), (-out, 0.0, -straight), (-out, 0.0, straight), (0.0, 0.0, half)))
    for points in (path, touched):
        points[0, 0], points[-1, 0] = sinks[0], sinks[2]
    pieces = list(pairwise(touched))
    if model.shape == "strap":
        mesh = strip(path, _Y, width / 2, thick / 2, 4)
        low, high = (-out - thick / 2, -width / 2, -straight), (-out + thick / 2, width / 2, straight)
        feet = [capsule_between(*piece, radius=_STRAP_FOOT_M) for piece in (pieces[0], pieces[-1])]
        shapes = [block(low, high), *feet]
    else:
        mesh = strip(path, _Y, width / 2, thick / 2, ROUND_SIDES)
        shapes = [capsule_between(*piece, radius=thick / 2) for piece in pieces]
    grasp = bar_grasp(model.projection_m, thick, width)
    return Pull(mesh, tuple(shapes), grasp, is_hookable(model.projection_m, thick))


def _d_path(out: float, half: float) -> np.ndarray:
    """Out, round the corner, along, round the corner, back: (P, 3)."""
    radius = min(_CORNER * out, 0.5 * half)
    turn = np.linspace(0, np.pi / 2, 5)
    x, z = -(out - radius) - radius * np.sin(turn), half - radius + radius * np.cos(turn)
    upper = np.stack((x, 0 * x, z), axis=-1)  # from the leg to the bar
    lower = upper[::-1] * (1, 1, -1)
    return np.concatenate((((0, 0, -half),), lower[::-1], upper[::-1], ((0, 0, half),)))

"""Lips along a front's edge, and flush bars in a hollow that is routed into the front."""

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.cabinets.pulls.pull import (
    ROUND_SIDES,
    Pull,
    Sinks,
    bar_grasp,
    block,
    capsule_between,
)
from artiskill.assets.cabinets.spec import HandleModel
from artiskill.assets.handles import HandleGrasp, grasp_depth
from artiskill.geometry.meshes import TriMesh, merge
from artiskill.geometry.primitives import box, cylinder

Corner = tuple[float, float, float]

_FLANGE_M = 0.0016  # thickness of the sheet that holds a lip on the front's face
_NOSE_M = 0.011  # height of a hooked lip's nose
_LINING_M = 0.0015
_BEVEL_M = 0.0006


def build_lip(model: HandleModel, length_m: float, sinks: Sinks) -> Pull:
    """A board that stands out along a front's edge, `flat` or `hooked` (with a nose); its flange is towards +y."""
    half, out, thick = length_m / 2, model.projection_m, model.diameter_m
    edge = -thick / 2
    board = ((-out, edge, -half), (0.0, edge + thick, half))
    flange = ((-_FLANGE_M, edge, -half), (0.0, edge + model.size_m, half))
    pieces, shapes = [board, flange], [block(*board)]
    width = thick
    if model.shape == "hooked":
        width = max(_NOSE_M, thick)
        pieces.append(((-out, edge, -half), (-out + max(thick, 0.004), edge + width, half)))
        shapes.append(block(*pieces[-1]))
    meshes = [_solid(low, high, _BEVEL_M) for low, high in pieces]
    grasp = HandleGrasp(
        np.array((-out + grasp_depth(out), edge + width / 2, 0.0)), np.array(((0.0, 1.0, 0.0),)), width
    )
    return Pull(merge(meshes), tuple(shapes), grasp, hookable=model.shape == "hooked")


def build_slot(model: HandleModel, length_m: float, sinks: Sinks) -> Pull:
    """A bar across a lined hollow, flush with the front; its shape is `round` or `square`.

    The hollow is open towards the room; the boards of the front around it are its walls as far as they reach.
    """
    half, side, depth, radius = length_m / 2, model.size_m / 2, model.projection_m, model.diameter_m / 2
    middle = np.array((radius, 0.0, 0.0))
    if model.shape == "round":
        bar = cylinder(radius, half, ROUND_SIDES)
        touched: CollisionShape = capsule_between((radius, 0, -half), (radius, 0, half), radius)
    else:
        bar = box((radius, radius, half), 0.001)
        touched = block((0.0, -radius, -half), (2 * radius, radius, half))
    t = _LINING_M
    walls = (
        ((depth, -side, -half), (depth + t, side, half)),
        ((0.0005, -side - t, -half - t), (depth + t, -side, half + t)),
        ((0.0005, side, -half - t), (depth + t, side + t, half + t)),
        ((0.0005, -side, -half - t), (depth + t, side, -half)),
        ((0.0005, -side, half), (depth + t, side, half + t)),
    )
    back = block((depth, -side, -half), (depth + 0.002, side, half))
    grasp = bar_grasp(0.0, 2 * radius, model.diameter_m)
    recess = merge([_solid(low, high, 0.0) for low, high in walls])
    return Pull(bar.transformed(middle), (touched, back), grasp, hookable=True, recess=recess)


def _solid(low: Corner, high: Corner, bevel_m: float) -> TriMesh:
    a, b = np.array(low), np.array(high)
    return box((b - a) / 2, bevel_m).transformed((a + b) / 2)

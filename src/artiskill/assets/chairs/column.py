"""Column, gas lift, ring for the feet, and the mechanism under the seat."""

import math

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.chairs.appearance import Skins
from artiskill.assets.chairs.base import hub_top_m
from artiskill.assets.chairs.beams import Beam, Tube, loop_mesh
from artiskill.assets.chairs.pen import Pen
from artiskill.assets.chairs.spec import ChairSpec, Column
from artiskill.assets.parts import IDENTITY
from artiskill.geometry.primitives import cylinder, lathe, rounded_box

_GAP_M = 0.001  # between shapes of links that move against one another
_BEHIND_PIVOT_M = 0.012  # how far the mechanism reaches behind the tilt axis
_RING_TUBE_M = 0.010
_RING_CHORDS = 12
_LEVER_M = 0.005


def tube_top_m(spec: ChairSpec) -> float:
    """Where the outer tube ends."""
    assert spec.column is not None, "only a column has a tube"
    low = hub_top_m(spec)
    return low + spec.column.top_share * (spec.mechanism_bottom_m - low)


def add_tube(pen: Pen, spec: ChairSpec, skins: Skins) -> None:
    """The outer tube on the base, its cover, and the ring for the feet."""
    column = spec.column
    assert column is not None, "only a column has a tube"
    low, high = hub_top_m(spec) - 0.004, tube_top_m(spec)
    if column.cover:
        middle = (low + high) / 2
        wide, narrow = column.tube_m + 0.008, column.tube_m + 0.003
        profile = [(0.0, low), (wide, low), (wide, middle - 0.003), (narrow, middle), (narrow, high), (0.0, high)]
        pen.mesh(lathe(profile, 18), skins.tube, "column")
    else:
        pen.mesh(
            cylinder(column.tube_m, (high - low) / 2, 18, 0.002).transformed((0, 0, (low + high) / 2)),
            skins.tube,
            "column",
        )
    radius = column.tube_m + (0.005 if column.cover else 0.0)
    pen.shape(_upright(radius, low, high))
    if column.footrest_m > 0:
        _add_ring(pen, column, skins)


def add_piston(pen: Pen, spec: ChairSpec, skins: Skins) -> None:
    """The inner tube, from within the outer one up to the mechanism."""
    column = spec.column
    assert column is not None, "only a column has a piston"
    low, high = tube_top_m(spec), spec.mechanism_bottom_m
    hidden = low - min(column.travel_m + 0.01 if column.travel_m > 0 else _GAP_M, low - 0.03)
    mesh = cylinder(column.piston_m, (high - hidden) / 2, 14).transformed((0, 0, (high + hidden) / 2))
    pen.mesh(mesh, skins.piston, "column")
    pen.shape(_upright(column.piston_m, low + _GAP_M, high - _GAP_M))


def pivot(spec: ChairSpec) -> np.ndarray:
    """(3,) a point on the axis about which the seat leans back."""
    height = spec.mechanism_top_m - spec.mechanism.height_m / 2
    return np.array((spec.mechanism.pivot_m, 0.0, height))


def add_mechanism(pen: Pen, spec: ChairSpec, skins: Skins) -> None:
    """The box under the seat, and its lever."""
    box = spec.mechanism
    rear = box.pivot_m + _BEHIND_PIVOT_M
    half = (box.length_m / 2, box.width_m / 2, box.height_m / 2)
    centre = np.array((rear - half[0], 0.0, spec.mechanism_top_m - half[2]))
    pen.mesh(rounded_box(half, 0.02, 3, 0.006).transformed(centre), skins.tube, "seat")
    pen.shape(CollisionShape("box", half, centre, IDENTITY, part="seat"))
    if box.lever:
        x, z = centre[0] + 0.02, centre[2] - 0.2 * box.height_m
        end = spec.seat.width_m / 2 - 0.01
        pen.bar(Tube([(x, half[1] - 0.005, z), (x, end, z)], _LEVER_M), skins.piston, "seat")
        paddle = rounded_box((0.014, 0.030, 0.005), 0.01, 3, 0.002).transformed((x, end, z))
        pen.mesh(paddle, skins.tube, "seat")


def _add_ring(pen: Pen, column: Column, skins: Skins) -> None:
    """A ring on spokes around the outer tube."""
    angles = np.arange(_RING_CHORDS * 3) * (2 * math.pi / (_RING_CHORDS * 3))
    circle = np.stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)), axis=1)
    height = np.array((0.0, 0.0, column.footrest_height_m))
    pen.mesh(loop_mesh(column.footrest_m * circle + height, _RING_TUBE_M), skins.piston, "footrest")
    # chords that lie as far within the ring at their middle as beyond it at their ends
    reach = column.footrest_m * (1 + (1 - math.cos(math.pi / _RING_CHORDS)) / 2)
    corners = reach * circle[::3] + height
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        for shape in Tube([start, end], _RING_TUBE_M).shapes("footrest"):
            pen.shape(shape)
    for k in range(3):
        out = circle[k * _RING_CHORDS]
        start, end = height + (column.tube_m - 0.004) * out, height + column.footrest_m * out
        pen.bar(Beam([start, end], 0.018, 0.008, (-out[1], out[0], 0.0)), skins.piston, "footrest")
    collar = cylinder(column.tube_m + 0.007, 0.014, 18, 0.003).transformed(height)
    pen.mesh(collar, skins.piston, "footrest")


def _upright(radius: float, low: float, high: float) -> CollisionShape:
    centre = np.array((0.0, 0.0, (low + high) / 2))
    return CollisionShape("cylinder", (radius, (high - low) / 2), centre, IDENTITY, part="column")

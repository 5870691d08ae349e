"""How the body under the arm looks: mobile base, lifted column, and a torso in the manner of the Sciurus17."""

import math

from artiskill.assets.articulated_object import VisualMesh
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import box, extrude, lathe, rounded_box, rounded_rectangle, superellipse_loft
from artiskill.geometry.rotations import quat_from_axis_angle
from artiskill.robots.visual_materials import ACCENT, BLACK, GREY, JOINT, NAVY, WHITE, drawn, drum

SHOULDER_X, SHOULDER_Z = 0.08083, 0.2885  # of joint 1's axis in the torso's frame
SHOULDER_END = 0.111  # |y| at which the arm's flange begins: 0.3012 less link 1's 0.19
WAIST_ABOVE_LIFT = 0.1315
_TO_PLUS_Y = quat_from_axis_angle((1, 0, 0), -math.pi / 2)  # z to y
_TO_PLUS_X = quat_from_axis_angle((0, 1, 0), math.pi / 2)  # z to x


def mobile_base() -> tuple[VisualMesh, ...]:
    """A low platform on four wheels; frame on the ground, x forward."""
    plinth = extrude(rounded_rectangle(0.235, 0.160, 0.05), 0.022).transformed((0, 0, 0.046))
    deck = rounded_box((0.25, 0.20, 0.022), 0.08, arc=4, bevel_m=0.008).transformed((0, 0, 0.096))
    strip = extrude(rounded_rectangle(0.247, 0.197, 0.077, 4), 0.006).transformed((0, 0, 0.070))
    wheels = [
        drum(0.04, 0.016, 14).transformed((x, y, 0.04), _TO_PLUS_Y) for x in (-0.15, 0.15) for y in (-0.176, 0.176)
    ]
    return drawn("mobile_base", (WHITE, [deck]), (JOINT, [plinth]), (ACCENT, [strip]), (BLACK, wheels))


def lift() -> tuple[VisualMesh, ...]:
    """The column: a mast of two stages hanging down, and the plate that carries the torso at z = 0."""
    upper = extrude(rounded_rectangle(0.095, 0.070, 0.03), 0.24).transformed((0, 0, -0.25))
    lower = extrude(rounded_rectangle(0.130, 0.090, 0.03), 0.575).transformed((0, 0, -1.025))
    plate = extrude(rounded_rectangle(0.115, 0.088, 0.04), 0.010).transformed((0, 0, -0.010))
    inlay = box((0.0965, 0.018, 0.24)).transformed((0, 0, -0.25))
    return drawn("lift", (GREY, [upper]), (JOINT, [lower, plate]), (WHITE, [inlay]))


def torso() -> tuple[VisualMesh, ...]:
    """Base, chest, shoulders, neck and head; frame at the waist."""
    base = superellipse_loft(
        [
            (-WAIST_ABOVE_LIFT, 0, 0, 0.098, 0.082, 4),
            (-0.095, 0, 0, 0.096, 0.080, 4),
            (-0.040, 0.005, 0, 0.066, 0.066, 2.6),
            (-0.004, 0.008, 0, 0.060, 0.062, 2.2),
        ]
    )
    waist = drum(0.052, 0.014).transformed((0.010, 0, 0.004))
    neck = drum(0.027, 0.030, 8).transformed((0.050, 0, 0.400))
    # one drum from shoulder to shoulder in white, a thinner and longer one whose ends the arms' flanges meet
    yoke, axle = (
        drum(radius, end, 16).transformed((SHOULDER_X, 0, SHOULDER_Z), _TO_PLUS_Y)
        for radius, end in ((0.066, SHOULDER_END - 0.016), (0.057, SHOULDER_END))
    )
    visor, lenses, ears = _face()
    return drawn(
        "torso",
        (WHITE, [_chest(), yoke, _head()]),
        (NAVY, [base, _belly()]),
        (JOINT, [waist, neck, axle, *ears]),
        (BLACK, [visor]),
        (ACCENT, lenses),
    )


def _chest() -> TriMesh:
    """The white shell: narrow at the waist, broad and forward at the shoulders."""
    return superellipse_loft(
        [
            (0.014, 0.012, 0, 0.050, 0.058, 2.5),
            (0.060, 0.018, 0, 0.064, 0.072, 2.8),
            (0.200, 0.044, 0, 0.092, 0.086, 3),
            (0.300, 0.054, 0, 0.100, 0.088, 3.2),
            (0.350, 0.054, 0, 0.080, 0.078, 3),
            (0.374, 0.050, 0, 0.042, 0.044, 2.5),
        ]
    )


def _belly() -> TriMesh:
    """The dark plate that stands out of the chest's front."""
    return superellipse_loft(
        [
            (0.070, 0.052, 0, 0.046, 0.026, 6),
            (0.105, 0.066, 0, 0.052, 0.044, 6),
            (0.190, 0.088, 0, 0.060, 0.052, 6),
            (0.225, 0.094, 0, 0.060, 0.046, 6),
        ],
        12,
    )


def _head() -> TriMesh:
    return superellipse_loft(
        [
            (0.420, 0.056, 0, 0.046, 0.050, 2.4),
            (0.436, 0.056, 0, 0.070, 0.076, 2.6),
            (0.470, 0.056, 0, 0.082, 0.090, 2.8),
            (0.508, 0.054, 0, 0.082, 0.090, 2.8),
            (0.540, 0.050, 0, 0.066, 0.074, 2.6),
            (0.556, 0.048, 0, 0.030, 0.036, 2.3),
        ]
    )


def _face() -> tuple[TriMesh, list[TriMesh], list[TriMesh]]:
    """Visor, the two eye cameras' lenses, and the discs at the ears."""
    visor = superellipse_loft(
        [
            (0.455, 0.084, 0, 0.060, 0.062, 3),
            (0.461, 0.084, 0, 0.066, 0.070, 3.4),
            (0.515, 0.084, 0, 0.066, 0.070, 3.4),
            (0.521, 0.084, 0, 0.060, 0.062, 3),
        ],
        12,
    )
    lens = lathe([(0, -0.010), (0.015, 0.001), (0.008, 0.006), (0, 0.007)], 10)
    lenses = [lens.transformed((0.147, y, 0.488), _TO_PLUS_X) for y in (-0.032, 0.032)]
    ears = [drum(0.030, 0.008).transformed((0.050, y, 0.488), _TO_PLUS_Y) for y in (-0.090, 0.090)]
    return visor, lenses, ears

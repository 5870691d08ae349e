"""What is drawn of the robot, part by part; all geometry is the project's own."""

import math
from collections.abc import Callable
from functools import cache

import numpy as np

from artiskill.assets.articulated_object import Material, VisualMesh
from artiskill.errors import UnknownNameError
from artiskill.geometry.meshes import TriMesh, merge
from artiskill.geometry.primitives import (
    box,
    extrude,
    lathe,
    rounded_box,
    rounded_rectangle,
    superellipse,
    superellipse_loft,
)
from artiskill.geometry.rotations import quat_from_axis_angle

# linear values; as displayed (sRGB) the white is 0.93 and the joints' dark grey about 0.2
WHITE = Material("robot_white", (0.85, 0.85, 0.85, 1.0), shininess=0.5)
JOINT = Material("robot_joint", (0.035, 0.037, 0.042, 1.0), shininess=0.3)
GREY = Material("robot_grey", (0.16, 0.17, 0.19, 1.0), shininess=0.4)
BLACK = Material("robot_black", (0.008, 0.008, 0.009, 1.0), shininess=0.1)
NAVY = Material("robot_navy", (0.022, 0.045, 0.095, 1.0), shininess=0.4)
ACCENT = Material("robot_accent", (0.010, 0.200, 0.600, 1.0), shininess=0.4)


def drawn(part: str, *groups: tuple[Material, list[TriMesh]]) -> tuple[VisualMesh, ...]:
    """One `VisualMesh` per finish; its part is `<part>_<finish>`."""
    return tuple(
        VisualMesh(merge(meshes), material, f"{part}_{material.name.removeprefix('robot_')}")
        for material, meshes in groups
    )


def drum(radius: float, half_length: float, sides: int = 12) -> TriMesh:
    """A plain cylinder about the origin, along z, with as few triangles as it can have."""
    return extrude(superellipse(radius, radius, 2.0, sides), half_length)


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


RADIUS = 0.055  # upper arm and elbow
WRIST_RADIUS = 0.047
BARREL_END = 0.08  # half length of a joint barrel
GAP = 0.006  # between a barrel's halves; the dark collar shows in it
ELBOW_OFFSET = 0.0825  # of joint 4's axis from joint 3's
WRIST_OFFSET = 0.088  # of joint 7's axis from joint 6's
BARREL_EXPONENT = 7.0  # of its sections: flat ends, slightly rounded edges
_ARCH_RAD = (math.radians(27), math.radians(52), math.radians(75))
_COARSE_ARCH_RAD = (math.radians(38), math.radians(70))
_ABOUT_X = quat_from_axis_angle((1, 0, 0), math.pi / 2)  # z to -y, y to z
_ABOUT_X_BACK = quat_from_axis_angle((1, 0, 0), -math.pi / 2)  # z to y, y to -z


def link1() -> tuple[VisualMesh, ...]:
    """The shoulder; its flange reaches back to the torso at z = -0.19."""
    shell = _elbow(start=-0.182, bend=-0.125, offset=0.0, side=-1)
    flange = drum(0.059, 0.007).transformed((0, 0, -0.184))
    return drawn("panda_link1", (WHITE, [shell]), (JOINT, [flange, _collar((0, 0, 0), _ABOUT_X), _end_cap(0, -1)]))


def link2() -> tuple[VisualMesh, ...]:
    """The other half of the shoulder's barrel and the upper arm's lower half."""
    shell = _elbow(start=-0.187, bend=-0.125, offset=0.0, side=-1)
    meshes = [m.transformed(quaternion=_ABOUT_X_BACK) for m in (shell, _end_cap(0, -1))]
    return drawn("panda_link2", (WHITE, meshes[:1]), (JOINT, meshes[1:]))


def link3() -> tuple[VisualMesh, ...]:
    """The upper arm's upper half, which leans forward to the elbow's barrel."""
    shell = _elbow(start=-0.119, bend=-0.105, offset=ELBOW_OFFSET, side=1)
    dark = [_collar((0, 0, -0.124)), _collar((ELBOW_OFFSET, 0, 0), _ABOUT_X), _end_cap(ELBOW_OFFSET, 1)]
    return drawn("panda_link3", (WHITE, [shell]), (JOINT, dark))


def link4() -> tuple[VisualMesh, ...]:
    """The elbow's other half: link 3's shape turned over."""
    shell = _elbow(start=-0.122, bend=-0.105, offset=ELBOW_OFFSET, side=1)
    moved = [
        m.transformed((-ELBOW_OFFSET, 0, 0)).transformed(quaternion=_ABOUT_X)
        for m in (shell, _end_cap(ELBOW_OFFSET, 1))
    ]
    return drawn("panda_link4", (WHITE, moved[:1]), (JOINT, moved[1:]))


def link5() -> tuple[VisualMesh, ...]:
    """The forearm: full at the elbow, then a flat neck beside the axis down to the wrist's barrel."""
    inner, outer = 0.054, 0.098  # the wrist's half barrel along y
    middle, half = (inner + outer) / 2, (outer - inner) / 2
    sections = [
        (-0.252, 0, 0, RADIUS, RADIUS, 2),
        (-0.205, 0, 0.001, RADIUS, RADIUS, 2),
        (-0.165, 0, 0.014, 0.052, 0.049, 2.2),
        (-0.125, 0, 0.040, 0.048, 0.039, 2.5),
        (-0.085, 0, 0.066, 0.046, 0.029, 3.2),
        (-0.050, 0, middle, WRIST_RADIUS, half, BARREL_EXPONENT),
        *_arch(0, middle, half, WRIST_RADIUS),
    ]
    wrist_collar = drum(WRIST_RADIUS - 0.002, 0.004).transformed((0, inner - 0.003, 0), _ABOUT_X)
    cap = _disc(0.034).transformed((0, outer, 0), _ABOUT_X_BACK)
    return drawn(
        "panda_link5",
        (WHITE, [superellipse_loft(sections)]),
        (JOINT, [_collar((0, 0, -0.2575)), wrist_collar, cap]),
    )


def link6() -> tuple[VisualMesh, ...]:
    """The wrist: a barrel about z grown together with one about y at joint 7's axis."""
    y_low, y_high, z_half = -0.050, 0.058, 0.048  # barrel of joint 7 along y, of joint 6 along z
    end_middle, end_half = (y_low + y_high) / 2, (y_high - y_low) / 2
    # lofted along the link's x; the loft's own x, y are the link's y, z. Both barrels are arches: the rear one
    # turned back to front, the front one with its two cross axes exchanged
    rear = [(-z, *rest) for z, *rest in reversed(_arch(0, 0, z_half, WRIST_RADIUS, _COARSE_ARCH_RAD))]
    middle = (0.045, end_middle / 2, 0, 0.051, z_half - 0.001, 3.5)
    front = [
        (WRIST_OFFSET + z, y, x, half_y, half_x, exponent)
        for z, x, y, half_x, half_y, exponent in _arch(0, end_middle, end_half, WRIST_RADIUS, _COARSE_ARCH_RAD)
    ]
    shell = superellipse_loft([*rear, middle, *front])
    shell = TriMesh(shell.vertices[:, [2, 0, 1]], shell.faces)  # an even permutation keeps faces outwards
    top = _disc(0.036).transformed((WRIST_OFFSET, y_high, 0), _ABOUT_X_BACK)
    side = _disc(0.034).transformed((0, 0, z_half))
    collar = drum(0.043, 0.005).transformed((WRIST_OFFSET, y_low - 0.002, 0), _ABOUT_X)
    return drawn("panda_link6", (WHITE, [shell]), (JOINT, [top, side, collar]))


def link7() -> tuple[VisualMesh, ...]:
    """The flange's housing with its knob, and the flange at z = 0.107."""
    body = lathe([(0, 0.056), (0.042, 0.056), (0.045, 0.060), (0.045, 0.080), (0.040, 0.092), (0, 0.092)], 14)
    knob = superellipse_loft(
        [
            (0.064, 0, 0, 0.018, 0.017, 3),
            (0.084, 0, 0, 0.026, 0.019, 3),
            (0.094, 0, 0, 0.015, 0.015, 3),
        ],
        8,
    ).transformed((0.040, 0, 0))
    turned = knob.transformed(quaternion=quat_from_axis_angle((0, 0, 1), math.pi / 4))
    flange = drum(0.034, 0.009).transformed((0, 0, 0.099))
    return drawn("panda_link7", (WHITE, [body, turned]), (JOINT, [flange]))


def hand() -> tuple[VisualMesh, ...]:
    """The gripper's body, 0.2 m wide in y, with the dark rail on which the fingers slide."""
    sections = [
        (0.000, 0, 0, 0.030, 0.044, 2.5),
        (0.010, 0, 0, 0.032, 0.066, 3),
        (0.024, 0, 0, 0.032, 0.094, 3.5),
        (0.034, 0, 0, 0.031, 0.100, 4),
        (0.052, 0, 0, 0.029, 0.100, 4),
        (0.058, 0, 0, 0.024, 0.094, 4),
    ]
    rail = box((0.012, 0.086, 0.006)).transformed((0, 0, 0.060))
    badge = drum(0.012, 0.002, 8).transformed((0.0315, 0, 0.032), quat_from_axis_angle((0, 1, 0), math.pi / 2))
    return drawn("panda_hand", (WHITE, [superellipse_loft(sections)]), (BLACK, [rail]), (GREY, [badge]))


def finger() -> tuple[VisualMesh, ...]:
    """A finger that opens along +y; its pad's inner face lies at y = 0, its tip at z = 0.0535."""
    profile = [
        (0.000, 0.0085, 0.0260),
        (0.0185, 0.0095, 0.0260),
        (0.0370, 0.0045, 0.0165),
        (0.0520, 0.0045, 0.0150),
    ]
    rows = [(z, 0, (y0 + y1) / 2, 0.0100 if z < 0.03 else 0.0080, (y1 - y0) / 2, 6) for z, y0, y1 in profile]
    pad = box((0.0085, 0.003, 0.0085)).transformed((0, 0.003, 0.045))
    return drawn("panda_finger", (JOINT, [superellipse_loft(rows, 8)]), (BLACK, [pad]))


def _elbow(start: float, bend: float, offset: float, side: int) -> TriMesh:
    """A round link along z that grows into half of a barrel about y through (offset, 0, 0).

    Args:
        start: z at which the link begins, a flat round end.
        bend: z at which it leaves its straight.
        offset: x of the barrel's axis.
        side: -1 or 1, the half of y on which the barrel lies.
    """
    rows: list[tuple[float, ...]] = [(start, 0, 0, RADIUS, RADIUS, 2), (bend, 0, 0, RADIUS, RADIUS, 2)]
    for z in (*np.linspace(bend, -0.055, 4)[1:], -0.025):
        # the inner face must be back at the gap where the other half's barrel begins; the rest has more time
        inner = _blend(z, bend, -0.055, RADIUS, -GAP)
        outer = _blend(z, bend, -0.025, RADIUS, BARREL_END)
        x = _blend(z, bend, 0.0, 0.0, offset)
        exponent = _blend(z, bend, -0.025, 2.0, BARREL_EXPONENT)
        rows.append((z, x, side * (outer - inner) / 2, RADIUS * (1 + 0.3 * offset), (outer + inner) / 2, exponent))
    return superellipse_loft(rows + _arch(offset, side * (BARREL_END + GAP) / 2, (BARREL_END - GAP) / 2, RADIUS))


def _arch(
    x: float, y: float, half_y: float, radius: float, angles_rad: tuple[float, ...] = _ARCH_RAD
) -> list[tuple[float, ...]]:
    """Sections of a half barrel about y, from its axis at z = 0 up to its crown."""
    return [
        (radius * math.sin(a), x, y, radius * math.cos(a), half_y, BARREL_EXPONENT) for a in (0.0, *angles_rad)
    ]


def _blend(z: float, z0: float, z1: float, a: float, b: float) -> float:
    """From a at z0 to b at z1 with flat ends."""
    s = min(max((z - z0) / (z1 - z0), 0.0), 1.0)
    return a + (b - a) * s * s * (3 - 2 * s)


def _collar(position: tuple[float, ...], quaternion: np.ndarray | tuple[float, ...] = (1, 0, 0, 0)) -> TriMesh:
    """The dark band in the gap between two shells."""
    return drum(RADIUS - 0.0015, 0.0085).transformed(position, quaternion)


def _disc(radius: float) -> TriMesh:
    """A shallow dark lens on a barrel's end, standing out 2 mm along +z."""
    return lathe([(0, -0.004), (radius, 0.0005), (0, 0.002)], 14)


def _end_cap(x: float, side: int) -> TriMesh:
    return _disc(0.041).transformed((x, side * BARREL_END, 0), _ABOUT_X_BACK if side > 0 else _ABOUT_X)


_BUILDERS: dict[str, Callable[[], tuple[VisualMesh, ...]]] = {
    "mobile_base": mobile_base,
    "lift": lift,
    "torso": torso,
    "panda_link1": link1,
    "panda_link2": link2,
    "panda_link3": link3,
    "panda_link4": link4,
    "panda_link5": link5,
    "panda_link6": link6,
    "panda_link7": link7,
    "panda_hand": hand,
    "panda_finger": finger,
}
ROBOT_PARTS: tuple[str, ...] = tuple(_BUILDERS)


@cache
def robot_visuals(part: str) -> tuple[VisualMesh, ...]:
    """The drawn surfaces of a robot part, in the part's own body frame (metres).

    Args:
        part: one of `ROBOT_PARTS`, without a side: `panda_link3` serves both arms, `panda_finger` both fingers.

    Raises:
        UnknownNameError: there is no such part.
    """
    if part not in _BUILDERS:
        raise UnknownNameError("robot part", part, _BUILDERS)
    return _BUILDERS[part]()

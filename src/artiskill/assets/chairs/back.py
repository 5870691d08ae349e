"""The back: a cushion, a shell, a net in a frame or slats, what carries it, and the headrest."""

import math

import numpy as np

from artiskill.assets.chairs.appearance import Skin, Skins
from artiskill.assets.chairs.beams import Beam, Tube, loop_mesh
from artiskill.assets.chairs.frames import rail_path
from artiskill.assets.chairs.pads import Pad, even_outline, placed, rolled_mesh, strips
from artiskill.assets.chairs.pen import Pen
from artiskill.assets.chairs.spec import ChairSpec
from artiskill.geometry.arrays import exp, matmul
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import cylinder
from artiskill.geometry.rotations import quat_from_axis_angle

_Y = (0.0, 1.0, 0.0)
_OVER_SEAT_M = 0.018  # how far the back's front stands over the seat's rear edge
_NET_FRAME_M = 0.012  # radius of the tube around a net
_SHELL_M = 0.008  # thickness of the shell behind a cushion
_GROOVE_M = 0.010  # depth of the seams of a cushion sewn into rolls
_SPINE_M = (0.056, 0.015)  # width and thickness
_UNDER_SEAT_M = 0.010  # how far below the seat's underside a spine's axis runs
_UPRIGHT_M = 0.024
_RAIL_M = 0.055  # height of a slatted back's top rail
_HINGE_M = 0.013
_HINGE_GAP_M = 0.001
_RAIL_FILLET_M = 0.032


class BackPlane:
    """The plane of the back's rear face: u up from its lower edge, v along y, w forwards."""

    def __init__(self, spec: ChairSpec) -> None:
        """Place the plane."""
        self.back, seat = spec.back, spec.seat
        lean = self.back.lean_rad
        self.axes = np.array(((math.sin(lean), 0.0, math.cos(lean)), _Y, (-math.cos(lean), 0.0, math.sin(lean))))
        rear = seat.depth_m / 2 - _OVER_SEAT_M + self.back.thickness_m
        self.origin = np.array((rear, 0.0, seat.height_m + self.back.gap_m))

    def point(self, u: float, v: float, w: float) -> np.ndarray:
        """A point of the plane's frame in the object frame."""
        placed_point: np.ndarray = self.origin + matmul(np.array(((u, v, w),)), self.axes)[0]
        return placed_point

    def forward(self, u: float, v: float) -> float:
        """How far the bent panel stands forward of the plane there."""
        flat = np.array(((u - self.back.height_m / 2, v, 0.0),))
        return float(self.bend(flat)[0, 2])

    def bend(self, points: np.ndarray) -> np.ndarray:
        """From a flat panel about its middle to the panel."""
        half_u, half_v = self.back.height_m / 2, self.back.width_m / 2
        moved = points.copy()
        moved[:, 1] *= 1.0 - self.back.taper * (points[:, 0] / half_u + 1) / 2
        moved[:, 2] += self.back.wrap_m * (points[:, 1] / half_v) ** 2
        moved[:, 2] += self.back.lumbar_m * exp(-(((points[:, 0] / half_u + 0.45) / 0.4) ** 2))
        return moved

    def pad(self, thickness_m: float, edge_m: float, w_m: float = 0.0, scale: float = 1.0) -> Pad:
        """A pad that covers the panel, its rear face `w_m` before the plane."""
        half_u, half_v = scale * self.back.height_m / 2, scale * self.back.width_m / 2
        flat = Pad(half_u, half_v, self.back.exponent, thickness_m, edge_m, 0.0, self.bend)
        return placed(flat, self.point(self.back.height_m / 2, 0.0, w_m), self.axes)


def recline_axis(spec: ChairSpec) -> np.ndarray:
    """(3,) a point on the axis about which the back leans back against the seat."""
    return np.array((spec.seat.depth_m / 2 - 0.035, 0.0, spec.seat_bottom_m - _UNDER_SEAT_M))


def add_back(pen: Pen, spec: ChairSpec, skins: Skins) -> None:
    """Draw and touch the back with its headrest; what carries it is added by `add_support`."""
    if spec.back.kind == "none":
        return
    plane = BackPlane(spec)
    {"mesh": _add_net, "slats": _add_slats, "curved": _add_shell}.get(spec.back.kind, _add_cushion)(
        pen, spec, plane, skins
    )
    if spec.back.headrest is not None:
        _add_headrest(pen, plane, skins)


def add_support(pen: Pen, spec: ChairSpec, skins: Skins) -> None:
    """What carries the back: a spine from under the seat, uprights, or a cantilever's own tube."""
    if spec.base.kind == "cantilever":
        _add_rails(pen, spec, skins)
    elif spec.back.kind not in ("none", "slats"):
        plane, back = BackPlane(spec), spec.back
        reclines = spec.mechanism.recline_rad > 0
        start = recline_axis(spec)[0] + 0.004 if reclines else spec.mechanism.pivot_m + 0.016
        under = spec.seat_bottom_m - _UNDER_SEAT_M
        corner = spec.seat.depth_m / 2 + 0.028
        low, high = (0.12, 0.5) if back.kind == "low" else (0.16, 0.42)
        low, high = low * back.height_m, high * back.height_m
        path = [np.array((start, 0.0, under)), np.array((corner, 0.0, under))]
        behind = -_SPINE_M[1] / 2 - (back.thickness_m / 2 if back.kind == "mesh" else 0.0)
        # the panel's rear is hollow between the two points where it bulges forward
        depth = min(plane.forward(u, 0.0) for u in np.linspace(low, high, 5)) + behind
        path += [plane.point(u, 0.0, depth) for u in (low, high)]
        width = np.array((1.0, 1.0, 0.9, 0.75)) * _SPINE_M[0]
        pen.bar(Beam(path, width, _SPINE_M[1], _Y), skins.frame, "back", 0.045, 10)
        if reclines:
            turn = quat_from_axis_angle((1, 0, 0), math.pi / 2)
            barrel = cylinder(_HINGE_M, 0.045, 12, 0.002)
            pen.mesh(barrel.transformed(recline_axis(spec), turn), skins.tube, "back")


def add_recline_bracket(pen: Pen, spec: ChairSpec, skins: Skins) -> None:
    """On the seat: the bar that carries a reclining back's hinge."""
    axis = recline_axis(spec)
    start = (spec.mechanism.pivot_m + 0.016, 0.0, axis[2])
    bar = Beam([start, (axis[0] - 0.003, 0.0, axis[2])], _SPINE_M[0], _SPINE_M[1], _Y)
    pen.bar(bar, skins.frame, "seat")


def _add_cushion(pen: Pen, spec: ChairSpec, plane: BackPlane, skins: Skins) -> None:
    back = spec.back
    pen.touch_pad(plane.pad(back.thickness_m, 0.02), "back", strips(back.wrap_m))
    pen.cushion(plane.pad(_SHELL_M, 0.004, 0.0, 0.97), skins.shell, "back", seen="rear")
    rest = back.thickness_m - 0.6 * _SHELL_M
    if back.rolls < 2:
        pen.cushion(plane.pad(rest, 0.6 * rest, 0.6 * _SHELL_M), skins.back, "back", seen="front")
        return
    whole = plane.pad(rest, 0.02, 0.6 * _SHELL_M)
    pen.mesh(rolled_mesh(whole, back.rolls, _GROOVE_M, skins.back.tile_m), skins.back, "back")


def _add_shell(pen: Pen, spec: ChairSpec, plane: BackPlane, skins: Skins) -> None:
    back = spec.back
    pen.touch_pad(plane.pad(back.thickness_m, 0.006), "back", strips(back.wrap_m))
    if not back.soft:
        pen.cushion(plane.pad(back.thickness_m, 0.4 * back.thickness_m), skins.back, "back")
        return
    pen.cushion(plane.pad(_SHELL_M, 0.003), skins.shell, "back", seen="rear")
    rest = back.thickness_m - 0.6 * _SHELL_M
    pen.cushion(plane.pad(rest, 0.6 * rest, 0.6 * _SHELL_M, 0.97), skins.back, "back", seen="front")


def _add_net(pen: Pen, spec: ChairSpec, plane: BackPlane, skins: Skins) -> None:
    back = spec.back
    thick = max(back.thickness_m, 1.3 * _NET_FRAME_M)
    pen.touch_pad(plane.pad(thick, 0.003, -thick / 2), "back", strips(back.wrap_m))
    pen.cushion(plane.pad(back.thickness_m, 0.001, -back.thickness_m / 2, 0.985), skins.back, "back")
    rim = even_outline(back.height_m / 2, back.width_m / 2, back.exponent, 32)
    shrink = 1.0 - _NET_FRAME_M / np.array((back.height_m / 2, back.width_m / 2))
    flat = np.column_stack((rim * shrink, np.zeros(len(rim))))
    bent = matmul(plane.bend(flat), plane.axes) + plane.point(back.height_m / 2, 0.0, 0.0)
    pen.mesh(_centred_loop(bent), skins.frame, "back")
    u = 0.24 * back.height_m
    reach = 0.44 * back.width_m
    path = [plane.point(u, v, plane.forward(u, v) - 0.010) for v in (-reach, -reach / 2, 0.0, reach / 2, reach)]
    pen.mesh(Beam(path, 0.035, 0.008, plane.axes[0]).mesh(8), skins.frame, "back")


def _centred_loop(points: np.ndarray) -> TriMesh:
    middle = points.mean(axis=0)
    return loop_mesh(points - middle, _NET_FRAME_M).transformed(middle)


def _add_slats(pen: Pen, spec: ChairSpec, plane: BackPlane, skins: Skins) -> None:
    """Two uprights from within the seat, a top rail, and slats across or upright."""
    back = spec.back
    below = -(back.gap_m + 0.6 * spec.seat.thickness_m) / math.cos(back.lean_rad)
    if spec.base.kind == "cantilever":
        below = 0.0
    top = back.height_m - _RAIL_M / 2
    reach = {u: _reach(plane, u) for u in (below, top)}
    for s in (-1, 1):
        path = [plane.point(u, s * reach[u], back.thickness_m / 2) for u in (below, top)]
        pen.bar(Beam(path, _UPRIGHT_M, _UPRIGHT_M, _Y, back.upright), skins.frame, "back")
    _add_slat(pen, plane, top, _RAIL_M, skins.back)
    if not back.upright:
        first, last = 0.10 * back.height_m, back.height_m - 1.9 * _RAIL_M
        for u in np.linspace(first, last, back.slats):
            _add_slat(pen, plane, float(u), 0.6 * (last - first) / back.slats, skins.back)
        return
    low = 0.06 * back.height_m
    _add_slat(pen, plane, low, 0.03, skins.back)
    for share in np.linspace(-1, 1, back.slats + 2)[1:-1]:
        path = [plane.point(u, share * _reach(plane, u), _slat_w(plane)) for u in (low, top)]
        pen.bar(Beam(path, 0.020, 0.012, _Y), skins.back, "back")


def _reach(plane: BackPlane, u: float) -> float:
    """Half the distance of the uprights at that height; they keep their line below the panel."""
    back = plane.back
    return (back.width_m / 2 - _UPRIGHT_M / 2) * (1.0 - back.taper * u / back.height_m)


def _slat_w(plane: BackPlane) -> float:
    return plane.back.thickness_m / 2 + 0.3 * plane.back.wrap_m


def _add_slat(pen: Pen, plane: BackPlane, u: float, height_m: float, skin: Skin) -> None:
    """A slat between the uprights, drawn bent backwards in its middle, touched as a straight bar."""
    back, reach = plane.back, _reach(plane, u)
    middle = back.thickness_m / 2
    stations = [(v, middle + back.wrap_m * ((v / reach) ** 2 - 1) * 0.7) for v in np.linspace(-reach, reach, 7)]
    drawn = Beam([plane.point(u, v, w) for v, w in stations], height_m, 0.8 * back.thickness_m, plane.axes[0])
    pen.bar(drawn, skin, "back", touched=False)
    mean = middle - 0.45 * back.wrap_m
    ends = [plane.point(u, v, mean) for v in (-reach, reach)]
    for shape in Beam(ends, height_m, 0.8 * back.thickness_m, plane.axes[0]).shapes("back"):
        pen.shape(shape)


def _add_headrest(pen: Pen, plane: BackPlane, skins: Skins) -> None:
    back, rest = plane.back, plane.back.headrest
    assert rest is not None, "only asked where there is one"
    centre = back.height_m + rest.gap_m + rest.height_m / 2
    half_v = rest.width_m / 2

    def bend(points: np.ndarray) -> np.ndarray:
        moved = points.copy()
        moved[:, 2] += 0.02 * (points[:, 1] / half_v) ** 2
        return moved

    flat = Pad(rest.height_m / 2, half_v, 3.5, rest.thickness_m, 0.6 * rest.thickness_m, 0.004, bend)
    pad = placed(flat, plane.point(centre, 0.0, 0.012), plane.axes)
    pen.cushion(pad, skins.back if back.soft else skins.pad, "headrest", 20)
    pen.touch_pad(pad, "headrest")
    foot = back.height_m - 0.09
    path = [
        plane.point(u, 0.0, w)
        for u, w in ((foot, -0.006), (back.height_m + 0.4 * rest.gap_m, -0.006), (centre, 0.012))
    ]
    pen.bar(Beam(path, 0.05, 0.010, _Y), skins.frame, "headrest", 0.02)


def _add_rails(pen: Pen, spec: ChairSpec, skins: Skins) -> None:
    """A cantilever's tube: along the seat's sides and up behind the back."""
    plane, half_y = BackPlane(spec), spec.base.leg_width_m[0] / 2
    radius = spec.base.leg_height_m[0] / 2
    end = 0.55 * spec.back.height_m
    net = spec.back.kind == "mesh"  # has no rear to end in: the tube stays behind it, on its cross bar
    for s in (-1, 1):
        v = s * min(half_y, 0.40 * spec.back.width_m)
        path = [(x, s * half_y, z) for x, z in rail_path(spec)]
        path[-1] = (plane.origin[0] + 0.012, s * half_y, path[-1][2])
        behind = radius + spec.back.thickness_m if net else 0.5 * radius
        path += [tuple(plane.point(u, v, plane.forward(u, v) - behind)) for u in (0.0, end)]
        pen.mesh(Tube(path, radius).mesh(10, _RAIL_FILLET_M), skins.base, "seat")
        path[0] = (path[0][0], path[0][1], path[0][2] + radius + _HINGE_GAP_M)  # a capsule's end is round
        for shape in Tube(path, radius).shapes("seat", 0.7 * _RAIL_FILLET_M):
            pen.shape(shape)

"""What one sits on and leans against: the seat, the back with what carries it, the headrest, and the armrests."""

import dataclasses
import math
from functools import partial

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.chairs.base import rail_path
from artiskill.assets.chairs.link_builder import Beam, LinkBuilder, Tube, loop_mesh
from artiskill.assets.chairs.pads import Bend, Pad, even_outline, moved_pad, rolled_mesh, strips, unbent
from artiskill.assets.chairs.spec import ChairSpec, Seat
from artiskill.assets.parts import IDENTITY, TO_Y
from artiskill.geometry.arrays import exp, matmul
from artiskill.geometry.primitives import cylinder, rounded_box

_X, _Y, _Z = np.eye(3)
_PAN_M = 0.008
_CROWN_M = 0.006
_NOSE_SHARE = 0.45  # of the depth over which a waterfall's front falls
_SADDLE_RISE = 0.35  # how far a saddle's front and rear rise, relative to how far its sides hang
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
_BRACKET_M = 0.009
_CLEAR_OF_BOX_M = 0.008
_POST_M = (0.046, 0.020)  # along x, along y
_LOOP_M = (0.030, 0.016)  # width along y, thickness
_LOOP_TUBE_M = 0.0125
_ARM_X_M = 0.01  # middle of the armrests


def add_seat(link: LinkBuilder, spec: ChairSpec) -> None:
    """Add the seat: a cushion on a pan, or a board."""
    seat = spec.seat
    crown = _CROWN_M if seat.soft and seat.kind != "saddle" else 0.0
    half_u, half_v, thickness = seat.depth_m / 2, seat.width_m / 2, seat.thickness_m - crown
    whole = Pad(half_u, half_v, seat.exponent, thickness, seat.edge_m, crown, _form(seat))
    place = partial(moved_pad, origin=(0.0, 0.0, spec.seat_bottom_m), axes=np.eye(3))
    link.add_pad_collision(place(whole), "seat", 3 if seat.kind == "saddle" else 1, along=0)
    if not seat.soft:
        link.add_pad_visual(place(whole), "seat", "seat")
        return
    pan = dataclasses.replace(
        whole, half_u=0.96 * half_u, half_v=0.96 * half_v, thickness_m=_PAN_M, edge_m=0.004, crown_m=0.0
    )
    link.add_pad_visual(place(pan), "shell", "seat", 24, "rear")
    lift = 0.7 * _PAN_M

    def raised(points: np.ndarray) -> np.ndarray:
        return whole.bend(points + np.array((0.0, 0.0, lift)))

    cushion = dataclasses.replace(whole, thickness_m=thickness - lift, bend=raised)
    link.add_pad_visual(place(cushion), "seat", "seat", seen="front")


def _form(seat: Seat) -> Bend:
    """Return the upper side's form; the underside stays flat."""
    half_u, half_v = seat.depth_m / 2, seat.width_m / 2

    def waterfall(points: np.ndarray) -> np.ndarray:
        share = np.clip((-points[:, 0] / half_u - 1 + 2 * _NOSE_SHARE) / (2 * _NOSE_SHARE), 0.0, 1.0)
        return _sunk(points, -seat.shape_m * share**2, seat.thickness_m)

    def saddle(points: np.ndarray) -> np.ndarray:
        rise = _SADDLE_RISE * seat.shape_m * ((points[:, 0] / half_u) ** 2 - 0.5)
        return _sunk(points, rise - seat.shape_m * (points[:, 1] / half_v) ** 2, seat.thickness_m)

    return {"waterfall": waterfall, "saddle": saddle}.get(seat.kind, unbent)


def _sunk(points: np.ndarray, change: np.ndarray, thickness_m: float) -> np.ndarray:
    """Move points along w, those of the upper side by the whole change, those of the underside not at all."""
    moved = points.copy()
    moved[:, 2] += change * points[:, 2] / thickness_m
    return moved


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
        """Return a point of the plane's frame in the object frame."""
        moved: np.ndarray = self.origin + matmul(np.array(((u, v, w),)), self.axes)[0]
        return moved

    def forward(self, u: float, v: float) -> float:
        """Return how far the bent panel stands forward of the plane there."""
        flat = np.array(((u - self.back.height_m / 2, v, 0.0),))
        return float(self.bend(flat)[0, 2])

    def bend(self, points: np.ndarray) -> np.ndarray:
        """Bend points of a flat panel about its middle."""
        half_u, half_v = self.back.height_m / 2, self.back.width_m / 2
        moved = points.copy()
        moved[:, 1] *= 1.0 - self.back.taper * (points[:, 0] / half_u + 1) / 2
        moved[:, 2] += self.back.wrap_m * (points[:, 1] / half_v) ** 2
        moved[:, 2] += self.back.lumbar_m * exp(-(((points[:, 0] / half_u + 0.45) / 0.4) ** 2))
        return moved

    def pad(self, thickness_m: float, edge_m: float, w_m: float = 0.0, scale: float = 1.0) -> Pad:
        """Return a pad that covers the panel, its rear face `w_m` before the plane."""
        half_u, half_v = scale * self.back.height_m / 2, scale * self.back.width_m / 2
        flat = Pad(half_u, half_v, self.back.exponent, thickness_m, edge_m, 0.0, self.bend)
        return moved_pad(flat, self.point(self.back.height_m / 2, 0.0, w_m), self.axes)


def recline_axis(spec: ChairSpec) -> np.ndarray:
    """Return a point on the axis about which the back leans back against the seat, (3,)."""
    return np.array((spec.seat.depth_m / 2 - 0.035, 0.0, spec.seat_bottom_m - _UNDER_SEAT_M))


def add_back(link: LinkBuilder, spec: ChairSpec) -> None:
    """Add the back with its headrest; `add_support` adds what carries it."""
    if spec.back.kind == "none":
        return
    plane = BackPlane(spec)
    builders = {"mesh": _add_net, "slats": _add_slats, "curved": _add_shell}
    builders.get(spec.back.kind, _add_cushion)(link, spec, plane)
    if spec.back.headrest is not None:
        _add_headrest(link, plane)


def add_support(link: LinkBuilder, spec: ChairSpec) -> None:
    """Add what carries the back: a spine from under the seat, uprights, or a cantilever's own tube."""
    if spec.base.kind == "cantilever":
        _add_rails(link, spec)
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
        link.add_bar(Beam(path, width, _SPINE_M[1], _Y), "frame", "back", 0.045, 10)
        if reclines:
            barrel = cylinder(_HINGE_M, 0.045, 12, 0.002).transformed(recline_axis(spec), TO_Y)
            link.add_visual(barrel, "tube", "back")


def add_recline_bracket(link: LinkBuilder, spec: ChairSpec) -> None:
    """Add to the seat the bar that carries a reclining back's hinge."""
    axis = recline_axis(spec)
    start = (spec.mechanism.pivot_m + 0.016, 0.0, axis[2])
    bar = Beam([start, (axis[0] - 0.003, 0.0, axis[2])], _SPINE_M[0], _SPINE_M[1], _Y)
    link.add_bar(bar, "frame", "seat")


def _add_cushion(link: LinkBuilder, spec: ChairSpec, plane: BackPlane) -> None:
    back = spec.back
    link.add_pad_collision(plane.pad(back.thickness_m, 0.02), "back", strips(back.wrap_m))
    link.add_pad_visual(plane.pad(_SHELL_M, 0.004, 0.0, 0.97), "shell", "back", seen="rear")
    rest = back.thickness_m - 0.6 * _SHELL_M
    if back.rolls < 2:
        link.add_pad_visual(plane.pad(rest, 0.6 * rest, 0.6 * _SHELL_M), "back", "back", seen="front")
        return
    whole = plane.pad(rest, 0.02, 0.6 * _SHELL_M)
    link.add_visual(rolled_mesh(whole, back.rolls, _GROOVE_M, link.materials["back"].tile_m), "back", "back")


def _add_shell(link: LinkBuilder, spec: ChairSpec, plane: BackPlane) -> None:
    back = spec.back
    link.add_pad_collision(plane.pad(back.thickness_m, 0.006), "back", strips(back.wrap_m))
    if not back.soft:
        link.add_pad_visual(plane.pad(back.thickness_m, 0.4 * back.thickness_m), "back", "back")
        return
    link.add_pad_visual(plane.pad(_SHELL_M, 0.003), "shell", "back", seen="rear")
    rest = back.thickness_m - 0.6 * _SHELL_M
    link.add_pad_visual(plane.pad(rest, 0.6 * rest, 0.6 * _SHELL_M, 0.97), "back", "back", seen="front")


def _add_net(link: LinkBuilder, spec: ChairSpec, plane: BackPlane) -> None:
    back = spec.back
    thick = max(back.thickness_m, 1.3 * _NET_FRAME_M)
    link.add_pad_collision(plane.pad(thick, 0.003, -thick / 2), "back", strips(back.wrap_m))
    link.add_pad_visual(plane.pad(back.thickness_m, 0.001, -back.thickness_m / 2, 0.985), "back", "back")
    rim = even_outline(back.height_m / 2, back.width_m / 2, back.exponent, 32)
    shrink = 1.0 - _NET_FRAME_M / np.array((back.height_m / 2, back.width_m / 2))
    flat = np.column_stack((rim * shrink, np.zeros(len(rim))))
    bent = matmul(plane.bend(flat), plane.axes) + plane.point(back.height_m / 2, 0.0, 0.0)
    middle = bent.mean(axis=0)
    link.add_visual(loop_mesh(bent - middle, _NET_FRAME_M).transformed(middle), "frame", "back")
    u = 0.24 * back.height_m
    reach = 0.44 * back.width_m
    path = [plane.point(u, v, plane.forward(u, v) - 0.010) for v in (-reach, -reach / 2, 0.0, reach / 2, reach)]
    link.add_visual(Beam(path, 0.035, 0.008, plane.axes[0]).mesh(8), "frame", "back")


def _add_slats(link: LinkBuilder, spec: ChairSpec, plane: BackPlane) -> None:
    """Add two uprights from within the seat, a top rail, and slats across or upright."""
    back = spec.back
    below = -(back.gap_m + 0.6 * spec.seat.thickness_m) / math.cos(back.lean_rad)
    if spec.base.kind == "cantilever":
        below = 0.0
    top = back.height_m - _RAIL_M / 2
    reach = {u: _reach(plane, u) for u in (below, top)}
    for s in (-1, 1):
        path = [plane.point(u, s * reach[u], back.thickness_m / 2) for u in (below, top)]
        link.add_bar(Beam(path, _UPRIGHT_M, _UPRIGHT_M, _Y, back.upright), "frame", "back")
    _add_slat(link, plane, top, _RAIL_M, "back")
    if not back.upright:
        first, last = 0.10 * back.height_m, back.height_m - 1.9 * _RAIL_M
        for u in np.linspace(first, last, back.slats):
            _add_slat(link, plane, float(u), 0.6 * (last - first) / back.slats, "back")
        return
    low, w = 0.06 * back.height_m, back.thickness_m / 2 + 0.3 * back.wrap_m
    _add_slat(link, plane, low, 0.03, "back")
    for share in np.linspace(-1, 1, back.slats + 2)[1:-1]:
        path = [plane.point(u, share * _reach(plane, u), w) for u in (low, top)]
        link.add_bar(Beam(path, 0.020, 0.012, _Y), "back", "back")


def _reach(plane: BackPlane, u: float) -> float:
    """Return half the distance of the uprights at that height; they keep their line below the panel."""
    back = plane.back
    return (back.width_m / 2 - _UPRIGHT_M / 2) * (1.0 - back.taper * u / back.height_m)


def _add_slat(link: LinkBuilder, plane: BackPlane, u: float, height_m: float, surface: str) -> None:
    """Add a slat between the uprights, bent backwards in its middle; its collision shape is straight."""
    back, reach = plane.back, _reach(plane, u)
    middle = back.thickness_m / 2
    stations = [(v, middle + back.wrap_m * ((v / reach) ** 2 - 1) * 0.7) for v in np.linspace(-reach, reach, 7)]
    bent = Beam([plane.point(u, v, w) for v, w in stations], height_m, 0.8 * back.thickness_m, plane.axes[0])
    link.add_bar_visual(bent, surface, "back")
    mean = middle - 0.45 * back.wrap_m
    ends = [plane.point(u, v, mean) for v in (-reach, reach)]
    link.add_collision(*Beam(ends, height_m, 0.8 * back.thickness_m, plane.axes[0]).shapes("back"))


def _add_headrest(link: LinkBuilder, plane: BackPlane) -> None:
    back, rest = plane.back, plane.back.headrest
    assert rest is not None, "only asked where there is one"
    centre = back.height_m + rest.gap_m + rest.height_m / 2
    half_v = rest.width_m / 2

    def bend(points: np.ndarray) -> np.ndarray:
        moved = points.copy()
        moved[:, 2] += 0.02 * (points[:, 1] / half_v) ** 2
        return moved

    flat = Pad(rest.height_m / 2, half_v, 3.5, rest.thickness_m, 0.6 * rest.thickness_m, 0.004, bend)
    pad = moved_pad(flat, plane.point(centre, 0.0, 0.012), plane.axes)
    link.add_pad_visual(pad, "back" if back.soft else "pad", "headrest", 20)
    link.add_pad_collision(pad, "headrest")
    foot = back.height_m - 0.09
    stations = ((foot, -0.006), (back.height_m + 0.4 * rest.gap_m, -0.006), (centre, 0.012))
    path = [plane.point(u, 0.0, w) for u, w in stations]
    link.add_bar(Beam(path, 0.05, 0.010, _Y), "frame", "headrest", 0.02)


def _add_rails(link: LinkBuilder, spec: ChairSpec) -> None:
    """Add a cantilever's tube: along the seat's sides and up behind the back."""
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
        link.add_visual(Tube(path, radius).mesh(10, _RAIL_FILLET_M), "base", "seat")
        path[0] = (path[0][0], path[0][1], path[0][2] + radius + _HINGE_GAP_M)  # a capsule's end is round
        link.add_collision(*Tube(path, radius).shapes("seat", 0.7 * _RAIL_FILLET_M))


def add_arms(link: LinkBuilder, spec: ChairSpec) -> None:
    """Add both armrests: a pad on a post, a loop, or an arm that comes forward from the back."""
    builders = {"tee": _add_tee, "loop": _add_loop, "cantilever": _add_cantilever}
    if spec.arms.kind in builders:
        for side in (-1, 1):
            builders[spec.arms.kind](link, spec, side)


def _arm_y(spec: ChairSpec) -> float:
    """Return the distance of the armrests' middles from the middle of the chair."""
    return max(spec.arms.clear_m / 2 + spec.arms.width_m / 2, spec.seat.width_m / 2 + 0.022)


def _top(spec: ChairSpec) -> float:
    return spec.seat.height_m + spec.arms.height_m


def _inner_y(spec: ChairSpec) -> float:
    """Return where brackets begin: beside the mechanism, which a tilting seat moves against."""
    return spec.mechanism.width_m / 2 + _CLEAR_OF_BOX_M


def _add_pad(link: LinkBuilder, spec: ChairSpec, x: float, y: float) -> None:
    arms = spec.arms
    half = (arms.length_m / 2, arms.width_m / 2, arms.thickness_m / 2)
    centre = np.array((x, y, _top(spec) - half[2]))
    link.add_visual(rounded_box(half, 0.45 * arms.width_m, 4, 0.4 * half[2]).transformed(centre), "pad", "arm")
    size = (half[0] - 0.004, half[1] - 0.002, half[2])
    link.add_collision(CollisionShape("box", size, centre, IDENTITY, part="arm"))


def _add_tee(link: LinkBuilder, spec: ChairSpec, side: int) -> None:
    y, x = side * _arm_y(spec), _ARM_X_M
    under = spec.seat_bottom_m - _BRACKET_M / 2
    bracket = [(x, side * _inner_y(spec), under), (x, y, under)]
    link.add_bar(Beam(bracket, 1.1 * _POST_M[0], _BRACKET_M, _X), "frame", "arm")
    post = [(x, y, under - _BRACKET_M / 2), (x, y, _top(spec) - 0.8 * spec.arms.thickness_m)]
    link.add_bar(Beam(post, _POST_M[0], _POST_M[1], _X), "frame", "arm")
    _add_pad(link, spec, x - 0.015, y)


def _add_loop(link: LinkBuilder, spec: ChairSpec, side: int) -> None:
    """Add a loop from under the seat's front to under its rear."""
    y = side * _arm_y(spec)
    inner = side * _inner_y(spec)
    top = _top(spec) - (0.8 * spec.arms.thickness_m if spec.arms.padded else _LOOP_M[1] / 2)
    half = spec.arms.length_m / 2
    front, rear = _ARM_X_M - half, _ARM_X_M + half
    foot = 0.75 * half
    if link.materials["frame"].material.texture is None and not spec.arms.padded:
        under = spec.seat_bottom_m - _LOOP_TUBE_M
        xs = (_ARM_X_M - foot, _ARM_X_M - foot, front, rear, _ARM_X_M + foot, _ARM_X_M + foot)
        start = inner + side * _LOOP_TUBE_M  # a capsule's end is round
        ys, zs = (start, y, y, y, y, start), (under, under, top, top, under, under)
        link.add_bar(Tube(list(zip(xs, ys, zs, strict=True)), _LOOP_TUBE_M), "frame", "arm", 0.035, 8)
        return
    under = spec.seat_bottom_m - _BRACKET_M / 2
    corners = [(_ARM_X_M - foot, under), (front, top), (rear, top), (_ARM_X_M + foot, under)]
    link.add_bar(Beam([(x, y, z) for x, z in corners], *_LOOP_M, _Y), "frame", "arm", 0.035, 8)
    bracket = Beam([(_ARM_X_M, inner, under), (_ARM_X_M, y, under)], 2 * foot + 0.02, _BRACKET_M, _X)
    link.add_bar(bracket, "frame", "arm")
    if spec.arms.padded:
        _add_pad(link, spec, _ARM_X_M, y)


def _add_cantilever(link: LinkBuilder, spec: ChairSpec, side: int) -> None:
    """Add an arm from the back's edge outwards and forwards."""
    plane, y = BackPlane(spec), side * _arm_y(spec)
    z = _top(spec) - 0.7 * spec.arms.thickness_m
    u = (z - plane.origin[2]) / plane.axes[0, 2]
    v = side * (spec.back.width_m / 2 - 0.03) * (1.0 - spec.back.taper * u / spec.back.height_m)
    root = plane.point(u, v, plane.forward(u, v) + 0.4 * spec.back.thickness_m)
    tip = _ARM_X_M - spec.arms.length_m / 2
    path = [(root[0], root[1], z), (root[0] - 0.03, y, z), (tip + 0.02, y, z)]
    link.add_bar(Beam(path, 0.034, 0.018, _Z), "frame", "arm", 0.03, 8)
    _add_pad(link, spec, _ARM_X_M - 0.01, y)

"""Open vessels and wheels: parts that a general decomposition would spoil.

A decomposition of a thin shell either leaves gaps or fills the cavity. A vessel is convex sector by sector about
its axis: the wall is cut into sectors and, where it bulges, into bands; the floor is what lies lowest. What is
poured in stays in, and nothing covers the opening.

The hull of a wheel is a polygon, which would bump along. A real tread is crowned: it touches the ground in a spot.
A cylinder as wide as the drawn wheel would touch it along a line and resist, with its friction, every turn of the
caster; the data set's casters trail too little, 9 mm in one that was measured, to overcome that. So the cylinder
is narrow, in the middle of the drawn wheel.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import CollisionShape, Joint
from artiskill.assets.partnet.meshes import cut, distance_to_surface, limit_vertices, slab, thick_corners, weld
from artiskill.geometry.meshes import TriMesh, convex_hull, depth_inside, sample_surface
from artiskill.geometry.rotations import quat_from_matrix

# A ball of 50 mm that falls from the rim at 2.5 m/s moves 5 mm in a step of 2 ms: it must not pass in one.
LEAST_WALL_M = 0.008
_SECTORS, _BANDS = (12, 16, 20), (1, 2, 3)
_GOOD_ERROR_M = 0.006  # of a wall's hulls: less than this is not worth more of them
_PROBES = 400
_FLOOR_SHARE = 0.25  # the floor lies in this lowest part of a vessel
_RAYS, _LEVELS = 48, 12


# Beyond these the drawn wheel rolls visibly out of round, and a warning says so.
ROUND_TOLERANCE_M = 0.002
TREAD_HALF_WIDTH_M = 0.003
# A ball fills pi / 6 of the box about it and a disc pi / 4: halfway, a ball as long as wide is one.
_BALL_SHARE = (np.pi / 6 + np.pi / 4) / 2
_BALL_LENGTHS = (0.85, 1.15)  # of a ball's extent along the axle, in diameters


@dataclass(frozen=True, eq=False)
class Vessel:
    """The convex pieces of a vessel, (V, 3) corners each."""

    wall: list[np.ndarray]  # sectors of the side
    floor: list[np.ndarray]  # pieces of the bottom
    error_m: float  # how far the wall's pieces stand into the cavity, or off its outside, whichever is more


@dataclass(frozen=True, eq=False)
class _Cavity:
    """The space inside a vessel."""

    centre: np.ndarray  # (2,) where its axis stands
    heights: np.ndarray  # (L,) of the levels, metres
    angles: np.ndarray  # (R,) of the rays, radians
    radius: np.ndarray  # (L, R) from the axis to the first surface; infinite where there is none
    floor_z: float  # height of the floor
    wall_m: float  # how thick most of the wall is drawn, 0 for a sheet


def _find_cavity(mesh: TriMesh) -> _Cavity | None:
    """Find the cavity of a vessel that is open at the top (+z); None if it has a lid, no floor or no wall.

    The floor is where a plumb line on the axis first meets the surface; the wall must stand all round above it.
    """
    low, high = mesh.bounds
    centre = (low[:2] + high[:2]) / 2
    hits = _heights_above(mesh, centre)
    if not len(hits) or hits.max() > low[2] + 0.5 * (high[2] - low[2]):
        return None
    floor_z = float(hits.max())
    heights = np.linspace(floor_z + 0.1 * (high[2] - floor_z), high[2] - 0.05 * (high[2] - floor_z), _LEVELS)
    angles = np.arange(_RAYS) * (2 * np.pi / _RAYS)
    hits_of = [[_hits_along(mesh, centre, z, angle) for angle in angles] for z in heights]
    radius = np.array([[row[0] if len(row) else np.inf for row in level] for level in hits_of])
    if not np.isfinite(radius[:-2]).all():  # a rim may be lower here and there, for a spout
        return None
    wall = [row[1] - row[0] if len(row) > 1 else 0.0 for level in hits_of for row in level]
    return _Cavity(centre, heights, angles, radius, floor_z, float(np.quantile(wall, 0.25)))


def vessel_hulls(mesh: TriMesh, max_vertices: int) -> Vessel | None:
    """Return a vessel's wall and floor as convex pieces; None where the mesh is no open vessel.

    Args:
        mesh: the drawn surface of the body, z up.
        max_vertices: corners of a piece at most.
    """
    mesh = weld(mesh)
    cavity = _find_cavity(mesh) if len(mesh.faces) else None
    if cavity is None:
        return None
    best: Vessel | None = None
    for bands in _BANDS:
        for sectors in _SECTORS:
            for turn in (0.0, 0.5):
                found = _cut_vessel(mesh, cavity, sectors, bands, turn, max_vertices)
                if best is None or found.error_m < best.error_m - 1e-3:
                    best = found
            if best is not None and best.error_m <= _GOOD_ERROR_M:
                return best
    return best


def _cut_vessel(
    mesh: TriMesh, cavity: _Cavity, sectors: int, bands: int, turn: float, max_vertices: int
) -> Vessel:
    edges = np.linspace(mesh.bounds[0, 2], mesh.bounds[1, 2], bands + 1)
    edges[0], edges[-1] = edges[0] - 1e-6, edges[-1] + 1e-6
    up = np.array((0.0, 0.0, 1.0))
    wall = []
    side = _without_floor(mesh, cavity)
    for low, high in itertools.pairwise(edges):
        band = side if bands == 1 else slab(side, up, low, high)
        if band is None:
            continue
        for k in range(sectors):
            piece = _sector(band, cavity.centre, 2 * np.pi * (k + turn) / sectors, 2 * np.pi / sectors)
            if piece is not None:
                wall.append(_thick_outwards(piece.vertices, cavity, max_vertices))
    floor = [_floor(mesh, cavity, max_vertices)]
    intrusion_m = max((_intrusion(piece, cavity) for piece in wall), default=np.inf)
    return Vessel(wall, floor, max(intrusion_m, _bulge(wall, mesh, cavity)))


def _without_floor(mesh: TriMesh, cavity: _Cavity) -> TriMesh:
    """Return the faces of the side: those of the floor lie low and near the axis."""
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    reach = np.linalg.norm(mesh.vertices[mesh.faces][..., :2] - cavity.centre, axis=2).min(axis=1)
    inner = float(cavity.radius[0].min())
    is_floor = (middles[:, 2] <= cavity.floor_z + 1e-3) & (reach < 0.8 * inner)
    return TriMesh(mesh.vertices, mesh.faces[~is_floor])


def _floor(mesh: TriMesh, cavity: _Cavity, max_vertices: int) -> np.ndarray:
    """Return the hull of all at the floor's height and below, thick enough, and not below what is drawn."""
    piece = cut(mesh, np.array((0.0, 0.0, -1.0)), -(cavity.floor_z + 1e-6))
    points = np.empty((0, 3)) if piece is None else piece.vertices
    bottom = max(cavity.floor_z - LEAST_WALL_M, float(mesh.bounds[0, 2]))
    top = max(cavity.floor_z, bottom + LEAST_WALL_M)
    ring = cavity.radius[0][:, None] * np.stack((np.cos(cavity.angles), np.sin(cavity.angles)), axis=1)
    # the floor reaches the wall, however the two are drawn
    rims = [np.column_stack((ring + cavity.centre, np.full(len(ring), z))) for z in (bottom, top)]
    return limit_vertices(thick_corners(np.concatenate((points, *rims)), 1e-3), max_vertices)


def _sector(mesh: TriMesh, centre: np.ndarray, start: float, width: float) -> TriMesh | None:
    """Return what lies between two half planes from the axis, `width` (less than half a turn) apart."""
    piece: TriMesh | None = mesh
    for angle, side in ((start, 1.0), (start + width, -1.0)):
        normal = side * np.array((-np.sin(angle), np.cos(angle), 0.0))
        piece = None if piece is None else cut(piece, normal, float(normal[:2] @ centre))
    return piece


def _thick_outwards(points: np.ndarray, cavity: _Cavity, max_vertices: int) -> np.ndarray:
    """Return the hull of a piece of wall, made thick enough away from the cavity."""
    middle = points[:, :2].mean(axis=0) - cavity.centre
    outward = np.append(middle / max(float(np.linalg.norm(middle)), 1e-9), 0.0)
    pad = max(LEAST_WALL_M - cavity.wall_m, 0.0)
    return limit_vertices(thick_corners(np.concatenate((points, points + outward * pad)), 1e-3), max_vertices)


def _intrusion(piece: np.ndarray, cavity: _Cavity) -> float:
    """Return how far (metres) a convex piece stands into the cavity."""
    planes = convex_hull(piece).planes
    directions = np.stack((np.cos(cavity.angles), np.sin(cavity.angles)), axis=1)
    radius = np.where(np.isfinite(cavity.radius), cavity.radius, 1e3)  # far away where there is no wall
    wall = radius[..., None] * directions + cavity.centre
    points = np.concatenate((wall, np.broadcast_to(cavity.heights[:, None, None], (*wall.shape[:2], 1))), axis=2)
    deepest = 0.0
    for share in (0.99, 0.97, 0.94, 0.9, 0.85, 0.7, 0.5):
        inner = points.copy()
        inner[..., :2] = cavity.centre + share * (points[..., :2] - cavity.centre)
        inside = depth_inside(planes, inner.reshape(-1, 3)) > 0
        if inside.any():
            away = (1 - share) * np.linalg.norm(points[..., :2] - cavity.centre, axis=2).reshape(-1)
            deepest = max(deepest, float(away[inside].max()))
    return deepest


def _bulge(wall: list[np.ndarray], mesh: TriMesh, cavity: _Cavity) -> float:
    """Return how far (metres) 95 % of the wall's outside lies from the drawn surface, without its padding."""
    solids = [convex_hull(piece).mesh for piece in wall]
    points = sample_surface(solids, _PROBES, np.random.default_rng(0))
    reach = np.linalg.norm(points[:, :2] - cavity.centre, axis=1)
    away = distance_to_surface(points[reach > float(cavity.radius[0].min())], mesh)
    return float(np.quantile(away, 0.95)) - max(LEAST_WALL_M - cavity.wall_m, 0.0) if len(away) else 0.0


def _heights_above(mesh: TriMesh, xy: np.ndarray) -> np.ndarray:
    """Return the heights at which a vertical line meets the mesh."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return _line_hits(a[:, :2], b[:, :2], c[:, :2], xy, a[:, 2], b[:, 2], c[:, 2])


def _line_hits(a: np.ndarray, b: np.ndarray, c: np.ndarray, at: np.ndarray, *heights: np.ndarray) -> np.ndarray:
    """Return heights, interpolated, of the flat triangles (F, 2) that hold a point; edges count."""
    double = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    solid = np.abs(double) > 1e-14
    a, b, c, double = a[solid], b[solid], c[solid], double[solid]
    u = ((at - a)[:, 0] * (c - a)[:, 1] - (at - a)[:, 1] * (c - a)[:, 0]) / double
    v = ((b - a)[:, 0] * (at - a)[:, 1] - (b - a)[:, 1] * (at - a)[:, 0]) / double
    hit = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)
    ha, hb, hc = (h[solid][hit] for h in heights)
    return ha + u[hit] * (hb - ha) + v[hit] * (hc - ha)


def _hits_along(mesh: TriMesh, centre: np.ndarray, height: float, angle: float) -> np.ndarray:
    """Return the distances from the axis at which a level ray meets the surface; opposite faces count once."""
    moved = mesh.vertices - (*centre, height)
    along = moved[:, :2] @ (np.cos(angle), np.sin(angle))
    flat = np.stack((moved[:, :2] @ (-np.sin(angle), np.cos(angle)), moved[:, 2]), axis=1)
    a, b, c = (mesh.faces[:, k] for k in range(3))
    hits = _line_hits(flat[a], flat[b], flat[c], np.zeros(2), along[a], along[b], along[c])
    return np.unique(np.round(hits[hits > 0], 6))


def wheel_shape(mesh: TriMesh, joint: Joint | None, part: str) -> tuple[CollisionShape, list[str]]:
    """Return a cylinder or, for a ball, a sphere that a wheel rolls on, and warnings.

    Args:
        mesh: the wheel's drawn surface, in the link's frame.
        joint: of its link. A wheel turns about this joint's axis if it lies round about it; one that does not, on
            a link that only swivels, say, is given the axle that its shape suggests.
        part: name of the shape's part.
    """
    centre, axis, radius_m, wobble_m = _about_joint(mesh, joint) or _about_own_axle(mesh)
    warnings = []
    if wobble_m > ROUND_TOLERANCE_M:
        warnings.append(f"a wheel is out of round by {1e3 * wobble_m:.0f} mm: it rolls on its greatest radius")
    along = (mesh.vertices - centre) @ axis
    middle = centre + axis * (along.min() + along.max()) / 2
    half = float(np.ptp(along)) / 2
    box = 2 * half * (2 * radius_m) ** 2
    lengths = half / radius_m
    if (
        _BALL_LENGTHS[0] <= lengths <= _BALL_LENGTHS[1]
        and convex_hull(mesh.vertices).volume_m3 < _BALL_SHARE * box
    ):
        still = np.array((1.0, 0.0, 0.0, 0.0))
        return CollisionShape("sphere", (radius_m,), middle, still, None, part), warnings
    size = (radius_m, min(half, TREAD_HALF_WIDTH_M))
    return CollisionShape("cylinder", size, middle, _turn_z_to(axis), None, part), warnings


def _about_joint(mesh: TriMesh, joint: Joint | None) -> tuple[np.ndarray, np.ndarray, float, float] | None:
    """Return centre, axle, radius and out-of-roundness about the link's joint; None where it is no axle."""
    if joint is None or joint.kind != "revolute":
        return None
    axis = np.asarray(joint.axis, dtype=float)
    radius_m, wobble_m = _roundness(mesh.vertices - joint.origin, axis)
    if wobble_m > 0.25 * radius_m:  # a swivel's axis, say, or far beside the wheel
        return None
    return np.asarray(joint.origin, dtype=float), axis, radius_m, wobble_m


def _about_own_axle(mesh: TriMesh) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Return the same from the shape alone: of its own principal axes, the one about which it is roundest."""
    hull = convex_hull(mesh.vertices).mesh.vertices
    middle = (hull.min(axis=0) + hull.max(axis=0)) / 2
    _, _, axes = np.linalg.svd(hull - hull.mean(axis=0), full_matrices=False)
    found = []
    for axis in (*axes, *np.eye(3)):
        radius_m, wobble_m = _roundness(hull - middle, axis)
        found.append((wobble_m / radius_m, radius_m, axis, wobble_m))
    _, radius_m, axis, wobble_m = min(found, key=lambda entry: round(entry[0], 3))
    return middle, axis, radius_m, wobble_m


def _roundness(points: np.ndarray, axis: np.ndarray) -> tuple[float, float]:
    """Return the largest distance of points from an axis, and how much less it is in the worst direction."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    u = np.cross(axis, helper)
    u /= np.linalg.norm(u)
    flat = np.stack((points @ u, points @ np.cross(axis, u)), axis=1)
    angles = np.linspace(0, 2 * np.pi, 72, endpoint=False)
    reach = (flat @ np.stack((np.cos(angles), np.sin(angles)))).max(axis=0)
    radius = float(np.linalg.norm(flat, axis=1).max())
    return radius, radius - float(reach.min())


def _turn_z_to(axis: np.ndarray) -> np.ndarray:
    """Return a quaternion (4,) that turns z to a unit vector."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x)
    return quat_from_matrix(np.stack((x, np.cross(axis, x), axis), axis=1))

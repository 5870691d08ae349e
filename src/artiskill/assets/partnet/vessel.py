"""Open vessels as convex sectors: what is poured in stays in, and nothing lids the opening.

A general decomposition of a thin shell either leaves gaps or fills the hollow. A vessel is convex sector by
sector about its axis: the wall is cut into sectors and, where it bulges, into bands; the floor is what lies
lowest.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from artiskill.assets.partnet.meshes import distance_to_surface, weld
from artiskill.assets.partnet.slicing import cut, hull_corners, slab
from artiskill.geometry.meshes import TriMesh, convex_hull, depth_inside, sample_surface

# A ball of 50 mm that falls from the rim at 2.5 m/s moves 5 mm in a step of 2 ms: it must not pass in one.
LEAST_WALL_M = 0.008
_SECTORS, _BANDS = (12, 16, 20), (1, 2, 3)
_GOOD_ERROR_M = 0.006  # of a wall's hulls: less than this is not worth more of them
_PROBES = 400
_FLOOR_SHARE = 0.25  # the floor lies in this lowest part of a vessel
_RAYS, _LEVELS = 48, 12


@dataclass(frozen=True, eq=False)
class Vessel:
    """The convex pieces of a vessel, (V, 3) corners each.

    Attributes:
        wall: sectors of the side.
        floor: pieces of the bottom.
        error_m: how far the wall's pieces stand into the hollow, or off its outside, whichever is more.
    """

    wall: list[np.ndarray]
    floor: list[np.ndarray]
    error_m: float


@dataclass(frozen=True, eq=False)
class Hollow:
    """The room inside a vessel.

    Attributes:
        centre: (2,) where its axis stands.
        heights: (L,) of the levels, metres.
        angles: (R,) of the rays, radians.
        radius: (L, R) from the axis to the first surface; infinite where there is none.
        floor_z: height of the floor.
        wall_m: how thick most of the wall is drawn, 0 for a sheet.
    """

    centre: np.ndarray
    heights: np.ndarray
    angles: np.ndarray
    radius: np.ndarray
    floor_z: float
    wall_m: float


def find_hollow(mesh: TriMesh) -> Hollow | None:
    """The hollow of a vessel that is open at the top (+z), or None: it has a lid, no floor or no wall.

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
    return Hollow(centre, heights, angles, radius, floor_z, float(np.quantile(wall, 0.25)))


def vessel_hulls(mesh: TriMesh, max_vertices: int) -> Vessel | None:
    """A vessel's wall and floor as convex pieces; None where the mesh is no open vessel.

    Args:
        mesh: the drawn surface of the body, z up.
        max_vertices: corners of a piece at most.
    """
    mesh = weld(mesh)
    hollow = find_hollow(mesh) if len(mesh.faces) else None
    if hollow is None:
        return None
    best: Vessel | None = None
    for bands in _BANDS:
        for sectors in _SECTORS:
            for turn in (0.0, 0.5):
                found = _cut_vessel(mesh, hollow, sectors, bands, turn, max_vertices)
                if best is None or found.error_m < best.error_m - 1e-3:
                    best = found
            if best is not None and best.error_m <= _GOOD_ERROR_M:
                return best
    return best


def _cut_vessel(mesh: TriMesh, hollow: Hollow, sectors: int, bands: int, turn: float, max_vertices: int) -> Vessel:
    edges = np.linspace(mesh.bounds[0, 2], mesh.bounds[1, 2], bands + 1)
    edges[0], edges[-1] = edges[0] - 1e-6, edges[-1] + 1e-6
    up = np.array((0.0, 0.0, 1.0))
    wall = []
    side = _without_floor(mesh, hollow)
    for low, high in itertools.pairwise(edges):
        band = side if bands == 1 else slab(side, up, low, high)
        if band is None:
            continue
        for k in range(sectors):
            piece = _sector(band, hollow.centre, 2 * np.pi * (k + turn) / sectors, 2 * np.pi / sectors)
            if piece is not None:
                wall.append(_thick_outwards(piece.vertices, hollow, max_vertices))
    floor = [_floor(mesh, hollow, max_vertices)]
    intrusion_m = max((_intrusion(piece, hollow) for piece in wall), default=np.inf)
    return Vessel(wall, floor, max(intrusion_m, _bulge(wall, mesh, hollow)))


def _without_floor(mesh: TriMesh, hollow: Hollow) -> TriMesh:
    """The faces of the side: those of the floor lie low and near the axis."""
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    reach = np.linalg.norm(mesh.vertices[mesh.faces][..., :2] - hollow.centre, axis=2).min(axis=1)
    inner = float(hollow.radius[0].min())
    is_floor = (middles[:, 2] <= hollow.floor_z + 1e-3) & (reach < 0.8 * inner)
    return TriMesh(mesh.vertices, mesh.faces[~is_floor])


def _floor(mesh: TriMesh, hollow: Hollow, max_vertices: int) -> np.ndarray:
    """The hull of everything at the floor's height and below, thick enough, and not below what is drawn."""
    piece = cut(mesh, np.array((0.0, 0.0, -1.0)), -(hollow.floor_z + 1e-6))
    points = np.empty((0, 3)) if piece is None else piece.vertices
    bottom = max(hollow.floor_z - LEAST_WALL_M, float(mesh.bounds[0, 2]))
    top = max(hollow.floor_z, bottom + LEAST_WALL_M)
    ring = hollow.radius[0][:, None] * np.stack((np.cos(hollow.angles), np.sin(hollow.angles)), axis=1)
    # the floor reaches the wall, however the two are drawn
    rims = [np.column_stack((ring + hollow.centre, np.full(len(ring), z))) for z in (bottom, top)]
    return hull_corners(np.concatenate((points, *rims)), 1e-3, max_vertices)


def _sector(mesh: TriMesh, centre: np.ndarray, start: float, width: float) -> TriMesh | None:
    """What lies between two half planes from the axis, `width` (less than half a turn) apart."""
    piece: TriMesh | None = mesh
    for angle, side in ((start, 1.0), (start + width, -1.0)):
        normal = side * np.array((-np.sin(angle), np.cos(angle), 0.0))
        piece = None if piece is None else cut(piece, normal, float(normal[:2] @ centre))
    return piece


def _thick_outwards(points: np.ndarray, hollow: Hollow, max_vertices: int) -> np.ndarray:
    """The hull of a piece of wall, made thick enough away from the hollow."""
    middle = points[:, :2].mean(axis=0) - hollow.centre
    outward = np.append(middle / max(float(np.linalg.norm(middle)), 1e-9), 0.0)
    pad = max(LEAST_WALL_M - hollow.wall_m, 0.0)
    return hull_corners(np.concatenate((points, points + outward * pad)), 1e-3, max_vertices)


def _intrusion(piece: np.ndarray, hollow: Hollow) -> float:
    """How far (metres) a convex piece stands into the hollow."""
    planes = convex_hull(piece).planes
    directions = np.stack((np.cos(hollow.angles), np.sin(hollow.angles)), axis=1)
    radius = np.where(np.isfinite(hollow.radius), hollow.radius, 1e3)  # far away where there is no wall
    wall = radius[..., None] * directions + hollow.centre
    points = np.concatenate((wall, np.broadcast_to(hollow.heights[:, None, None], (*wall.shape[:2], 1))), axis=2)
    deepest = 0.0
    for share in (0.99, 0.97, 0.94, 0.9, 0.85, 0.7, 0.5):
        inner = points.copy()
        inner[..., :2] = hollow.centre + share * (points[..., :2] - hollow.centre)
        inside = depth_inside(planes, inner.reshape(-1, 3)) > 0
        if inside.any():
            away = (1 - share) * np.linalg.norm(points[..., :2] - hollow.centre, axis=2).reshape(-1)
            deepest = max(deepest, float(away[inside].max()))
    return deepest


def _bulge(wall: list[np.ndarray], mesh: TriMesh, hollow: Hollow) -> float:
    """How far (metres) 95 % of the wall's outside lies from the drawn surface, its padding left out."""
    solids = [convex_hull(piece).mesh for piece in wall]
    points = sample_surface(solids, _PROBES, np.random.default_rng(0))
    reach = np.linalg.norm(points[:, :2] - hollow.centre, axis=1)
    away = distance_to_surface(points[reach > float(hollow.radius[0].min())], mesh)
    return float(np.quantile(away, 0.95)) - max(LEAST_WALL_M - hollow.wall_m, 0.0) if len(away) else 0.0


def _heights_above(mesh: TriMesh, xy: np.ndarray) -> np.ndarray:
    """Heights at which a vertical line meets the mesh."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return _line_hits(a[:, :2], b[:, :2], c[:, :2], xy, a[:, 2], b[:, 2], c[:, 2])


def _line_hits(a: np.ndarray, b: np.ndarray, c: np.ndarray, at: np.ndarray, *heights: np.ndarray) -> np.ndarray:
    """Heights, interpolated, of the flat triangles (F, 2) that hold a point; edges count."""
    double = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    solid = np.abs(double) > 1e-14
    a, b, c, double = a[solid], b[solid], c[solid], double[solid]
    u = ((at - a)[:, 0] * (c - a)[:, 1] - (at - a)[:, 1] * (c - a)[:, 0]) / double
    v = ((b - a)[:, 0] * (at - a)[:, 1] - (b - a)[:, 1] * (at - a)[:, 0]) / double
    hit = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)
    ha, hb, hc = (h[solid][hit] for h in heights)
    return ha + u[hit] * (hb - ha) + v[hit] * (hc - ha)


def _hits_along(mesh: TriMesh, centre: np.ndarray, height: float, angle: float) -> np.ndarray:
    """Distances from the axis, increasing, at which a level ray meets the surface; twin faces count once."""
    moved = mesh.vertices - (*centre, height)
    along = moved[:, :2] @ (np.cos(angle), np.sin(angle))
    flat = np.stack((moved[:, :2] @ (-np.sin(angle), np.cos(angle)), moved[:, 2]), axis=1)
    a, b, c = (mesh.faces[:, k] for k in range(3))
    hits = _line_hits(flat[a], flat[b], flat[c], np.zeros(2), along[a], along[b], along[c])
    return np.unique(np.round(hits[hits > 0], 6))

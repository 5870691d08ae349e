"""The body of a bucket as drawn: a thin wall, seen from both sides, with its floor, foot, lip and hoops."""

import numpy as np

from artiskill.assets.articulated_object import Material
from artiskill.assets.buckets.materials import SPANGLE_TILE_M, Materials
from artiskill.assets.buckets.section import outline
from artiskill.assets.buckets.spec import BucketSpec
from artiskill.assets.buckets.surface import SPOUT_DEPTH, half_width, spout_bulge
from artiskill.assets.parts import LinkParts, panel_mesh
from artiskill.geometry.arrays import arctan2, norm
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import loft, ring_sweep

_BEAD_POINTS = 8
_SPOUT_LEVELS = 5
_SPOUT_APART = 0.03  # of the height: no level so near to a knot
_BEVEL_M = 0.0008
_SHEET_M = 0.002  # thickness of a collar
_HOOP_M = (0.0004, 0.0022)  # a hoop reaches so far into the wall and beyond it
_FOOT_M = 0.003  # thickness of a foot's ring
_STAVE_GAP = 0.998  # of a stave's width: neighbours do not quite meet, and their bevels make the groove


def add_vessel(parts: LinkParts, spec: BucketSpec, materials: Materials, rng: np.random.Generator) -> None:
    """Draw everything of the body but the ears; what is touched is in `walls`."""
    if spec.staves:
        _add_staves(parts, spec, materials.wall, rng)
    else:
        _add_wall(parts, spec, materials)
        parts.add_visual(_carry(spec, _lip_loop(spec)), materials.lip, "lip")
    _add_floor(parts, spec, materials.inside)
    if spec.foot.kind == "ring":
        outer = float(half_width(spec.profile, spec.foot.height_m)) - spec.foot.inset_m
        parts.add_visual(
            _carry(spec, _rectangle(outer - _FOOT_M, outer, 0.0, spec.foot.height_m)), materials.wall, "foot"
        )
    for hoop in spec.hoops:
        low, high = (float(half_width(spec.profile, z)) for z in (hoop.z0, hoop.z1))
        into, out = _HOOP_M
        loop = [(low + out, hoop.z0), (high + out, hoop.z1), (high - into, hoop.z1), (low - into, hoop.z0)]
        parts.add_visual(_carry(spec, np.array(loop)), materials.ear, "wall")


def _add_wall(parts: LinkParts, spec: BucketSpec, materials: Materials) -> None:
    """One skin; or two, back to back, where inside and outside have different colours."""
    heights = _heights(spec)
    outer = half_width(spec.profile, heights)

    def skin(outside: np.ndarray, inside: np.ndarray) -> TriMesh:
        up, down = np.stack((outside, heights), axis=-1), np.stack((inside, heights), axis=-1)
        return _carry(spec, np.concatenate((up, down[::-1])))

    if materials.wall is materials.inside:
        parts.add_visual(skin(outer, outer - spec.wall_m), materials.wall, "wall")
        return
    parts.add_visual(skin(outer, outer - spec.wall_m / 2), materials.wall, "wall")
    parts.add_visual(skin(outer - spec.wall_m / 2, outer - spec.wall_m), materials.inside, "wall")


def _heights(spec: BucketSpec) -> np.ndarray:
    """Those of the knots, and more where a spout bends the wall."""
    knots = [z for z, _ in spec.profile.knots]
    if spec.spout_m > 0:
        bends = np.linspace((1 - SPOUT_DEPTH) * spec.height_m, spec.height_m, _SPOUT_LEVELS).tolist()
        near = _SPOUT_APART * spec.height_m
        knots += [z for z in bends if min(abs(z - knot) for knot in knots) > near]
    return np.unique(np.round(knots, 6))


def _carry(spec: BucketSpec, loop: np.ndarray) -> TriMesh:
    """A loop of (half width, height) around the section, drawn out at the spout."""
    around = outline(spec.section)
    tile = SPANGLE_TILE_M if spec.material == "galvanised" else 0.0
    if spec.spout_m <= 0:
        return ring_sweep(around, loop, tile)
    angles = arctan2(around[:, 1], around[:, 0])
    bulge = spout_bulge(angles[:, None], loop[None, :, 1], spec.height_m, spec.spout_m)
    loops = np.broadcast_to(loop, (len(around), *loop.shape)).copy()
    loops[:, :, 0] += bulge / norm(around)[:, None]
    return ring_sweep(around, loops, tile)


def _lip_loop(spec: BucketSpec) -> np.ndarray:
    """Section of the lip, counter-clockwise in (half width, height)."""
    outer, top = spec.top_m + spec.lip.overhang_m, spec.height_m
    inner, low = spec.top_m - spec.wall_m - 0.0003, top - spec.lip.height_m
    if spec.lip.kind == "rolled":
        angles = (np.arange(_BEAD_POINTS) + 0.5) * (2 * np.pi / _BEAD_POINTS)
        radii, middle = ((outer - inner) / 2, (top - low) / 2), ((outer + inner) / 2, (top + low) / 2)
        bead = np.stack((np.cos(angles), np.sin(angles)), axis=-1) / np.cos(np.pi / _BEAD_POINTS)
        return bead * radii + middle
    if spec.lip.kind == "flange":
        return _rectangle(inner, outer, low, top)
    below, back = top - 1.5 * _SHEET_M, outer - _SHEET_M
    points = [(outer, low), (outer, top - _BEVEL_M), (outer - _BEVEL_M, top), (inner, top)]
    return np.array([*points, (inner, below), (back, below), (back, low)])


def _rectangle(inner: float, outer: float, low: float, top: float) -> np.ndarray:
    """A bevelled rectangle, counter-clockwise."""
    b = min(_BEVEL_M, 0.3 * (top - low), 0.3 * (outer - inner))
    right = [(outer - b, low), (outer, low + b), (outer, top - b), (outer - b, top)]
    return np.array([*right, (inner + b, top), (inner, top - b), (inner, low + b), (inner + b, low)])


def _add_floor(parts: LinkParts, spec: BucketSpec, material: Material) -> None:
    around, rings = outline(spec.section), []
    for z in (spec.foot.height_m, spec.floor_z):
        scale = float(half_width(spec.profile, z)) - spec.wall_m / 2
        rings.append(np.column_stack((scale * around, np.full(len(around), z))))
    parts.add_visual(loft(np.array(rings)), material, "floor")


def _add_staves(parts: LinkParts, spec: BucketSpec, material: Material, rng: np.random.Generator) -> None:
    """Upright boards, each a bevelled box bent into its place."""
    low, top = spec.profile.knots[0][0], spec.height_m
    step = 2 * np.pi / spec.staves
    half = np.array((spec.wall_m, spec.top_m * step, top - low)) / 2
    for k in range(spec.staves):
        board = panel_mesh(np.zeros(3), half, 2, rng)
        depth, across, along = board.vertices.T
        angle = (k + 0.5 * _STAVE_GAP * across / half[1]) * step
        z = along + (low + top) / 2
        # corners as far outside the circle as the middle of a face is inside
        radius = half_width(spec.profile, z) * 2 / (1 + np.cos(step / 2)) + depth - half[0]
        vertices = np.stack((radius * np.cos(angle), radius * np.sin(angle), z), axis=-1)
        parts.add_visual(TriMesh(vertices, board.faces, board.uvs), material, "wall")

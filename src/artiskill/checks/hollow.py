"""Where a drawer is drawn hollow, nothing may be touched: no collision shape closes its opening.

The hollow is found from what is drawn: seen from above, everything over the drawer's bottom and under its rim that
no surface covers. It is then probed with points, at rest, against the shapes of all links.
"""

import numpy as np

from artiskill.assets.articulated_object import Link, VisualMesh
from artiskill.assets.handles import is_handle_part
from artiskill.assets.kinematics import link_poses
from artiskill.checks.config import ChecksConfig
from artiskill.checks.result import CheckResult, at_most, fine
from artiskill.checks.shapes import TouchedSurface
from artiskill.checks.specimen import Specimen
from artiskill.geometry.meshes import TriMesh, merge
from artiskill.geometry.rotations import quat_conjugate, transform_points

NAME = "hollow"
_GRID = 12  # columns along each side of the drawer
_LEVELS = 4  # points in each column
_MARGIN_M = 0.012  # from bottom and rim: twice the thickness by which collision shapes may exceed what is drawn
_SHALLOW_M = 0.03  # less than this is no hollow


def check_hollow(specimen: Specimen, config: ChecksConfig) -> list[CheckResult]:
    """One result per drawer: how much of its hollow is solid to the touch."""
    obj = specimen.object
    positions, quaternions = link_poses(obj, specimen.rest)
    touched = [TouchedSurface(link.collisions) for link in obj.links]
    results = []
    for i, link in enumerate(obj.links):
        if link.joint is None or link.joint.kind != "prismatic":
            continue
        points = hollow_points(link)
        if len(points) == 0:
            results.append(fine(NAME, link.name, "it is not drawn hollow"))
            continue
        world = transform_points(positions[i], quaternions[i], points)
        solid, where = np.zeros(len(points), dtype=bool), []
        for k, surface in enumerate(touched):
            back = quat_conjugate(quaternions[k])
            inside = surface.signed_distances(transform_points(np.zeros(3), back, world - positions[k])) < 0
            where += [obj.links[k].name] if inside.any() else []
            solid |= inside
        share, limit = 100 * float(solid.mean()), 100 * config.surfaces.solid_share
        note = f"shapes of {', '.join(where)} fill its opening" if share > limit else ""
        results.append(at_most(NAME, link.name, share, limit, "%", note))
    return results


def hollow_points(link: Link) -> np.ndarray:
    """Points in the hollow of a link that is open at its top, as far as it is drawn. (N, 3) in its frame."""
    meshes = [visual.mesh for visual in link.visuals if _is_box(visual)]
    if not meshes:
        return np.zeros((0, 3))
    mesh = merge(meshes)
    low, high = mesh.bounds
    steps = (np.arange(_GRID) + 0.5) / _GRID
    grid = np.stack(np.meshgrid(*(low[a] + steps * (high[a] - low[a]) for a in (0, 1))), axis=-1).reshape(-1, 2)
    bottom = heights_below(mesh, grid)
    rim = _rim(bottom, high[2])
    open_columns = np.isfinite(bottom) & (bottom < rim - _SHALLOW_M)
    shares = np.linspace(0.0, 1.0, _LEVELS)
    first, last = bottom[open_columns] + _MARGIN_M, rim - _MARGIN_M
    z = first[:, None] + shares * (last - first)[:, None]
    xy = np.repeat(grid[open_columns][:, None], _LEVELS, axis=1)
    return np.concatenate((xy, z[..., None]), axis=-1).reshape(-1, 3)


def heights_below(mesh: TriMesh, xy: np.ndarray) -> np.ndarray:
    """Height of the highest surface at each place seen from above, -inf where there is none. (P, 2) -> (P,)."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    area = _cross(b[:, :2] - a[:, :2], c[:, :2] - a[:, :2])
    seen = np.abs(area) > 1e-12  # upright triangles are lines from above
    a, b, c, area = a[seen], b[seen], c[seen], area[seen]
    p = xy[:, None]
    u = _cross(b[:, :2] - a[:, :2], p - a[:, :2]) / area  # weight of c
    v = _cross(p - a[:, :2], c[:, :2] - a[:, :2]) / area  # weight of b
    inside = (u >= 0) & (v >= 0) & (u + v <= 1)
    z = a[:, 2] + v * (b[:, 2] - a[:, 2]) + u * (c[:, 2] - a[:, 2])
    return np.where(inside, z, -np.inf).max(axis=1, initial=-np.inf)


def _rim(bottom: np.ndarray, top: float) -> float:
    """Height of a drawer's sides: those of its columns that are no opening, the front may be higher."""
    walls = (
        bottom[np.isfinite(bottom) & (bottom > np.median(bottom[np.isfinite(bottom)]) + _SHALLOW_M)]
        if (np.isfinite(bottom).any())
        else bottom[:0]
    )
    return float(min(np.median(walls), top)) if len(walls) else top


def _is_box(visual: VisualMesh) -> bool:
    """What makes the drawer's box: handles and fronts stand out of it."""
    return not is_handle_part(visual.part) and "front" not in visual.part


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]

"""Handles of imported links: which way is outward, whether a finger fits behind, thin meshes made thick."""

from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import Category, Handle, Joint
from artiskill.assets.handles import handle_from_mesh
from artiskill.assets.partnet.meshes import thick_hull
from artiskill.geometry.meshes import TriMesh, sample_surface, triangle_areas
from artiskill.geometry.rotations import quat_rotate

# The least gap in which the tip of a Panda finger hooks without pressing on the panel.
HOOK_GAP_M = 0.012
LEAST_HANDLE_THICKNESS_M = 0.002
_BAR_RATIO = 2.0  # a handle this many times as long as wide is a bar, else a knob
_HINGE_SIDE_SHARE = 0.4  # a handle within this share of a door's width from its hinge is on the wrong side
_SAMPLES = 4000


@dataclass(frozen=True, eq=False)
class Grip:
    """A handle, the gap behind its middle (metres, inf where nothing lies behind), and what to warn of."""

    handle: Handle
    gap_m: float
    warnings: tuple[str, ...]


def make_grip(
    link: str, mesh: TriMesh, panel: TriMesh | None, joint: Joint, category: Category, rng: np.random.Generator
) -> Grip:
    """Describe the handle of a moving link.

    Args:
        link: the link's name.
        mesh: the handle's drawn surface, in the link's frame.
        panel: the rest of the link's drawn surface, or None.
        joint: of the link; its lower limit is the closed pose.
        category: of the object: bails of buckets are held from outside, doors and drawers from the front.
        rng: for samples.
    """
    warnings = []
    hull, thickened = thick_hull(mesh.vertices, LEAST_HANDLE_THICKNESS_M)
    if thickened:
        mesh = hull.mesh
        thickness = LEAST_HANDLE_THICKNESS_M * 1e3
        warnings.append(f"a handle of {link!r} is thinner than {thickness:g} mm: its hull was thickened to that")
    outward, said = outward_direction(mesh, panel, joint, category)
    if category == "cabinet" and joint.kind == "revolute" and panel is not None:
        said = said + _hinge_side(mesh, panel, joint)
    warnings += [f"{link!r}: {text}" for text in said]
    gap = gap_behind(mesh, panel, outward, rng)
    handle = handle_from_mesh(link, "bar", mesh, outward, rng, hookable=gap >= HOOK_GAP_M)
    kind = "bar" if _length(mesh, handle) >= _BAR_RATIO * handle.grasp_width_m else "knob"
    handle = Handle(**{**vars(handle), "kind": kind})
    return Grip(handle, gap, tuple(warnings))


def outward_direction(
    mesh: TriMesh, panel: TriMesh | None, joint: Joint, category: Category
) -> tuple[np.ndarray, list[str]]:
    """Unit vector (3,), link frame, from the panel to the room at the closed pose; and warnings.

    A drawer's is its opening direction. A door's is the normal of its largest flat side, on the side where the
    handle stands; a bail's points away from its axis.
    """
    centre = mesh.bounds.mean(axis=0)
    if joint.kind == "prismatic":
        return joint.axis, []
    arm = centre - joint.origin
    radial = arm - joint.axis * (arm @ joint.axis)
    if category == "bucket":
        return _unit(radial, joint), []
    opening = _unit(np.cross(joint.axis, radial), joint)
    if panel is None:
        return opening, ["no panel behind the handle: its opening direction is taken as outward"]
    normal = _main_normal(panel)
    if abs(normal @ opening) < 0.5:
        return opening, ["the door's flat side does not face its opening direction, which is taken as outward"]
    normal = normal * np.sign(normal @ opening)
    if (centre - panel.bounds.mean(axis=0)) @ normal < 0:
        return -normal, ["the handle stands on the side away from which the door opens: it opens by pushing"]
    return normal, []


def _hinge_side(mesh: TriMesh, panel: TriMesh, joint: Joint) -> list[str]:
    """What to say of a handle nearer to the hinge than to the door's free edge, where opening takes much force."""
    arm_m, reach_m = (
        float(np.linalg.norm(np.cross(points - joint.origin, joint.axis), axis=1).max())
        for points in (mesh.bounds.mean(axis=0)[None], panel.vertices)
    )
    if arm_m >= _HINGE_SIDE_SHARE * reach_m:
        return []
    return [f"the handle is on the hinge side: {1e3 * arm_m:.0f} mm from the hinge of {1e3 * reach_m:.0f} mm"]


def gap_behind(mesh: TriMesh, panel: TriMesh | None, outward: np.ndarray, rng: np.random.Generator) -> float:
    """Free depth (metres) between the middle half of a handle and the panel behind it.

    Posts at a bar's ends do not count; a solid knob or a moulding leaves no gap. Infinite where nothing lies
    behind the handle's middle.
    """
    points = sample_surface([mesh], _SAMPLES, rng)
    depth = points @ outward
    flat = points - np.outer(depth, outward)
    _, _, axes = np.linalg.svd(flat - flat.mean(axis=0), full_matrices=False)
    along = flat @ axes[0]
    low, high = along.min(), along.max()
    middle = np.abs(along - (low + high) / 2) <= (high - low) / 4
    if not middle.any():  # two pieces with nothing between them
        middle[:] = True
    if panel is None:
        return np.inf
    behind = sample_surface([panel], _SAMPLES * 5, rng)
    corners = np.concatenate((behind, panel.vertices))
    reach = HOOK_GAP_M  # the finger's width beside the bar
    inside = np.ones(len(corners), dtype=bool)
    for axis in axes[:2]:
        handle_side, panel_side = points[middle] @ axis, corners @ axis
        inside &= (panel_side >= handle_side.min() - reach) & (panel_side <= handle_side.max() + reach)
    inner = float(depth[middle].min())
    heights = corners[inside] @ outward
    heights = heights[heights <= inner + 1e-4]
    return inner - float(heights.max()) if len(heights) else np.inf


def _main_normal(panel: TriMesh) -> np.ndarray:
    """The direction in which most of the panel's area faces, sign open: largest eigenvector of sum A n n^T."""
    corners = panel.vertices[panel.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.maximum(triangle_areas(panel), 1e-30)
    normals = normals / (2 * areas[:, None])
    _, vectors = np.linalg.eigh(np.einsum("f,fi,fj->ij", areas, normals, normals))
    return vectors[:, -1]


def _length(mesh: TriMesh, handle: Handle) -> float:
    """Extent along the handle's longer side seen from outside: the hand's x axis."""
    along = quat_rotate(handle.grasp_quaternions[0], np.array((1.0, 0.0, 0.0)))
    return float(np.ptp(mesh.vertices @ along))


def _unit(vector: np.ndarray, joint: Joint) -> np.ndarray:
    """The vector with length 1; a direction square to the axis where it is (nearly) zero."""
    length = float(np.linalg.norm(vector))
    if length > 1e-6:
        return vector / length
    helper = np.cross(joint.axis, np.eye(3)[int(np.argmin(np.abs(joint.axis)))])
    return helper / np.linalg.norm(helper)

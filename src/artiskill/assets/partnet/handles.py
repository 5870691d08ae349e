"""Handles of imported links: which way is outward, whether a finger fits behind, where the open gripper fits.

The usual grasp pose takes a handle's middle 10 mm behind its face. A handle that is near to its panel leaves too
little clearance for the fingertips there: then other poses are tried, less deep, further along the handle, or
across it, with the gripper as boxes against the collision shapes of the object at rest.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from artiskill.assets.articulated_object import Category, CollisionShape, Handle, Joint
from artiskill.assets.handles import handle_from_mesh, is_handle_part
from artiskill.assets.partnet.collisions import LinkSurface, moved_hull, shape_hull
from artiskill.assets.partnet.drawn import DrawnMesh, group_by_part
from artiskill.assets.partnet.meshes import thick_hull
from artiskill.geometry.meshes import ConvexHull, TriMesh, merge, sample_surface, triangle_areas
from artiskill.geometry.primitives import box
from artiskill.geometry.rotations import quat_from_axis_angle, quat_multiply, quat_rotate, quat_to_matrix

# The least gap in which the tip of a Panda finger hooks without pressing on the panel.
HOOK_GAP_M = 0.012
LEAST_HANDLE_THICKNESS_M = 0.002
_BAR_RATIO = 2.0  # a handle this many times as long as wide is a bar, else a knob
_HINGE_SIDE_SHARE = 0.4  # a handle within this share of a door's width from its hinge is on the wrong side
_SAMPLES = 4000

# The hand and one finger, closed, as boxes: middle from the point between the pads (x along the handle, y to that
# finger, z to the tips), half extents, turn about x. As configs/robots/panda.yaml has them; a test compares.
HAND = ((0.0, 0.0, -0.0704), (0.03, 0.1, 0.033), 0.0)
FINGER = (
    ((0.0, 0.0075, 0.0), (0.0085, 0.0075, 0.0085), 0.0),
    ((0.0, 0.0145, -0.0165), (0.0085, 0.004, 0.011), 0.25),
    ((0.0, 0.0185, -0.034), (0.01, 0.0075, 0.0075), 0.0),
)
OPEN_M = 0.04  # of each finger
# Each pad beside the handle: where the open fingers do not fit, and shortly before they close on it. What touches
# less than the last is no contact.
_NARROW_M, _TOUCH_M, _NONE_M = 0.018, 0.003, 1e-5
_STEP_M, _LEAST_DEPTH_M = 0.001, 0.002
_ALONG = (0.0, 0.25, -0.25, 0.5, -0.5)  # along the handle, shares of its half length
_HALF_TURN = quat_from_axis_angle((0, 0, 1), np.pi)
_QUARTER_TURN = quat_from_axis_angle((0, 0, 1), np.pi / 2)


@dataclass(frozen=True, eq=False)
class ImportedHandle:
    """A handle, and the gap behind its middle (metres; infinite where nothing lies behind)."""

    handle: Handle
    gap_m: float


def find_handles(
    surface: LinkSurface, category: Category, rng: np.random.Generator, warnings: list[str]
) -> list[ImportedHandle]:
    """Return the handles of a link; none on links that do not move or never close."""
    joint = surface.joint
    groups = _handle_groups(surface.drawn)
    if not groups or joint is None:
        return []
    if category == "cabinet" and np.isinf(joint.limits[0]):
        warnings.append(f"{surface.name!r} turns without end: its handle is no target")
        return []
    panels = [mesh.mesh for mesh in surface.drawn if not mesh.label.is_handle]
    panel = merge(panels) if panels else None
    found = []
    for meshes in groups:
        whole = merge(m.mesh for m in meshes)
        handle, said = describe_handle(surface.name, whole, panel, joint, category, rng)
        warnings += said
        found.append(handle)
    return found


def clear_handles(
    handles: Sequence[ImportedHandle],
    surfaces: Sequence[LinkSurface],
    shapes: Sequence[Sequence[CollisionShape]],
    positions: Sequence[np.ndarray],
    index: int,
    warnings: list[str],
) -> list[ImportedHandle]:
    """Return the handles of link `index`, the open gripper fitting beside the shapes of all links at rest."""
    obstacles = [
        Obstacle(
            moved_hull(shape_hull(shape), positions[k] - positions[index]),
            "" if k == index and is_handle_part(shape.part) else surface.name,
        )
        for k, surface in enumerate(surfaces)
        for shape in shapes[k]
    ]
    found = []
    for given, meshes in zip(handles, _handle_groups(surfaces[index].drawn), strict=True):
        vertices = np.concatenate([mesh.mesh.vertices for mesh in meshes])
        handle, said = with_clearance(given.handle, vertices, obstacles)
        warnings += said
        found.append(replace(given, handle=handle))
    return found


def _handle_groups(drawn: Sequence[DrawnMesh]) -> list[list[DrawnMesh]]:
    """Group the meshes of each handle: of one number (`handle-3`, `handle_post-3`), or of one name without."""
    groups: dict[int | str, list[DrawnMesh]] = {}
    for label, meshes in group_by_part(drawn).items():
        if label.is_handle:
            groups.setdefault(label.id if label.id >= 0 else label.name, []).extend(meshes)
    return list(groups.values())


def describe_handle(
    link: str, mesh: TriMesh, panel: TriMesh | None, joint: Joint, category: Category, rng: np.random.Generator
) -> tuple[ImportedHandle, list[str]]:
    """Return the handle of a moving link, and warnings.

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
    return ImportedHandle(replace(handle, kind=kind), gap), warnings


def outward_direction(
    mesh: TriMesh, panel: TriMesh | None, joint: Joint, category: Category
) -> tuple[np.ndarray, list[str]]:
    """Return the unit vector (3,), link frame, away from the panel at the closed pose, and warnings.

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
    """Warn of a handle nearer to the hinge than to the door's free edge, where opening takes much force."""
    arm_m, reach_m = (
        float(np.linalg.norm(np.cross(points - joint.origin, joint.axis), axis=1).max())
        for points in (mesh.bounds.mean(axis=0)[None], panel.vertices)
    )
    if arm_m >= _HINGE_SIDE_SHARE * reach_m:
        return []
    return [f"the handle is on the hinge side: {1e3 * arm_m:.0f} mm from the hinge of {1e3 * reach_m:.0f} mm"]


def gap_behind(mesh: TriMesh, panel: TriMesh | None, outward: np.ndarray, rng: np.random.Generator) -> float:
    """Return the free depth (metres) between the middle half of a handle and the panel behind it.

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
    """Return the direction in which most area faces, its sign open: largest eigenvector of sum A n n^T."""
    corners = panel.vertices[panel.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.maximum(triangle_areas(panel), 1e-30)
    normals = normals / (2 * areas[:, None])
    _, vectors = np.linalg.eigh(np.einsum("f,fi,fj->ij", areas, normals, normals))
    return vectors[:, -1]


def _length(mesh: TriMesh, handle: Handle) -> float:
    """Return the extent along the handle's longer side seen from outside: the hand's x axis."""
    along = quat_rotate(handle.grasp_quaternions[0], np.array((1.0, 0.0, 0.0)))
    return float(np.ptp(mesh.vertices @ along))


def _unit(vector: np.ndarray, joint: Joint) -> np.ndarray:
    """Return the vector with length 1; a direction square to the axis where it is (nearly) zero."""
    length = float(np.linalg.norm(vector))
    if length > 1e-6:
        return vector / length
    helper = np.cross(joint.axis, np.eye(3)[int(np.argmin(np.abs(joint.axis)))])
    return helper / np.linalg.norm(helper)


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A collision shape in the frame of a handle's link, and the name of its link; empty for the handle's own."""

    hull: ConvexHull
    link: str


@dataclass(frozen=True, eq=False)
class _Candidate:
    position: np.ndarray
    quaternion: np.ndarray
    width_m: float


def with_clearance(
    handle: Handle, vertices: np.ndarray, obstacles: Sequence[Obstacle]
) -> tuple[Handle, list[str]]:
    """Return the handle with grasp poses at which the open gripper fits, and warnings.

    Tried are, the usual one first, less depth, other places along the handle and the hand turned by a quarter.
    Where it fits at none, the pose that is least in the way stays, and a warning says so.

    Args:
        handle: with its usual poses.
        vertices: (V, 3) of its drawn surface, in its link's frame.
        obstacles: of the whole object at rest.
    """
    best: tuple[float, str, _Candidate] | None = None
    for number, candidate in enumerate(_candidates(handle, vertices)):
        depth, link = _obstruction(candidate, obstacles)
        if depth <= _NONE_M:
            if number == 0:
                return handle, []
            moved = 1e3 * float(np.linalg.norm(candidate.position - handle.grasp_positions[0]))
            said = (
                f"a handle of {handle.link!r} has no room for the usual grasp: its pose is {moved:.0f} mm from it"
            )
            return _with_pose(handle, candidate), [said]
        if best is None or depth < best[0]:
            best = depth, link, candidate
    assert best is not None
    depth, link, candidate = best
    said = (
        f"a handle of {handle.link!r} has no room for the gripper: at its best grasp pose, the open gripper runs "
        f"{1e3 * depth:.0f} mm into {link!r}"
    )
    return _with_pose(handle, candidate), [said]


def _with_pose(handle: Handle, pose: _Candidate) -> Handle:
    return replace(
        handle,
        grasp_positions=np.repeat(pose.position[None], 2, axis=0),
        grasp_quaternions=np.stack((pose.quaternion, quat_multiply(pose.quaternion, _HALF_TURN))),
        grasp_width_m=pose.width_m,
    )


def _candidates(handle: Handle, vertices: np.ndarray) -> list[_Candidate]:
    """Return poses to try, the nearest to the usual one first: turned last, less deep before further along."""
    usual, quaternion = handle.grasp_positions[0], handle.grasp_quaternions[0]
    axes = quat_to_matrix(quaternion)
    local = (vertices - usual) @ axes
    front, half = -float(local[:, 2].min()), float(np.ptp(local[:, 0])) / 2
    depths = np.append(np.arange(front, _LEAST_DEPTH_M, -_STEP_M), min(front, _LEAST_DEPTH_M))
    turned = quat_multiply(quaternion, _QUARTER_TURN)
    ways = [(quaternion, handle.grasp_width_m)]
    if 2 * half < 2 * OPEN_M - _STEP_M:
        ways.append((turned, 2 * half))
    found = []
    for (turn, width), share, depth in itertools.product(ways, _ALONG, depths):
        place = usual + axes @ np.array((share * half, 0.0, depth - front))
        found.append(_Candidate(place, turn, width))
    return found


def _obstruction(pose: _Candidate, obstacles: Sequence[Obstacle]) -> tuple[float, str]:
    """Return how deep (metres) the gripper is in something, at the better of two openings, and in which link."""
    narrow = min(OPEN_M, pose.width_m / 2 + _NARROW_M)
    beside = [obstacle for obstacle in obstacles if obstacle.link]
    closing = _deepest(pose, pose.width_m / 2 + _TOUCH_M, beside)
    return min(max(_deepest(pose, opening, obstacles), closing) for opening in (OPEN_M, narrow))


def _deepest(pose: _Candidate, opening_m: float, obstacles: Sequence[Obstacle]) -> tuple[float, str]:
    axes = quat_to_matrix(pose.quaternion)
    deepest = (0.0, "")
    for middle, half, turn in _boxes(opening_m):
        frame = axes @ turn
        corners = pose.position + (axes @ middle) + box(half).vertices @ frame.T
        low, high = corners.min(axis=0), corners.max(axis=0)
        for obstacle in obstacles:
            bounds = obstacle.hull.mesh.bounds
            if (low < bounds[1]).all() and (high > bounds[0]).all():
                deepest = max(deepest, (_depth(corners, frame, obstacle.hull), obstacle.link))
    return deepest


def _boxes(opening_m: float) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return middle (3,), half extents (3,) and axes (3, 3) of the open gripper's boxes, in the hand's axes."""
    found = [(np.array(HAND[0]), np.array(HAND[1]), np.eye(3))]
    for (x, y, z), half, turn in FINGER:
        for side in (1.0, -1.0):
            axes = quat_to_matrix(quat_from_axis_angle((1, 0, 0), side * turn))
            found.append((np.array((x, side * (y + opening_m), z)), np.array(half), axes))
    return found


def _depth(corners: np.ndarray, frame: np.ndarray, hull: ConvexHull) -> float:
    """Return how far a box must be moved to be free of a hull: the least overlap over all separating axes."""
    edges = hull.mesh.vertices[hull.mesh.faces] - hull.mesh.vertices[np.roll(hull.mesh.faces, 1, axis=1)]
    crossed = np.cross(edges.reshape(-1, 1, 3), frame.T).reshape(-1, 3)
    lengths = np.linalg.norm(crossed, axis=1)
    crossed = crossed[lengths > 1e-9] / lengths[lengths > 1e-9, None]
    axes = np.concatenate((frame.T, hull.planes[:, :3], crossed))
    ours, theirs = corners @ axes.T, hull.mesh.vertices @ axes.T
    overlaps = np.minimum(ours.max(axis=0) - theirs.min(axis=0), theirs.max(axis=0) - ours.min(axis=0))
    return max(float(overlaps.min()), 0.0)

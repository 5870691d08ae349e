"""From a handle's mesh to a `Handle`: surface samples, hull and grasp poses, whatever the object's source."""

from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import Handle
from artiskill.errors import AssetError
from artiskill.geometry.arrays import arctan2, matmul, norm
from artiskill.geometry.meshes import TriMesh, convex_hull, sample_surface
from artiskill.geometry.rotations import quat_from_axis_angle, quat_from_matrix, quat_multiply

POINTS_PER_HANDLE = 100
# The pads are 17 mm long and centred on the tool-centre point: this far inside the handle's outer face they
# cover a bar of 10-19 mm, and the fingertips stay clear of the panel behind a projection of 27 mm and more.
_GRASP_DEPTH_M = 0.010
# words of a part's name that make it something to grip
_HANDLE_WORDS = frozenset({"handle", "knob"})
_HALF_TURN = quat_from_axis_angle((0, 0, 1), np.pi)


@dataclass(frozen=True, eq=False)
class HandleGrasp:
    """How a hand that comes from outside takes hold of a handle, in the link's frame."""

    position: np.ndarray  # (3,) tool-centre point
    across: np.ndarray  # (K, 3) unit vectors square to the outward direction; the fingers close along any of them
    width_m: float  # extent between the pads


def handle_from_mesh(
    link_name: str,
    kind: str,
    mesh: TriMesh,
    outward: np.ndarray,
    rng: np.random.Generator,
    hookable: bool,
    grasp: HandleGrasp | None = None,
) -> Handle:
    """Describe the handle whose drawn surface is `mesh`; the hand comes from outside, along `-outward`.

    Args:
        link_name: the link that carries the handle.
        kind: `bar`, `knob`, ...
        mesh: the handle's surface in the link's frame.
        outward: (3,) direction from the panel to the room, in the link's frame; any length but zero.
        rng: draws the surface samples.
        hookable: whether a finger fits behind it.
        grasp: where to take hold of it; by default in its middle, the fingers closing across its shorter side.

    Raises:
        AssetError: the mesh does not span a volume, or `outward` has no direction.
    """
    if not norm(outward) > 0:
        raise AssetError(f"link {link_name!r}: its handle's outward direction is {np.asarray(outward)}")
    try:
        hull = convex_hull(mesh.vertices)
    except ValueError as error:
        raise AssetError(f"link {link_name!r}: its handle's mesh is flat or empty") from error
    outward = np.asarray(outward, dtype=float) / norm(outward)
    grasp = grasp or _middle_grasp(hull.mesh, outward)
    quaternions = _hand_quaternions(grasp, outward)
    positions = np.repeat(grasp.position[None], len(quaternions), axis=0)
    points = sample_surface([mesh], POINTS_PER_HANDLE, rng)
    return Handle(link_name, kind, points, hull.planes, positions, quaternions, grasp.width_m, hookable)


def grasp_depth(thickness_m: float) -> float:
    """Return how far behind a handle's outermost face the tool-centre point goes, if it is so thick there."""
    return min(_GRASP_DEPTH_M, thickness_m / 2)


def is_handle_part(part: str) -> bool:
    """Return whether a part of this name, `handle` or `round_knob`, say, is something to grip."""
    return not _HANDLE_WORDS.isdisjoint(part.lower().split("_"))


def _hand_quaternions(grasp: HandleGrasp, outward: np.ndarray) -> np.ndarray:
    """Return the orientations of a hand that comes along `-outward`, each with its half turn, (2 * K, 4)."""
    quaternions = []
    for across in grasp.across:
        rotation = np.stack((np.cross(across, -outward), across, -outward), axis=1)
        one = quat_from_matrix(rotation)
        quaternions += [one, quat_multiply(one, _HALF_TURN)]
    return np.stack(quaternions)


def _middle_grasp(hull: TriMesh, outward: np.ndarray) -> HandleGrasp:
    along, across = _face_axes(hull, outward)
    frame = np.stack((along, across, outward))  # rows: axes of the face
    in_frame = matmul(hull.vertices, frame.T)
    low, high = in_frame.min(axis=0), in_frame.max(axis=0)
    centre = (low + high) / 2
    centre[2] = high[2] - grasp_depth(high[2] - low[2])
    return HandleGrasp(matmul(centre[None], frame)[0], across[None], float(high[1] - low[1]))


def _face_axes(hull: TriMesh, outward: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the long and the short side of the smallest rectangle around a convex mesh, seen along `outward`.

    A side of that rectangle lies along an edge of the outline (Freeman and Shapira, 1975), and the outline's edges
    are edges of the mesh: trying the directions of all of these finds it.
    """
    helper = np.array((0.0, 0.0, 1.0)) if abs(outward[2]) < 0.9 else np.array((1.0, 0.0, 0.0))
    u = np.cross(helper, outward)
    u /= norm(u)
    v = np.cross(outward, u)
    flat = matmul(hull.vertices, np.stack((u, v), axis=1))
    edges = (flat[np.roll(hull.faces, -1, axis=1)] - flat[hull.faces]).reshape(-1, 2)
    edges = edges[norm(edges) > 1e-9]
    # rounded before the modulo, as -1e-17 would become a right angle; ties go to the least turned
    angles = np.unique(np.round(arctan2(edges[:, 1], edges[:, 0]), 9) % round(np.pi / 2, 9))
    turns = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    widths = np.ptp(matmul(flat, turns.T), axis=0)
    heights = np.ptp(matmul(flat, np.stack((-turns[:, 1], turns[:, 0]))), axis=0)
    best = int(np.argmin(np.round(widths * heights, 12)))
    c, s = turns[best]
    first, second = c * u + s * v, -s * u + c * v
    return (first, second) if widths[best] >= heights[best] else (second, first)

"""From URDF links to rigid bodies: fixed joints merged away, poses at any joint values."""

from dataclasses import dataclass, replace

import numpy as np

from artiskill.assets.partnet.urdf import UrdfJoint, UrdfMesh, UrdfModel, pose_matrix
from artiskill.geometry.rotations import quat_from_axis_angle, quat_to_matrix


@dataclass(frozen=True, eq=False)
class PlacedMesh:
    """A mesh, its pose (4, 4) in its body's frame, and the name of the link that lists it."""

    mesh: UrdfMesh
    pose: np.ndarray
    link: str


@dataclass(frozen=True, eq=False)
class Body:
    """Links that are rigid with each other.

    Attributes:
        name: of the link that the joint moves; `base` for the root.
        parent: index of the parent body, -1 for the root.
        joint: what moves it relative to its parent, None for the root and for a wall that it hangs on.
        pose: (4, 4) of its frame in the parent's at joint value 0.
        meshes: drawn meshes of all its links.
    """

    name: str
    parent: int
    joint: UrdfJoint | None
    pose: np.ndarray
    meshes: tuple[PlacedMesh, ...]


def build_bodies(model: UrdfModel, apart: str | None = None) -> tuple[Body, ...]:
    """Bodies depth first, parents before children, siblings in the file's order.

    Args:
        model: the file.
        apart: name of a link that stays a body of its own, without joint, though it is fixed to another.
    """
    children: dict[str, list[UrdfJoint]] = {}
    for joint in model.joints:
        children.setdefault(joint.parent, []).append(joint)
    bodies: list[Body] = []
    _grow(bodies, model, children, Body("base", -1, None, np.eye(4), ()), model.root, apart)
    return tuple(bodies)


def drop_empty(bodies: tuple[Body, ...]) -> tuple[tuple[Body, ...], list[str]]:
    """The bodies without those that draw nothing and carry nothing drawn, and what to say of these.

    A body without surface between others stays: it is a joint in a chain, as between the sliding and the turning
    of a seat, and a scene gives it a small mass of its own.
    """
    used = [bool(body.meshes) for body in bodies]
    for index in range(len(bodies) - 1, 0, -1):  # children stand after their parents
        used[bodies[index].parent] |= used[index]
    used[0] = True
    number = np.cumsum(used) - 1
    kept = tuple(
        replace(body, parent=int(number[body.parent]) if body.parent >= 0 else -1)
        for body, stays in zip(bodies, used, strict=True)
        if stays
    )
    dropped = [(b.name, b.joint.name) for b, stays in zip(bodies, used, strict=True) if b.joint and not stays]
    text = "link {!r} and its joint {!r} are left out: nothing drawn hangs on it"
    return kept, [text.format(*names) for names in dropped]


def body_poses(bodies: tuple[Body, ...], values: list[float]) -> list[np.ndarray]:
    """Poses (4, 4) of all bodies in the root's frame at joint values, one per body (the root's is ignored)."""
    poses: list[np.ndarray] = []
    for body, value in zip(bodies, values, strict=True):
        parent = poses[body.parent] if body.parent >= 0 else np.eye(4)
        poses.append(parent @ body.pose @ _motion(body.joint, value))
    return poses


def transform(pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (N, 3) by a (4, 4)."""
    return points @ pose[:3, :3].T + pose[:3, 3]


def _motion(joint: UrdfJoint | None, value: float) -> np.ndarray:
    if joint is None or value == 0:
        return np.eye(4)
    if joint.kind == "prismatic":
        return pose_matrix(joint.axis * value, np.eye(3))
    return pose_matrix(np.zeros(3), quat_to_matrix(quat_from_axis_angle(joint.axis, value)))


def _grow(
    bodies: list[Body],
    model: UrdfModel,
    children: dict[str, list[UrdfJoint]],
    body: Body,
    link: str,
    apart: str | None,
) -> None:
    """Append `body`, which starts with `link`, and after it everything that hangs on it."""
    index = len(bodies)
    bodies.append(body)
    meshes: list[PlacedMesh] = []
    moving: list[tuple[UrdfJoint, np.ndarray]] = []
    rigid = [(link, np.eye(4))]
    while rigid:
        name, pose = rigid.pop(0)
        meshes += [PlacedMesh(mesh, pose @ mesh.pose, name) for mesh in model.links[name]]
        for joint in children.get(name, []):
            if joint.kind == "fixed" and joint.child != apart:
                rigid.append((joint.child, pose @ joint.pose))
            else:
                moving.append((joint, pose @ joint.pose))
    bodies[index] = Body(body.name, body.parent, body.joint, body.pose, tuple(meshes))
    for joint, pose in moving:
        moves = None if joint.kind == "fixed" else joint
        _grow(bodies, model, children, Body(joint.child, index, moves, pose, ()), joint.child, apart)

"""The part of URDF that PartNet-Mobility uses: links, meshes and joints, then rigid bodies without fixed joints.

Frames and units are the file's: each link has its own frame, lengths are unscaled, angles radians.
"""

import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from artiskill.errors import AssetError, shown
from artiskill.files import is_file, read_bytes
from artiskill.geometry.rotations import quat_from_axis_angle, quat_from_rpy, quat_to_matrix

JOINT_TYPES = ("fixed", "revolute", "continuous", "prismatic")
# The data set's objects measure about 2 across; beyond this, squares and products would overflow somewhere.
LARGEST_NUMBER = 1e6
_MOST_BYTES, _MOST_LINKS = 20_000_000, 1000  # the data set's largest have 300 kB and 100 links


@dataclass(frozen=True, eq=False)
class UrdfMesh:
    """A mesh of a link."""

    link: str  # name of the link that lists it
    name: str | None  # the element's name, `handle-15` say, or None (older folders)
    file: str  # path relative to the object's folder, as written
    pose: np.ndarray  # (4, 4) of the mesh in the link's frame; in a body's, in that of the body
    scale: np.ndarray  # (3,) factors on the file's coordinates


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """A joint: the child's frame sits at `pose` in the parent's, then moves along or about `axis` (child frame).

    `limits` is (lower, upper) as written, or None where the file has none.
    """

    name: str
    kind: str
    parent: str
    child: str
    pose: np.ndarray
    axis: np.ndarray
    limits: tuple[float, float] | None


@dataclass(frozen=True, eq=False)
class UrdfModel:
    """Links (name to drawn meshes) and joints, both in the file's order; `root` is the link without a parent."""

    links: dict[str, tuple[UrdfMesh, ...]]
    joints: tuple[UrdfJoint, ...]
    root: str


def read_urdf(path: Path) -> UrdfModel:
    """Read a URDF file whose geometry is meshes.

    Raises:
        AssetError: the file is missing or no XML; a link, joint, mesh or number in it is not as it must be; the
            links are not one tree.
    """
    where = f"{path.parent.name}/{path.name}"
    if not is_file(path):
        raise AssetError(f"PartNet folder {str(path.parent)!r} has no file {path.name!r}; it must hold one")
    try:
        robot = ET.fromstring(read_bytes(path, _MOST_BYTES))
    except (ET.ParseError, ValueError, LookupError) as error:  # the latter two of unknown encodings
        raise AssetError(f"{where} is not valid XML: {error}") from error
    except OSError as error:
        raise AssetError(f"{where} cannot be read: {error.strerror}") from error
    if robot.tag != "robot":
        raise AssetError(f"{where}: the root element must be <robot>, not <{robot.tag}>")
    links: dict[str, tuple[UrdfMesh, ...]] = {}
    for element in robot.findall("link"):
        name = _attribute(element, "name", where)
        if name in links:
            raise AssetError(f"{where}: two links are named {name!r}")
        links[name] = tuple(_read_mesh(visual, name, where) for visual in element.findall("visual"))
    if len(links) > _MOST_LINKS:
        raise AssetError(f"{where} has {len(links)} links; at most {_MOST_LINKS} are legal")
    joints = tuple(_read_joint(element, where) for element in robot.findall("joint"))
    return UrdfModel(links, joints, _check_tree(links, joints, where))


def pose_matrix(position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return the homogeneous (4, 4) of a position (3,) and a rotation (3, 3)."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, position
    return pose


def _check_tree(links: dict[str, tuple[UrdfMesh, ...]], joints: tuple[UrdfJoint, ...], where: str) -> str:
    """Return the root link's name; raise AssetError unless the joints make one tree of all links."""
    parent_of: dict[str, str] = {}
    for joint in joints:
        for end in (joint.parent, joint.child):
            if end not in links:
                raise AssetError(
                    f"{where}: joint {joint.name!r} names the link {end!r}, which does not exist; "
                    f"links: {', '.join(links)}"
                )
        if joint.child in parent_of:
            raise AssetError(f"{where}: link {joint.child!r} has two parent joints; it may have one")
        parent_of[joint.child] = joint.parent
    roots = [name for name in links if name not in parent_of]
    if len(roots) != 1:
        raise AssetError(f"{where}: exactly one link must have no parent joint, but {roots or 'none'} have none")
    for name in links:
        seen = {name}
        while name in parent_of:
            name = parent_of[name]
            if name in seen:
                raise AssetError(f"{where}: the joints above link {name!r} make a loop")
            seen.add(name)
    return roots[0]


def _read_mesh(visual: ET.Element, link: str, where: str) -> UrdfMesh:
    where = f"{where}: link {link!r}"
    mesh = visual.find("geometry/mesh")
    if mesh is None:
        found = [child.tag for child in visual.findall("geometry/*")]
        raise AssetError(f"{where}: a <visual> must have a <geometry> with a <mesh>; it has {found or 'none'}")
    scale = _bounded(mesh.get("scale", "1 1 1"), f"{where}: mesh scale")
    if np.any(scale == 0):
        raise AssetError(f"{where}: a mesh scale of 0 is not legal: {mesh.get('scale')!r}")
    file = _attribute(mesh, "filename", where)
    return UrdfMesh(link, visual.get("name"), file, _read_pose(visual, where), scale)


def _read_joint(element: ET.Element, where: str) -> UrdfJoint:
    name = _attribute(element, "name", where)
    where = f"{where}: joint {name!r}"
    kind = _attribute(element, "type", where)
    if kind not in JOINT_TYPES:
        raise AssetError(f"{where} has the unknown type {kind!r}; legal: {', '.join(JOINT_TYPES)}")
    ends = []
    for tag in ("parent", "child"):
        end = element.find(tag)
        if end is None:
            raise AssetError(f"{where} has no <{tag} link=...>")
        ends.append(_attribute(end, "link", where))
    axis_element = element.find("axis")
    axis = _bounded("1 0 0" if axis_element is None else axis_element.get("xyz", ""), f"{where}: axis")
    length = float(np.linalg.norm(axis))
    if kind != "fixed" and length < 1e-9:
        raise AssetError(f"{where} has an axis of length 0")
    limit = element.find("limit")
    limits = None
    if limit is not None:
        lower, upper = (_numbers(limit.get(side, "0"), 1, f"{where}: {side} limit") for side in ("lower", "upper"))
        limits = (float(lower[0]), float(upper[0]))
    return UrdfJoint(name, kind, ends[0], ends[1], _read_pose(element, where), axis / max(length, 1e-9), limits)


def _read_pose(element: ET.Element, where: str) -> np.ndarray:
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    xyz = _bounded(origin.get("xyz", "0 0 0"), f"{where}: origin xyz")
    rpy = _bounded(origin.get("rpy", "0 0 0"), f"{where}: origin rpy")
    return pose_matrix(xyz, quat_to_matrix(quat_from_rpy(rpy)))


def _attribute(element: ET.Element, key: str, where: str) -> str:
    value = element.get(key)
    if not value:
        raise AssetError(f"{where}: <{element.tag}> has no attribute {key!r}")
    return value


def _numbers(text: str, count: int, what: str) -> np.ndarray:
    """Read so many numbers, none of them NaN; infinite ones are legal."""
    number, finite = (
        (f"{count} numbers", f"{count} finite numbers") if count > 1 else ("a number", "a finite number")
    )
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError as error:
        raise AssetError(f"{what} must be {number}, not {shown(text)}") from error
    if len(values) != count:
        raise AssetError(f"{what} must be {number}, not {shown(text)}")
    if np.isnan(values).any():
        raise AssetError(f"{what} must be {finite}, not {shown(text)}")
    return values


def _bounded(text: str, what: str) -> np.ndarray:
    """Read three numbers of a size that can be calculated with."""
    values = _numbers(text, 3, what)
    if np.abs(values).max() > LARGEST_NUMBER:
        raise AssetError(f"{what} must be 3 finite numbers of at most {LARGEST_NUMBER:g}, not {shown(text)}")
    return values


@dataclass(frozen=True, eq=False)
class Body:
    """Links that are rigid with each other."""

    name: str  # of the link that the joint moves; `base` for the root
    parent: int  # index of the parent body, -1 for the root
    # what moves it relative to its parent, None for the root and for a wall that it hangs on
    joint: UrdfJoint | None
    pose: np.ndarray  # (4, 4) of its frame in the parent's at joint value 0
    meshes: tuple[UrdfMesh, ...]  # drawn meshes of all its links, their poses in its frame


def build_bodies(model: UrdfModel, apart: str | None = None) -> tuple[Body, ...]:
    """Return bodies depth first, parents before children, siblings in the file's order.

    Args:
        model: the file.
        apart: name of a link that stays a body of its own, without joint, though it is fixed to another.
    """
    children: dict[str, list[UrdfJoint]] = {}
    for joint in model.joints:
        children.setdefault(joint.parent, []).append(joint)
    bodies: list[Body] = []

    def append(body: Body, link: str) -> None:
        """Append a body, which starts with a link, and after it everything that hangs on it."""
        index = len(bodies)
        bodies.append(body)
        meshes: list[UrdfMesh] = []
        moving: list[tuple[UrdfJoint, np.ndarray]] = []
        rigid = [(link, np.eye(4))]
        while rigid:
            name, pose = rigid.pop(0)
            meshes += [replace(mesh, pose=pose @ mesh.pose) for mesh in model.links[name]]
            for joint in children.get(name, []):
                if joint.kind == "fixed" and joint.child != apart:
                    rigid.append((joint.child, pose @ joint.pose))
                else:
                    moving.append((joint, pose @ joint.pose))
        bodies[index] = replace(body, meshes=tuple(meshes))
        for joint, pose in moving:
            moves = None if joint.kind == "fixed" else joint
            append(Body(joint.child, index, moves, pose, ()), joint.child)

    append(Body("base", -1, None, np.eye(4), ()), model.root)
    return tuple(bodies)


def drop_empty(bodies: tuple[Body, ...]) -> tuple[tuple[Body, ...], list[str]]:
    """Return the bodies without those that draw nothing and carry nothing drawn, and a warning for each of these.

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
    """Return poses (4, 4) of all bodies in the root's frame at joint values, one per body (the root's: unused)."""
    poses: list[np.ndarray] = []
    for body, value in zip(bodies, values, strict=True):
        parent = poses[body.parent] if body.parent >= 0 else np.eye(4)
        poses.append(parent @ body.pose @ _motion(body.joint, value))
    return poses


def transform(pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Transform points (N, 3) by a (4, 4)."""
    return points @ pose[:3, :3].T + pose[:3, 3]


def _motion(joint: UrdfJoint | None, value: float) -> np.ndarray:
    if joint is None or value == 0:
        return np.eye(4)
    if joint.kind == "prismatic":
        return pose_matrix(joint.axis * value, np.eye(3))
    return pose_matrix(np.zeros(3), quat_to_matrix(quat_from_axis_angle(joint.axis, value)))

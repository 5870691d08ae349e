"""`ArticulatedObject`: an object with joints, as geometry and physics, independent of any engine.

Generators and importers make it, once; everything later (scenes, sensors, rewards, experts) reads it. The object
frame has z up and the ground at z = 0 when the object stands as it should; cabinets and chairs face -x. All arrays
are float64 unless said otherwise and must be treated as read-only.
"""

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np

from artiskill.errors import AssetError, UnknownNameError, shown
from artiskill.geometry.arrays import norm
from artiskill.geometry.meshes import TriMesh

Category = Literal["cabinet", "chair", "bucket"]
JointKind = Literal["prismatic", "revolute"]
ShapeKind = Literal["box", "cylinder", "capsule", "sphere", "hull"]

CATEGORIES: tuple[Category, ...] = get_args(Category)
ROOM_WALL = "room_wall"  # link and part
LEGAL_ID = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]*")  # files and folders are called by it: no `..`
_UNIT_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Material:
    """What a surface looks like.

    Attributes:
        name: for people.
        rgba: linear base colour, four numbers in [0, 1].
        texture: (H, W, 3) uint8 sRGB image that multiplies the colour where the mesh has UVs, or None.
        shininess: 0 (matt) to 1 (polished).
    """

    name: str
    rgba: tuple[float, float, float, float]
    texture: np.ndarray | None = None
    shininess: float = 0.2


@dataclass(frozen=True, eq=False)
class VisualMesh:
    """A visual mesh of a link, in the link's frame.

    Attributes:
        mesh: triangles in the link's frame.
        material: what it looks like.
        part: what it is, a semantic name such as `handle`, `drawer_front`, `frame`, `shelf`.
    """

    mesh: TriMesh
    material: Material
    part: str


@dataclass(frozen=True, eq=False)
class CollisionShape:
    """A convex shape for contact, in the link's frame.

    Attributes:
        kind: which primitive.
        size: box: three half extents; cylinder and capsule: radius and half length (along the shape's z, without
            the capsule's caps); sphere: radius; hull: empty.
        position: (3,) centre in the link's frame.
        quaternion: (4,) orientation in the link's frame.
        vertices: (V, 3) corner points of a hull in the shape's frame, else None.
        part: as in `VisualMesh`.
    """

    kind: ShapeKind
    size: tuple[float, ...]
    position: np.ndarray
    quaternion: np.ndarray
    vertices: np.ndarray | None = None
    part: str = ""


@dataclass(frozen=True, eq=False)
class Joint:
    """How a link moves relative to its parent.

    Attributes:
        name: unique within the object.
        kind: `prismatic` (metres) or `revolute` (radians).
        axis: (3,) unit vector in the link's frame.
        origin: (3,) a point on the axis, in the link's frame.
        limits: lower < upper; -inf and inf where a revolute joint turns without end. A closed door or drawer is at
            its lower limit.
        stiffness: of a spring in the joint, N/m or N m/rad; 0 for none.
        spring_reference: the joint value at which that spring is slack; beyond a limit, it holds the joint there.
    """

    name: str
    kind: JointKind
    axis: np.ndarray
    origin: np.ndarray
    limits: tuple[float, float]
    stiffness: float = 0.0
    spring_reference: float = 0.0

    @property
    def rest(self) -> float:
        """The joint value of the object at rest: the lower limit, 0 where there is none."""
        return self.limits[0] if np.isfinite(self.limits[0]) else 0.0


@dataclass(frozen=True, eq=False)
class Link:
    """A rigid part of an object.

    Attributes:
        name: unique within the object, `link_<k>` for the moving ones, `base` for the root, `room_wall`
            for what a cabinet hangs on.
        parent: index of the parent link, -1 for the root; a parent stands before its children.
        position: (3,) of the link's frame in the parent's at joint value 0.
        quaternion: (4,) orientation in the parent's frame at joint value 0.
        joint: None for the root and for rigidly attached links.
        visuals: its visual meshes.
        collisions: its collision shapes.
        density_kg_m3: mass and inertia follow from it and the collision shapes.
        surface_points: (N, 3) samples of the visual meshes, in the link's frame.
    """

    name: str
    parent: int
    position: np.ndarray
    quaternion: np.ndarray
    joint: Joint | None
    visuals: tuple[VisualMesh, ...]
    collisions: tuple[CollisionShape, ...]
    density_kg_m3: float
    surface_points: np.ndarray

    @property
    def is_wall(self) -> bool:
        """Whether it is the wall that the object hangs on, and no part of the object."""
        return self.name == ROOM_WALL and self.joint is None


@dataclass(frozen=True, eq=False)
class Handle:
    """The part of a link that a hand grips or hooks, in the link's frame.

    Attributes:
        link: name of the link that carries it.
        kind: `bar`, `knob`, `edge`, ...
        points: (N, 3) samples of its surface.
        planes: (P, 4) of its convex hull, as in `geometry.meshes.ConvexHull`.
        grasp_positions: (G, 3) tool-centre points (between the finger pads) of its grasp poses; the first is the
            best.
        grasp_quaternions: (G, 4) hand orientations: the hand's z axis points from the wrist to the handle, the
            fingers close along its y axis. A pose and its half turn about z are both listed.
        grasp_width_m: extent between the pads when gripped as in the first pose.
        hookable: a finger fits behind it and can pull without closing.
    """

    link: str
    kind: str
    points: np.ndarray
    planes: np.ndarray
    grasp_positions: np.ndarray
    grasp_quaternions: np.ndarray
    grasp_width_m: float
    hookable: bool


@dataclass(frozen=True, eq=False)
class ArticulatedObject:
    """An object with joints; see the module's docstring for its frame.

    Attributes:
        id: name in catalogues, results and environment ids; letters, digits, `-`, `.` and `_` only.
        category: `cabinet`, `chair` or `bucket`.
        links: the root first, parents before children; a wall that it hangs on is one, see `own_links`.
        handles: of all links; a door or drawer is a legal target where it has one.
        bounds: (2, 3) smallest and largest corner in the object frame, at rest (every joint at `Joint.rest`),
            without a wall that it hangs on.
        metadata: facts for people and filters: family, dimensions, source, warnings of the importer.
    """

    id: str
    category: Category
    links: tuple[Link, ...]
    handles: tuple[Handle, ...]
    bounds: np.ndarray
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_object_id(self.id)
        names = [link.name for link in self.links]
        if not names:
            raise AssetError(f"object {self.id!r} has no links")
        if len(set(names)) != len(names):
            raise AssetError(f"object {self.id!r}: two links share a name among {names}")
        for i, link in enumerate(self.links):
            if not -1 <= link.parent < i or (link.parent == -1) != (i == 0):
                raise AssetError(f"object {self.id!r}: link {link.name!r} must stand after its parent")
            if link.joint is not None:
                _check_joint(link.joint, f"object {self.id!r}: joint {link.joint.name!r} of {link.name!r}")
        for handle in self.handles:
            if handle.link not in names:
                raise AssetError(f"object {self.id!r}: a handle's link {handle.link!r} is none of {names}")

    @property
    def family(self) -> str:
        """What kind of cabinet, chair or bucket it is; of an imported one, its source's category or its source."""
        meta = self.metadata
        return str(meta.get("family", meta.get("model_category", meta.get("source", "unknown"))))

    @property
    def jointed_links(self) -> tuple[int, ...]:
        """Indices of the links that have a joint; joint k of the object belongs to the k-th of them."""
        return tuple(i for i, link in enumerate(self.links) if link.joint is not None)

    @property
    def joints(self) -> tuple[Joint, ...]:
        """All joints, in the order of `jointed_links`."""
        return tuple(link.joint for link in self.links if link.joint is not None)

    @property
    def own_links(self) -> tuple[int, ...]:
        """Indices of the links that are the object itself: all but the wall that it hangs on.

        The wall is drawn and collides like them. It is left out where the object is measured: its size, its mass,
        its similarity to others, how its picture is framed.
        """
        return tuple(i for i, link in enumerate(self.links) if not link.is_wall)

    @property
    def rest_qpos(self) -> np.ndarray:
        """Joint values at rest, (J,)."""
        return np.array([joint.rest for joint in self.joints])

    @cached_property
    def content_hash(self) -> str:
        """Hex digest over every number, to a nanometre or nanoradian, and every name except the id."""
        return _content_hash(self.category, self.links, self.handles, self.bounds, self.metadata)

    def link_index(self, name: str) -> int:
        """Return the index of a link.

        Raises:
            UnknownNameError: no link has this name.
        """
        for i, link in enumerate(self.links):
            if link.name == name:
                return i
        raise UnknownNameError("link", name, [link.name for link in self.links], f"(object {self.id!r})")

    def handles_of(self, link_name: str) -> tuple[Handle, ...]:
        """Return the handles that a link carries, possibly none."""
        return tuple(h for h in self.handles if h.link == link_name)

    def target_links(self, kind: JointKind) -> tuple[str, ...]:
        """Return the names of the links that move by such a joint and carry a handle: legal targets."""
        return tuple(
            link.name
            for link in self.links
            if link.joint is not None and link.joint.kind == kind and self.handles_of(link.name)
        )


def check_object_id(object_id: object) -> None:
    """Refuse an illegal id.

    Raises:
        AssetError: it is no text, begins with `.`, or holds anything but letters, digits, `-`, `.` and `_`.
    """
    if not isinstance(object_id, str) or not LEGAL_ID.fullmatch(object_id):
        raise AssetError(f"object id {object_id!r}: legal are letters, digits, '-', '_' and, not first, '.'")


def _check_joint(joint: Joint, what: str) -> None:
    """Raise AssetError unless axis and limits are as `Joint` says: an engine would take others silently."""
    axis, limits = np.asarray(joint.axis), np.asarray(joint.limits)
    if axis.shape != (3,) or axis.dtype.kind not in "fiu" or not _is_unit(axis):
        raise AssetError(f"{what}: its axis must be a finite vector of length 1, not {shown(joint.axis)}")
    if limits.shape != (2,) or limits.dtype.kind not in "fiu" or not limits[0] < limits[1]:
        raise AssetError(f"{what}: its limits must be two numbers, lower < upper, not {shown(joint.limits)}")
    if joint.kind != "revolute" and not np.isfinite(limits).all():
        raise AssetError(f"{what} is {joint.kind}: its limits must be finite, not {shown(joint.limits)}")
    if not (0 <= joint.stiffness < np.inf and np.isfinite(joint.spring_reference)):
        raise AssetError(
            f"{what}: its spring needs a finite stiffness of at least 0 and a finite reference, not "
            f"{joint.stiffness!r} and {joint.spring_reference!r}"
        )


def _is_unit(axis: np.ndarray) -> bool:
    bounded = bool((np.abs(axis) < 2).all())  # false for nan; and squares do not overflow
    return bounded and abs(float(norm(axis)) - 1) < _UNIT_TOLERANCE


def _content_hash(*values: Any) -> str:
    """Return 16 hex digits over values made of dataclasses, mappings, sequences, arrays and plain values.

    Floats are rounded to nine digits (a nanometre, a nanoradian), as the last bits of sines differ between C
    libraries. At the edge of a rounding that does not help: processors must give the same bits (`geometry.exact`).
    """
    digest = hashlib.sha256()
    for value in values:
        _feed(digest, value)
    return digest.hexdigest()[:16]


def _feed(digest: Any, value: Any) -> None:
    """Feed any nested value into a hash, each piece with its length, so that no two merge."""
    if isinstance(value, np.ndarray):
        _feed_bytes(digest, f"{value.dtype}{value.shape}".encode())
        stable = np.round(value, 9) + 0.0 if value.dtype.kind == "f" else value  # + 0.0: no negative zeros
        _feed_bytes(digest, np.ascontiguousarray(stable).tobytes())
    elif is_dataclass(value):
        for f in fields(value):
            _feed_bytes(digest, f.name.encode())
            _feed(digest, getattr(value, f.name))
    elif isinstance(value, Mapping):
        _feed_bytes(digest, f"mapping of {len(value)}".encode())
        for key in sorted(value):
            _feed_bytes(digest, repr(key).encode())
            _feed(digest, value[key])
    elif isinstance(value, tuple | list):
        _feed_bytes(digest, f"sequence of {len(value)}".encode())
        for item in value:
            _feed(digest, item)
    elif isinstance(value, float):
        _feed_bytes(digest, repr(round(float(value), 9) + 0.0).encode())
    else:
        _feed_bytes(digest, repr(value).encode())


def _feed_bytes(digest: Any, data: bytes) -> None:
    digest.update(b"%d:" % len(data))
    digest.update(data)

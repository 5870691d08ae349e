"""Layouts: sizes that scenes of different objects are padded to, so that they step together in one batch.

The engine steps models side by side that agree in the sizes of all its arrays, whatever the values in them. A
layout of `configs/layouts` says what an object of a category may take up; inert bodies, joints, geoms and meshes
fill the rest.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import mujoco
import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.config import CONFIG_DIR, check_not_negative, check_positive, from_mapping, load_yaml
from artiskill.scene.object_model import ObjectPart

LAYOUT_DIR = CONFIG_DIR / "layouts"
FREE_ROOT_DOF = 6


@dataclass(frozen=True)
class LayoutConfig:
    """What the padded object takes up in a scene.

    Attributes:
        links: bodies: the object's own, a wall that it hangs on too, and one for each joint that it lacks.
        joints: joints of one degree of freedom.
        inertia: sum over the joints of the degrees of freedom from the world up to and including each: the entries
            that they have in the sparse inertia matrix.
        geoms: collision shapes.
        volumes: nodes of the engine's trees of bounding volumes, over links and their meshes.
    """

    links: int
    joints: int
    inertia: int
    geoms: int
    volumes: int

    def __post_init__(self) -> None:
        check_positive(self, "links", "geoms", "volumes")
        check_not_negative(self, "joints", "inertia")


@dataclass(frozen=True)
class SceneLayout:
    """Sizes that two scenes must share to step in one batch: the engine's arrays have them as shapes.

    Attributes:
        links: places for links in `Snapshot`; an object's own come first, then inert ones.
        joints: places for the object's joints, likewise.
        engine: sizes of the engine's arrays, by their names in `mujoco.MjModel`.
    """

    links: int
    joints: int
    engine: tuple[tuple[str, int], ...]


_ENGINE_SIZES = (
    *("nq", "nv", "nu", "na", "nbody", "njnt", "ngeom", "nsite", "ntree", "neq"),
    *("nC", "nD", "nJmom", "nbvh", "nbvhdynamic", "nsensordata", "nmocap", "narena"),
)


def layout_of(model: Any, links: int, joints: int) -> SceneLayout:
    """The layout of a compiled model whose object takes `links` bodies and `joints` joints."""
    return SceneLayout(links, joints, tuple((name, int(getattr(model, name))) for name in _ENGINE_SIZES))


@cache
def category_layouts(category: str) -> tuple[LayoutConfig, ...]:
    """The layouts of a category, smallest first."""
    path = LAYOUT_DIR / f"{category}.yaml"
    return tuple(from_mapping(LayoutConfig, entry, path.name) for entry in load_yaml(path)["layouts"])


def inertia_entries(obj: ArticulatedObject, free_root: bool) -> int:
    """`LayoutConfig.inertia` of an object."""
    above: list[int] = []
    total = 0
    for link in obj.links:
        dof = above[link.parent] if link.parent >= 0 else FREE_ROOT_DOF * free_root
        if link.joint is not None:
            dof += 1
            total += dof
        above.append(dof)
    return total


PADDING_PREFIX = "padding/"
_MASS_KG, _INERTIA_KG_M2, _ARMATURE_KG_M2 = 1e-6, 1e-9, 0.1
_GEOM_RADIUS_M = 0.01
_SMALLEST_FAN = 3  # triangles


@dataclass(frozen=True)
class Padding:
    """What an object lacks.

    Attributes:
        config: the layout that it is brought up to.
        depths: per padding joint, how many of them there are from the root to it: 1 hangs on the root itself.
        still: bodies without joint; the first carries the geoms, a padding joint's body where there is none, the
            object's root where there is neither.
        geoms: inert ones.
        fans: triangles of each mesh that nothing uses, for the bounding volumes that it has.
    """

    config: LayoutConfig
    depths: tuple[int, ...]
    still: int
    geoms: int
    fans: tuple[int, ...]


def plan_padding(obj: ArticulatedObject, part: ObjectPart, spec: Any) -> Padding | None:
    """What brings an object up to the smallest layout of its category that has room for it, or None.

    Args:
        obj: the object.
        part: its names in the specification.
        spec: of a scene with the object; it is compiled where the object has hulls.
    """
    free = bool(part.root)
    entries, geoms = inertia_entries(obj, free), sum(len(link.collisions) for link in obj.links)
    volumes = _bounding_volumes(obj, part, spec)
    for config in category_layouts(obj.category):
        missing = config.joints - len(obj.joints)
        depths = _depths(missing, config.inertia - entries, FREE_ROOT_DOF * free)
        if depths is None:
            continue
        still, blank = config.links - len(obj.links) - missing, config.geoms - geoms
        fans = _fans(config.volumes - volumes)
        if still >= 0 and blank >= 0 and fans is not None:
            return Padding(config, depths, still, blank, fans)
    return None


def add_padding(spec: Any, part: ObjectPart, padding: Padding) -> None:
    """Add what a plan says to a specification: behind the object's own links, so that theirs stay together."""
    root = spec.body(part.bodies[0])
    last = {0: root}  # by depth, the body to hang on
    for number, depth in enumerate(padding.depths):
        last[depth] = _hang(last[depth - 1], f"{PADDING_PREFIX}{number}")
    still = [root.add_body(name=f"{PADDING_PREFIX}still{number}") for number in range(padding.still)]
    carrier = still[0] if still else last[max(last)]
    for _ in range(padding.geoms):
        carrier.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(_GEOM_RADIUS_M, 0, 0), contype=0, conaffinity=0, mass=0
        )
    for number, triangles in enumerate(padding.fans):
        points, faces = _fan(triangles)
        mesh = spec.add_mesh(name=f"{PADDING_PREFIX}fan{number}", uservert=points, userface=faces)
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL


def _hang(parent: Any, name: str) -> Any:
    body = parent.add_body(name=name)
    body.explicitinertial, body.mass, body.inertia = True, _MASS_KG, (_INERTIA_KG_M2,) * 3
    body.add_joint(
        name=name,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=(0, 0, 1),
        armature=_ARMATURE_KG_M2,
        limited=mujoco.mjtLimited.mjLIMITED_FALSE,
    )
    return body


def _bounding_volumes(obj: ArticulatedObject, part: ObjectPart, spec: Any) -> int:
    """`LayoutConfig.volumes` of an object: a tree over n shapes, or n triangles of a hull, has 2 n - 1 nodes.

    How many triangles a hull has only the engine knows: its Qhull merges faces that nearly lie in one plane.
    """
    solid = [link for link in obj.links if link.collisions]
    volumes = 2 * sum(len(link.collisions) for link in solid) - len(solid)
    if all(shape.kind != "hull" for link in obj.links for shape in link.collisions):
        return volumes
    model = spec.compile()
    bodies = [model.body(name).id for name in part.bodies]
    geoms = np.isin(model.geom_bodyid, bodies) & (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)
    return volumes + int(model.mesh_bvhnum[model.geom_dataid[geoms]].sum())


def _depths(count: int, entries: int, root_dof: int) -> tuple[int, ...] | None:
    """Depths of `count` padding joints that have so many inertia entries in all, or None.

    A joint at depth d has root_dof + d entries. Each depth in use needs one of the depth before it to hang on.
    """
    extra = entries - count * (root_dof + 1)  # how far the joints lie below depth 1, summed
    if count < 0 or extra < 0 or (count == 0 and extra > 0):
        return None
    depths = [1] * count
    for depth in range(2, count + 1):
        # move joints down by one, as many as there are but one, which the next depth hangs on
        movable = depths.count(depth - 1) - 1
        moved = min(extra, movable)
        for k in range(count - 1, -1, -1):
            if moved and depths[k] == depth - 1:
                depths[k], moved, extra = depth, moved - 1, extra - 1
    return tuple(sorted(depths)) if extra == 0 else None


def _fans(volumes: int) -> tuple[int, ...] | None:
    """Triangles of meshes with so many bounding volumes in all (a mesh of n has 2 n - 1), or None."""
    least = 2 * _SMALLEST_FAN - 1
    if volumes == 0:
        return ()
    if volumes % 2 and volumes >= least:
        return ((volumes + 1) // 2,)
    if volumes % 2 == 0 and volumes >= 2 * least:
        return (_SMALLEST_FAN, (volumes - least + 1) // 2)
    return None


def _fan(triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and faces, flat, of triangles around a common corner."""
    angles = np.linspace(0, 2 * np.pi, triangles, endpoint=False)
    rim = np.stack((np.cos(angles), np.sin(angles), 0.1 * (np.arange(triangles) % 2)), axis=1)
    points = np.concatenate((np.zeros((1, 3)), rim))
    first = np.arange(triangles)
    faces = np.stack((np.zeros(triangles, dtype=int), 1 + first, 1 + (first + 1) % triangles), axis=1)
    return points.ravel(), faces.ravel()

"""Adding one convex shape to a body of a MuJoCo specification: for robots and objects alike."""

from typing import Any

import mujoco
import numpy as np

GEOM_TYPES = {
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "hull": mujoco.mjtGeom.mjGEOM_MESH,
}


def add_shape(body: Any, name: str, kind: str, size: Any, position: Any, quaternion: Any) -> Any:
    """Add a primitive to `body` and return the geom; for a hull the caller names its mesh.

    Args:
        body: an `MjsBody`.
        name: of the geom.
        kind: a key of `GEOM_TYPES`.
        size: as in `assets.articulated_object.CollisionShape`; empty for a hull.
        position: (3,) in the body's frame.
        quaternion: (4,) in the body's frame.
    """
    padded = np.zeros(3)
    padded[: len(size)] = size
    return body.add_geom(
        name=name,
        type=GEOM_TYPES[kind],
        size=padded,
        pos=np.asarray(position, dtype=float),
        quat=np.asarray(quaternion, dtype=float),
    )

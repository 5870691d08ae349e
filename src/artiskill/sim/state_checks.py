"""Does a saved state belong to a simulation, and can it be one: everything that is asked before it is restored."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from artiskill.config import differing, to_mapping
from artiskill.errors import StateError
from artiskill.scene.props import Prop
from artiskill.scene.scene import Scene
from artiskill.sim.engine_arrays import places_of
from artiskill.sim.states import SimulationState

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION.value
_LARGEST = mujoco.mjMAXVAL  # beyond it the engine says that the physics has run away
_UNIT_TOLERANCE = 1e-6  # of a quaternion's length; the engine keeps it to 1e-15
_TIME, _QPOS = 0, 1  # a row begins with the time; positions follow
_MOST_DIFFERENCES = 3  # that an error names


def check_state(state: SimulationState, scenes: Sequence[Scene]) -> None:
    """See whether environments of these scenes could go on from a state; nothing is changed.

    Args:
        state: of as many environments.
        scenes: of one layout.

    Raises:
        StateError: it comes from another object, robot, physics configuration, props or batch size, or holds what
            no simulation could have saved.
    """
    if not isinstance(state, SimulationState):
        raise StateError(f"a state of a simulation is a SimulationState, not a {type(state).__name__}")
    _check_origin(state, scenes)
    _check_arrays(state, scenes)
    for row, scene in enumerate(scenes):
        _check_joints(state, row, scene)
        _check_poses(state, row, scene)


def object_hash_of(scenes: Sequence[Scene]) -> str:
    """Of the object that all have, or of all objects."""
    hashes = [scene.object.content_hash for scene in scenes]
    return hashes[0] if len(set(hashes)) == 1 else "+".join(hashes)


def touched_props(props: tuple[Prop, ...]) -> tuple[Prop, ...]:
    """Those that a state depends on: what is only drawn moves nothing."""
    return tuple(prop for prop in props if prop.motion != "drawn")


def _check_origin(state: SimulationState, scenes: Sequence[Scene]) -> None:
    """Object, robot, props and physics must be those of the simulation."""
    scene = scenes[0]
    given = getattr(state, "object_hash", None)
    if not isinstance(given, str) or given != object_hash_of(scenes):
        raise StateError(f"this state belongs to another object than the simulation of {scene.object.id!r}")
    ours = {
        "robot": scene.robot.config,
        "physics configuration": scene.physics,
        "props": touched_props(scene.props),
    }
    theirs = {
        "robot": getattr(state, "robot", None),  # states pickled by earlier versions have none
        "physics configuration": getattr(state, "physics", None),
        "props": getattr(state, "props", None),
    }
    for what, mine in ours.items():
        if type(theirs[what]) is not type(mine):
            raise StateError(
                f"this state does not say which {what} it depends on: a {type(theirs[what]).__name__}"
            )
        if theirs[what] != mine:
            found = differing(_named(theirs[what]), _named(mine))
            more = ["..."] if len(found) > _MOST_DIFFERENCES else []
            raise StateError(
                f"this state belongs to another {what} than the simulation of {scene.object.id!r}: "
                + "; ".join(found[:_MOST_DIFFERENCES] + more)
            )


def _named(config: Any) -> dict[str, Any]:
    """The plain values of a configuration, or of props by name."""
    if isinstance(config, tuple):
        return {getattr(item, "name", str(k)): to_mapping(item) for k, item in enumerate(config)}
    values: dict[str, Any] = to_mapping(config)
    return values


def _check_arrays(state: SimulationState, scenes: Sequence[Scene]) -> None:
    """Every array has its shape and finite numbers that the engine would not take for diverged."""
    scene, batch = scenes[0], len(scenes)
    links, joints = scene.layout.links, scene.layout.joints
    size = mujoco.mj_stateSize(scene.model, _STATE)
    shapes = {
        "rows": (batch, size),
        "joint_friction": (batch, joints),
        "joint_damping": (batch, joints),
        "joint_limits": (batch, joints, 2),
        "previous_link_position_w": (batch, links, 3),
        "previous_link_quaternion_w": (batch, links, 4),
    }
    for name, shape in shapes.items():
        given = getattr(state, name, None)
        if not isinstance(given, np.ndarray) or given.shape != shape:
            found = getattr(given, "shape", type(given).__name__)
            raise StateError(f"a state of {scene.object.id!r} has {name} of {shape}, not {found}")
        if given.dtype != np.float64:
            raise StateError(f"a state has {name} of float64, not of {given.dtype}")
        if not (np.abs(np.asarray(given)) <= _LARGEST).all():
            is_finite = np.isfinite(given).all()
            what = f"beyond {_LARGEST:g}, where physics runs away" if is_finite else "that are not finite"
            raise StateError(f"this state's {name} has numbers {what}")


def _check_joints(state: SimulationState, row: int, scene: Scene) -> None:
    """The object's joints have parameters that a level could give them; those that pad them have their own."""
    model, places, own = scene.model, places_of(scene), len(scene.object.joints)
    friction, damping, limits = state.joint_friction[row], state.joint_damping[row], state.joint_limits[row]
    for name, values in (("joint_friction", friction), ("joint_damping", damping)):
        if (values < 0).any():
            raise StateError(f"this state's {name} must not be negative; it has {values.min():g}")
    limited = model.jnt_limited[places.joints].astype(bool)
    limited[own:] = False
    if (limits[limited, 0] >= limits[limited, 1]).any():
        k = int(np.flatnonzero(limited & (limits[:, 0] >= limits[:, 1]))[0])
        raise StateError(
            f"this state's joint_limits must be a lower and a higher number, not {limits[k].tolist()}"
        )
    fixed = (
        ("joint_friction", friction[own:], model.dof_frictionloss[places.dof][own:]),
        ("joint_damping", damping[own:], model.dof_damping[places.dof][own:]),
        ("joint_limits", limits[~limited], model.jnt_range[places.joints][~limited]),
    )
    for name, given, mine in fixed:
        if not np.array_equal(given, mine):
            raise StateError(f"this state's {name} has numbers where {scene.object.id!r} has no joint with any")


def _check_poses(state: SimulationState, row: int, scene: Scene) -> None:
    """Time does not run before the episode, and orientations are unit quaternions."""
    values, index = state.rows[row], scene.index
    if values[_TIME] < 0:
        raise StateError(f"this state's time must not be negative, not {values[_TIME]:g} s")
    qpos = values[_QPOS : _QPOS + scene.model.nq]
    free = (qpos[index.root_qpos].reshape(-1, 7)[:, 3:], qpos[index.prop_qpos].reshape(-1, 7)[:, 3:])
    for name, quaternions in (
        ("rows", np.concatenate(free)),
        ("previous_link_quaternion_w", state.previous_link_quaternion_w[row]),
    ):
        off = np.abs((quaternions * quaternions).sum(axis=-1) - 1.0) > 2 * _UNIT_TOLERANCE
        if off.any():
            raise StateError(f"this state's {name} must have unit quaternions, not {quaternions[off][0].tolist()}")

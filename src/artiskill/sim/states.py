"""Where an episode starts, what its future depends on, and whether a saved state may be restored."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from artiskill.config import differing, to_mapping
from artiskill.errors import StateError
from artiskill.geometry.arrays import norm, rotate
from artiskill.geometry.rotations import quat_to_matrix
from artiskill.robots.config import RobotConfig
from artiskill.scene.physics import PhysicsConfig
from artiskill.scene.props import Prop
from artiskill.scene.scene import Scene
from artiskill.sim.snapshot import Snapshot

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION.value
_LARGEST = mujoco.mjMAXVAL  # beyond it the engine says that the physics has run away
_UNIT_TOLERANCE = 1e-6  # of a quaternion's length; the engine keeps it to 1e-15
_TIME, _QPOS = 0, 1  # a row begins with the time; positions follow
_MOST_DIFFERENCES = 3  # that an error names


@dataclass(frozen=True, eq=False)
class InitialState:
    """Where one environment starts, and the parameters that its level gives the object's joints.

    Attributes:
        robot_qpos: (R,).
        object_qpos: (J,).
        joint_friction: (J,) N or N m.
        joint_damping: (J,) N s/m or N m s/rad.
        object_limits: (J, 2) limits that the level gives the object's joints; None leaves their own.
        root_pose_w: (7,) position and orientation of an object that is free to move, else None.
        prop_positions_w: (K, 3) of the free props, upright; None without any.
        settle_steps: physics steps taken before the first snapshot, with drives at rest.
    """

    robot_qpos: np.ndarray
    object_qpos: np.ndarray
    joint_friction: np.ndarray
    joint_damping: np.ndarray
    object_limits: np.ndarray | None = None
    root_pose_w: np.ndarray | None = None
    prop_positions_w: np.ndarray | None = None
    settle_steps: int = 0


@dataclass(frozen=True, eq=False)
class SimulationState:
    """Everything that the future of a batch depends on; `Simulation.restore` restores it.

    The joints' friction, damping and limits are drawn by levels and restored; object, robot, props and physics are
    only named: they must be those of the simulation.

    Attributes:
        rows: (B, S) the engine's integration state (`mjSTATE_INTEGRATION`, warm start included).
        joint_friction: (B, J).
        joint_damping: (B, J).
        joint_limits: (B, J, 2), 0 where a joint has none.
        previous_link_position_w: (B, L, 3).
        previous_link_quaternion_w: (B, L, 4).
        object_hash: `ArticulatedObject.content_hash` of the object; of all, where they differ.
        robot: the configuration of the robot that it was simulated with.
        physics: the configuration that it was simulated with.
        props: what stood or lay beside robot and object and could be touched.
    """

    rows: np.ndarray
    joint_friction: np.ndarray
    joint_damping: np.ndarray
    joint_limits: np.ndarray
    previous_link_position_w: np.ndarray
    previous_link_quaternion_w: np.ndarray
    object_hash: str
    robot: RobotConfig
    physics: PhysicsConfig
    props: tuple[Prop, ...]


@dataclass(frozen=True)
class ObjectSlices:
    """Where the object's joints and links are in the engine's arrays, padding included; equal in a layout.

    Attributes:
        links: in body arrays.
        joints: in joint arrays.
        qpos: of the joints, in qpos.
        dof: of the joints, in qvel.
    """

    links: slice
    joints: slice
    qpos: slice
    dof: slice


def object_slices(scene: Scene) -> ObjectSlices:
    """Return the slices of a scene's layout."""
    index, layout = scene.index, scene.layout
    has_root = index.root_dof.stop > index.root_dof.start  # one free joint, between the robot's and these
    links, joints = index.object_bodies.start, index.robot.stop + has_root
    qpos, dof = index.object_qpos.start, index.object_dof.start
    return ObjectSlices(
        links=slice(links, links + layout.links),
        joints=slice(joints, joints + layout.joints),
        qpos=slice(qpos, qpos + layout.joints),
        dof=slice(dof, dof + layout.joints),
    )


def with_values(
    state: SimulationState, scene: Scene, values: Mapping[str, np.ndarray], before: Snapshot
) -> SimulationState:
    """Return a state of one environment with other positions and velocities; everything else stays as it is.

    Render such a state, but do not step on from it: the drives' filters keep the values of the old state.

    Args:
        state: of this scene.
        scene: whose state it is.
        values: of the J own joints `robot_qpos`, `robot_qvel`, `object_qpos`, `object_qvel`, and of what can
            move freely `root_position_w`, `root_quaternion_w`, `root_velocity_w`, `prop_position_w`,
            `prop_velocity_w`, as in `Snapshot`, without the batch dimension.
        before: one step earlier (B = 1).
    """
    index, model, rows = scene.index, scene.model, state.rows.copy()
    qpos, qvel = rows[0, _QPOS : _QPOS + model.nq], rows[0, _QPOS + model.nq : _QPOS + model.nq + model.nv]
    qpos[index.robot], qvel[index.robot] = values["robot_qpos"], values["robot_qvel"]
    qpos[index.object_qpos], qvel[index.object_dof] = values["object_qpos"], values["object_qvel"]
    if index.root_dof.stop > index.root_dof.start:
        quaternion = values["root_quaternion_w"].astype(np.float64)
        quaternion /= norm(quaternion)
        velocity = values["root_velocity_w"].astype(np.float64)
        qpos[index.root_qpos] = np.concatenate((values["root_position_w"], quaternion))
        # the engine has the angular part in the body's frame
        own = rotate(quat_to_matrix(quaternion).T, velocity[3:])
        qvel[index.root_dof] = np.concatenate((velocity[:3], own))
    qpos[index.prop_qpos].reshape(-1, 7)[:, :3] = values["prop_position_w"]
    qvel[index.prop_dof].reshape(-1, 6)[:, :3] = values["prop_velocity_w"]
    return replace(
        state,
        rows=rows,
        previous_link_position_w=before.link_position_w.copy(),
        previous_link_quaternion_w=before.link_quaternion_w.copy(),
    )


def check_state(state: SimulationState, scenes: Sequence[Scene]) -> None:
    """Check that environments of these scenes can be restored to a state; nothing is changed.

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
    """Return the content hash of the object in all scenes, or the hashes of all objects joined."""
    hashes = [scene.object.content_hash for scene in scenes]
    return hashes[0] if len(set(hashes)) == 1 else "+".join(hashes)


def touched_props(props: tuple[Prop, ...]) -> tuple[Prop, ...]:
    """Return the props that a state depends on: all but those that are only drawn."""
    return tuple(prop for prop in props if prop.motion != "drawn")


def _check_origin(state: SimulationState, scenes: Sequence[Scene]) -> None:
    """Check that object, robot, props and physics are those of the scenes."""
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
    """Return the plain values of a configuration, or of props by name."""
    if isinstance(config, tuple):
        return {getattr(item, "name", str(k)): to_mapping(item) for k, item in enumerate(config)}
    values: dict[str, Any] = to_mapping(config)
    return values


def _check_arrays(state: SimulationState, scenes: Sequence[Scene]) -> None:
    """Check shapes and types, and that no value is so large that the engine takes it for diverged."""
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
    """Check that joint parameters are ones that a level can draw, and that padding joints have their own."""
    model, slices, own = scene.model, object_slices(scene), len(scene.object.joints)
    friction, damping, limits = state.joint_friction[row], state.joint_damping[row], state.joint_limits[row]
    for name, values in (("joint_friction", friction), ("joint_damping", damping)):
        if (values < 0).any():
            raise StateError(f"this state's {name} must not be negative; it has {values.min():g}")
    limited = model.jnt_limited[slices.joints].astype(bool)
    limited[own:] = False
    if (limits[limited, 0] >= limits[limited, 1]).any():
        k = int(np.flatnonzero(limited & (limits[:, 0] >= limits[:, 1]))[0])
        raise StateError(
            f"this state's joint_limits must be a lower and a higher number, not {limits[k].tolist()}"
        )
    fixed = (
        ("joint_friction", friction[own:], model.dof_frictionloss[slices.dof][own:]),
        ("joint_damping", damping[own:], model.dof_damping[slices.dof][own:]),
        ("joint_limits", limits[~limited], model.jnt_range[slices.joints][~limited]),
    )
    for name, given, mine in fixed:
        if not np.array_equal(given, mine):
            raise StateError(f"this state's {name} has numbers where {scene.object.id!r} has no joint with any")


def _check_poses(state: SimulationState, row: int, scene: Scene) -> None:
    """Check that the time is not negative and that orientations are unit quaternions."""
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

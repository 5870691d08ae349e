"""A saved state with everything somewhere else: states of which only positions and velocities are known."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from artiskill.geometry.arrays import norm, rotate
from artiskill.geometry.rotations import quat_to_matrix
from artiskill.scene.scene import Scene
from artiskill.sim.snapshot import Snapshot
from artiskill.sim.states import SimulationState

_QPOS = 1  # a row of the engine's integration state begins with the time; positions and velocities follow


def placed(
    state: SimulationState, scene: Scene, values: Mapping[str, np.ndarray], before: Snapshot
) -> SimulationState:
    """A state of one environment with given positions and velocities; all else, activations say, stays.

    It is good for looking at, not for going on from: what the drives' filters hold belongs to another instant.

    Args:
        state: of this scene.
        scene: whose state it is.
        values: of the J own joints `robot_qpos`, `robot_qvel`, `object_qpos`, `object_qvel`, and of what can
            move freely `root_position_w`, `root_quaternion_w`, `root_velocity_w`, `prop_position_w`,
            `prop_velocity_w`, as in `Snapshot`, without the batch dimension.
        before: the instant before (B = 1).
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

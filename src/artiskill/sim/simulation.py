"""`Simulation`: a batch of environments of one layout, stepped, saved and restored bit for bit."""

import copy
from collections.abc import Sequence
from dataclasses import fields

import mujoco
import numpy as np
from mujoco.batch import Batch

from artiskill.errors import DivergedError, StateError
from artiskill.scene.scene import Scene
from artiskill.sim.snapshot import Snapshot
from artiskill.sim.states import InitialState, SimulationState

# Position- and velocity-dependent fields are brought up to date after the last physics step.
_CURRENT = mujoco.mjtStage.mjSTAGE_VEL.value


class Simulation:
    """`num_envs` copies of a scene; each has its own joint parameters.

    Args:
        scene: what is simulated. It is not changed: every environment runs on its own copy of the model.
        num_envs: B.
        num_threads: threads that step; any number gives the same bits.
    """

    def __init__(self, scene: Scene, num_envs: int = 1, num_threads: int = 1) -> None:
        self.scene = scene
        self.num_envs = num_envs
        self._models = [copy.copy(scene.model) for _ in range(num_envs)]
        # persistent: a step goes on from the stages that brought the fields up to date after the last one
        self._batch = Batch(scene.model, num_envs, num_threads, persistent=True)
        self._batch.set_models(self._models)
        self._bind()
        index = scene.index
        joints = scene.model.dof_jntid[index.object_dof]  # the object's joints in the engine's joint arrays
        self._joints = slice(int(joints[0]), int(joints[-1]) + 1) if len(joints) else slice(0, 0)
        self._previous_position = self._xpos[:, index.object_bodies].copy()
        self._previous_quaternion = self._xquat[:, index.object_bodies].copy()

    def _bind(self) -> None:
        """Live views of the engine's arrays, made once."""
        bind = self._batch.bind
        self._qpos, self._qvel, self._ctrl, self._time = bind("qpos"), bind("qvel"), bind("ctrl"), bind("time")
        self._xpos, self._xquat, self._xmat = bind("xpos"), bind("xquat"), bind("xmat")
        self._anchor, self._axis, self._sensors = bind("xanchor"), bind("xaxis"), bind("sensordata")

    def reset(self, initial_states: Sequence[InitialState], env_ids: Sequence[int] | None = None) -> None:
        """Put environments at their initial states.

        Args:
            initial_states: one per environment that is reset.
            env_ids: sorted indices of the environments; None for all.
        """
        ids = np.arange(self.num_envs) if env_ids is None else np.asarray(env_ids)
        index = self.scene.index
        for i, state in zip(ids, initial_states, strict=True):
            limits = (
                self.scene.model.jnt_range[self._joints] if state.object_limits is None else state.object_limits
            )
            self._set_parameters(i, state.joint_friction, state.joint_damping, limits)
        self._batch.set_models(self._models)  # again after every edit
        self._batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        for i, state in zip(ids, initial_states, strict=True):
            self._qpos[i, index.robot] = state.robot_qpos
            self._qpos[i, index.object_qpos] = state.object_qpos
            if state.root_pose_w is not None:
                self._qpos[i, index.root_qpos] = state.root_pose_w
            if state.prop_positions_w is not None:
                self._qpos[i, index.prop_qpos] = _upright(state.prop_positions_w)
            self._ctrl[i] = self.rest_targets(state.robot_qpos)
            if state.settle_steps:
                self._batch.step(np.array([i]), nstep=state.settle_steps)
                self._time[i] = 0.0
        self._batch.forward(ids, stage=_CURRENT)
        self._previous_position[ids] = self._xpos[ids, index.object_bodies]
        self._previous_quaternion[ids] = self._xquat[ids, index.object_bodies]

    def rest_targets(self, robot_qpos: np.ndarray) -> np.ndarray:
        """Drive targets that hold a robot where it is: zero velocity, fingers at their position. (R,) -> (R,)."""
        is_position = self.scene.model.actuator_gainprm[:, 0] == -self.scene.model.actuator_biasprm[:, 1]
        return np.where(is_position, robot_qpos, 0.0)

    def step(self, targets: np.ndarray) -> None:
        """One environment step of all environments with constant drive targets (B, R).

        Raises:
            DivergedError: the engine warned that a state is not finite, or that it ran out of memory. It would
                otherwise start such an environment over, silently.
        """
        bodies = self.scene.index.object_bodies
        self._previous_position[:] = self._xpos[:, bodies]
        self._previous_quaternion[:] = self._xquat[:, bodies]
        self._ctrl[:] = targets
        self._batch.step(nstep=self.scene.physics.physics_steps_per_step, stage=_CURRENT)
        if self._batch.warning[..., 1].any():
            self._raise_diverged()

    def _raise_diverged(self) -> None:
        envs, kinds = np.nonzero(self._batch.warning[..., 1])
        said = sorted({mujoco.mjtWarning(int(kind)).name.removeprefix("mjWARN_") for kind in kinds})
        raise DivergedError(
            f"the physics of {self.scene.object.id!r} diverged in environments {sorted({int(e) for e in envs})} "
            f"({', '.join(said)}); reset them before stepping on"
        )

    def snapshot(self) -> Snapshot:
        """What is true now; the arrays are copies."""
        index, batch = self.scene.index, self.num_envs
        qpos, qvel, sensors = self._qpos.copy(), self._qvel.copy(), self._sensors.copy()
        position, quaternion = self._xpos.copy(), self._xquat.copy()
        rotation = self._xmat[:, index.object_bodies].copy()
        tool_axes = sensors[:, index.tool_axes].reshape(batch, -1, 3, 3)
        rotation = rotation.reshape(batch, -1, 3, 3)
        prop_qvel = qvel[:, index.prop_dof].reshape(batch, -1, 6)
        return Snapshot(
            time_s=self._time.copy(),
            step_s=self.scene.physics.step_s,
            robot_qpos=qpos[:, index.robot],
            robot_qvel=qvel[:, index.robot],
            robot_joint_anchor_w=self._anchor[:, index.robot].copy(),
            robot_joint_axis_w=self._axis[:, index.robot].copy(),
            finger_line_w=sensors[:, index.finger_lines].reshape(batch, -1, 2, 3),
            fingertip_velocity_w=sensors[:, index.fingertip_velocities].reshape(batch, -1, 3),
            tool_position_w=sensors[:, index.tool_positions].reshape(batch, -1, 3),
            tool_rotation_w=tool_axes.swapaxes(-1, -2),
            object_qpos=qpos[:, index.object_qpos],
            object_qvel=qvel[:, index.object_dof],
            root_velocity_w=self._root_velocity(qvel[:, index.root_dof], rotation[:, 0]),
            prop_position_w=qpos[:, index.prop_qpos].reshape(batch, -1, 7)[..., :3],
            prop_velocity_w=prop_qvel[..., :3],
            link_position_w=position[:, index.object_bodies],
            link_quaternion_w=quaternion[:, index.object_bodies],
            link_rotation_w=rotation,
            previous_link_position_w=self._previous_position.copy(),
            previous_link_quaternion_w=self._previous_quaternion.copy(),
            body_position_w=position,
            body_quaternion_w=quaternion,
        )

    def save(self) -> SimulationState:
        """The state of all environments, detached from the simulation."""
        friction, damping, limits = self._parameters()
        return SimulationState(
            rows=self._batch.state.copy(),
            joint_friction=friction,
            joint_damping=damping,
            joint_limits=limits,
            previous_link_position_w=self._previous_position.copy(),
            previous_link_quaternion_w=self._previous_quaternion.copy(),
            object_hash=self.scene.object.content_hash,
            physics=self.scene.physics,
        )

    def restore(self, state: SimulationState) -> None:
        """Take back a saved state: the same actions then give the same bits.

        Raises:
            StateError: the state comes from another scene or batch size.
        """
        self.check_state(state)
        for i in range(self.num_envs):
            self._set_parameters(i, state.joint_friction[i], state.joint_damping[i], state.joint_limits[i])
        self._batch.set_models(self._models)
        self._batch.state[:] = state.rows
        self._batch.forward(stage=_CURRENT)
        self._previous_position[:] = state.previous_link_position_w
        self._previous_quaternion[:] = state.previous_link_quaternion_w

    def check_state(self, state: SimulationState) -> None:
        """See whether `restore` would take a state; nothing is changed.

        Raises:
            StateError: it comes from another scene, physics configuration or batch size, or is not finite.
        """
        ours = self.save()
        if (state.object_hash, state.physics) != (ours.object_hash, ours.physics):
            which = "object" if state.object_hash != ours.object_hash else "physics configuration"
            raise StateError(
                f"this state belongs to another {which} than the simulation of {self.scene.object.id!r}"
            )
        for f in fields(SimulationState):
            mine, given = getattr(ours, f.name), getattr(state, f.name)
            if not isinstance(mine, np.ndarray):
                continue
            if not isinstance(given, np.ndarray) or given.shape != mine.shape:
                shape = getattr(given, "shape", type(given).__name__)
                raise StateError(f"a state of {self.scene.object.id!r} has {f.name} of {mine.shape}, not {shape}")
            if not np.isfinite(given).all():
                raise StateError(f"this state's {f.name} has numbers that are not finite")

    def _set_parameters(self, env: int, friction: np.ndarray, damping: np.ndarray, limits: np.ndarray) -> None:
        model, dof = self._models[env], self.scene.index.object_dof
        model.dof_frictionloss[dof] = friction
        model.dof_damping[dof] = damping
        model.jnt_range[self._joints] = limits

    def _parameters(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        dof = self.scene.index.object_dof
        friction = np.stack([m.dof_frictionloss[dof] for m in self._models])
        damping = np.stack([m.dof_damping[dof] for m in self._models])
        return friction, damping, np.stack([m.jnt_range[self._joints] for m in self._models])

    def _root_velocity(self, qvel: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """(B, 6) world-frame velocity from that of a free joint, whose angular part is in the body's own frame."""
        if not qvel.shape[1]:
            return np.zeros((self.num_envs, 6))
        qvel[:, 3:] = np.einsum("bij,bj->bi", rotation, qvel[:, 3:])
        return qvel


def _upright(positions: np.ndarray) -> np.ndarray:
    """(K, 3) positions -> (7 K,) poses."""
    return np.concatenate((positions, np.tile((1.0, 0.0, 0.0, 0.0), (len(positions), 1))), axis=1).ravel()

"""`Simulation`: a batch of environments of one layout, stepped, saved and restored bit for bit."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch

from artiskill.errors import Cause, DivergedError
from artiskill.geometry.arrays import rotate
from artiskill.scene.scene import Scene
from artiskill.sim.snapshot import Snapshot
from artiskill.sim.states import (
    InitialState,
    SimulationState,
    check_state,
    object_hash_of,
    object_slices,
    touched_props,
)

# Position- and velocity-dependent fields are brought up to date after the last physics step.
_CURRENT = mujoco.mjtStage.mjSTAGE_VEL.value


class Simulation:
    """`num_envs` environments; each has its own scene, of one layout, and its own joint parameters.

    Args:
        scene: what is simulated, until a reset brings another. It is not changed: every environment runs on its
            own copy of the model.
        num_envs: B.
        num_threads: threads that step; any number gives the same bits.
    """

    def __init__(self, scene: Scene, num_envs: int = 1, num_threads: int = 1) -> None:
        self.num_envs, self.num_threads = num_envs, num_threads
        self.scenes = [scene] * num_envs
        self._slices = object_slices(scene)
        self._step_s, self._physics_steps = scene.physics.step_s, scene.physics.physics_steps_per_step
        self._models = [copy.copy(scene.model) for _ in range(num_envs)]
        self._make_batch()
        self._count_joints()
        self._previous_position = self._xpos[:, self._slices.links].copy()
        self._previous_quaternion = self._xquat[:, self._slices.links].copy()

    @property
    def scene(self) -> Scene:
        """The first environment's: robot, props, physics and layout are those of all."""
        return self.scenes[0]

    def _make_batch(self) -> None:
        """Make a batch of the present models, and live views of its arrays, (B, ...) each."""
        # persistent: a step goes on from the stages that brought the fields up to date after the last one
        self._batch = Batch(self._models[0], self.num_envs, self.num_threads, persistent=True)
        self._batch.set_models(self._models)
        bind = self._batch.bind
        self._qpos, self._qvel, self._ctrl, self._time = bind("qpos"), bind("qvel"), bind("ctrl"), bind("time")
        self._xpos, self._xquat, self._xmat = bind("xpos"), bind("xquat"), bind("xmat")
        self._anchor, self._axis, self._sensors = bind("xanchor"), bind("xaxis"), bind("sensordata")

    # -- start, save, restore ------------------------------------------------------------------------------------

    def reset(
        self,
        initial_states: Sequence[InitialState],
        env_ids: Sequence[int] | np.ndarray | None = None,
        scenes: Sequence[Scene] | None = None,
    ) -> None:
        """Put environments at their initial states.

        Args:
            initial_states: one per environment that is reset.
            env_ids: sorted indices of the environments; None for all.
            scenes: what each of them simulates from now on, of this simulation's layout; None for no change.
        """
        ids = self._ids(env_ids)
        self._set_scenes(ids, scenes)
        for i, state in zip(ids, initial_states, strict=True):
            self._set_parameters(i, state)
        self._batch.set_models(self._models)  # again after every edit
        self._batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        for i, state in zip(ids, initial_states, strict=True):
            self._set_initial(i, state)
            if state.settle_steps:
                self._batch.step(np.array([i]), nstep=state.settle_steps)
                self._time[i] = 0.0
        self._batch.forward(ids, stage=_CURRENT)
        self._keep_link_poses(ids)

    def save(self, env_ids: Sequence[int] | None = None) -> SimulationState:
        """Return the state of all environments, or of some, detached from the simulation."""
        ids = self._ids(env_ids)
        models = [self._models[i] for i in ids]
        return SimulationState(
            rows=self._batch.state[ids],
            joint_friction=np.stack([m.dof_frictionloss[self._slices.dof] for m in models]),
            joint_damping=np.stack([m.dof_damping[self._slices.dof] for m in models]),
            joint_limits=np.stack([m.jnt_range[self._slices.joints] for m in models]),
            previous_link_position_w=self._previous_position[ids],
            previous_link_quaternion_w=self._previous_quaternion[ids],
            object_hash=object_hash_of([self.scenes[i] for i in ids]),
            robot=self.scene.robot.config,
            physics=self.scene.physics,
            props=touched_props(self.scene.props),
        )

    def restore(
        self,
        state: SimulationState,
        env_ids: Sequence[int] | None = None,
        scenes: Sequence[Scene] | None = None,
        is_checked: bool = False,
    ) -> None:
        """Restore a saved state, of all environments or of some: the same actions then give the same bits.

        Args:
            state: of as many environments.
            env_ids: which; None for all.
            scenes: what each of them simulates from now on, as in `reset`; None for no change.
            is_checked: whether `check_state` has accepted the state for these scenes.

        Raises:
            StateError: the state comes from another object, robot, physics configuration, props or batch size, or
                holds what no simulation could have saved.
        """
        ids = self._ids(env_ids)
        if not is_checked:
            check_state(state, scenes or [self.scenes[i] for i in ids])
        if self._set_scenes(ids, scenes):
            self._batch.set_models(self._models)
            self._batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value)  # nothing of the old scenes is left
        self._set_state(state, ids)

    def broadcast_state(self, state: SimulationState) -> None:
        """Put all environments at one saved state (B = 1), as predictive controllers do.

        Raises:
            StateError: the state comes from another scene, or is of several environments.
        """
        check_state(state, [self.scene])
        self._set_state(state, np.arange(self.num_envs))

    def grow(self, num_envs: int) -> None:
        """Add environments up to this number; each new one starts as a copy of the first."""
        more = [0] * (num_envs - self.num_envs)
        rows = np.concatenate((np.arange(self.num_envs), np.array(more, dtype=int)))
        state = self._batch.state[rows]
        self.scenes += [self.scenes[i] for i in more]
        self._models += [copy.copy(self._models[i]) for i in more]
        self._previous_position = self._previous_position[rows]
        self._previous_quaternion = self._previous_quaternion[rows]
        self.num_envs = num_envs
        self._make_batch()
        self._count_joints()
        self._batch.state[:] = state
        self._batch.forward(stage=_CURRENT)

    def _ids(self, env_ids: Sequence[int] | np.ndarray | None) -> np.ndarray:
        return np.arange(self.num_envs) if env_ids is None else np.asarray(env_ids)

    def _set_scenes(self, ids: np.ndarray, scenes: Sequence[Scene] | None) -> bool:
        """Give environments other scenes; return whether any of them is another one than before."""
        changed = False
        for i, scene in zip(ids.tolist(), scenes or (), strict=bool(scenes)):
            if self.scenes[i] is not scene:
                assert scene.layout == self.scene.layout, "scenes of one simulation have one layout"
                self.scenes[i], self._models[i] = scene, copy.copy(scene.model)
                changed = True
        if changed:
            self._count_joints()
        return changed

    def _count_joints(self) -> None:
        self._object_joints = np.array([len(scene.object.joints) for scene in self.scenes])  # (B,)
        is_own = np.arange(self.scene.layout.joints) < self._object_joints[:, None]  # the others pad the layout
        self._own_joints = is_own.astype(np.float64)  # (B, J)

    def _set_parameters(self, env: int, state: InitialState) -> None:
        model, scene = self._models[env], self.scenes[env]
        dof, start = scene.index.object_dof, self._slices.joints.start
        model.dof_frictionloss[dof] = state.joint_friction
        model.dof_damping[dof] = state.joint_damping
        joints = slice(start, start + len(scene.object.joints))
        own = scene.model.jnt_range[joints]
        model.jnt_range[joints] = own if state.object_limits is None else state.object_limits

    def _set_initial(self, env: int, state: InitialState) -> None:
        index, model = self.scenes[env].index, self.scene.model
        self._qpos[env, index.robot] = state.robot_qpos
        self._qpos[env, index.object_qpos] = state.object_qpos
        if state.root_pose_w is not None:
            self._qpos[env, index.root_qpos] = state.root_pose_w
        if state.prop_positions_w is not None:
            upright = np.tile((1.0, 0.0, 0.0, 0.0), (len(state.prop_positions_w), 1))
            self._qpos[env, index.prop_qpos] = np.concatenate((state.prop_positions_w, upright), axis=1).ravel()
        # drive targets that hold the robot where it is: velocities of 0, fingers at their position
        is_position = model.actuator_gainprm[:, 0] == -model.actuator_biasprm[:, 1]
        self._ctrl[env] = np.where(is_position, state.robot_qpos, 0.0)

    def _set_state(self, state: SimulationState, ids: np.ndarray) -> None:
        """Put environments at a state: each at its own, or all at the same."""
        for k, i in enumerate(ids):
            model, row = self._models[i], k % len(state.rows)
            model.dof_frictionloss[self._slices.dof] = state.joint_friction[row]
            model.dof_damping[self._slices.dof] = state.joint_damping[row]
            model.jnt_range[self._slices.joints] = state.joint_limits[row]
        self._batch.set_models(self._models)
        self._batch.state[ids] = state.rows
        self._batch.warning[ids] = 0  # of what was there before
        self._batch.forward(ids, stage=_CURRENT)
        self._previous_position[ids] = state.previous_link_position_w
        self._previous_quaternion[ids] = state.previous_link_quaternion_w

    def _keep_link_poses(self, ids: slice | np.ndarray) -> None:
        self._previous_position[ids] = self._xpos[ids, self._slices.links]
        self._previous_quaternion[ids] = self._xquat[ids, self._slices.links]

    # -- step and look -------------------------------------------------------------------------------------------

    def step(self, targets: np.ndarray, env_ids: np.ndarray | None = None) -> None:
        """Take one environment step with constant drive targets.

        Args:
            targets: (B, R), also when only some environments step.
            env_ids: sorted indices of the environments that step; None for all.

        Raises:
            DivergedError: the engine warned that a state is not finite, or that it ran out of memory. It would
                otherwise start such an environment over, silently.
        """
        ids = slice(None) if env_ids is None else env_ids
        self._keep_link_poses(ids)
        self._ctrl[ids] = targets[ids]
        self._batch.step(env_ids, nstep=self._physics_steps, stage=_CURRENT)
        if self._batch.warning[ids, :, 1].any():
            raise DivergedError(self.diverged(ids))

    def diverged(self, ids: slice | np.ndarray = slice(None)) -> dict[int, Cause]:
        """Return which of these environments the engine has warned of since their reset, and why."""
        causes: dict[int, Cause] = {}
        for env in np.arange(self.num_envs)[ids].tolist():
            kinds = np.flatnonzero(self._batch.warning[env, :, 1]).tolist()
            if kinds:
                names = tuple(mujoco.mjtWarning(kind).name.removeprefix("mjWARN_") for kind in kinds)
                causes[env] = self.scenes[env].object.id, names
        return causes

    def snapshot(self) -> Snapshot:
        """Return the present values; the arrays are copies."""
        index, slices, batch = self.scene.index, self._slices, self.num_envs
        qpos, qvel, sensors = self._qpos.copy(), self._qvel.copy(), self._sensors.copy()
        position, quaternion = self._xpos.copy(), self._xquat.copy()
        rotation = self._xmat[:, slices.links].copy().reshape(batch, -1, 3, 3)
        tool_axes = sensors[:, index.tool_axes].reshape(batch, -1, 3, 3)
        return Snapshot(
            time_s=self._time.copy(),
            step_s=self._step_s,
            robot_qpos=qpos[:, index.robot],
            robot_qvel=qvel[:, index.robot],
            robot_joint_anchor_w=self._anchor[:, index.robot].copy(),
            robot_joint_axis_w=self._axis[:, index.robot].copy(),
            finger_line_w=sensors[:, index.finger_lines].reshape(batch, -1, 2, 3),
            fingertip_velocity_w=sensors[:, index.fingertip_velocities].reshape(batch, -1, 3),
            tool_position_w=sensors[:, index.tool_positions].reshape(batch, -1, 3),
            tool_rotation_w=tool_axes.swapaxes(-1, -2),
            object_joints=self._object_joints,  # never written to
            object_qpos=qpos[:, slices.qpos] * self._own_joints,
            object_qvel=qvel[:, slices.dof] * self._own_joints,
            root_velocity_w=_root_velocity(qvel[:, index.root_dof], rotation[:, 0]),
            prop_position_w=qpos[:, index.prop_qpos].reshape(batch, -1, 7)[..., :3],
            prop_velocity_w=qvel[:, index.prop_dof].reshape(batch, -1, 6)[..., :3],
            link_position_w=position[:, slices.links],
            link_quaternion_w=quaternion[:, slices.links],
            link_rotation_w=rotation,
            previous_link_position_w=self._previous_position.copy(),
            previous_link_quaternion_w=self._previous_quaternion.copy(),
            body_position_w=position,
            body_quaternion_w=quaternion,
        )


def _root_velocity(qvel: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return the (B, 6) world-frame velocity of a free joint, whose angular part is in the body's own frame."""
    if not qvel.shape[1]:
        return np.zeros((len(qvel), 6))
    qvel[:, 3:] = rotate(rotation, qvel[:, 3:])
    return qvel


@dataclass(frozen=True, eq=False)
class Contacts:
    """C places where two bodies touch, and with which force.

    Attributes:
        position_w: (C, 3).
        force_w: (C, 3) in newtons, that the first body pushes the second one with.
        bodies: (C, 2) their indices in the arrays `body_*` of a snapshot; 0 is the ground.
    """

    position_w: np.ndarray
    force_w: np.ndarray
    bodies: np.ndarray


def contacts_of(scene: Scene, state: SimulationState) -> Contacts:
    """Return what touches what in a state (B = 1) of a scene, under the drive targets of its last step."""
    model, slices = copy.copy(scene.model), object_slices(scene)
    model.dof_frictionloss[slices.dof] = state.joint_friction[0]
    model.dof_damping[slices.dof] = state.joint_damping[0]
    model.jnt_range[slices.joints] = state.joint_limits[0]
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, state.rows[0], mujoco.mjtState.mjSTATE_INTEGRATION.value)
    mujoco.mj_forward(model, data)
    forces, wrench = np.zeros((data.ncon, 3)), np.zeros(6)
    for number, frame in enumerate(data.contact.frame.reshape(-1, 3, 3)):
        mujoco.mj_contactForce(model, data, number, wrench)
        forces[number] = rotate(frame.T, wrench[:3])  # the frame's rows are the axes
    bodies = model.geom_bodyid[data.contact.geom.reshape(-1, 2)]
    return Contacts(data.contact.pos.reshape(-1, 3).copy(), forces, bodies)


class BareEngine:
    """The engine with nothing around it: what everything else's speed is compared with.

    Its `step` does the physics of `Simulation.step`, bit for bit, and leaves out the rest: fields that are current
    after the step, previous poses, checks.

    Args:
        simulation: whose models and states it copies.
    """

    def __init__(self, simulation: Simulation) -> None:
        models = [copy.copy(model) for model in simulation._models]
        self._batch = Batch(models[0], simulation.num_envs, simulation.num_threads)
        self._batch.set_models(models)
        self._batch.state[:] = simulation._batch.state
        self._ctrl = self._batch.bind("ctrl")
        self._physics_steps = simulation._physics_steps

    def step(self, targets: np.ndarray) -> None:
        """Take one environment step under drive targets (B, R)."""
        self._ctrl[:] = targets
        self._batch.step(nstep=self._physics_steps)

    @property
    def state(self) -> np.ndarray:
        """(B, S) the engine's integration state; a live view."""
        return self._batch.state

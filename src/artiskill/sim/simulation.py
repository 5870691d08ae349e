"""`Simulation`: a batch of environments of one layout, stepped, saved and restored bit for bit."""

import copy
from collections.abc import Sequence

import mujoco
import numpy as np
from mujoco.batch import Batch

from artiskill.errors import ActionError, Cause, DivergedError
from artiskill.scene.scene import Scene
from artiskill.sim.engine_arrays import EngineArrays, places_of, run
from artiskill.sim.snapshot import Snapshot
from artiskill.sim.state_checks import check_state, object_hash_of, touched_props
from artiskill.sim.states import InitialState, SimulationState

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
        self._places = places_of(scene)
        self._own_joints = np.zeros((num_envs, scene.layout.joints))
        self._own_joints[:, : len(scene.object.joints)] = 1.0
        self._models = [copy.copy(scene.model) for _ in range(num_envs)]
        self._start()
        self._previous_position = self._xpos[:, self._places.links].copy()
        self._previous_quaternion = self._xquat[:, self._places.links].copy()

    @property
    def scene(self) -> Scene:
        """The first environment's: robot, props, physics and layout are those of all."""
        return self.scenes[0]

    def _start(self) -> None:
        """A batch of the present models, and live views of the engine's arrays, made once."""
        # persistent: a step goes on from the stages that brought the fields up to date after the last one
        self._batch = Batch(self._models[0], self.num_envs, self.num_threads, persistent=True)
        self._batch.set_models(self._models)
        self._arrays = arrays = EngineArrays(self._batch)
        self._qpos, self._qvel, self._ctrl, self._time = arrays.qpos, arrays.qvel, arrays.ctrl, arrays.time
        self._xpos, self._xquat = arrays.xpos, arrays.xquat

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
        ids = np.arange(self.num_envs) if env_ids is None else np.asarray(env_ids)
        for i, scene in zip(ids, scenes or (), strict=bool(scenes)):
            self._put_scene(int(i), scene)
        for i, state in zip(ids, initial_states, strict=True):
            self._set_parameters(i, state)
        self._batch.set_models(self._models)  # again after every edit
        self._batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        for i, state in zip(ids, initial_states, strict=True):
            self._put(i, state)
            if state.settle_steps:
                self._batch.step(np.array([i]), nstep=state.settle_steps)
                self._time[i] = 0.0
        self._batch.forward(ids, stage=_CURRENT)
        self._previous_position[ids] = self._xpos[ids, self._places.links]
        self._previous_quaternion[ids] = self._xquat[ids, self._places.links]

    def _put_scene(self, env: int, scene: Scene) -> None:
        if self.scenes[env] is scene:
            return
        assert scene.layout == self.scene.layout, "scenes of one simulation have one layout"
        self.scenes[env], self._models[env] = scene, copy.copy(scene.model)
        self._own_joints[env] = np.arange(scene.layout.joints) < len(scene.object.joints)

    def _put(self, env: int, state: InitialState) -> None:
        index = self.scenes[env].index
        self._qpos[env, index.robot] = state.robot_qpos
        self._qpos[env, index.object_qpos] = state.object_qpos
        if state.root_pose_w is not None:
            self._qpos[env, index.root_qpos] = state.root_pose_w
        if state.prop_positions_w is not None:
            self._qpos[env, index.prop_qpos] = _upright(state.prop_positions_w)
        self._ctrl[env] = self.rest_targets(state.robot_qpos)

    def rest_targets(self, robot_qpos: np.ndarray) -> np.ndarray:
        """Drive targets that hold a robot where it is: zero velocity, fingers at their position. (R,) -> (R,)."""
        is_position = self.scene.model.actuator_gainprm[:, 0] == -self.scene.model.actuator_biasprm[:, 1]
        return np.where(is_position, robot_qpos, 0.0)

    def grow(self, num_envs: int) -> None:
        """Make room for more environments; each new one starts as the first is."""
        more = [0] * (num_envs - self.num_envs)
        rows = np.concatenate((np.arange(self.num_envs), np.array(more, dtype=int)))
        state = self._batch.state[rows]
        self.scenes += [self.scenes[i] for i in more]
        self._models += [copy.copy(self._models[i]) for i in more]
        self._own_joints = self._own_joints[rows]
        self._previous_position = self._previous_position[rows]
        self._previous_quaternion = self._previous_quaternion[rows]
        self.num_envs = num_envs
        self._start()
        self._batch.state[:] = state
        self._batch.forward(stage=_CURRENT)

    def step(self, targets: np.ndarray, env_ids: np.ndarray | None = None) -> None:
        """One environment step with constant drive targets.

        Args:
            targets: (B, R), also when only some environments step.
            env_ids: sorted indices of the environments that step; None for all.

        Raises:
            DivergedError: the engine warned that a state is not finite, or that it ran out of memory. It would
                otherwise start such an environment over, silently.
        """
        ids = slice(None) if env_ids is None else env_ids
        self._previous_position[ids] = self._xpos[ids, self._places.links]
        self._previous_quaternion[ids] = self._xquat[ids, self._places.links]
        self._ctrl[ids] = targets[ids]
        self._batch.step(env_ids, nstep=self.scene.physics.physics_steps_per_step, stage=_CURRENT)
        if self._batch.warning[ids, :, 1].any():
            raise DivergedError(self.diverged(ids))

    def rollout(self, targets: np.ndarray) -> list[Snapshot]:
        """Environment steps under given drive targets, as predictive controllers ask for them.

        Args:
            targets: (B, T, R).

        Returns:
            T snapshots, one after each environment step.

        Raises:
            ActionError: targets of another shape.
            DivergedError: as `step`.
        """
        size = self._ctrl.shape[1]
        if targets.ndim != 3 or targets.shape[::2] != (self.num_envs, size):
            raise ActionError(
                f"a rollout needs drive targets of shape ({self.num_envs}, steps, {size}), not {targets.shape}"
            )
        snapshots = []
        for k in range(targets.shape[1]):
            self.step(targets[:, k])
            snapshots.append(self.snapshot())
        return snapshots

    def diverged(self, ids: slice | np.ndarray = slice(None)) -> dict[int, Cause]:
        """Which environments, of these, the engine has warned of since their reset, and how."""
        causes: dict[int, Cause] = {}
        for env in np.arange(self.num_envs)[ids].tolist():
            kinds = np.flatnonzero(self._batch.warning[env, :, 1]).tolist()
            if kinds:
                said = tuple(mujoco.mjtWarning(kind).name.removeprefix("mjWARN_") for kind in kinds)
                causes[env] = self.scenes[env].object.id, said
        return causes

    def snapshot(self) -> Snapshot:
        """What is true now; the arrays are copies."""
        previous = self._previous_position, self._previous_quaternion
        return self._arrays.snapshot(self.scene, self._places, self._own_joints, previous)

    def save(self, env_ids: Sequence[int] | None = None) -> SimulationState:
        """The state of all environments, or of some, detached from the simulation."""
        ids = np.arange(self.num_envs) if env_ids is None else np.asarray(env_ids)
        models = [self._models[i] for i in ids]
        return SimulationState(
            rows=self._batch.state[ids],
            joint_friction=np.stack([m.dof_frictionloss[self._places.dof] for m in models]),
            joint_damping=np.stack([m.dof_damping[self._places.dof] for m in models]),
            joint_limits=np.stack([m.jnt_range[self._places.joints] for m in models]),
            previous_link_position_w=self._previous_position[ids],
            previous_link_quaternion_w=self._previous_quaternion[ids],
            object_hash=object_hash_of([self.scenes[i] for i in ids]),
            robot=self.scene.robot.config,
            physics=self.scene.physics,
            props=touched_props(self.scene.props),
        )

    def restore(
        self, state: SimulationState, env_ids: Sequence[int] | None = None, is_checked: bool = False
    ) -> None:
        """Take back a saved state, of all environments or into some: the same actions then give the same bits.

        Args:
            state: of as many environments.
            env_ids: into which; None for all.
            is_checked: whether `check_state` has seen it already.

        Raises:
            StateError: the state comes from another object, robot, physics configuration, props or batch size, or
                holds what no simulation could have saved.
        """
        if not is_checked:
            self.check_state(state, env_ids)
        self._take(state, np.arange(self.num_envs) if env_ids is None else np.asarray(env_ids))

    def spread(self, state: SimulationState) -> None:
        """Put all environments at one saved instant (B = 1), as predictive controllers do.

        Raises:
            StateError: the state comes from another scene, or is of several environments.
        """
        self.check_state(state, [0])
        self._take(state, np.arange(self.num_envs))

    def _take(self, state: SimulationState, ids: np.ndarray) -> None:
        """Put environments at a state: each at its own, or all at the same."""
        for k, i in enumerate(ids):
            model, row = self._models[i], k % len(state.rows)
            model.dof_frictionloss[self._places.dof] = state.joint_friction[row]
            model.dof_damping[self._places.dof] = state.joint_damping[row]
            model.jnt_range[self._places.joints] = state.joint_limits[row]
        self._batch.set_models(self._models)
        self._batch.state[ids] = state.rows
        self._batch.warning[ids] = 0  # of what was there before
        self._batch.forward(ids, stage=_CURRENT)
        self._previous_position[ids] = state.previous_link_position_w
        self._previous_quaternion[ids] = state.previous_link_quaternion_w

    def check_state(self, state: SimulationState, env_ids: Sequence[int] | None = None) -> None:
        """See whether `restore` would take a state; nothing is changed.

        Raises:
            StateError: as `restore`.
        """
        ids = range(self.num_envs) if env_ids is None else env_ids
        check_state(state, [self.scenes[i] for i in ids])

    def _set_parameters(self, env: int, state: InitialState) -> None:
        model, scene = self._models[env], self.scenes[env]
        dof, joints = scene.index.object_dof, run(self._places.joints.start, len(scene.object.joints))
        model.dof_frictionloss[dof] = state.joint_friction
        model.dof_damping[dof] = state.joint_damping
        own = scene.model.jnt_range[joints]
        model.jnt_range[joints] = own if state.object_limits is None else state.object_limits


def _upright(positions: np.ndarray) -> np.ndarray:
    """(K, 3) positions -> (7 K,) poses."""
    return np.concatenate((positions, np.tile((1.0, 0.0, 0.0, 0.0), (len(positions), 1))), axis=1).ravel()

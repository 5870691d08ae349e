"""Stepping many environments: parameters of their own, resets of some, states saved and restored."""

import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pytest

from artiskill.assets.catalog import load_object
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import DivergedError, StateError
from artiskill.scene.scene import Scene, build_scene
from artiskill.sim.simulation import Simulation, contacts_of
from artiskill.sim.states import InitialState
from artiskill.tasks.registry import make_task

TASK = make_task("OpenCabinetDrawer")


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(TASK.robot, load_object("cabinet-0001"), TASK.physics)


def start(scene: Scene, seed: int, **changes) -> InitialState:
    state = TASK.sample_initial_state(scene.object, np.random.default_rng(seed))
    return dataclasses.replace(state, **changes)


def test_a_step_is_that_many_engine_steps(scene: Scene) -> None:
    state, target = start(scene, 0), np.linspace(-0.4, 0.4, 13)
    simulation = Simulation(scene)
    simulation.reset([state])
    simulation.step(target[None])
    model = simulation._models[0]
    data = mujoco.MjData(model)
    data.qpos[scene.index.robot], data.qpos[scene.index.object_qpos] = state.robot_qpos, state.object_qpos
    data.ctrl[:] = target
    for _ in range(scene.physics.physics_steps_per_step):
        mujoco.mj_step(model, data)
    snapshot = simulation.snapshot()
    np.testing.assert_array_equal(snapshot.robot_qpos[0], data.qpos[:13])
    np.testing.assert_array_equal(snapshot.robot_qvel[0], data.qvel[:13])
    assert snapshot.time_s[0] == pytest.approx(0.05)
    mujoco.mj_forward(model, data)  # poses in the snapshot are those of the new state
    np.testing.assert_allclose(snapshot.body_position_w[0], data.xpos, atol=1e-12)


def test_every_environment_has_its_own_joint_parameters(scene: Scene) -> None:
    simulation = Simulation(scene, num_envs=2)
    joints = len(scene.object.jointed_links)
    moving = {"object_qpos": np.full(joints, 0.1)}
    weak, strong = (start(scene, 0, joint_damping=np.full(joints, d), **moving) for d in (5.0, 20.0))
    simulation.reset([weak, strong])
    simulation._qvel[:, scene.index.object_dof] = 0.3
    simulation.step(np.zeros((2, 13)))
    speed = simulation.snapshot().object_qvel[:, :joints]
    assert (speed[0] > speed[1] + 1e-3).all()
    assert (scene.model.dof_damping[scene.index.object_dof] == 0).all(), "the scene's model stays as it was"


def test_resetting_some_leaves_the_others(scene: Scene) -> None:
    simulation = Simulation(scene, num_envs=3)
    simulation.reset([start(scene, i) for i in range(3)])
    simulation.step(np.full((3, 13), 0.2))
    before = simulation.snapshot()
    simulation.reset([start(scene, 7)], env_ids=[1])
    after = simulation.snapshot()
    for i in (0, 2):
        np.testing.assert_array_equal(after.robot_qpos[i], before.robot_qpos[i])
        np.testing.assert_array_equal(after.previous_link_position_w[i], before.previous_link_position_w[i])
    np.testing.assert_array_equal(after.robot_qpos[1], start(scene, 7).robot_qpos)
    assert after.time_s[1] == 0


def test_snapshots_are_detached(scene: Scene) -> None:
    simulation = Simulation(scene)
    simulation.reset([start(scene, 0)])
    snapshot = simulation.snapshot()
    kept = {f.name: np.array(getattr(snapshot, f.name)) for f in dataclasses.fields(snapshot)}
    simulation.step(np.full((1, 13), 0.3))
    for name, value in kept.items():
        np.testing.assert_array_equal(getattr(snapshot, name), value, err_msg=name)


def test_the_previous_pose_is_one_step_old(scene: Scene) -> None:
    joints = len(scene.object.jointed_links)
    simulation = Simulation(scene)
    simulation.reset([start(scene, 0, object_qpos=np.full(joints, 0.1))])
    first = simulation.snapshot()
    np.testing.assert_array_equal(first.previous_link_position_w, first.link_position_w)
    simulation._qvel[:, scene.index.object_dof] = 0.5
    simulation.step(np.zeros((1, 13)))
    second = simulation.snapshot()
    np.testing.assert_array_equal(second.previous_link_position_w, first.link_position_w)
    assert (second.link_speed_m_s[0, list(scene.object.jointed_links)] > 0).all()


def test_settling_moves_time_back_to_zero(scene: Scene) -> None:
    simulation = Simulation(scene)
    simulation.reset([start(scene, 0, settle_steps=25)])
    assert simulation.snapshot().time_s[0] == 0
    np.testing.assert_allclose(simulation.snapshot().robot_qpos[0], start(scene, 0).robot_qpos, atol=1e-6)


def test_states_of_other_scenes_are_refused(scene: Scene) -> None:
    other = Simulation(build_scene(TASK.robot, load_object("cabinet-0003"), TASK.physics))
    simulation = Simulation(scene)
    with pytest.raises(StateError, match="another object"):
        simulation.restore(other.save())
    slower = dataclasses.replace(TASK.physics, timestep_s=0.001)
    with pytest.raises(StateError, match="physics configuration"):
        simulation.restore(Simulation(build_scene(TASK.robot, scene.object, slower)).save())
    with pytest.raises(StateError, match=r"rows of \(1, \d+\), not \(2, \d+\)"):
        simulation.restore(Simulation(scene, num_envs=2).save())
    mine = simulation.save()
    for name in ("rows", "joint_friction", "previous_link_position_w"):
        with pytest.raises(StateError, match=f"{name} has numbers that are not finite"):
            simulation.restore(dataclasses.replace(mine, **{name: getattr(mine, name) * np.nan}))
    np.testing.assert_array_equal(simulation.save().rows, mine.rows)


@pytest.mark.parametrize(
    "change",
    [
        *({"integrator": name} for name in ("implicit", "euler", "rk4")),
        *({"solver": name} for name in ("cg", "pgs")),
        {"cone": "pyramidal", "noslip_iterations": 5},
    ],
    ids=str,
)
def test_other_solvers_move_the_robot_likewise_and_restore_every_bit(scene: Scene, change: dict) -> None:
    targets = np.full((1, 13), 0.2)
    targets[:, 11:] = 0.03
    physics = dataclasses.replace(TASK.physics, **change)
    simulations = [Simulation(build_scene(TASK.robot, scene.object, p)) for p in (TASK.physics, physics)]
    for simulation in simulations:
        simulation.reset([start(scene, 0)])
        for _ in range(10):
            simulation.step(targets)
    usual, other = simulations
    np.testing.assert_allclose(other.snapshot().robot_qpos, usual.snapshot().robot_qpos, atol=0.01)
    state = other.save()
    with pytest.raises(StateError, match="physics configuration"):
        usual.restore(state)
    other.step(targets)
    rows = other.save().rows
    other.restore(state)
    other.step(targets)
    np.testing.assert_array_equal(other.save().rows, rows)


def test_physics_that_runs_away_is_an_error(scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    simulation = Simulation(scene, num_envs=2)
    simulation.reset([start(scene, i) for i in range(2)])
    simulation._qvel[1] = 1e12
    with pytest.raises(DivergedError, match=r"environments \[1\].*BAD"):
        simulation.step(np.zeros((2, 13)))
    assert list(tmp_path.iterdir()) == [], "the engine leaves no log where it runs"
    simulation.reset([start(scene, 1)], env_ids=[1])
    simulation.step(np.zeros((2, 13)))


@pytest.mark.parametrize("way", ["broadcast_state", "restore"])
def test_a_restored_state_has_not_run_away(scene: Scene, way: str) -> None:
    simulation = Simulation(scene, num_envs=2)
    simulation.reset([start(scene, 0)] * 2)
    good = simulation.save([0]) if way == "broadcast_state" else simulation.save()
    targets = np.zeros((2, 13))
    targets[1] = np.nan
    getattr(simulation, way)(good)
    with pytest.raises(DivergedError, match=r"environments \[1\]"):
        simulation.step(targets)
    getattr(simulation, way)(good)
    simulation.step(np.zeros((2, 13)))


def test_growing_changes_nothing_about_those_that_are_there(scene: Scene) -> None:
    targets = np.random.default_rng(0).uniform(-0.3, 0.3, (5, 13))
    grown, plain = Simulation(scene, num_envs=2), Simulation(scene, num_envs=2)
    for simulation in (grown, plain):
        simulation.reset([start(scene, 0), start(scene, 1)])
        simulation.step(targets[:2])
    grown.grow(5)
    grown.step(targets)
    plain.step(targets[:2])
    np.testing.assert_array_equal(grown.save([0, 1]).rows, plain.save().rows)


def test_environments_may_have_different_scenes_of_one_layout(scene: Scene) -> None:
    other = build_scene(TASK.robot, load_object("cabinet-0003"), TASK.physics)
    assert other.layout == scene.layout
    mixed = Simulation(scene, num_envs=2)
    states = [TASK.sample_initial_state(s.object, np.random.default_rng(3)) for s in (scene, other)]
    mixed.reset(states, scenes=[scene, other])
    mixed.step(np.zeros((2, 13)))
    for row, (single_scene, state) in enumerate(zip((scene, other), states, strict=True)):
        single = Simulation(single_scene)
        single.reset([state])
        single.step(np.zeros((1, 13)))
        np.testing.assert_array_equal(single.save().rows[0], mixed.save().rows[row])
    joints = len(other.object.joints)
    snapshot = mixed.snapshot()
    assert snapshot.object_joints.tolist() == [len(scene.object.joints), joints]
    assert (snapshot.object_qpos[1, joints:] == 0).all()


def test_only_some_environments_step(scene: Scene) -> None:
    simulation = Simulation(scene, num_envs=3)
    simulation.reset([start(scene, k) for k in range(3)])
    simulation.step(np.full((3, 13), 0.3))
    before, speeds = simulation.save().rows, simulation.snapshot().link_speed_m_s
    simulation.step(np.full((3, 13), 0.2), np.array([0, 2]))
    after = simulation.save().rows
    assert [np.array_equal(a, b) for a, b in zip(before, after, strict=True)] == [False, True, False]
    np.testing.assert_array_equal(simulation.snapshot().link_speed_m_s[1], speeds[1])


@pytest.mark.parametrize(("task", "obj"), [("PushChair", "chair-0004"), ("MoveBucket", "bucket-0001")])
def test_contacts_carry_what_stands_on_the_ground(task: str, obj: str) -> None:
    env = ManipulationEnv(task, objects=[obj])
    env.reset(options={"level": 0})
    for _ in range(40):
        env.step(np.zeros(env.control.size))
    contacts = contacts_of(env.scene, env.save_state().simulation)
    bodies, model = env.scene.index.object_bodies, env.scene.model
    own = np.arange(bodies.start, bodies.stop)
    sign = np.isin(contacts.bodies[:, 1], own).astype(float) - np.isin(contacts.bodies[:, 0], own)
    weight_n = -model.opt.gravity[2] * model.body_mass[own].sum()
    np.testing.assert_allclose(sign @ contacts.force_w, (0.0, 0.0, weight_n), atol=1e-4 * weight_n)
    assert -0.01 < contacts.position_w[:, 2].min() < 0.01

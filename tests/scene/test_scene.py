"""Object and robot in one model: what collides with what, where things are, what is drawn."""

import dataclasses

import mujoco
import numpy as np
import pytest

from artiskill.assets.catalog import load_object
from artiskill.config import from_mapping
from artiskill.errors import ConfigError
from artiskill.robots.config import load_robot
from artiskill.scene.physics import PhysicsConfig
from artiskill.scene.scene import Scene, build_scene, cached_scene
from artiskill.sim.simulation import Simulation
from artiskill.sim.states import InitialState

ROBOT = load_robot("one_arm")


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(ROBOT, load_object("cabinet-0003"), PhysicsConfig())


def collide(model: mujoco.MjModel, first: str, second: str) -> bool:
    a, b = model.geom(first), model.geom(second)
    return bool((a.contype[0] & b.conaffinity[0]) | (b.contype[0] & a.conaffinity[0]))


def test_who_collides_with_whom(scene: Scene) -> None:
    model, robot = scene.model, scene.robot
    cabinet = [model.geom(i).name for i in range(model.ngeom) if model.geom(i).name.startswith("object/")]
    finger, link, column = robot.finger_geoms[0], robot.outer_geoms[0], robot.column_geoms[0]
    assert all(collide(model, part, cabinet[0]) for part in (finger, link, column))
    assert collide(model, finger, "ground")
    assert collide(model, link, "ground")
    assert not collide(model, column, "ground"), "it hangs through the ground"
    assert not collide(model, cabinet[0], cabinet[-1]), "links of one cabinet never touch"
    assert not collide(model, cabinet[0], "ground")
    assert not collide(model, finger, robot.finger_geoms[-1])
    trunk = (*robot.torso_geoms, *robot.column_geoms)
    assert all(collide(model, part, own) for part in (finger, link) for own in trunk)
    assert not any(collide(model, part, own) for part in robot.inner_geoms for own in trunk)
    assert not collide(model, trunk[0], trunk[-1])


def drive_forward(scene: Scene, steps: int) -> float:
    """Where the base ends, along x, that drives at full speed from 1.2 m before the cabinet, beside it."""
    obj, simulation = scene.object, Simulation(scene, num_envs=1)
    start, none = np.zeros(len(scene.robot.joints)), np.zeros(len(obj.joints))
    start[:2] = -1.2, 1.5
    simulation.reset([InitialState(start, obj.rest_qpos, none, none)])
    action = np.eye(1, 13)
    for _ in range(steps):
        simulation.step(action)
    return float(simulation.snapshot().robot_qpos[0, 0])


def test_a_wall_stops_the_robot() -> None:
    obj, physics = load_object("cabinet-0002"), PhysicsConfig()
    without = dataclasses.replace(obj, links=obj.links[:-1])
    walled, free = (build_scene(ROBOT, one, physics) for one in (obj, without))
    face = float(obj.links[-1].position[0])
    assert drive_forward(free, 100) > face + 0.5
    stopped = drive_forward(walled, 100)
    assert stopped < face
    assert drive_forward(walled, 150) == pytest.approx(stopped, abs=0.02), "it pushes on and gets no further"
    model, robot, wall = walled.model, walled.robot, "object/room_wall_shape0"
    touching = (*robot.finger_geoms, *robot.outer_geoms, *robot.torso_geoms, *robot.column_geoms)
    assert all(collide(model, part, wall) for part in touching)
    assert not collide(model, "ground", wall)
    assert not collide(model, "object/link_0_shape0", wall), "links of one object never meet"


def test_contact_recipe(scene: Scene) -> None:
    model, contact = scene.model, scene.physics.contact
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    assert model.opt.impratio == contact.impratio
    touches = (model.geom_contype | model.geom_conaffinity) > 0
    np.testing.assert_allclose(model.geom_solref[touches] - (2 * model.opt.timestep, 1), 0, atol=1e-12)
    np.testing.assert_allclose(model.jnt_solref[model.jnt_limited == 1, 0], 2 * model.opt.timestep)
    for name in scene.robot.finger_geoms:
        assert model.geom(name).friction[0] == contact.finger_friction
        assert model.geom(name).priority[0] == 1


def test_the_solver_is_what_the_configuration_says() -> None:
    physics = PhysicsConfig(
        integrator="rk4",
        solver="pgs",
        cone="pyramidal",
        solver_iterations=7,
        solver_tolerance=1e-5,
        line_search_iterations=9,
        line_search_tolerance=0.1,
        noslip_iterations=3,
    )
    option = build_scene(ROBOT, load_object("cabinet-0003"), physics).model.opt
    assert option.integrator == mujoco.mjtIntegrator.mjINT_RK4
    assert option.solver == mujoco.mjtSolver.mjSOL_PGS
    assert option.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL
    assert (option.iterations, option.noslip_iterations, option.ls_iterations) == (7, 3, 9)
    assert (option.tolerance, option.ls_tolerance) == (1e-5, 0.1)


def test_the_usual_solver_is_the_engines_own_but_for_the_recipe(scene: Scene) -> None:
    option, plain = scene.model.opt, mujoco.MjSpec().compile().opt
    for name in ("iterations", "tolerance", "ls_iterations", "ls_tolerance", "noslip_iterations", "solver"):
        assert getattr(option, name) == getattr(plain, name), name


def test_joints_keep_their_limits_and_axes(scene: Scene) -> None:
    model, obj = scene.model, scene.object
    joints = [link.joint for link in obj.links if link.joint is not None]
    indices = range(*scene.index.object_qpos.indices(model.njnt))
    assert len(joints) == len(indices)
    for joint, i in zip(joints, indices, strict=True):
        np.testing.assert_allclose(model.jnt_range[i], joint.limits)
        np.testing.assert_allclose(model.jnt_axis[i], joint.axis, atol=1e-12)


def test_sensors_are_where_the_index_says(scene: Scene) -> None:
    data = mujoco.MjData(scene.model)
    data.qpos[4:11], data.qvel[:4] = ROBOT.initial.arm_qpos_rad, (0.1, 0.2, 0.3, 0.4)
    mujoco.mj_forward(scene.model, data)
    index, robot = scene.index, scene.robot
    lines = data.sensordata[index.finger_lines].reshape(-1, 2, 3)
    for i, (start, tip) in enumerate(zip(robot.finger_line_sites, robot.fingertip_sites, strict=True)):
        np.testing.assert_allclose(lines[i, 0], data.site(start).xpos, atol=1e-12)
        np.testing.assert_allclose(lines[i, 1], data.site(tip).xpos, atol=1e-12)
        jacobian = np.zeros((3, scene.model.nv))
        mujoco.mj_jacSite(scene.model, data, jacobian, None, scene.model.site(tip).id)
        velocities = data.sensordata[index.fingertip_velocities].reshape(-1, 3)
        np.testing.assert_allclose(velocities[i], jacobian @ data.qvel, atol=1e-9)
    axes = data.sensordata[index.tool_axes].reshape(-1, 3, 3)
    np.testing.assert_allclose(axes[0].T.ravel(), data.site(robot.tool_sites[0]).xmat, atol=1e-9)


def test_everything_drawn_belongs_to_a_body(scene: Scene) -> None:
    parts = {visual.part for _, visual in scene.visuals}
    assert {"handle", "drawer_front"} <= parts
    bodies = {body for body, _ in scene.visuals}
    assert bodies <= set(range(1, scene.model.nbody))
    assert set(range(scene.index.object_bodies.start, scene.index.object_bodies.stop)) <= bodies


def test_scenes_are_remembered_and_never_changed() -> None:
    obj, physics = load_object("cabinet-0003"), PhysicsConfig()
    assert cached_scene(ROBOT, obj, physics) is cached_scene(ROBOT, obj, physics)
    other = from_mapping(PhysicsConfig, {"timestep_s": 0.001, "physics_steps_per_control": 10})
    assert cached_scene(ROBOT, obj, other) is not cached_scene(ROBOT, obj, physics)
    assert other.step_s == pytest.approx(physics.step_s)


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"timestep_s": 0.0}, "timestep_s"),
        ({"control_steps_per_step": 0}, "at least 1"),
        ({"contact": {"time_constant_steps": 1}}, "stability"),
        ({"contact": {"impedance": [1, 2]}}, "impedance|5"),
        ({"contact": {"finger_friction": -1}}, "finger_friction must be finite and at least 0, not -1"),
        ({"contact": {"finger_frictoin": 1}}, "finger_friction"),
    ],
)
def test_bad_physics(values: dict, says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        from_mapping(PhysicsConfig, values)

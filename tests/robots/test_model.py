"""The robot's part of a model: what it is made of, how it moves, and that what is drawn is what touches."""

from functools import cache

import mujoco
import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape, Joint, Link
from artiskill.config import load_config
from artiskill.envs.control import action_scale
from artiskill.geometry.meshes import sample_surface
from artiskill.geometry.rotations import (
    quat_conjugate,
    quat_from_axis_angle,
    quat_from_matrix,
    quat_from_rpy,
    quat_multiply,
    quat_rotate,
)
from artiskill.robots.arm_config import ROBOT_DIR, ArmConfig, ShapeConfig, load_arm
from artiskill.robots.config import RobotConfig, load_robot
from artiskill.robots.model import RobotPart, add_robot
from artiskill.robots.visuals import robot_visuals
from artiskill.scene.physics import PhysicsConfig, set_joint_limits_solver, set_options
from artiskill.scene.scene import build_scene

TRUNK = ("root_x_axis_joint", "root_y_axis_joint", "root_z_rotation_joint", "linear_actuator_height")
LEFT_MOUNT = {"side": "left", "position_m": [0.08083, 0.3012, 0.2885], "rpy_rad": [-1.5707963267948966, 0, 0]}
LIFT, ARM, FINGERS = 3, slice(4, 11), slice(11, 13)
# Drawn vertices may stand this far out of the collision shapes, and these as far out of what is drawn: the joint
# barrels have flat ends with sharp edges, which no capsule has.
MOST_OUTSIDE_M = 0.016


def arm_joints(side: str) -> tuple[str, ...]:
    return (*(f"{side}_panda_joint{i}" for i in range(1, 8)), *(f"{side}_panda_finger_joint{i}" for i in (1, 2)))


def two_armed() -> RobotConfig:
    mounts = [{"side": "right", "position_m": [0.08083, -0.3012, 0.2885], "rpy_rad": [1.5707963267948966, 0, 0]}]
    return load_config(
        RobotConfig, ROBOT_DIR / "one_arm.yaml", {"name": "two_arms", "mounts": [*mounts, LEFT_MOUNT]}
    )


def compiled(config: RobotConfig) -> tuple[object, RobotPart]:
    spec, physics = mujoco.MjSpec(), PhysicsConfig()
    set_options(spec, physics)
    part = add_robot(spec, config)
    set_joint_limits_solver(spec.joints, physics)
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = 0
    return spec.compile(), part


@pytest.fixture(scope="module")
def robot():
    return compiled(load_robot("one_arm"))


class Run:
    """The robot at rest at half height, moved by drive targets."""

    def __init__(self, model, config):
        self.model, self.data = model, mujoco.MjData(model)
        count = len(config.mounts)
        arm = [*config.initial.arm_qpos_rad, *[config.initial.finger_qpos_m] * 2]
        self.data.qpos[:] = [0, 0, 0, 0.8, *arm * count]
        self.targets = action_scale(config).to_targets(np.zeros(model.nu))

    def step(self, seconds):
        self.data.ctrl[:] = self.targets
        mujoco.mj_step(self.model, self.data, nstep=round(seconds / self.model.opt.timestep))
        return self.data


@pytest.fixture
def run(robot):
    return Run(robot[0], load_robot("one_arm"))


# -- what it is made of ----------------------------------------------------------------------------------------


def test_joints_stand_in_the_specified_order(robot):
    model, part = robot
    assert part.joints == (*TRUNK, *arm_joints("right"))
    assert tuple(model.joint(i).name for i in range(model.njnt)) == part.joints
    assert tuple(model.actuator(i).name for i in range(model.nu)) == part.actuators == part.joints


def test_two_arms_are_a_matter_of_configuration():
    config = two_armed()
    model, part = compiled(config)
    assert part.joints == (*TRUNK, *arm_joints("right"), *arm_joints("left"))
    assert model.nq == model.nv == model.nu == 22
    assert action_scale(config).center.shape == (22,)
    assert len(part.fingertip_sites) == len(part.finger_line_sites) == 4
    assert part.tool_sites == ("right_tool_center", "left_tool_center")


def test_two_arms_mirror_each_other():
    config = two_armed()
    model, part = compiled(config)
    run = Run(model, config)
    run.targets[[4, 13]] = -0.5, 0.5  # the first joints' axes point away from the torso, to opposite sides
    data = run.step(0.5)
    right, left = (data.site(name).xpos for name in part.tool_sites)
    assert right * (1, -1, 1) == pytest.approx(left, abs=1e-3)
    assert data.qpos[4] == pytest.approx(-0.25, abs=0.02)


def test_ranges_are_the_data_sheets(robot):
    model, _ = robot
    ranges = {
        "root_x_axis_joint": (-10, 10),
        "root_y_axis_joint": (-10, 10),
        "linear_actuator_height": (0, 1.6),
        "right_panda_joint1": (-2.8973, 2.8973),
        "right_panda_joint2": (-1.7628, 1.7628),
        "right_panda_joint3": (-2.8973, 2.8973),
        "right_panda_joint4": (-3.0718, -0.0698),
        "right_panda_joint5": (-2.8973, 2.8973),
        "right_panda_joint6": (-0.0175, 3.7525),
        "right_panda_joint7": (-2.8973, 2.8973),
        "right_panda_finger_joint1": (0, 0.04),
        "right_panda_finger_joint2": (0, 0.04),
    }
    for name, limits in ranges.items():
        assert model.joint(name).limited
        assert model.joint(name).range == pytest.approx(limits)
    assert not model.joint("root_z_rotation_joint").limited


def test_masses_and_inertias_are_the_identified_ones(robot):
    model, _ = robot
    masses = (4.970684, 0.646926, 3.228604, 3.587895, 1.225946, 1.666555, 0.735522)
    for i, mass in enumerate(masses, start=1):
        assert model.body(f"right_panda_link{i}").mass == pytest.approx(mass)
    assert model.body("right_panda_link3").inertia == pytest.approx((0.037242, 0.036155, 0.01083))
    assert model.body("right_panda_link4").ipos == pytest.approx((-0.05317, 0.104419, 0.027454))
    trunk = 1.0 + 10.0 + 1.72 + 1.48
    assert model.body_mass.sum() == pytest.approx(trunk + sum(masses) + 0.73 + 2 * 0.015)


def test_drives_have_the_specified_damping_and_force_limits(robot):
    model, _ = robot
    damping = dict.fromkeys(TRUNK, 1000.0) | dict.fromkeys(arm_joints("right")[:7], 100.0)
    for name, value in damping.items():
        actuator = model.actuator(name)
        assert actuator.gainprm[0] == -actuator.biasprm[2] == value
        assert actuator.dynprm[0] == pytest.approx(1 / (2 * np.pi * 40))
    efforts = [87.0] * 4 + [12.0] * 3 + [20.0] * 2
    for name, effort in zip(arm_joints("right"), efforts, strict=True):
        assert model.actuator(name).forcelimited
        assert model.actuator(name).forcerange == pytest.approx((-effort, effort))
    assert np.all(model.dof_frictionloss == 0.1)


def test_the_panda_reaches_as_far_as_its_data_sheet_says(robot):
    """Stretched out, the flange is 0.088 m beside and 0.316 + 0.384 m beyond the shoulder, 0.107 m back."""
    model, _ = robot
    data = mujoco.MjData(model)
    data.qpos[ARM] = 0
    mujoco.mj_forward(model, data)
    shoulder, hand = (data.body(f"right_panda_{name}") for name in ("link1", "hand"))
    offset = quat_rotate(quat_conjugate(shoulder.xquat), hand.xpos - shoulder.xpos)
    assert offset == pytest.approx((0.088, 0, 0.316 + 0.384 - 0.107), abs=1e-6)


# -- how it moves ------------------------------------------------------------------------------------------------


def test_at_rest_it_neither_moves_nor_sags(run):
    before = run.data.qpos.copy()
    data = run.step(10.0)
    assert data.qpos == pytest.approx(before, abs=1e-6)
    assert data.qvel == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_base_drives_forward_in_its_own_frame(run, yaw):
    run.data.qpos[2] = yaw
    run.targets[0] = 0.5
    qvel = run.step(1.0).qvel[:2]
    assert qvel == pytest.approx((0.5 * np.cos(yaw), 0.5 * np.sin(yaw)), abs=0.005)


def test_base_keeps_its_direction_while_it_turns(run):
    run.targets[1:3] = 0.2, 1.0
    data = run.step(2.0)
    cos, sin = np.cos(data.qpos[2]), np.sin(data.qpos[2])
    own = (cos * data.qvel[0] + sin * data.qvel[1], -sin * data.qvel[0] + cos * data.qvel[1])
    assert data.qvel[2] == pytest.approx(1.0, rel=0.01)
    assert own == pytest.approx((0, 0.2), abs=0.02)  # Coriolis forces are not balanced: see docs/control.md


def test_lift_and_arm_reach_their_velocities(run):
    run.targets[LIFT], run.targets[5], run.targets[10] = 0.3, 0.4, -1.0
    qvel = run.step(0.5).qvel
    assert qvel[LIFT] == pytest.approx(0.3, rel=0.02)
    assert qvel[5] == pytest.approx(0.4, rel=0.02)
    assert qvel[10] == pytest.approx(-1.0, rel=0.02)


def test_filter_and_inertia_delay_the_lift(run):
    """The low-pass (4 ms) and the lifted mass over the drive's damping (30 ms) set how fast velocity follows."""
    run.targets[LIFT] = 0.5
    mass = run.model.body_mass.sum() - run.model.body("mobile_base").mass[0]
    run.step(0.03)
    expected = 0.5 * (1 - np.exp(-0.03 / (mass / 1000)))
    assert 0.7 * expected < run.data.qvel[LIFT] < expected


@pytest.mark.parametrize("opening_m", [0.0, 0.04])
def test_fingers_open_and_close_all_the_way(run, opening_m):
    run.targets[FINGERS] = opening_m
    data = run.step(0.5)
    assert data.qpos[FINGERS] == pytest.approx(opening_m, abs=2e-4)
    pads = [run.data.site(f"right_panda_{name}_tip").xpos for name in ("leftfinger", "rightfinger")]
    assert np.linalg.norm(pads[0] - pads[1]) == pytest.approx(2 * opening_m, abs=4e-4)


def test_drives_do_not_push_through_joint_limits(run):
    run.targets[ARM] = 3.14
    data = run.step(4.0)
    upper = run.model.jnt_range[ARM, 1]
    assert np.all(data.qpos[ARM] < upper + 0.01)
    assert data.qpos[ARM] == pytest.approx(upper, abs=0.01)


def test_fingers_hold_a_bar_against_a_pull():
    """20 N per finger on a handle of 12 mm, with a drawer of 3 kg: it creeps by under 0.3 mm in 2 s at 30 N."""
    config = load_robot("one_arm")
    probe = Run(compiled(config)[0], config).step(0.0)
    mujoco.mj_forward(probe.model, probe)
    tool = probe.site("right_tool_center")
    none, still = np.zeros((0, 3)), np.array((1.0, 0, 0, 0))
    bar = CollisionShape("box", (0.06, 0.006, 0.006), np.zeros(3), still)
    slide = Joint("pull", "prismatic", np.array((0, 0, 1.0)), np.zeros(3), (-1.0, 1.0))
    root = Link("base", -1, tool.xpos.copy(), quat_from_matrix(tool.xmat.reshape(3, 3)), None, (), (), 500.0, none)
    link = Link("link_0", 0, np.zeros(3), still, slide, (), (bar,), 3.0 / (0.12 * 0.012**2), none)
    scene = build_scene(
        config, ArticulatedObject("bar", "cabinet", (root, link), (), np.zeros((2, 3))), PhysicsConfig()
    )
    model, data = scene.model, mujoco.MjData(scene.model)
    model.dof_damping[:11] = 1e9  # the arm is held
    data.qpos[:13] = probe.qpos
    mujoco.mj_step(model, data, nstep=500)  # targets are 0: the fingers close
    grip = np.abs(data.actuator_force[FINGERS])
    pulled, force = scene.index.object_qpos.start, scene.index.object_dof.start
    before = data.qpos[pulled]
    data.qfrc_applied[force] = 30.0
    mujoco.mj_step(model, data, nstep=1000)
    assert grip == pytest.approx(20.0)
    assert 0 < data.qpos[pulled] - before < 3e-4


# -- what is drawn and what touches ------------------------------------------------------------------------------


@cache
def arm() -> ArmConfig:
    return load_arm("panda")


@cache
def triangles(part: str) -> np.ndarray:
    """(F, 3, 3) corners of everything drawn of a part."""
    return np.concatenate([v.mesh.vertices[v.mesh.faces] for v in robot_visuals(part)])


@cache
def surface(part: str) -> np.ndarray:
    return sample_surface([v.mesh for v in robot_visuals(part)], 6000, np.random.default_rng(0))


def is_inside(part: str, points: np.ndarray) -> np.ndarray:
    """Whether the solid angles of all faces add up to the whole sphere (van Oosterom and Strackee, 1983)."""
    a, b, c = (triangles(part)[None, :, k] - points[:, None] for k in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=-1) for x in (a, b, c))
    ab, bc, ca = ((x * y).sum(-1) for x, y in ((a, b), (b, c), (c, a)))
    turns = np.arctan2((a * np.cross(b, c)).sum(-1), la * lb * lc + ab * lc + bc * la + ca * lb).sum(1)
    return turns > np.pi


def outside_drawn_m(part: str, points: np.ndarray) -> np.ndarray:
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(surface(part)).query(points)
    return np.where(is_inside(part, points), 0.0, distance)


def capsule_ends(shape: ShapeConfig) -> np.ndarray:
    assert shape.kind == "capsule", "arm links are made of capsules"
    axis = quat_rotate(quat_from_rpy(shape.rpy_rad), np.array((0, 0, shape.size[1])))
    return np.array(shape.position_m) + np.outer((-1, 1), axis)


def outside_capsule_m(shape: ShapeConfig, points: np.ndarray) -> np.ndarray:
    start, end = capsule_ends(shape)
    along = np.clip((points - start) @ (end - start) / ((end - start) @ (end - start)), 0, 1)
    return np.linalg.norm(points - start - along[:, None] * (end - start), axis=1) - shape.size[0]


def capsule_surface(shape: ShapeConfig) -> np.ndarray:
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    start, end = capsule_ends(shape)
    axis = (end - start) / np.linalg.norm(end - start)
    caps = np.where((directions @ axis > 0)[:, None], end, start) + shape.size[0] * directions
    sideways = directions - np.outer(directions @ axis, axis)
    sideways /= np.linalg.norm(sideways, axis=1, keepdims=True)
    along = start + rng.random(400)[:, None] * (end - start)
    return np.concatenate((caps, along + shape.size[0] * sideways))


def outside_neighbour_m(index: int, step: int, points: np.ndarray) -> np.ndarray:
    """How far points of link `index` are outside the next or the previous link, at the worst of some angles."""
    joint = arm().joints[max(index, index + step)]
    worst = np.zeros(len(points))
    for angle in np.linspace(*joint.range_rad, 4):
        turn = quat_multiply(quat_from_rpy(joint.rpy_rad), quat_from_axis_angle((0, 0, 1), angle))
        if step < 0:
            moved = quat_rotate(turn, points) + np.array(joint.position_m)
        else:
            moved = quat_rotate(quat_conjugate(turn), points - np.array(joint.position_m))
        worst = np.maximum(worst, outside_drawn_m(arm().links[index + step].name, moved))
    return worst


@pytest.mark.parametrize("index", range(7))
def test_what_is_drawn_of_an_arm_link_touches(index):
    link = arm().links[index]
    points = np.concatenate((triangles(link.name).reshape(-1, 3), surface(link.name)[:1000]))
    outside = np.min([outside_capsule_m(shape, points) for shape in link.collisions], axis=0)
    assert outside.max() < MOST_OUTSIDE_M


@pytest.mark.parametrize("index", range(7))
def test_what_touches_of_an_arm_link_is_drawn(index):
    """Of the link itself, or of a neighbour, with which it shares a joint's barrel."""
    link = arm().links[index]
    points = np.concatenate([capsule_surface(shape) for shape in link.collisions])
    outside = outside_drawn_m(link.name, points)
    for step in (-1, 1):
        if 0 <= index + step < 7:
            outside = np.minimum(outside, outside_neighbour_m(index, step, points))
    if index == 6:
        hand = arm().hand
        moved = quat_rotate(quat_conjugate(quat_from_rpy(hand.rpy_rad)), points - np.array(hand.position_m))
        outside = np.minimum(outside, outside_drawn_m("panda_hand", moved))
    assert outside.max() < MOST_OUTSIDE_M


def test_collision_shapes_are_few():
    assert all(len(link.collisions) <= 2 for link in arm().links)

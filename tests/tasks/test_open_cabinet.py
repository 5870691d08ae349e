"""Rewards, flags and observations as functions of snapshots: any array library, any batch, hand-made states."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from artiskill.assets.articulated_object import ROOM_WALL, ArticulatedObject
from artiskill.assets.cabinets import GENERATOR
from artiskill.assets.catalog import load_object
from artiskill.errors import AssetError, ConfigError, UnknownNameError
from artiskill.scene.scene import build_scene
from artiskill.sim.simulation import Simulation
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.cabinet_measures import (
    MEASURES,
    Limits,
    describe_handle,
    finger_distances,
    hand_angle,
    measure,
    measure_by_arrays,
)
from artiskill.tasks.levels import MAX_LEVEL, RngStream, check_level, level_generator
from artiskill.tasks.open_cabinet import CabinetGoal, make_cabinet_goal
from artiskill.tasks.registry import make_task
from artiskill.tasks.task import stack_goals

TASK = make_task("OpenCabinetDrawer")


@pytest.fixture(scope="module")
def cabinet() -> ArticulatedObject:
    return load_object("cabinet-0003")


@pytest.fixture(scope="module")
def moving(cabinet: ArticulatedObject) -> tuple[Snapshot, CabinetGoal]:
    """Three environments after twenty random steps, with different targets."""
    targets = TASK.targets(cabinet)[:3]
    simulation = Simulation(build_scene(TASK.robot, cabinet, TASK.physics), num_envs=3)
    states = [TASK.sample_initial_state(cabinet, level_generator(i, RngStream.INITIAL_STATE)) for i in range(3)]
    simulation.reset([dataclasses.replace(s, object_qpos=s.object_qpos + 0.1 * i) for i, s in enumerate(states)])
    rng = np.random.default_rng(0)
    for _ in range(20):
        simulation.step(rng.uniform(-0.5, 0.5, (3, 13)))
    return simulation.snapshot(), stack_goals([TASK.make_goal(cabinet, t) for t in targets])


@pytest.mark.parametrize("object_id", ["cabinet-0002", "cabinet-0057", "cabinet-0088"])
def test_the_robot_starts_clear_of_the_wall_that_a_cabinet_hangs_on(object_id: str) -> None:
    obj = load_object(object_id)
    scene = build_scene(TASK.robot, obj, TASK.physics)
    levels = range(40)
    simulation = Simulation(scene, num_envs=len(levels))
    simulation.reset(
        [TASK.sample_initial_state(obj, level_generator(level, RngStream.INITIAL_STATE)) for level in levels]
    )
    bodies = [scene.model.body(name).id for name in scene.robot.bodies]
    face, furthest = obj.links[-1].position[0], simulation.snapshot().body_position_w[:, bodies, 0].max()
    assert obj.links[-1].is_wall
    assert furthest < face - 0.5


def test_a_wall_belongs_to_no_mask() -> None:
    obj = load_object("cabinet-0002")
    scene = build_scene(TASK.robot, obj, TASK.physics)
    masks = TASK.masks(scene, "link_0")
    (wall,) = (i for i, (_, visual) in enumerate(scene.visuals) if visual.part == ROOM_WALL)
    assert not masks[:, wall].any()
    assert masks.any(axis=1).all()


def converted(value: Any, asarray: Any) -> Any:
    """A snapshot or goal whose arrays come from another library."""
    arrays = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
    return type(value)(**{k: asarray(v.copy()) if isinstance(v, np.ndarray) else v for k, v in arrays.items()})


def row_of(value: Any, i: int) -> Any:
    arrays = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
    cut = {k: v[i : i + 1] if isinstance(v, np.ndarray) else v for k, v in arrays.items()}
    return type(value)(**{**cut, **({"row": np.array([0])} if "row" in cut else {})})


def answers(snapshot: Snapshot, goal: CabinetGoal) -> dict[str, Any]:
    return {
        **TASK.flags(snapshot, goal),
        **TASK.reward_terms(snapshot, goal, TASK.flags(snapshot, goal)),
        "state": TASK.observe_state(snapshot, goal),
    }


def test_torch_gives_the_same_answers(moving: tuple[Snapshot, CabinetGoal]) -> None:
    torch = pytest.importorskip("torch", reason="torch tensors are tried where torch is installed")
    ours = answers(*moving)
    theirs = answers(*(converted(value, torch.asarray) for value in moving))
    door, ajar = make_task("OpenCabinetDoor"), [opened(*moving, np.array((0.15, 0.2, 0.6))), moving[1]]
    doors = [
        door.reward_terms(*given, door.flags(*given))
        for given in (ajar, [converted(v, torch.asarray) for v in ajar])
    ]
    for name, value in doors[0].items():
        np.testing.assert_allclose(doors[1][name].numpy(), value, atol=1e-7, err_msg=name)
    described = [describe_handle(*moving), describe_handle(*(converted(v, torch.asarray) for v in moving)).numpy()]
    np.testing.assert_allclose(*described, atol=1e-12)
    for name, value in ours.items():
        assert isinstance(theirs[name], torch.Tensor), name
        np.testing.assert_allclose(theirs[name].numpy(), value, atol=1e-7, err_msg=name)


def test_a_batch_is_its_rows(moving: tuple[Snapshot, CabinetGoal]) -> None:
    whole = answers(*moving)
    for i in range(3):
        part = answers(*(row_of(value, i) for value in moving))
        for name, value in whole.items():
            np.testing.assert_array_equal(part[name][0], value[i], err_msg=name)


@pytest.mark.parametrize("name", ["OpenCabinetDrawer", "OpenCabinetDoor"])
def test_the_state_may_say_where_the_handle_is(name: str) -> None:
    """All is in the base frame: an ideal hand sees the grasp where it is, and the handle goes as it says."""
    obj = load_object("cabinet-0002" if name == "OpenCabinetDrawer" else "cabinet-0064")
    task, plain = make_task(name, {"state.handle": True}), make_task(name)
    snapshot, goal = gripping(obj, "link_0")
    grasp = snapshot.link_position_w[0, goal.link[0]] + goal.grasp_positions[0, 0]
    snapshot = dataclasses.replace(snapshot, tool_position_w=grasp[None, None])
    seen, usual = task.observe_state(snapshot, goal)[0], plain.observe_state(snapshot, goal)[0]
    before = sum(field.size for field in plain.state_fields) - 38
    np.testing.assert_array_equal(seen[:before], usual[:before])
    np.testing.assert_array_equal(seen[-38:], usual[-38:])
    assert len(seen) == sum(field.size for field in task.state_fields) == len(usual) + 23
    position, offset, grasp_axes, hand_axes, velocity, opening, width = np.split(
        seen[before:-38], np.cumsum([3, 3, 6, 6, 3, 1])
    )
    x, y, yaw = snapshot.robot_qpos[0, :3]
    turn = np.array(((np.cos(yaw), -np.sin(yaw), 0), (np.sin(yaw), np.cos(yaw), 0), (0, 0, 1)))
    np.testing.assert_allclose(turn @ position + (x, y, 0), grasp, atol=1e-6)
    np.testing.assert_allclose(offset, 0, atol=1e-6)
    np.testing.assert_allclose(grasp_axes, hand_axes, atol=1e-6)
    np.testing.assert_allclose(opening, 0, atol=1e-6)
    np.testing.assert_allclose(width, goal.grasp_width_m, atol=1e-6)
    simulation = Simulation(build_scene(task.robot, obj, task.physics))
    state = task.sample_initial_state(obj, np.random.default_rng(0))
    positions = []
    for moved in (0.0, 1e-4):
        qpos = state.object_qpos.copy()
        qpos[goal.joint[0]] += moved
        simulation.reset([dataclasses.replace(state, object_qpos=qpos)])
        part = task.observe_state(simulation.snapshot(), goal)[0][before : before + 3]
        positions.append(part.astype(float))
    np.testing.assert_allclose((positions[1] - positions[0]) / 1e-4, velocity, atol=5e-3)
    with pytest.raises(ConfigError, match="state"):
        make_task("PushChair", {"state.handle": True})


def at_handle(snapshot: Snapshot, goal: CabinetGoal) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance and depth of the fingers, and the hand's angle."""
    origin, rotation = (v[goal.row, goal.link] for v in (snapshot.link_position_w, snapshot.link_rotation_w))
    lines, hand = snapshot.finger_line_w[:, :2], snapshot.tool_rotation_w[:, 0]
    distance, depth = finger_distances(lines, origin, rotation, goal.handle_points, goal.handle_planes)
    return distance, depth, hand_angle(rotation, hand, goal.grasp_rotations)


def shaken(snapshot: Snapshot) -> Snapshot:
    """The same instant with every link on the move."""
    rng = np.random.default_rng(0)
    moved = {
        "object_qvel": snapshot.object_qvel,
        "previous_link_position_w": snapshot.link_position_w,
        "previous_link_quaternion_w": snapshot.link_quaternion_w,
    }
    return dataclasses.replace(snapshot, **{k: v + rng.normal(0.0, 0.01, v.shape) for k, v in moved.items()})


def test_kernels_measure_what_the_array_code_defines(
    moving: tuple[Snapshot, CabinetGoal], cabinet: ArticulatedObject
) -> None:
    never, ajar = Limits(0.015, 0.1, 1.0), Limits(0.015, 0.1, 1.0, (0.1, 0.9))
    held, gripped = gripping(cabinet, "link_3")
    tried = [(shaken(moving[0]), moving[1], never), (shaken(held), gripped, never)]
    tried += [(opened(*moving, np.array(part)), moving[1], ajar) for part in ((0.05, 0.2, 0.6), (0.7, 0.95, 1.1))]
    tried += [(opened(held, gripped, np.array([part])), gripped, ajar) for part in (0.2, 0.95)]
    for snapshot, goal, limits in tried:
        kernels, arrays = measure(snapshot, goal, limits), measure_by_arrays(snapshot, goal, limits)
        assert kernels.shape == (len(goal.link), len(MEASURES))
        np.testing.assert_allclose(kernels, arrays, rtol=1e-12, atol=1e-14)
        exact = [MEASURES.index(name) for name in ("opening_speed", "opening", "speed", "angular_speed")]
        np.testing.assert_array_equal(kernels[:, exact], arrays[:, exact])
        if len(goal.link) == 1:
            assert kernels[0, MEASURES.index("depth")] > 0, "the hand is at the handle"
        elif limits is never:
            assert (np.ptp(arrays, axis=0) > 0).all(), "every measure is tried with different values"
    with pytest.raises(ValueError, match="a goal of 1 environments for a snapshot of 3"):
        measure(moving[0], gripped, never)


def opened(snapshot: Snapshot, goal: CabinetGoal, opening: np.ndarray) -> Snapshot:
    """The same instant with the targets' joints elsewhere: 0 is closed, 1 open enough."""
    qpos = snapshot.object_qpos.copy()
    qpos[goal.row, goal.joint] = goal.lower + opening * (goal.open_qpos - goal.lower)
    return dataclasses.replace(snapshot, object_qpos=qpos)


def test_a_door_that_is_ajar_counts_as_held_and_a_drawer_does_not(
    moving: tuple[Snapshot, CabinetGoal],
) -> None:
    """Who opens a door farther earns more, in steps as small as the opening's, wherever the hand is."""
    door = make_task("OpenCabinetDoor")
    earned: dict[str, list[np.ndarray]] = {TASK.name: [], door.name: []}
    grips = []
    openings = np.linspace(0.0, 0.99, 1981)
    for opening in openings:
        snapshot = opened(*moving, opening)
        for task in (TASK, door):
            terms = task.reward_terms(snapshot, moving[1], task.flags(snapshot, moving[1]))
            weights = task.reward_weights
            earned[task.name].append(sum(weights.get(name, 0.0) * value for name, value in terms.items()))
        grips.append(terms["grip"])
    doors, drawers = (np.array(earned[name]) for name in (door.name, TASK.name))
    bonus = door.config.reward.stage_bonus
    assert (drawers < bonus[1]).all(), "no hand is at its handle"
    first, last = door.config.reward.ajar
    closed, ajar = openings <= first, openings >= last
    raised = bonus[0] - TASK.config.reward.stage_bonus[0]
    np.testing.assert_allclose(doors[closed], drawers[closed] + raised, rtol=0, atol=1e-12)
    assert (doors[closed] == doors[0]).all()
    assert (doors[ajar] > bonus[1]).all()
    np.testing.assert_allclose(np.array(grips)[ajar & (openings < 0.8)], 1.0, atol=1e-12)
    rise = np.diff(doors, axis=0)
    assert (rise > -1e-12).all()
    assert rise[openings[1:] < 0.8].max() < 0.5, "the stage's points come over many small steps"


@pytest.mark.parametrize(
    ("name", "object_id"),
    [
        ("OpenCabinetDoor", "cabinet-0059"),
        ("OpenCabinetDoor", "cabinet-0064"),
        ("OpenCabinetDrawer", "cabinet-0010"),
        ("OpenCabinetDrawer", "cabinet-0026"),
    ],
)
def test_the_first_tenth_of_the_way_earns_more_than_a_hold_above_its_least_reward(
    name: str, object_id: str
) -> None:
    """Else agents hold it and keep still."""
    task, (snapshot, goal) = make_task(name), gripping(load_object(object_id), "link_0")

    def earned(given: Snapshot) -> float:
        terms = task.reward_terms(given, goal, task.flags(given, goal))
        return float(sum(task.reward_weights.get(key, 0.0) * value[0] for key, value in terms.items()))

    lost, _ = gripping(load_object(object_id), "link_0", along_m=0.05)
    bonus, held = task.config.reward.stage_bonus, earned(snapshot)
    assert earned(lost) < bonus[1] < held
    assert earned(opened(snapshot, goal, np.array([0.1]))) - held > held - bonus[1]


def test_a_hand_is_drawn_behind_a_door_once_it_is_ajar() -> None:
    task, (snapshot, goal) = make_task("OpenCabinetDoor"), gripping(load_object("cabinet-0064"), "link_0")
    link, first = goal.link[0], task.config.reward.ajar[1]
    rotation = snapshot.link_rotation_w[0, link]
    place = snapshot.link_position_w[0, link] + rotation @ goal.pushing_position[0]
    grasp = snapshot.link_position_w[0, link] + rotation @ goal.grasp_positions[0, 0]
    lever = grasp - snapshot.link_position_w[0, link] - rotation @ goal.joint_origin[0]
    opens = np.cross(rotation @ goal.joint_axis[0], lever)  # where the handle goes
    assert (place - grasp) @ opens == pytest.approx(-0.1 * np.linalg.norm(opens))
    for opening, hand, expected in (
        (0.0, place, 0.0),
        (first, place, 1.0),
        (first, grasp, 0.9),
        (0.5, place, 1.0),
    ):
        there = dataclasses.replace(opened(snapshot, goal, np.array([opening])), tool_position_w=hand[None, None])
        terms = task.reward_terms(there, goal, task.flags(there, goal))
        assert terms["hand_behind"][0] == pytest.approx(expected, abs=1e-9)


def test_ajar_is_a_range_of_the_opening() -> None:
    with pytest.raises(ConfigError, match=r"ajar must be a lower of at least 0 and a higher number, not"):
        make_task("OpenCabinetDoor", {"reward.ajar": [0.3, 0.2]})
    with pytest.raises(ConfigError, match=r"ajar must not go beyond 1, not"):
        make_task("OpenCabinetDoor", {"reward.ajar": [0.3, 1.2]})
    assert make_task("OpenCabinetDoor", {"reward.ajar": None}).config.reward.ajar is None


def test_distance_is_that_of_segments_to_points(
    moving: tuple[Snapshot, CabinetGoal], cabinet: ArticulatedObject
) -> None:
    snapshot, goal = moving
    distance, _, _ = at_handle(snapshot, goal)
    for i in range(3):
        link = int(goal.link[i])
        handle = cabinet.handles_of(cabinet.links[link].name)[0]
        points = handle.points @ snapshot.link_rotation_w[i, link].T + snapshot.link_position_w[i, link]
        for finger in range(2):
            start, tip = snapshot.finger_line_w[i, finger]
            along = np.linspace(0, 1, 4001)[:, None]
            dense = start + along * (tip - start)
            brute = np.sqrt(((dense[:, None] - points[None]) ** 2).sum(-1)).min()
            assert distance[i, finger] == pytest.approx(brute, abs=1e-5)


def gripping(
    cabinet: ArticulatedObject, target: str, along_m: float = 0.0, slack_m: float = 0.001
) -> tuple[Snapshot, CabinetGoal]:
    """A made-up instant: an ideal hand at the handle, or `along_m` back from it, each finger `slack_m` from it."""
    goal = make_cabinet_goal(cabinet, target, 0.9)
    simulation = Simulation(build_scene(TASK.robot, cabinet, TASK.physics))
    simulation.reset([TASK.sample_initial_state(cabinet, np.random.default_rng(0))])
    snapshot = simulation.snapshot()
    rotation = goal.grasp_rotations[:, 0]
    tool = snapshot.link_position_w[0, goal.link[0]] + goal.grasp_positions[0, 0] - along_m * rotation[0, :, 2]
    across, forward = rotation[0, :, 1], rotation[0, :, 2]
    gap = goal.grasp_width_m[0] / 2 + slack_m
    ends = [[tool + s * gap * across + z * forward for z in (-0.025, 0.0085)] for s in (1, -1)]
    return dataclasses.replace(snapshot, tool_rotation_w=rotation[None], finger_line_w=np.array(ends)[None]), goal


def stage_of(snapshot: Snapshot, goal: CabinetGoal) -> int:
    earned = float(answers(snapshot, goal)["stage"][0])
    return int(np.searchsorted(TASK.config.reward.stage_bonus, earned, side="right")) - 1


def test_an_ideal_grip_is_close_and_a_distant_hand_is_not(cabinet: ArticulatedObject) -> None:
    snapshot, goal = gripping(cabinet, "link_3")
    distance, depth, angle = at_handle(snapshot, goal)
    assert (distance < 0.01).all()
    assert depth[0] > 0
    assert angle[0] == pytest.approx(0, abs=1e-6)
    assert stage_of(snapshot, goal) == 1
    assert stage_of(*gripping(cabinet, "link_3", along_m=0.05)) == 0


def test_reward_rises_on_the_way_to_the_handle_and_as_fingers_close(cabinet: ArticulatedObject) -> None:
    weights = TASK.reward_weights
    earned = []
    ways = [(along, 0.009) for along in (0.5, 0.3, 0.1, 0.05, 0.02, 0.0)] + [(0.0, 0.005), (0.0, 0.003)]
    for way in ways:
        terms = answers(*gripping(cabinet, "link_3", *way))
        earned.append(sum(weight * float(terms[name][0]) for name, weight in weights.items()))
    assert earned == sorted(earned)
    assert len(set(earned)) == len(earned)


def test_still_compares_with_the_previous_step(cabinet: ArticulatedObject) -> None:
    snapshot, goal = gripping(cabinet, "link_3")
    assert bool(TASK.flags(snapshot, goal)["cabinet_static"][0])
    for shift, still in ((0.1 * 0.05 * 0.99, True), (0.1 * 0.05 * 1.01, False)):
        moved = snapshot.previous_link_position_w + np.array((shift, 0, 0))
        flags = TASK.flags(dataclasses.replace(snapshot, previous_link_position_w=moved), goal)
        assert bool(flags["cabinet_static"][0]) is still


def test_open_from_nine_tenths(cabinet: ArticulatedObject) -> None:
    snapshot, goal = gripping(cabinet, "link_3")
    for fraction, is_open in ((0.899, False), (0.901, True)):
        qpos = snapshot.object_qpos.copy()
        qpos[0, goal.joint[0]] = fraction * goal.upper[0]
        opened = dataclasses.replace(snapshot, object_qpos=qpos)
        assert bool(TASK.flags(opened, goal)["open_enough"][0]) is is_open


def test_initial_states_lie_in_their_ranges(cabinet: ArticulatedObject) -> None:
    config = TASK.config.initial
    for level in range(200):
        state = TASK.sample_initial_state(cabinet, level_generator(level, RngStream.INITIAL_STATE))
        offset = state.robot_qpos[:2] - np.array(config.robot_circle_center_m)
        assert 1.6 <= np.linalg.norm(offset) <= 1.8
        assert abs(np.arctan2(offset[1], -offset[0])) <= 0.1 * np.pi + 1e-9
        toward_center = np.arctan2(-offset[1], -offset[0])
        turn = np.angle(np.exp(1j * (state.robot_qpos[2] - toward_center)))
        assert abs(turn) <= 0.05 * np.pi + 1e-9
        assert (state.object_qpos == 0).all()
        assert ((state.joint_friction >= 0.05) & (state.joint_friction <= 0.15)).all()
        assert ((state.joint_damping >= 5) & (state.joint_damping <= 20)).all()


def test_goals_name_what_is_wrong(cabinet: ArticulatedObject) -> None:
    with pytest.raises(UnknownNameError, match="link_3"):
        make_cabinet_goal(cabinet, "link_33", 0.9)
    with pytest.raises(AssetError, match="no joint"):
        make_cabinet_goal(cabinet, "base", 0.9)


def test_too_many_joints_for_the_state_vector(
    cabinet: ArticulatedObject, moving: tuple[Snapshot, CabinetGoal]
) -> None:
    small = make_task("OpenCabinetDrawer", {"max_object_joints": 2})
    with pytest.raises(AssetError, match="max_object_joints"):
        small.observe_state(*moving)


def test_levels() -> None:
    draws = [level_generator(3, stream).random() for stream in RngStream]
    assert len(set(draws)) == len(draws), "streams are independent"
    assert level_generator(3, RngStream.OBJECT).random() == draws[0]
    assert check_level(np.int64(MAX_LEVEL)) == MAX_LEVEL
    for bad in (-1, MAX_LEVEL + 1, 1.0, True, "3", None):
        with pytest.raises(ConfigError, match="level"):
            check_level(bad)


def test_unknown_tasks_and_bad_values() -> None:
    with pytest.raises(UnknownNameError, match="OpenCabinetDrawer"):
        make_task("OpenCabinetDrawers")
    with pytest.raises(ConfigError, match="stage_bonus"):
        make_task("OpenCabinetDrawer", {"reward.stage_bonus": [1, 2, 3, 3]})
    with pytest.raises(ConfigError, match="range"):
        make_task("OpenCabinetDrawer", {"initial.joint_damping": [20, 5]})


def goal_with(kind: str, grasps: int) -> CabinetGoal:
    """The goal of the first drawer or door with such a handle."""
    for seed in range(200):
        obj = GENERATOR.make(seed, f"cabinet-{seed}")
        for handle in obj.handles:
            if handle.kind == kind and len(handle.grasp_positions) == grasps:
                return make_cabinet_goal(obj, handle.link, 0.9)
    raise AssertionError(f"no {kind} with {grasps} grasps")


def test_grasps_are_padded_with_the_best() -> None:
    bar, knob = goal_with("bar", 2), goal_with("knob", 8)
    both = stack_goals([bar, knob])
    assert both.grasp_rotations.shape == (2, 8, 3, 3)
    np.testing.assert_array_equal(both.grasp_rotations[0, :2], bar.grasp_rotations[0])
    np.testing.assert_array_equal(both.grasp_rotations[0, 2:], np.repeat(bar.grasp_rotations[:, 0], 6, axis=0))
    np.testing.assert_array_equal(both.grasp_positions[1], knob.grasp_positions[0])
    most = max(len(bar.handle_planes[0]), len(knob.handle_planes[0]))
    assert both.handle_planes.shape == (2, most, 4)

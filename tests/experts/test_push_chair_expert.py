"""The expert of PushChair: it finds posts to grip, steers, brakes, keeps the chair upright, and is repeatable."""

import dataclasses

import numpy as np
import pytest

from artiskill.assets.catalog import list_objects, load_object
from artiskill.config import CONFIG_DIR, load_config
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError
from artiskill.experts.push_chair import ChairPhase, PushChairExpert
from artiskill.experts.push_chair_plan import LEFT, RIGHT, PushChairExpertConfig, make_plan, steered
from artiskill.experts.variation import load_variation, varied
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.grasp_candidates import graspable_columns

SWIVEL, SLED, CANTILEVER = "chair-0001", "chair-0039", "chair-0037"
CHAIRS = list_objects("chair") + list_objects("chair", "ood")


@pytest.fixture
def config() -> PushChairExpertConfig:
    return load_config(PushChairExpertConfig, CONFIG_DIR / "experts" / "push_chair.yaml")


@pytest.fixture
def env() -> ManipulationEnv:
    env = ManipulationEnv("PushChair", objects=[SWIVEL, SLED, CANTILEVER])
    env.reset(options={"level": 0, "object": SWIVEL})
    return env


@pytest.mark.parametrize("name", CHAIRS)
def test_every_chair_has_a_post_to_grip(name: str) -> None:
    obj = load_object(name)
    places = graspable_columns(obj)
    points, count = places.points, places.count
    assert count in (1, 2, 4)
    assert not points[count:].any()
    assert (points[:count, 2] > 0.1).all()
    seat = obj.metadata["seat_height_m"]
    assert (points[:count, 2] < seat).all(), "below the seat"
    if count == 1:
        np.testing.assert_allclose(points[0, :2], 0.0, atol=1e-6, err_msg="the column stands in the middle")
    lowest, highest = places.ends[:count, 0], places.ends[:count, 1]
    assert (lowest[:, 2] <= points[:count, 2]).all()
    assert (points[:count, 2] <= highest[:, 2]).all()
    assert (lowest[:, 2] > 0.1).all()
    assert (highest[:, 2] < seat).all()
    lean, way = points[:count] - lowest, highest - lowest
    np.testing.assert_allclose(np.cross(lean, way), 0.0, atol=1e-9, err_msg="all three lie on the post's axis")


def test_a_column_takes_one_hand_that_points_to_the_target(
    env: ManipulationEnv, config: PushChairExpertConfig
) -> None:
    for level in range(6):
        env.reset(options={"level": level, "object": SWIVEL})
        plan = make_plan(env.snapshot, env.goal, config)
        (hand,) = plan.hands
        pointing = plan.side_rad + np.pi + (0.75 if hand == RIGHT else -0.75)
        chair = env.snapshot.link_position_w[0, 0, :2]
        forward = np.array((np.cos(pointing), np.sin(pointing)))
        np.testing.assert_allclose(forward, -chair / np.linalg.norm(chair), atol=1e-9)


@pytest.mark.parametrize("name", [SLED, CANTILEVER])
def test_a_frame_takes_both_hands_which_do_not_cross(
    env: ManipulationEnv, config: PushChairExpertConfig, name: str
) -> None:
    for level in range(6):
        env.reset(options={"level": level, "object": name})
        plan = make_plan(env.snapshot, env.goal, config)
        assert plan.hands == (RIGHT, LEFT)
        heading = plan.side_rad + np.pi
        left = np.array((-np.sin(heading), np.cos(heading)))
        assert (plan.points[LEFT] - plan.points[RIGHT])[:2] @ left > 0.3


def test_a_chair_without_known_posts_still_has_a_plan(env: ManipulationEnv, config: PushChairExpertConfig) -> None:
    env.goal.grasp_count[:] = 0
    assert len(make_plan(env.snapshot, env.goal, config).hands) == 1


def test_a_bias_leads_it_to_other_sides(env: ManipulationEnv, config: PushChairExpertConfig) -> None:
    sides, hands = set(), set()
    for bias in (-np.pi / 2, 0.0, np.pi / 2):
        changed = dataclasses.replace(config, side_bias_rad=bias)
        env.reset(options={"level": 0, "object": SLED})
        sides.add(make_plan(env.snapshot, env.goal, changed).side_rad)
        env.reset(options={"level": 0, "object": SWIVEL})
        hands.add(make_plan(env.snapshot, env.goal, changed).hands)
    assert len(sides) > 1
    assert hands == {(RIGHT,), (LEFT,)}


def test_the_height_of_the_grip_goes_from_end_to_end(env: ManipulationEnv, config: PushChairExpertConfig) -> None:
    def height(share: float) -> float:
        plan = make_plan(env.snapshot, env.goal, dataclasses.replace(config, grip_height_share=share))
        return float(plan.points[RIGHT, 2])

    lowest, highest = env.goal.grasp_ends[0, 0, :, 2]
    assert height(-1.0) == lowest
    assert height(0.0) == env.goal.grasp_points[0, 0, 2]
    assert height(1.0) == highest
    assert lowest < height(-0.5) < height(0.0) < height(0.5) < highest


@pytest.mark.parametrize(("key", "value"), [("grip_height_share", 1.1), ("base_speed_share", 0), ("stop_m", 0.2)])
def test_illegal_values_are_refused(config: PushChairExpertConfig, key: str, value: float) -> None:
    with pytest.raises(ConfigError, match=key):
        dataclasses.replace(config, **{key: value})


def test_every_draw_of_its_variation_is_legal(config: PushChairExpertConfig) -> None:
    ranges = load_variation("PushChair").ranges
    drawn = [varied(config, ranges, np.random.default_rng(seed)) for seed in range(100)]
    assert len({one.side_bias_rad for one in drawn}) == len(drawn)
    assert all(one.base_distance_m < one.around_distance_m for one in drawn), "it drives around, not through"


@pytest.mark.slow
@pytest.mark.parametrize("name", [SWIVEL, SLED, CANTILEVER])
def test_it_brings_the_chair_home_upright(env: ManipulationEnv, name: str) -> None:
    env.reset(options={"level": 1, "object": name})
    expert = PushChairExpert(env.task.robot)
    expert.reset(env.snapshot, env.goal)
    phases, done = [], False
    while not done:
        action = expert.act(env.snapshot, env.goal)
        assert np.abs(action).max() <= 1
        phases.append(expert.phase)
        _, _, terminated, truncated, info = env.step(action)
        done = terminated or truncated
        assert env.snapshot.link_rotation_w[0, 0, 2, 2] > np.cos(0.05 * np.pi), "it stands all the way"
    assert info["success"]
    order = [p for i, p in enumerate(phases) if i == 0 or p is not phases[i - 1]]
    assert order == [
        ChairPhase.CARRY,
        ChairPhase.ALIGN,
        ChairPhase.REACH,
        ChairPhase.GRIP,
        ChairPhase.DRIVE,
        ChairPhase.HOLD,
    ]


@pytest.mark.slow
def test_it_takes_a_lost_grip_again(env: ManipulationEnv) -> None:
    """Made to open its hands and back away in mid-drive, it approaches anew and still succeeds."""
    env.reset(options={"level": 1, "object": SWIVEL})
    expert = PushChairExpert(env.task.robot)
    expert.reset(env.snapshot, env.goal)
    disturbed, regained = 0, False
    for _ in range(200):
        action = expert.act(env.snapshot, env.goal)
        if expert.phase is ChairPhase.DRIVE and disturbed < 8:
            action[[11, 12, 20, 21]], action[0] = 1.0, -1.0
            disturbed += 1
        regained |= disturbed == 8 and expert.phase is ChairPhase.REACH
        _, _, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            break
    assert disturbed == 8
    assert regained
    assert info["success"]


def test_the_same_episode_gives_the_same_actions(env: ManipulationEnv) -> None:
    def actions() -> np.ndarray:
        env.reset(options={"level": 3, "object": SLED})
        expert = PushChairExpert(env.task.robot)
        expert.reset(env.snapshot, env.goal)
        taken = []
        for _ in range(30):
            taken.append(expert.act(env.snapshot, env.goal))
            env.step(taken[-1])
        return np.array(taken)

    np.testing.assert_array_equal(actions(), actions())


@pytest.mark.slow
@pytest.mark.parametrize("curve_rad_m", [-0.4, 0.4])
def test_a_curve_takes_the_chair_home_on_its_side(
    env: ManipulationEnv, config: PushChairExpertConfig, curve_rad_m: float
) -> None:
    env.reset(options={"level": 1, "object": SWIVEL})
    expert = PushChairExpert(env.task.robot, dataclasses.replace(config, curve_rad_m=curve_rad_m))
    expert.reset(env.snapshot, env.goal)
    start = env.snapshot.link_position_w[0, 0, :2]
    left_of_the_way = np.array((start[1], -start[0])) / np.linalg.norm(start)  # as seen when going to the origin
    aside, done = [], False
    while not done:
        _, _, terminated, truncated, info = env.step(expert.act(env.snapshot, env.goal))
        aside.append(float(env.snapshot.link_position_w[0, 0, :2] @ left_of_the_way))
        done = terminated or truncated
    assert info["success"]
    assert max(np.array(aside) * np.sign(curve_rad_m)) > 0.05
    assert max(np.array(aside) * -np.sign(curve_rad_m)) < 0.05


@pytest.mark.slow
def test_a_hand_that_was_pushed_aside_goes_back_and_reaches_anew(
    env: ManipulationEnv, config: PushChairExpertConfig
) -> None:
    env.reset(options={"level": 1, "object": SWIVEL})
    expert = PushChairExpert(env.task.robot, dataclasses.replace(config, stray_m=0.04))
    expert.reset(env.snapshot, env.goal)
    phases, reached, pushed, done = [expert.phase], 0, 0, False
    while not done:
        action = expert.act(env.snapshot, env.goal)
        if expert.phase is not phases[-1]:
            phases.append(expert.phase)
        reached += expert.phase is ChairPhase.REACH
        if expert.phase is ChairPhase.REACH and reached > 5 and pushed < 8:
            action[2] = -0.5  # the base turns
            pushed += 1
        _, _, terminated, truncated, info = env.step(action)
        done = terminated or truncated
    assert pushed
    assert phases[3:6] == [ChairPhase.RETREAT, ChairPhase.CARRY, ChairPhase.ALIGN]
    assert info["success"]


@pytest.mark.slow
def test_it_gives_up_a_reach_in_vain_and_takes_the_usual_hold(
    env: ManipulationEnv, config: PushChairExpertConfig
) -> None:
    env.reset(options={"level": 1, "object": SWIVEL})
    changed = dataclasses.replace(config, grip_height_share=-0.5, reach_steps=25)
    expert = PushChairExpert(env.task.robot, changed)
    expert.reset(env.snapshot, env.goal)
    held = 0
    for _ in range(120):
        action = expert.act(env.snapshot, env.goal)
        if expert.phase is ChairPhase.REACH:
            action[:] = 0.0
            held += 1
        env.step(action)
        if held and expert.phase is ChairPhase.CARRY:
            break
    assert held == 25
    assert expert._plan is not None
    np.testing.assert_array_equal(expert._plan.points[RIGHT], env.goal.grasp_points[0, 0])


def test_it_drives_around_a_chair_and_not_through_it(env: ManipulationEnv, config: PushChairExpertConfig) -> None:
    """From the far side, the base led from one place to the next."""
    expert = PushChairExpert(env.task.robot)
    expert.reset(env.snapshot, env.goal)
    assert expert._plan is not None
    aim = expert._aim(env.snapshot, expert._plan)
    qpos = env.snapshot.robot_qpos.copy()
    qpos[0, :2] = 2 * aim.center_xy - aim.base_xy
    nearest, here = np.inf, qpos[0, :2].copy()
    for _ in range(12):
        there = expert._way_around(dataclasses.replace(env.snapshot, robot_qpos=qpos), aim)
        way = here + np.linspace(0, 1, 20)[:, None] * (there - here)
        nearest = min(nearest, np.linalg.norm(way - aim.center_xy, axis=1).min())
        qpos[0, :2] = here = there
    np.testing.assert_array_equal(here, aim.base_xy)
    assert nearest > 0.9 * config.base_distance_m


def chair_at(env: ManipulationEnv, x: float, y: float) -> Snapshot:
    """As it is, but for the chair's place."""
    position = env.snapshot.link_position_w.copy()
    position[0, :, :2] += (x, y) - position[0, 0, :2]
    return dataclasses.replace(env.snapshot, link_position_w=position)


def test_a_chair_that_is_held_may_stir_a_little(env: ManipulationEnv, config: PushChairExpertConfig) -> None:
    expert = PushChairExpert(env.task.robot)
    expert.reset(env.snapshot, env.goal)
    assert expert._plan is not None

    def phase_at(distance_m: float) -> ChairPhase:
        snapshot = chair_at(env, distance_m, 0.0)
        expert.phase = ChairPhase.HOLD
        expert._advance_phase(snapshot, expert._aim(snapshot, expert._plan), expert._plan)
        return expert.phase

    assert phase_at(0.5 * (config.stop_m + config.leave_m)) is ChairPhase.HOLD
    assert phase_at(1.1 * config.leave_m) is not ChairPhase.HOLD


def test_a_hand_that_pushes_alone_steers_towards_the_target(
    env: ManipulationEnv, config: PushChairExpertConfig
) -> None:
    config = dataclasses.replace(config, steer_rad_s=0.15)
    plan = make_plan(chair_at(env, 1.0, 0.0), env.goal, config)
    (hand,) = plan.hands
    snapshot, sides = chair_at(env, 1.0, 0.1), [plan.side_rad]
    for _ in range(40):
        plan = steered(plan, snapshot, config)
        sides.append(plan.side_rad)
    assert 0 < max(np.diff(sides)) <= 0.15 * snapshot.step_s + 1e-12
    pointing = sides[-1] + (0.75 if hand == RIGHT else -0.75)
    assert pointing == pytest.approx(np.arctan2(0.1, 1.0)), "straight to where it shall go"
    assert steered(plan, chair_at(env, 0.0, 0.2), config) is plan, "so near, where it lies says little"


def test_hands_take_sides_and_no_diagonals(env: ManipulationEnv, config: PushChairExpertConfig) -> None:
    square = 0.2 * np.array(((1.0, 1, 1), (1, -1, 1), (-1, -1, 1), (-1, 1, 1)))
    goal = dataclasses.replace(
        env.goal,
        grasp_points=square[None],
        grasp_ends=np.repeat(square[None, :, None], 2, axis=2),
        grasp_count=np.array([4]),
    )
    sides = set()
    for bias in np.linspace(-3, 3, 13):
        plan = make_plan(env.snapshot, goal, dataclasses.replace(config, side_bias_rad=float(bias)))
        assert np.linalg.norm(plan.points[0] - plan.points[1]) == pytest.approx(0.4)
        sides.add(round(np.remainder(plan.side_rad, 2 * np.pi) / (np.pi / 2)) % 4)
    assert sides == {0, 1, 2, 3}

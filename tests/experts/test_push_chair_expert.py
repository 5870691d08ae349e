"""The expert of PushChair: it finds posts to grip, steers, brakes, keeps the chair upright, and is repeatable."""

import numpy as np
import pytest

from artiskill.assets.catalog import list_objects, load_object
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.experts.push_chair import Phase, PushChairExpert
from artiskill.experts.push_chair_plan import LEFT, RIGHT, make_plan
from artiskill.tasks.push_chair.posts import grip_points

SWIVEL, SLED, CANTILEVER = "chair-0001", "chair-0039", "chair-0037"
CHAIRS = list_objects("chair") + list_objects("chair", "ood")


@pytest.fixture
def env() -> ManipulationEnv:
    env = ManipulationEnv("PushChair", objects=[SWIVEL, SLED, CANTILEVER])
    env.reset(options={"level": 0, "object": SWIVEL})
    return env


@pytest.mark.parametrize("name", CHAIRS)
def test_every_chair_has_a_post_to_grip(name: str) -> None:
    obj = load_object(name)
    points, count = grip_points(obj)
    assert count in (1, 2, 4)
    assert not points[count:].any()
    assert (points[:count, 2] > 0.1).all()
    seat = obj.metadata["seat_height_m"]
    assert (points[:count, 2] < seat).all(), "below the seat"
    if count == 1:
        np.testing.assert_allclose(points[0, :2], 0.0, atol=1e-6, err_msg="the column stands in the middle")


def test_a_column_takes_one_hand_that_points_to_the_target(env: ManipulationEnv) -> None:
    for level in range(6):
        env.reset(options={"level": level, "object": SWIVEL})
        plan = make_plan(env.snapshot, env.goal, 0.75)
        (hand,) = plan.hands
        pointing = plan.side_rad + np.pi + (0.75 if hand == RIGHT else -0.75)
        chair = env.snapshot.link_position_w[0, 0, :2]
        forward = np.array((np.cos(pointing), np.sin(pointing)))
        np.testing.assert_allclose(forward, -chair / np.linalg.norm(chair), atol=1e-9)


@pytest.mark.parametrize("name", [SLED, CANTILEVER])
def test_a_frame_takes_both_hands_which_do_not_cross(env: ManipulationEnv, name: str) -> None:
    for level in range(6):
        env.reset(options={"level": level, "object": name})
        plan = make_plan(env.snapshot, env.goal, 0.75)
        assert plan.hands == (RIGHT, LEFT)
        heading = plan.side_rad + np.pi
        left = np.array((-np.sin(heading), np.cos(heading)))
        assert (plan.points[LEFT] - plan.points[RIGHT])[:2] @ left > 0.3


def test_a_chair_without_known_posts_still_has_a_plan(env: ManipulationEnv) -> None:
    env.goal.grip_count[:] = 0
    assert len(make_plan(env.snapshot, env.goal, 0.75).hands) == 1


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
    assert order == [Phase.CARRY, Phase.ALIGN, Phase.REACH, Phase.GRIP, Phase.DRIVE, Phase.HOLD]


@pytest.mark.slow
def test_it_takes_a_lost_grip_again(env: ManipulationEnv) -> None:
    """Made to open its hands and back away in mid-drive, it approaches anew and still succeeds."""
    env.reset(options={"level": 1, "object": SWIVEL})
    expert = PushChairExpert(env.task.robot)
    expert.reset(env.snapshot, env.goal)
    disturbed, regained = 0, False
    for _ in range(200):
        action = expert.act(env.snapshot, env.goal)
        if expert.phase is Phase.DRIVE and disturbed < 8:
            action[[11, 12, 20, 21]], action[0] = 1.0, -1.0
            disturbed += 1
        regained |= disturbed == 8 and expert.phase is Phase.REACH
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

"""The expert of PushChair: it takes the seat, steers, brakes, keeps the chair upright, and remembers nothing."""

import dataclasses

import numpy as np
import pytest

from artiskill.assets.catalog import list_objects, load_object
from artiskill.config import CONFIG_DIR, load_config
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.experts.push_chair import PushChairExpert, PushChairExpertConfig, choose_press, seat_body
from artiskill.experts.variation import load_variation, varied
from artiskill.experts.walls import Press
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.grasp_candidates import seat_of

SWIVEL, SLED, CANTILEVER, LEDGED = "chair-0001", "chair-0039", "chair-0037", "chair-0047"
CHAIRS = list_objects("chair") + list_objects("chair", "ood")
APPROACH, CLOSE, DRIVE, HOLD = range(4)


@pytest.fixture
def config() -> PushChairExpertConfig:
    return load_config(PushChairExpertConfig, CONFIG_DIR / "experts" / "push_chair.yaml")


@pytest.fixture
def env() -> ManipulationEnv:
    env = ManipulationEnv("PushChair", objects=[SWIVEL, SLED, CANTILEVER])
    env.reset(options={"level": 0, "object": SWIVEL})
    return env


@pytest.mark.parametrize("name", CHAIRS)
def test_every_chair_has_a_seat(name: str) -> None:
    """Against what its generator says of it."""
    obj = load_object(name)
    seat = seat_of(obj)
    assert any(shape.part == "seat" for shape in obj.links[seat.link].collisions)
    tips, hand = seat.outline
    assert (tips <= hand).all()
    assert 0.05 < tips.min() <= tips.max() < obj.metadata["width_m"]
    sides = tips[90] + tips[270]
    assert 0.25 < sides < 0.66, "as wide as one sits, and what stands beside it"
    assert tips[90] == pytest.approx(tips[270], abs=0.01)


def test_a_round_seat_has_a_round_outline() -> None:
    """Of a stool with a seat of 0.4 m: seen from a place that is not its middle."""
    tips = seat_of(load_object(SWIVEL)).outline[0]
    angles = np.radians(np.arange(360))
    points = tips[:, None] * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    np.testing.assert_allclose(np.linalg.norm(points - (0.1, 0.0), axis=-1), 0.2, atol=0.008)


def test_a_ledge_below_the_edge_stops_fingers() -> None:
    """Of a chair whose armrests stand on a plate 2 cm below its seat's middle: hands that met it never pressed."""
    tips = seat_of(load_object(LEDGED)).outline[0]
    assert tips[75] > 0.27, "the seat's own edge is at 0.23"
    env = ManipulationEnv("PushChair", objects=LEDGED)
    env.reset(options={"level": 0})
    expert, done = PushChairExpert(env.task.robot), False
    while not done:
        _, _, terminated, truncated, info = env.step(expert.act(env.snapshot, env.goal))
        done = terminated or truncated
    assert info["success"]


def best_press(snapshot: Snapshot, env: ManipulationEnv, config: PushChairExpertConfig) -> Press:
    seat = seat_body(snapshot, env.goal, config.hands)
    return choose_press(snapshot, seat, config.seat)


def heading_of(press: Press, snapshot: Snapshot, env: ManipulationEnv) -> float:
    """Where a robot faces that presses there, an angle in the world."""
    rotation = seat_body(snapshot, env.goal, PushChairExpert(env.task.robot).config.hands).rotation
    return float(press.direction_rad + np.arctan2(rotation[1, 0], rotation[0, 0]) - np.pi / 2)


def test_the_hands_take_it_from_the_robots_side(env: ManipulationEnv, config: PushChairExpertConfig) -> None:
    for name in (SWIVEL, SLED, CANTILEVER):
        for level in range(4):
            env.reset(options={"level": level, "object": name})
            heading = heading_of(best_press(env.snapshot, env, config), env.snapshot, env)
            way = env.snapshot.link_position_w[0, 0, :2] - env.snapshot.robot_qpos[0, :2]
            assert np.cos(heading - np.arctan2(way[1], way[0])) > np.cos(1.2)


def test_a_robot_faces_the_way_or_aside_of_it(env: ManipulationEnv, config: PushChairExpertConfig) -> None:
    """A stool may be pressed from any direction."""
    turns = []
    for side in (-0.6, 0.0, 0.6):
        seat = dataclasses.replace(config.seat, side_rad=side, side_weight=20.0)
        press = best_press(env.snapshot, env, dataclasses.replace(config, seat=seat))
        chair = env.snapshot.link_position_w[0, 0, :2]
        turns.append(heading_of(press, env.snapshot, env) - np.arctan2(-chair[1], -chair[0]))
    np.testing.assert_allclose(np.angle(np.exp(1j * np.array(turns))), (-0.6, 0.0, 0.6), atol=0.25)


def test_every_draw_of_its_variation_is_legal(config: PushChairExpertConfig) -> None:
    ranges = load_variation("PushChair").ranges
    drawn = [varied(config, ranges, np.random.default_rng(seed)) for seed in range(100)]
    assert len({one.seat.side_rad for one in drawn}) == len(drawn)


@pytest.mark.slow
@pytest.mark.parametrize("name", [SWIVEL, SLED, CANTILEVER])
def test_it_brings_the_chair_home_upright(env: ManipulationEnv, name: str) -> None:
    env.reset(options={"level": 1, "object": name})
    expert = PushChairExpert(env.task.robot)
    phases, done = [], False
    while not done:
        command = expert.command(env.snapshot, env.goal)
        phases.append(command.phase)
        _, _, terminated, truncated, info = env.step(expert.controller.action(env.snapshot, command))
        done = terminated or truncated
        assert env.snapshot.link_rotation_w[0, 0, 2, 2] > np.cos(0.05 * np.pi), "it stands all the way"
    assert info["success"]
    order = [p for i, p in enumerate(phases) if i == 0 or p != phases[i - 1]]
    assert order[:3] == [APPROACH, CLOSE, DRIVE]
    assert set(order[3:]) <= {DRIVE, HOLD}


@pytest.mark.slow
def test_it_takes_a_lost_chair_again(env: ManipulationEnv) -> None:
    """Made to open its arms and back away in mid-drive, it approaches anew and still succeeds."""
    env.reset(options={"level": 1, "object": SWIVEL})
    expert = PushChairExpert(env.task.robot)
    disturbed, again = 0, False
    for _ in range(200):
        command = expert.command(env.snapshot, env.goal)
        action = expert.controller.action(env.snapshot, command)
        if (command.phase == DRIVE and disturbed < 8) or 0 < disturbed < 8:
            action[[4, 13]], action[0] = (-0.5, 0.5), -1.0
            disturbed += 1
        again |= disturbed == 8 and command.phase == APPROACH
        _, _, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            break
    assert disturbed == 8
    assert again
    assert info["success"]


def test_what_it_wants_follows_from_the_state_alone(env: ManipulationEnv) -> None:
    """One that saw an episode of another chair before agrees to the bit with one that saw nothing."""
    expert = PushChairExpert(env.task.robot)
    for name in (SLED, SWIVEL):
        env.reset(options={"level": 3, "object": name})
        for _ in range(20):
            action = expert.act(env.snapshot, env.goal)
            assert np.abs(action).max() <= 1
            np.testing.assert_array_equal(action, PushChairExpert(env.task.robot).act(env.snapshot, env.goal))
            env.step(action)


@pytest.mark.slow
@pytest.mark.parametrize("curve_rad_m", [-0.4, 0.4])
def test_a_curve_takes_the_chair_home_on_its_side(
    env: ManipulationEnv, config: PushChairExpertConfig, curve_rad_m: float
) -> None:
    env.reset(options={"level": 1, "object": SWIVEL})
    expert = PushChairExpert(env.task.robot, dataclasses.replace(config, curve_rad_m=curve_rad_m))
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


def with_hands(snapshot: Snapshot, env: ManipulationEnv, gap_m: float, chair_xy: tuple[float, float]) -> Snapshot:
    """The same state, but for the place of the chair and for the hands, which point at their places from a gap."""
    moved = snapshot.link_position_w.copy()
    moved[0, :, :2] += np.array(chair_xy) - moved[0, 0, :2]
    snapshot = dataclasses.replace(
        snapshot,
        link_position_w=moved,
        root_velocity_w=np.zeros_like(snapshot.root_velocity_w),
        fingertip_velocity_w=np.zeros_like(snapshot.fingertip_velocity_w),
    )
    config = PushChairExpert(env.task.robot).config
    press, seat = best_press(snapshot, env, config), seat_body(snapshot, env.goal, config.hands)
    left = seat.rotation @ np.array((np.cos(press.direction_rad), np.sin(press.direction_rad), 0.0))
    tools, turns = [], []
    for side, reach in zip((-1, 1), press.reach_m, strict=True):
        tools.append(seat.position + side * (reach + 0.0085 + gap_m) * left)
        forward, across = -side * left, side * np.array((0, 0, 1.0))
        turns.append(np.stack((np.cross(across, forward), across, forward), axis=-1))
    return dataclasses.replace(snapshot, tool_position_w=np.array([tools]), tool_rotation_w=np.array([turns]))


def test_it_drives_what_it_holds_and_rests_at_the_target(env: ManipulationEnv) -> None:
    config = PushChairExpert(env.task.robot).config
    slow = dataclasses.replace(config, hands=dataclasses.replace(config.hands, lead_m_s=0.2))
    expert = PushChairExpert(env.task.robot, slow)
    outside = expert.command(with_hands(env.snapshot, env, 0.07, (1.0, 0.0)), env.goal)
    assert outside.phase == CLOSE
    assert outside.press_n == 0.0
    assert (outside.twists[:, 2] > 0.1).all(), "hands in line close in"
    snapshot = with_hands(env.snapshot, env, 0.0, (1.0, 0.0))
    driving = expert.command(snapshot, env.goal)
    assert driving.phase == DRIVE
    assert driving.press_n == expert.config.hands.press_n
    hands_w = np.einsum("aij,aj->ai", snapshot.tool_rotation_w[0], driving.twists[:, :3])
    np.testing.assert_allclose(hands_w[:, 0], -0.2, atol=0.02)
    resting = expert.command(with_hands(env.snapshot, env, 0.0, (0.01, 0.0)), env.goal)
    assert resting.phase == HOLD
    assert np.abs(resting.twists[:, :3]).max() < 0.02


def test_arms_and_base_that_are_out_of_place_go_home_first(env: ManipulationEnv) -> None:
    """The hands' twists are then those of joints that go to the arms' posture, away from the chair."""
    expert = PushChairExpert(env.task.robot)
    whole_body, near = expert.controller.whole_body, env.snapshot
    qpos = near.robot_qpos.copy()
    qpos[0, [4, 13]] += (-2.5, 2.5)
    command = expert.command(dataclasses.replace(near, robot_qpos=qpos), env.goal)
    assert command.phase == APPROACH
    state = dataclasses.replace(near, robot_qpos=qpos)
    twists_w = np.einsum("aij,akj->aki", state.tool_rotation_w[0], command.twists.reshape(2, 2, 3)).reshape(2, 6)
    qvel = whole_body.joint_velocities(state, twists_w, expert.controller._posture_qvel(state, command))
    assert qvel[4] > 1.5, "the right shoulder turns back"
    assert qvel[11] < -1.5, "and the left one"

"""The expert of MoveBucket and what it stands on: two-armed kinematics, outlines, places to press."""

import dataclasses

import numpy as np
import pytest

from artiskill.assets.catalog import load_object
from artiskill.config import CONFIG_DIR, load_config
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.experts.move_bucket import MoveBucketExpert, MoveBucketExpertConfig, PressConfig, bucket_wall
from artiskill.experts.move_bucket import choose_press as choose_press_of
from artiskill.experts.variation import load_variation, varied
from artiskill.experts.walls import Press
from artiskill.experts.whole_body import Command, WholeBodyConfig, WholeBodyController
from artiskill.sim.snapshot import Snapshot
from artiskill.tasks.move_bucket import BucketGoal, make_bucket_goal

APPROACH, CLOSE, LIFT, CARRY = range(4)


def choose_press(snapshot: Snapshot, goal: BucketGoal, config: PressConfig) -> Press:
    """As the expert does, with hands of the usual width."""
    return choose_press_of(snapshot, goal, bucket_wall(goal, 0.05), config)


@pytest.fixture
def config() -> MoveBucketExpertConfig:
    return load_config(MoveBucketExpertConfig, CONFIG_DIR / "experts" / "move_bucket.yaml")


@pytest.fixture
def env() -> ManipulationEnv:
    env = ManipulationEnv("MoveBucket", objects="bucket-0024")
    env.reset(seed=0)
    return env


def test_both_hands_follow_their_own_twists(env: ManipulationEnv) -> None:
    controller = WholeBodyController(env.task.robot, WholeBodyConfig(), arms=2)
    before = env.snapshot.tool_position_w[0]
    twists = np.array(((0.05, -0.05, 0.08, 0, 0, 0), (-0.03, 0.06, 0.02, 0, 0, 0)))
    for _ in range(20):
        qvel = controller.joint_velocities(env.snapshot, twists, np.zeros(controller.num_joints))
        env.step(controller.to_action(env.snapshot, qvel, np.full((2, 2), 0.02)))
    np.testing.assert_allclose(env.snapshot.tool_position_w[0] - before, twists[:, :3], atol=0.02)


def test_jacobian_is_the_derivative(env: ManipulationEnv) -> None:
    """Against finite differences of the engine's own kinematics."""
    controller = WholeBodyController(env.task.robot, WholeBodyConfig(), arms=2)
    simulation = env.simulation
    assert simulation is not None
    jacobian, h = controller.jacobian(env.snapshot), 1e-6
    saved = simulation.save()
    for k, joint in enumerate(controller.columns):
        ends = []
        for sign in (1, -1):
            simulation.restore(dataclasses.replace(saved, rows=saved.rows.copy()))
            simulation._qpos[0, joint] += sign * h
            simulation._batch.forward()
            ends.append(simulation.snapshot().tool_position_w[0])
        difference = (ends[0] - ends[1]) / (2 * h)
        np.testing.assert_allclose(jacobian[[0, 1, 2, 6, 7, 8], k], difference.reshape(-1), atol=1e-6)


@pytest.mark.parametrize(("bucket", "aspect"), [("bucket-0002", 1.0), ("bucket-0042", 0.665)])
def test_the_outline_is_what_collides(bucket: str, aspect: float) -> None:
    """Of a square bucket and of an oval one, across and along."""
    obj = load_object(bucket)
    goal = make_bucket_goal(obj, "base")
    outline = goal.outline[0]
    np.testing.assert_allclose(outline[:, 0] / outline[:, 18], aspect, atol=0.02)
    half_width = obj.metadata["width_m"] / 2
    assert (np.diff(outline[:, 18]) >= 0).all(), "buckets widen upwards"
    assert (outline[:, 18] < half_width + 1e-3).all()
    assert (outline[:, 18] > 0.7 * half_width).all()


def test_a_square_bucket_is_pressed_on_its_flats_away_from_the_platform() -> None:
    env = ManipulationEnv("MoveBucket", objects="bucket-0010")
    config = MoveBucketExpert(env.task.robot).config.press
    for level in range(8):
        env.reset(seed=level)
        press = choose_press(env.snapshot, env.goal, config)
        flat = np.arange(4) * np.pi / 2
        assert np.cos(press.direction_rad - flat).max() > np.cos(0.3)
        rotation = env.snapshot.link_rotation_w[0, 0, :2, :2]
        left = rotation @ np.array((np.cos(press.direction_rad), np.sin(press.direction_rad)))
        robot_side = np.array((-left[1], left[0]))  # from the bucket to where the robot will stand
        bucket = env.snapshot.link_position_w[0, 0, :2]
        assert robot_side @ bucket > -0.1, "the robot keeps the bucket between itself and the platform"


def test_it_goes_to_the_side_that_it_prefers(env: ManipulationEnv, config: MoveBucketExpertConfig) -> None:
    directions = []
    for side in (-0.6, 0.0, 0.6):
        press = dataclasses.replace(config.press, side_rad=side, side_weight=2.0)
        directions.append(choose_press(env.snapshot, env.goal, press).direction_rad)
    turns = np.angle(np.exp(1j * np.diff(directions)))
    assert (turns >= 0).all(), "counter-clockwise, as far as the bail and its shape allow"
    assert turns.sum() > 0.5


def test_palms_are_beside_the_platform_too(config: MoveBucketExpertConfig) -> None:
    """Of a bucket that somebody left close to it; by its fingertips alone a hand would come to rest on it."""
    env = ManipulationEnv("MoveBucket", objects="bucket-0007")
    env.reset(seed=0)
    moved, robot = env.snapshot.link_position_w.copy(), env.snapshot.robot_qpos.copy()
    moved[0, :, :2] += np.array((0.0, 0.47)) - moved[0, 0, :2]
    turn = env.snapshot.link_rotation_w[0, 0, :2, :2]

    def nearest_palm_m(press_config: PressConfig, bearing_rad: float) -> float:
        robot[0, :2] = moved[0, 0, :2] + 0.6 * np.array((np.sin(bearing_rad), np.cos(bearing_rad)))
        snapshot = dataclasses.replace(env.snapshot, link_position_w=moved, robot_qpos=robot)
        press = choose_press(snapshot, env.goal, press_config)
        way = turn @ (np.cos(press.direction_rad), np.sin(press.direction_rad))
        palms = moved[0, 0, :2] + np.outer((press.reach_m + 0.1) * (-1, 1), way)
        return float(np.abs(palms).max(axis=1).min())

    bearings = np.linspace(-0.6, 0.6, 13)
    half_m, fingertips = config.press.platform_half_m, dataclasses.replace(config.press, palm_m=0.0)
    assert min(nearest_palm_m(fingertips, bearing) for bearing in bearings) < half_m
    assert min(nearest_palm_m(config.press, bearing) for bearing in bearings) >= half_m


def test_the_share_decides_how_high_it_presses(env: ManipulationEnv, config: MoveBucketExpertConfig) -> None:
    def height(share: float) -> float:
        press = dataclasses.replace(config.press, share=share, height_weight=50.0)
        return choose_press(env.snapshot, env.goal, press).height_m

    heights = env.goal.outline_height[0]
    assert height(0.4) == heights[1]
    assert height(0.6) == heights[3]


def test_every_draw_of_its_variation_is_legal(config: MoveBucketExpertConfig) -> None:
    ranges = load_variation("MoveBucket").ranges
    drawn = [varied(config, ranges, np.random.default_rng(seed)) for seed in range(100)]
    assert len({one.press.side_rad for one in drawn}) == len(drawn)
    assert all(0.3 <= one.press.share <= 0.7 for one in drawn), "outlines are known there"


def test_pushing_velocities_leave_the_trunk_alone(env: ManipulationEnv) -> None:
    controller = WholeBodyController(env.task.robot, WholeBodyConfig(), arms=2)
    forces = np.array(((0.0, 30.0, 0.0), (0.0, -30.0, 0.0)))
    push = controller.pushing_velocities(env.snapshot, forces)
    assert (push[:4] == 0).all()
    lever = controller.jacobian(env.snapshot).reshape(2, 6, -1)[:, :3]
    torque = push * env.task.robot.drives.arm_damping
    np.testing.assert_allclose(torque[4:], np.einsum("ain,ai->n", lever, forces)[4:])


@pytest.mark.slow
def test_it_presses_lifts_and_carries_the_bucket_level(env: ManipulationEnv) -> None:
    expert = MoveBucketExpert(env.task.robot)
    phases, tilts, gaps, done = [], [], [], False
    while not done:
        command = expert.command(env.snapshot, env.goal)
        phases.append(command.phase)
        _, _, terminated, truncated, info = env.step(expert.controller.action(env.snapshot, command))
        tilts.append(float(np.arccos(min(1.0, env.snapshot.link_rotation_w[0, 0, 2, 2]))))
        if command.phase == CARRY:
            gaps.append(np.linalg.norm(np.diff(env.snapshot.tool_position_w[0], axis=0)))
        done = terminated or truncated
    assert info["success"]
    assert [p for i, p in enumerate(phases) if i == 0 or p != phases[i - 1]] == [APPROACH, CLOSE, LIFT, CARRY]
    assert max(tilts) < 0.1, "the bucket stays level"
    assert np.ptp(gaps) < 0.005, "the hands neither slip nor squeeze through the wall"


def test_what_it_wants_follows_from_the_state_alone(env: ManipulationEnv) -> None:
    """One that saw an episode of another bucket before agrees to the bit with one that saw nothing."""
    other = ManipulationEnv("MoveBucket", objects="bucket-0002")
    other.reset(seed=3)
    expert = MoveBucketExpert(env.task.robot)
    for _ in range(20):
        other.step(expert.act(other.snapshot, other.goal))
    for _ in range(20):
        action = expert.act(env.snapshot, env.goal)
        assert np.abs(action).max() <= 1
        np.testing.assert_array_equal(action, MoveBucketExpert(env.task.robot).act(env.snapshot, env.goal))
        env.step(action)


@pytest.mark.slow
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_it_carries_in_a_curve_and_holds_aside(
    env: ManipulationEnv, config: MoveBucketExpertConfig, sign: float
) -> None:
    changed = dataclasses.replace(config, curve_rad_m=0.5 * sign, aside_m=0.1 * sign)
    expert = MoveBucketExpert(env.task.robot, changed)
    expert.reset(env.snapshot, env.goal)
    start = env.snapshot.link_position_w[0, 0, :2]
    done = False
    while not done:
        _, _, terminated, truncated, info = env.step(expert.act(env.snapshot, env.goal))
        done = terminated or truncated
    assert info["success"]
    position = env.snapshot.link_position_w[0, 0]
    heading = np.array((np.cos(env.snapshot.robot_qpos[0, 2]), np.sin(env.snapshot.robot_qpos[0, 2])))
    left = np.array((-heading[1], heading[0]))
    assert sign * (position[:2] @ left) > 0.03
    assert np.linalg.norm(position[:2]) < np.linalg.norm(start)


def with_level_share(config: MoveBucketExpertConfig, share: float) -> MoveBucketExpertConfig:
    return dataclasses.replace(config, hands=dataclasses.replace(config.hands, level_share=share))


@pytest.mark.slow
def test_hands_level_a_bucket_that_has_tilted(env: ManipulationEnv, config: MoveBucketExpertConfig) -> None:
    """The base is made to jerk just after the lift."""

    def tilt_at_end(level_share: float) -> float:
        env.reset(options={"level": 7, "object": "bucket-0031"})
        expert = MoveBucketExpert(env.task.robot, with_level_share(config, level_share))
        carried = 0
        while carried < 25:
            command = expert.command(env.snapshot, env.goal)
            action = expert.controller.action(env.snapshot, command)
            carried += command.phase >= LIFT
            if 2 < carried < 8:
                action[0] = -0.5
            env.step(action)
        return float(np.arccos(min(1.0, env.snapshot.link_rotation_w[0, 0, 2, 2])))

    assert tilt_at_end(0.7) < 0.7 * tilt_at_end(0.0)


def with_hands(
    snapshot: Snapshot, press: Press, gap_m: float, aside_m: float = 0.0, turned: bool = False
) -> Snapshot:
    """The same state, but for the hands: fingertips at a gap from the places, above their line, level or not."""
    rotation, root = snapshot.link_rotation_w[0, 0], snapshot.link_position_w[0, 0]
    left = rotation @ np.array((np.cos(press.direction_rad), np.sin(press.direction_rad), 0.0))
    tools, turns = [], []
    for side, reach in zip((-1, 1), press.reach_m, strict=True):
        out = reach + 0.0085 + gap_m
        tools.append(root + (press.height_m + aside_m) * rotation[:, 2] + side * out * left)
        forward = -side * left
        across = np.array((0, 0, 1.0)) if turned else np.cross((0, 0, 1.0), forward)
        turns.append(np.stack((np.cross(across, forward), across, forward), axis=-1))
    return dataclasses.replace(snapshot, tool_position_w=np.array([tools]), tool_rotation_w=np.array([turns]))


def inwards_m_s(command: Command) -> np.ndarray:
    """How fast both hands go the way that they point, (2,)."""
    return command.twists[:, 2]


def test_hands_that_are_in_line_close_in_and_others_keep_off(env: ManipulationEnv) -> None:
    expert = MoveBucketExpert(env.task.robot)
    press = choose_press(env.snapshot, env.goal, expert.config.press)
    in_line = expert.command(with_hands(env.snapshot, press, 0.06), env.goal)
    above = expert.command(with_hands(env.snapshot, press, 0.06, aside_m=0.06), env.goal)
    turned = expert.command(with_hands(env.snapshot, press, 0.06, turned=True), env.goal)
    assert (in_line.phase, above.phase, turned.phase) == (CLOSE, APPROACH, APPROACH)
    assert (inwards_m_s(in_line) > 0.1).all()
    for command in (above, turned):
        assert (inwards_m_s(command) < 0.0).all()
        assert command.press_n == 0.0


def test_what_it_wants_changes_smoothly_on_the_way_in(env: ManipulationEnv) -> None:
    expert = MoveBucketExpert(env.task.robot)
    press = choose_press(env.snapshot, env.goal, expert.config.press)
    for aside in (0.0, 0.02, 0.04):
        ways = [
            expert.command(with_hands(env.snapshot, press, gap, aside), env.goal)
            for gap in np.arange(0.1, 0.0, -0.002)
        ]
        twists = np.array([command.twists[:, :3] for command in ways])
        assert np.abs(np.diff(twists, axis=0)).max() < 0.1
        assert np.abs(np.diff([command.press_n for command in ways])).max() < 12


def test_the_force_grows_as_the_hands_arrive_and_falls_as_they_slip(env: ManipulationEnv) -> None:
    expert = MoveBucketExpert(env.task.robot)
    press = choose_press(env.snapshot, env.goal, expert.config.press)
    forces = [
        expert.command(with_hands(env.snapshot, press, gap, aside), env.goal).press_n
        for gap, aside in ((0.04, 0.0), (0.02, 0.0), (0.0, 0.0), (0.0, 0.2))
    ]
    assert forces[0] == 0 < forces[1] < forces[2] == expert.config.hands.press_n
    assert forces[3] == 0


def test_it_lifts_what_it_holds_and_carries_what_it_has_lifted(env: ManipulationEnv) -> None:
    expert = MoveBucketExpert(env.task.robot)
    press = choose_press(env.snapshot, env.goal, expert.config.press)
    snapshot = with_hands(env.snapshot, press, 0.0)
    still = dataclasses.replace(snapshot, fingertip_velocity_w=np.zeros_like(snapshot.fingertip_velocity_w))
    assert expert.command(still, env.goal).phase == LIFT
    up, moved = np.array((0, 0, 0.15)), ("link_position_w", "tool_position_w", "finger_line_w")
    high = dataclasses.replace(still, **{name: getattr(still, name) + up for name in moved})
    command = expert.command(high, env.goal)
    assert command.phase == CARRY
    hands_w = np.einsum("aij,aj->ai", high.tool_rotation_w[0], command.twists[:, :3])
    bucket = high.link_position_w[0, 0, :2]
    assert (hands_w[:, :2] @ bucket < 0).all(), "towards the platform, which is at the origin"


def test_hands_keep_off_the_bail(config: MoveBucketExpertConfig) -> None:
    """The bail of this bucket hangs where it would be pressed else."""
    env, press = ManipulationEnv("MoveBucket", objects="bucket-0033"), config.press
    env.reset(seed=1)

    def missing_m(config: PressConfig) -> float:
        """How much too near the bail is to one of the hands, in height."""
        chosen, goal, now = choose_press(env.snapshot, env.goal, config), env.goal, env.snapshot
        link = goal.point_link[0]
        moving = np.flatnonzero(link > 0)
        world = np.einsum("nij,nj->ni", now.link_rotation_w[0, link[moving]], goal.points[0, moving])
        world += now.link_position_w[0, link[moving]] - now.link_position_w[0, 0]
        points = world @ now.link_rotation_w[0, 0]
        left = np.array((np.cos(chosen.direction_rad), np.sin(chosen.direction_rad)))
        found = 0.0
        for side, reach in zip((-1, 1), chosen.reach_m, strict=True):
            along, across = points[:, :2] @ (side * left), points[:, :2] @ (-left[1], left[0])
            before = (along > reach - 0.01) & (np.abs(across) < press.bail_band_m)
            gap = np.abs(points[before, 2] - chosen.height_m).min(initial=np.inf)
            found = max(found, press.bail_clearance_m - gap)
        return found

    assert missing_m(dataclasses.replace(press, bail_weight=0.0)) > 0.01
    assert missing_m(press) < 0.001


def test_hands_stay_clear_of_the_platform(env: ManipulationEnv, config: MoveBucketExpertConfig) -> None:
    """A bucket that was dropped stands right before it."""
    moved = env.snapshot.link_position_w.copy()
    moved[0, :, :2] += (0.44, 0.0) - moved[0, 0, :2]
    snapshot = dataclasses.replace(env.snapshot, link_position_w=moved)

    def lowest_above_platform(weight: float) -> float:
        chosen = dataclasses.replace(config.press, platform_weight=weight, side_rad=1.57, side_weight=10.0)
        press = choose_press(snapshot, env.goal, chosen)
        left = moved[0, 0, :2] + press.reach_m[1] * np.array(
            (
                np.cos(press.direction_rad + heading(snapshot)),
                np.sin(press.direction_rad + heading(snapshot)),
            )
        )
        right = 2 * moved[0, 0, :2] - left
        near = min(np.abs(left).max(), np.abs(right).max())
        return press.height_m if near < 0.35 else np.inf

    assert lowest_above_platform(0.0) < 0.13
    assert lowest_above_platform(60.0) > 0.13


def heading(snapshot: Snapshot) -> float:
    """The bucket's yaw."""
    return float(np.arctan2(snapshot.link_rotation_w[0, 0, 1, 0], snapshot.link_rotation_w[0, 0, 0, 0]))


def test_a_gap_between_two_staves_does_not_matter(env: ManipulationEnv, config: MoveBucketExpertConfig) -> None:
    whole = choose_press(env.snapshot, env.goal, config.press)
    outline = env.goal.outline.copy()
    outline[:, :, 4::9] = 0.0
    press = choose_press(env.snapshot, dataclasses.replace(env.goal, outline=outline), config.press)
    np.testing.assert_allclose(press.outline_m, whole.outline_m, atol=0.005)
    assert press.height_m == whole.height_m

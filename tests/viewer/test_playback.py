"""Timelines and the player; no browser, no viser."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demos import PACK
from artiskill.demos.recording import digest_of
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ArtiSkillError, DemoError, PolicyError, UnknownNameError
from artiskill.evaluation.pictures import EpisodeChoice
from artiskill.evaluation.policies import ExpertActor
from artiskill.geometry.rotations import quat_from_axis_angle, quat_multiply, quat_to_matrix, transform_points
from artiskill.sim.snapshot import Snapshot
from artiskill.viewer.playback import (
    NOT_SOLVED,
    SOLVED,
    LiveEpisode,
    Player,
    RecordedEpisode,
    recorded_episode,
    reward_text,
    state_text,
)

STEP_S = 0.05


class Growing:
    """A timeline that grows up to a length; moments know their number."""

    def __init__(self, most: int, known: int = 1) -> None:
        self.most, self.known = most, known

    @property
    def is_complete(self) -> bool:
        return self.known == self.most

    def __len__(self) -> int:
        return self.known

    def moment(self, step: int) -> Any:
        assert 0 <= step < self.known
        return SimpleNamespace(number=step, context=SimpleNamespace(snapshot=SimpleNamespace(step_s=STEP_S)))

    def extend(self) -> None:
        assert not self.is_complete
        self.known += 1


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


def player_of(timeline: Any, clock: Clock) -> Player:
    return Player(timeline, clock)


def test_a_player_begins_paused(clock: Clock) -> None:
    player = player_of(Growing(10), clock)
    clock.now += 5.0
    assert not player.update()
    assert player.position == 0


@pytest.mark.parametrize(("speed", "steps"), [("1/2", 1), ("1", 2), ("2", 4), ("4", 8)])
def test_it_plays_as_fast_as_asked(clock: Clock, speed: str, steps: int) -> None:
    player = player_of(Growing(100), clock)
    player.set_speed(speed)
    player.play()
    for k in range(1, 6):
        clock.now += 2 * STEP_S + 1e-9
        assert player.update()
        assert player.position == k * steps
        assert player.moment.number == player.position  # type: ignore[attr-defined]


def test_time_between_two_steps_is_not_lost(clock: Clock) -> None:
    player = player_of(Growing(100), clock)
    player.play()
    shown = []
    for _ in range(10):
        clock.now += 0.6 * STEP_S + 1e-9
        shown.append(player.update())
    assert player.position == 6
    assert shown.count(True) == 6


def test_who_is_slow_falls_behind_instead_of_jumping(clock: Clock) -> None:
    player = player_of(Growing(1000), clock)
    player.play()
    clock.now += 60.0
    player.update()
    assert player.position == 8
    clock.now += STEP_S + 1e-9
    player.update()
    assert player.position == 9


def test_it_stops_at_the_end_and_plays_again_from_the_beginning(clock: Clock) -> None:
    player = player_of(Growing(4), clock)
    player.play()
    clock.now += 1.0
    assert player.update()
    assert (player.position, player.is_playing, player.at_end) == (3, False, True)
    player.toggle()
    assert (player.position, player.is_playing) == (0, True)
    player.toggle()
    assert not player.is_playing


def test_stepping_extends_and_stays_within_the_episode(clock: Clock) -> None:
    player = player_of(Growing(3), clock)
    player.play()
    player.step()
    assert (player.position, player.is_playing, len(player.timeline)) == (1, False, 2)
    player.step(-5)
    assert player.position == 0
    player.step(50)
    assert (player.position, len(player.timeline)) == (2, 3)


def test_seeking_shows_what_is_known_and_simulates_nothing(clock: Clock) -> None:
    player = player_of(Growing(50, known=10), clock)
    player.seek(5)
    assert player.position == 5
    player.seek(40)
    assert (player.position, len(player.timeline)) == (9, 10)


def test_an_unknown_speed(clock: Clock) -> None:
    with pytest.raises(UnknownNameError, match="unknown speed '3'"):
        player_of(Growing(3), clock).set_speed("3")


def test_a_live_episode_is_that_of_the_environment(choice: EpisodeChoice) -> None:
    episode, actor = LiveEpisode(choice), ExpertActor()
    env = ManipulationEnv(choice.task, objects=[choice.object])
    observation, info = env.reset(options={"level": 3})
    actor.reset(env, observation, info)
    done, step = False, 0
    while not done:
        found = episode.moment(step)
        np.testing.assert_array_equal(found.context.snapshot.body_position_w, env.snapshot.body_position_w)
        assert found.flags == info["flags"]
        assert found.reward_terms == info["reward_terms"]
        assert (found.end, found.context.elapsed) == ("", step)
        assert not episode.is_complete
        observation, reward, terminated, truncated, info = env.step(actor.act(env, observation))
        done, step = terminated or truncated, step + 1
        episode.extend()
        assert episode.moment(step).reward == reward
    assert info["success"]
    assert episode.is_complete
    assert len(episode) == step + 1
    assert episode.moment(step).end == SOLVED
    assert "cabinet-0002" in episode.title


def test_what_is_read_of_a_moment(choice: EpisodeChoice) -> None:
    episode = LiveEpisode(choice)
    episode.extend()
    moment = episode.moment(1)
    assert "**step 1** (0.05 s)" in state_text(moment)
    assert all(name in state_text(moment) for name in moment.flags)
    assert all(f"| {name} | {value:.3f} |" in reward_text(moment) for name, value in moment.reward_terms.items())


def test_an_episode_that_is_not_solved(choice: EpisodeChoice) -> None:
    still = EpisodeChoice(choice.task, choice.object, policy="still", config={"episode_steps": 2})
    episode = LiveEpisode(still)
    while not episode.is_complete:
        episode.extend()
    assert len(episode) == 3
    assert episode.moment(2).end == NOT_SOLVED


def test_a_policy_that_fails_ends_its_episode_and_says_so(choice: EpisodeChoice) -> None:
    def policy(observation: np.ndarray) -> np.ndarray:
        raise ValueError("no idea")

    player = Player(LiveEpisode(EpisodeChoice(choice.task, choice.object, policy=policy)))
    player.step()
    assert player.at_end
    assert "no idea" in player.moment.end
    assert PolicyError.__name__ in player.moment.end


@pytest.fixture(scope="module")
def demos() -> DemoFile:
    pytest.importorskip("h5py")
    return DemoFile(PACK / "OpenCabinetDrawer" / "cabinet-0002.h5")


def test_a_demonstration_has_its_exact_states_at_any_step(demos: DemoFile, rng: np.random.Generator) -> None:
    trajectory, env = demos.trajectory(0), demos.make_env()
    episode = RecordedEpisode(trajectory, demos.make_env(), "one")
    wanted = {
        step: env.restore_state(state) and env.snapshot for step, state in enumerate(trajectory.env_states(env))
    }
    assert len(episode) == len(trajectory) + 1 == len(wanted)
    for step in rng.permutation(len(episode)).tolist():
        found = episode.moment(step)
        for name in ("body_position_w", "body_quaternion_w", "robot_qvel", "previous_link_position_w"):
            np.testing.assert_array_equal(getattr(found.context.snapshot, name), getattr(wanted[step], name))
        assert found.context.elapsed == step
        assert found.reward == (trajectory.rewards[step - 1] if step else 0.0)
    assert found is episode.moment(step)
    assert episode.moment(len(trajectory)).end == SOLVED
    assert episode.moment(len(trajectory) - 1).end == ""
    assert digest_of(trajectory.env_state(len(trajectory), env).simulation) == trajectory.recording.digests[-1]


def test_a_demonstration_that_comes_out_otherwise(demos: DemoFile) -> None:
    trajectory = demos.trajectory(0)
    trajectory.recording.actions[3] = 0.5
    with pytest.raises(DemoError, match="step 4 is another one"):
        RecordedEpisode(trajectory, demos.make_env(), "one")


def test_which_demonstrations_there_are(demos: DemoFile) -> None:
    assert "demonstration 1 of" in recorded_episode(demos, 1).title
    with pytest.raises(IndexError):
        recorded_episode(demos, len(demos))


@pytest.mark.parametrize("change", [{"task": "Nothing"}, {"object": "cabinet-9999"}, {"policy": "nobody"}])
def test_what_there_is_not(choice: EpisodeChoice, change: dict[str, str]) -> None:
    values = {"task": choice.task, "object": choice.object, **change}
    with pytest.raises(ArtiSkillError, match=next(iter(change.values()))):
        LiveEpisode(EpisodeChoice(**values))


def tool_error(episode: LiveEpisode, arm: int = 0) -> tuple[float, float]:
    """Distance (m) and angle (rad) of a hand to where it shall be."""
    snapshot = episode.moment(len(episode) - 1).context.snapshot
    turn = quat_to_matrix(episode.hand.quaternions_w[arm])
    cosine = (np.trace(turn.T @ snapshot.tool_rotation_w[0, arm]) - 1) / 2
    distance = np.linalg.norm(snapshot.tool_position_w[0, arm] - episode.hand.positions_w[arm])
    return float(distance), float(np.arccos(np.clip(cosine, -1, 1)))


@pytest.mark.parametrize("task", ["OpenCabinetDrawer", "PushChair"])
def test_hands_go_where_a_person_puts_them(task: str) -> None:
    obj = {"OpenCabinetDrawer": "cabinet-0002", "PushChair": "chair-0004"}[task]
    episode = LiveEpisode(EpisodeChoice(task, obj))
    episode.take_over(0, by_hand=True)
    hand = episode.hand
    for arm in range(len(hand.positions_w)):
        hand.positions_w[arm] += (-0.08, 0.05, 0.1)
        turn = quat_from_axis_angle((0.0, 0.0, 1.0), 0.3)
        hand.quaternions_w[arm] = quat_multiply(turn, hand.quaternions_w[arm])
    assert tool_error(episode)[0] > 0.1
    for _ in range(50):
        episode.extend()
    for arm in range(len(hand.positions_w)):
        distance, angle = tool_error(episode, arm)
        assert distance < 0.005
        assert angle < 0.02


def test_the_trunk_is_pushed_and_takes_the_hands_along() -> None:
    episode = LiveEpisode(EpisodeChoice("OpenCabinetDrawer", "cabinet-0002"))
    episode.take_over(0, by_hand=True)
    first = episode.moment(0).context.snapshot
    episode.hand.has_moved_on = False
    for _ in range(10):
        episode.hand.push((1.0, 0.0, 0.0, 0.0))
        episode.extend()
    assert episode.hand.has_moved_on
    for _ in range(20):
        episode.extend()
    last = episode.moment(30).context.snapshot
    yaw = float(first.robot_qpos[0, 2])
    way = last.robot_qpos[0, :2] - first.robot_qpos[0, :2]
    steps = 10 + 2  # of the last push two are left
    assert way @ (np.cos(yaw), np.sin(yaw)) == pytest.approx(0.5 * steps * STEP_S, abs=0.05)
    np.testing.assert_allclose((last.tool_position_w - first.tool_position_w)[0, 0, :2], way, atol=0.02)


@pytest.mark.parametrize("opening_m", [0.0, 0.03])
def test_fingers_open_and_close(opening_m: float) -> None:
    episode = LiveEpisode(EpisodeChoice("OpenCabinetDrawer", "cabinet-0002"))
    episode.take_over(0, by_hand=True)
    episode.hand.opening_m = opening_m
    for _ in range(20):
        episode.extend()
    np.testing.assert_allclose(episode.moment(20).context.snapshot.robot_qpos[0, -2:], opening_m, atol=1e-3)


def test_a_person_takes_over_in_the_middle_and_hands_back(choice: EpisodeChoice) -> None:
    episode = LiveEpisode(choice)
    while not episode.is_complete:
        episode.extend()
    before = episode.moment(20)
    episode.take_over(20, by_hand=True)
    assert len(episode) == 21
    assert episode.moment(20) is before
    assert not episode.is_complete
    episode.hand.positions_w[0] += (0.0, 0.0, 0.05)
    for _ in range(10):
        episode.extend()
    assert episode.moment(30).context.elapsed == 30
    episode.take_over(30, by_hand=False)
    while not episode.is_complete:
        episode.extend()
    assert episode.moment(len(episode) - 1).end == SOLVED


def test_who_takes_over_at_the_last_step_but_one_can_still_fail(choice: EpisodeChoice) -> None:
    episode = LiveEpisode(EpisodeChoice(choice.task, choice.object, policy="still", config={"episode_steps": 3}))
    while not episode.is_complete:
        episode.extend()
    episode.take_over(3, by_hand=True)
    assert episode.is_complete
    assert episode.moment(3).end == NOT_SOLVED


class Person:
    """Drives a robot with one hand: with the buttons until the hand is near, then with the gizmo."""

    def __init__(self, episode: LiveEpisode) -> None:
        episode.take_over(0, by_hand=True)
        self.episode, self.hand = episode, episode.hand

    @property
    def snapshot(self) -> Snapshot:
        return self.episode.moment(len(self.episode) - 1).context.snapshot

    def wait(self, steps: int) -> None:
        for _ in range(steps):
            if not self.episode.is_complete:
                self.episode.extend()

    def drive_to(self, goal_w: np.ndarray) -> None:
        for _ in range(100):
            x, y, z = goal_w - self.snapshot.tool_position_w[0, 0]
            if max(abs(x), abs(y), abs(z)) < 0.03:
                break
            yaw = float(self.snapshot.robot_qpos[0, 2])
            cosine, sine = np.cos(yaw), np.sin(yaw)
            self.hand.push(
                np.clip((3 * (cosine * x + sine * y), 3 * (cosine * y - sine * x), 0.0, 3 * z), -0.6, 0.6)
            )
            self.wait(1)
        self.wait(6)

    def put_hand(self, position_w: np.ndarray, quaternion_w: np.ndarray) -> None:
        self.hand.positions_w[0], self.hand.quaternions_w[0] = position_w, quaternion_w
        self.wait(25)


def test_a_drawer_is_opened_by_hand() -> None:
    """Drive to the handle, turn the hand, close the fingers, drive back."""
    choice = EpisodeChoice("OpenCabinetDrawer", "cabinet-0002", level=3, config={"episode_steps": 1000})
    person = Person(LiveEpisode(choice))
    obj, episode = person.episode.scene.object, person.episode
    handle, link = obj.handles_of(episode.target)[0], obj.link_index(episode.target)
    position, quaternion = (
        getattr(person.snapshot, f"link_{name}_w")[0, link] for name in ("position", "quaternion")
    )
    grasp_w = transform_points(position, quaternion, handle.grasp_positions[:1])[0]
    turn_w = quat_multiply(quaternion, handle.grasp_quaternions[0])
    before_w = grasp_w - 0.2 * quat_to_matrix(turn_w)[:, 2]
    person.hand.opening_m = 0.04
    person.drive_to(before_w)
    person.put_hand(before_w, turn_w)
    person.drive_to(grasp_w)
    person.put_hand(grasp_w, turn_w)
    person.hand.opening_m = 0.0
    person.wait(15)
    for _ in range(30):
        person.hand.push((-0.5, 0.0, 0.0, 0.0))
        person.wait(1)
    person.wait(30)
    assert episode.moment(len(episode) - 1).end == SOLVED

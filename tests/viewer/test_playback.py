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

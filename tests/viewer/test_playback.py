"""Timelines and the player; no browser, no viser."""

import threading
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ArtiSkillError, PolicyError, UnknownNameError
from artiskill.evaluation.pictures import EpisodeChoice
from artiskill.evaluation.policies import ExpertActor
from artiskill.evaluation.serve import PolicyServer
from artiskill.viewer.playback import (
    NOT_SOLVED,
    SOLVED,
    LiveEpisode,
    Player,
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


def test_a_slow_policy_does_not_hold_up_the_page(clock: Clock) -> None:
    class Slow(Growing):
        def extend(self) -> None:
            clock.now += 0.1
            super().extend()

    player = player_of(Slow(100), clock)
    player.play()
    for k in range(1, 5):
        clock.now += 2 * STEP_S
        assert player.update()
        assert player.position == k


def test_pictures_between_two_steps(clock: Clock) -> None:
    player = player_of(Growing(100), clock)
    player.step(3)
    assert [found.number for found in player.between()[:2]] == [3, 3]  # type: ignore[attr-defined]
    player.play()
    clock.now += STEP_S + 1e-9
    player.update()
    clock.now += 0.25 * STEP_S
    before, after, share = player.between()
    assert (before.number, after.number) == (3, 4)  # type: ignore[attr-defined]
    assert share == pytest.approx(0.25, abs=1e-3)
    player.pause()
    assert player.between()[2] == 1.0


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


@pytest.mark.parametrize("change", [{"task": "Nothing"}, {"object": "cabinet-9999"}, {"policy": "nobody"}])
def test_what_there_is_not(choice: EpisodeChoice, change: dict[str, str]) -> None:
    values = {"task": choice.task, "object": choice.object, **change}
    with pytest.raises(ArtiSkillError, match=next(iter(change.values()))):
        LiveEpisode(EpisodeChoice(**values))


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


def test_a_served_policy_goes_on_after_a_person(choice: EpisodeChoice) -> None:
    with PolicyServer("pretrained", 0, task=choice.task, on_event=lambda text: None) as server:
        thread = threading.Thread(target=server.run)
        thread.start()
        episode = LiveEpisode(replace(choice, policy=server.url))
        for _ in range(15):
            episode.extend()
        episode.take_over(10, by_hand=True)
        for _ in range(5):
            episode.hand.push((0.0, 0.2, 0.0, 0.0))
            episode.extend()
        episode.take_over(15, by_hand=False)
        while not episode.is_complete:
            episode.extend()
        assert episode.moment(len(episode) - 1).end == SOLVED
        episode.close()
    thread.join(10)
    assert not thread.is_alive()

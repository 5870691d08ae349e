"""Hands, trunk and fingers go where a person wants them; what a person solves becomes a demonstration."""

from pathlib import Path

import numpy as np
import pytest

from artiskill.demos.demos import PACK, Demos
from artiskill.demos.settings import HUMAN
from artiskill.demos.verify import verify
from artiskill.errors import DemoError
from artiskill.evaluation.pictures import EpisodeChoice
from artiskill.geometry.rotations import quat_from_axis_angle, quat_multiply, quat_to_matrix
from artiskill.viewer.playback import SOLVED, LiveEpisode

STEP_S = 0.05


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


def test_what_a_hand_wants_goes_with_the_trunk() -> None:
    """A hand that is on its way, or presses against something, goes on while the trunk turns, rolls and rises."""
    episode = LiveEpisode(EpisodeChoice("OpenCabinetDrawer", "cabinet-0002"))
    episode.take_over(0, by_hand=True)
    hand = episode.hand

    def in_trunk(positions_w: np.ndarray) -> np.ndarray:
        x, y, yaw, lift = episode.moment(len(episode) - 1).context.snapshot.robot_qpos[0, :4]
        turn = quat_to_matrix(quat_from_axis_angle((0.0, 0.0, 1.0), yaw))
        found: np.ndarray = (positions_w - (x, y, lift)) @ turn
        return found

    hand.positions_w[0] += (-0.05, 0.05, 0.1)
    wanted = in_trunk(hand.positions_w)
    for _ in range(15):
        hand.push((0.4, 0.2, 0.2, 0.3))
        episode.extend()
    for _ in range(30):
        episode.extend()
    snapshot = episode.moment(len(episode) - 1).context.snapshot
    np.testing.assert_allclose(in_trunk(hand.positions_w), wanted, atol=0.01)
    np.testing.assert_allclose(snapshot.tool_position_w[0], hand.positions_w, atol=0.005)


@pytest.mark.parametrize("opening_m", [0.0, 0.03])
def test_fingers_open_and_close(opening_m: float) -> None:
    episode = LiveEpisode(EpisodeChoice("OpenCabinetDrawer", "cabinet-0002"))
    episode.take_over(0, by_hand=True)
    episode.hand.opening_m = opening_m
    for _ in range(20):
        episode.extend()
    np.testing.assert_allclose(episode.moment(20).context.snapshot.robot_qpos[0, -2:], opening_m, atol=1e-3)


def test_a_hand_that_was_dragged_out_of_reach_comes_back() -> None:
    episode = LiveEpisode(EpisodeChoice("MoveBucket", "bucket-0001", policy="still"))
    episode.take_over(0, by_hand=True)
    home = episode.hand.positions_w.copy()
    for away_m, is_there in ((0.8, False), (0.0, True)):
        episode.hand.positions_w[:] = np.add(home, (0.0, 0.0, away_m))
        for _ in range(60):
            episode.extend()
        for arm in (0, 1):
            assert (tool_error(episode, arm)[0] < 0.01) is is_there


def test_two_hands_move_as_one() -> None:
    episode = LiveEpisode(EpisodeChoice("MoveBucket", "bucket-0001", policy="still"))
    episode.take_over(0, by_hand=True)
    hand = episode.hand
    hand.join()
    for _ in range(10):
        hand.push((0.4, 0.0, 0.2, 0.0))
        episode.extend()
    assert hand.pair is not None
    turn = quat_multiply(hand.pair.quaternion_w, quat_from_axis_angle((0.0, 1.0, 0.0), 0.2))
    hand.move_pair(np.add(hand.pair.position_w, (0.0, 0.0, 0.1)), turn, 0.3)
    for _ in range(50):
        episode.extend()
    snapshot = episode.moment(len(episode) - 1).context.snapshot
    right, left = snapshot.tool_position_w[0]
    np.testing.assert_allclose((right + left) / 2, hand.pair.position_w, atol=0.005)
    across = quat_to_matrix(hand.pair.quaternion_w)[:, 1]  # it has gone along with the trunk
    np.testing.assert_allclose((left - right) / 0.3, across, atol=0.02)
    forward = snapshot.tool_rotation_w[0, :, :, 2]
    np.testing.assert_allclose(forward[0], across, atol=0.02)
    np.testing.assert_allclose(forward[1], -forward[0], atol=0.02)
    hand.reset(episode._env, None, {})
    assert hand.pair is None


def test_a_trunk_that_is_not_pushed_stays() -> None:
    """While the hands press on each other's wrists, say; drives alone would yield."""
    episode = LiveEpisode(EpisodeChoice("MoveBucket", "bucket-0001", policy="still"))
    episode.take_over(0, by_hand=True)
    before = episode.moment(0).context.snapshot.robot_qpos[0, :4]
    episode.hand.join()
    for apart_m in (0.3, -0.3):  # the hands meet, and press
        pair = episode.hand.pair
        assert pair is not None
        episode.hand.move_pair(pair.position_w, pair.quaternion_w, apart_m)
        for _ in range(60):
            episode.extend()
    snapshot = episode.moment(len(episode) - 1).context.snapshot
    assert np.linalg.norm(np.diff(snapshot.tool_position_w[0], axis=0)) < 0.25
    np.testing.assert_allclose(snapshot.robot_qpos[0, :4], before, atol=0.03)


def test_what_a_person_solves_is_a_demonstration_that_verifies(choice: EpisodeChoice, tmp_path: Path) -> None:
    """The policy acts, a person in the middle, then the policy again; twice, on two levels."""
    pytest.importorskip("h5py")
    for number, level in enumerate((3, 4)):
        episode = LiveEpisode(EpisodeChoice(choice.task, choice.object, level=level))
        for _ in range(30):
            episode.extend()
        episode.take_over(10, by_hand=True)
        for _ in range(5):
            episode.hand.push((0.0, 0.2, 0.0, 0.0))
            episode.extend()
        episode.take_over(15, by_hand=False)
        while not episode.is_complete:
            episode.extend()
        assert episode.was_driven
        last = episode.moment(len(episode) - 1)
        assert last.end == SOLVED
        episode.check_store(tmp_path / "mine")
        assert episode.store(tmp_path / "mine") == f"demonstration {number} in {tmp_path}/mine/cabinet-0002.h5"
    (result,) = verify(tmp_path / "mine")
    assert (result.trajectories, result.exact, result.faults) == (2, 2, ())
    demos = Demos(tmp_path / "mine", check=True)
    assert demos.manifest.settings.expert.kind == HUMAN
    with demos.open("cabinet-0002") as file:
        stored = file.trajectory(1)
        assert (stored.level, stored.success) == (4, True)
        assert np.flatnonzero(~stored.disturbed).tolist() == [10, 11, 12, 13, 14]
        assert sum(count.attempts for count in file.header.targets) == 2


def test_a_folder_of_other_demonstrations_is_refused_before_anybody_drives(choice: EpisodeChoice) -> None:
    pytest.importorskip("h5py")
    with pytest.raises(DemoError, match="holds demonstrations of other settings"):
        LiveEpisode(choice).check_store(PACK / choice.task)
    with pytest.raises(DemoError, match="holds demonstrations of PushChair, not of OpenCabinetDrawer"):
        LiveEpisode(choice).check_store(PACK / "PushChair")

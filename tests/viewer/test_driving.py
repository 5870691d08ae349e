"""Hands, trunk and fingers go where a person wants them; what a person solves becomes a demonstration."""

from pathlib import Path

import numpy as np
import pytest

from artiskill.demos.demos import PACK, Demos
from artiskill.demos.recording import digest_of
from artiskill.demos.settings import HUMAN
from artiskill.demos.verify import verify
from artiskill.errors import DemoError
from artiskill.evaluation.pictures import EpisodeChoice
from artiskill.geometry.rotations import quat_from_axis_angle, quat_multiply, quat_to_matrix, transform_points
from artiskill.sim.snapshot import Snapshot
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


def open_drawer_by_hand() -> LiveEpisode:
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
    return episode


def test_a_drawer_is_opened_by_hand_and_stored_bit_for_bit(tmp_path: Path) -> None:
    pytest.importorskip("h5py")
    episode = open_drawer_by_hand()
    last = episode.moment(len(episode) - 1)
    assert last.end == SOLVED
    episode.store(tmp_path)
    with Demos(tmp_path).open("cabinet-0002") as file:
        stored = file.trajectory(0)
    assert stored.recording.digests[-1] == digest_of(last.state.simulation)
    assert not stored.disturbed.any()


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

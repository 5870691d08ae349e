"""Every task is solved once by hand: with the page's buttons, sliders and gizmos alone, and stored bit for bit."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.viewer.test_pages import PERSON, use, widget

from artiskill.demos.demos import Demos
from artiskill.demos.recording import digest_of
from artiskill.demos.settings import HUMAN
from artiskill.demos.verify import verify
from artiskill.evaluation.pictures import EpisodeChoice
from artiskill.geometry.rotations import quat_from_axis_angle, quat_multiply, quat_to_matrix, transform_points
from artiskill.sim.snapshot import Snapshot
from artiskill.viewer.episode_page import EpisodePage
from artiskill.viewer.pickers import LivePicker
from artiskill.viewer.playback import SOLVED, LiveEpisode

STEPS = 3000
FORWARD, LEFT = ("forward (I)", "back (K)"), ("left (J)", "right (L)")
YAW, LIFT = ("turn left (U)", "turn right (O)"), ("up (Y)", "down (H)")


class Person:
    """Who sits before the page: sees where everything is, and uses what the page offers."""

    def __init__(self, server: Any, choice: EpisodeChoice, folder: Path) -> None:
        self.server = server
        self.page = EpisodePage(server, LivePicker(choice), plays=False, record=folder)
        self.use("Button", "drive", True)

    @property
    def episode(self) -> LiveEpisode:
        assert isinstance(self.page.player.timeline, LiveEpisode)
        return self.page.player.timeline

    @property
    def snapshot(self) -> Snapshot:
        return self.page.player.moment.context.snapshot

    def use(self, kind: str, label: str, value: Any) -> None:
        use(widget(self.server, kind, label), value)
        self.page.update()

    def wait(self, steps: int = 1) -> None:
        for _ in range(steps):
            self.page.player.step()
            self.page.show()

    def hold(self, button: str) -> None:
        """What a browser sends ten times a second while a button is held."""
        for callback in widget(self.server, "Button", button)._button_impl.hold_cbs_from_freq[10.0]:
            callback(SimpleNamespace(client_id=PERSON, client=None))
        self.page.update()

    def drag(self, number: int, position_w: np.ndarray, quaternion_w: np.ndarray | None = None) -> None:
        gizmo = self.server.scene.get_handle_by_name(f"/hand-{number}")
        gizmo._impl.position = position_w
        gizmo._impl.wxyz = gizmo.wxyz if quaternion_w is None else quaternion_w
        for callback in gizmo._impl_aux.update_cb:
            callback(SimpleNamespace(client_id=PERSON, client=None, target=gizmo))
        self.page.update()

    def drive(self, off: Callable[[], np.ndarray], within: float = 0.03, most: int = 300, rest: int = 6) -> None:
        """Hold the buttons that reduce what is left of a way: world x and y, yaw, lift; it is small at the end."""
        for _ in range(most):
            x, y, yaw, lift = off()
            if max(abs(x), abs(y), abs(yaw), abs(lift)) < within or self.page.player.at_end:
                break
            heading = float(self.snapshot.robot_qpos[0, 2])
            cosine, sine = np.cos(heading), np.sin(heading)
            ways = (cosine * x + sine * y, cosine * y - sine * x, yaw, lift)
            for (more, less), way in zip((FORWARD, LEFT, YAW, LIFT), ways, strict=True):
                if abs(way) > 0.8 * within:
                    self.hold(more if way > 0 else less)
            self.wait()
        self.wait(rest)

    def embrace(self, middle_w: np.ndarray) -> None:
        """Bring a pair of hands to both sides of something, and nearer until they press it."""
        self.drag(0, middle_w)
        self.wait(15)
        for apart_cm in range(70, 5, -1):
            self.use("Slider", "apart (cm; G, T)", apart_cm)
            self.wait(2)
            right, left = self.snapshot.tool_position_w[0]
            if np.linalg.norm(left - right) > 0.06 + apart_cm / 100:
                break
        self.wait(15)

    def carry(self, near_m: float = 0.0) -> None:
        """Drive until the object is so near the target, which is the origin."""

        def off() -> np.ndarray:
            x, y = -self.snapshot.link_position_w[0, 0, :2]
            share = max(1.0 - near_m / np.hypot(x, y), 0.0)
            return np.array((share * x, share * y, 0.0, 0.0))

        self.drive(off, 0.05)


def stored_exactly(person: Person, folder: Path) -> None:
    """The episode is solved, the page says where it is stored, and every bit of it comes again."""
    last, episode = person.page.player.moment, person.episode
    assert last.end == SOLVED
    assert person.page._hand.note.content.startswith("stored: demonstration 0 in")
    (result,) = verify(folder)
    assert (result.trajectories, result.exact, result.faults) == (1, 1, ())
    demos = Demos(folder, check=True)
    assert demos.manifest.settings.expert.kind == HUMAN
    with demos.open(episode.scene.object.id) as file:
        stored = file.trajectory(0)
    assert stored.recording.digests[-1] == digest_of(last.state.simulation)
    assert not stored.disturbed.any()


def person_at(server: Any, folder: Path, task: str, obj: str, level: int = 0) -> Person:
    pytest.importorskip("h5py")
    choice = EpisodeChoice(task, obj, level=level, policy="still", config={"episode_steps": STEPS})
    return Person(server, choice, folder)


def take_handle(person: Person) -> None:
    """Drive before the handle, turn the hand, drive on and shut the fingers."""
    obj, episode = person.episode.scene.object, person.episode
    handle, link = obj.handles_of(episode.target)[0], obj.link_index(episode.target)
    position, quaternion = (
        getattr(person.snapshot, f"link_{name}_w")[0, link] for name in ("position", "quaternion")
    )
    grasp_w = transform_points(position, quaternion, handle.grasp_positions[:1])[0]
    turn_w = quat_multiply(quaternion, handle.grasp_quaternions[0])
    before_w = grasp_w - 0.2 * quat_to_matrix(turn_w)[:, 2]

    def off(goal_w: np.ndarray) -> np.ndarray:
        x, y, z = goal_w - person.snapshot.tool_position_w[0, 0]
        return np.array((x, y, 0.0, z))

    for goal_w in (before_w, grasp_w):
        person.drive(lambda goal_w=goal_w: off(goal_w))  # type: ignore[misc]
        person.drag(0, goal_w, turn_w)
        person.wait(25)
    person.use("Slider", "fingers (mm; N)", 0)
    person.wait(15)


def test_a_drawer(server: Any, tmp_path: Path) -> None:
    person = person_at(server, tmp_path, "OpenCabinetDrawer", "cabinet-0002", level=3)
    take_handle(person)
    for _ in range(30):
        person.hold("back (K)")
        person.wait()
    person.wait(30)
    stored_exactly(person, tmp_path)


@pytest.mark.slow
def test_a_door(server: Any, tmp_path: Path) -> None:
    """The gizmo is dragged around the hinge, the robot driven after it."""
    person = person_at(server, tmp_path, "OpenCabinetDoor", "cabinet-0041")
    link = person.episode.scene.object.link_index(person.episode.target)
    hinge_w = person.snapshot.link_position_w[0, link].copy()
    take_handle(person)
    gizmo = person.server.scene.get_handle_by_name("/hand-0")
    handle_w, quaternion_w, base = gizmo.position, gizmo.wxyz, person.snapshot.robot_qpos[0, :4].copy()
    side = np.sign((handle_w - hinge_w)[1])  # cabinets face -x
    for angle in side * np.arange(0.0, 1.9, 0.015):
        turn = quat_from_axis_angle((0.0, 0.0, 1.0), angle)
        place_w = hinge_w[:2] + (quat_to_matrix(turn)[:2, :2] @ (base[:2] - hinge_w[:2]))
        goal = np.array((*place_w, base[2] + angle, base[3]))
        person.drive(lambda goal=goal: goal - person.snapshot.robot_qpos[0, :4], 0.06, 1, 0)  # type: ignore[misc]
        person.drag(0, hinge_w + quat_to_matrix(turn) @ (handle_w - hinge_w), quat_multiply(turn, quaternion_w))
        person.wait(2)
        if person.page.player.at_end:
            break
    stored_exactly(person, tmp_path)


def pair_at(person: Person, lift_m: float) -> None:
    """Make a pair of the hands, and drive until it is around the object."""
    person.wait(20)
    person.use("Checkbox", "both hands as one (B)", True)
    position_w, base_w = person.snapshot.link_position_w[0, 0], person.snapshot.robot_qpos[0, :2]
    way = position_w[:2] - base_w
    ahead = np.array((*way / np.linalg.norm(way), 0.0, 0.0))
    place = np.array((*position_w[:2], np.arctan2(way[1], way[0]), lift_m))
    for metres in (1.1, 0.65):
        goal = place - metres * ahead
        person.drive(lambda goal=goal: goal - person.snapshot.robot_qpos[0, :4])  # type: ignore[misc]


@pytest.mark.slow
def test_a_chair(server: Any, tmp_path: Path) -> None:
    """Held between the hands, and driven."""
    person = person_at(server, tmp_path, "PushChair", "chair-0004")
    seat = int(person.page.player.moment.context.goal.seat_link[0])
    chair_w = person.snapshot.link_position_w[0, seat]
    pair_at(person, 0.3)
    person.embrace(np.add(chair_w, (0.0, 0.0, 0.06)))
    person.carry()
    person.wait(40)
    stored_exactly(person, tmp_path)


@pytest.mark.slow
def test_a_bucket(server: Any, tmp_path: Path) -> None:
    """Pressed between the hands below its middle, lifted by the lift, carried by the base."""
    person = person_at(server, tmp_path, "MoveBucket", "bucket-0001")
    bucket_w = person.snapshot.link_position_w[0, 0].copy()
    pair_at(person, 0.08)
    person.embrace(np.add(bucket_w, (0.0, 0.0, 0.15)))
    person.drive(lambda: np.array((0.0, 0.0, 0.0, 0.2 - person.snapshot.link_position_w[0, 0, 2])))
    person.carry(0.18)
    person.wait(20)
    stored_exactly(person, tmp_path)

"""Every task is solved once by hand: with the page's buttons, sliders and gizmos alone, and stored bit for bit."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from artiskill.demos.demos import Demos
from artiskill.demos.recording import digest_of
from artiskill.demos.settings import HUMAN
from artiskill.demos.verify import verify
from artiskill.evaluation.pictures import EpisodeChoice
from artiskill.sim.snapshot import Snapshot
from artiskill.viewer.episode_page import EpisodePage
from artiskill.viewer.pickers import LivePicker
from artiskill.viewer.playback import SOLVED, LiveEpisode
from tests.viewer.test_pages import PERSON, use, widget

STEPS = 3000
FORWARD, LEFT, YAW, LIFT = ("forward (I)", "back (K)"), ("left (J)", "right (L)"), ("turn left (U)", "turn right (O)"), ("up (Y)", "down (H)")


class Person:
    """Who sits before the page: sees where everything is, and uses what the page offers."""

    def __init__(self, server: Any, choice: EpisodeChoice, folder: Path) -> None:
        self.server = server
        self.page = EpisodePage(server, LivePicker(choice), plays=False, record=folder)
        self.use("Checkbox", "drive", True)

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

    def drive(self, off: Callable[[], np.ndarray], within: float = 0.03, most: int = 300) -> None:
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
        self.wait(6)


def test_a_bucket(server: Any, tmp_path: Path) -> None:
    choice = EpisodeChoice("MoveBucket", "bucket-0001", policy="still", config={"episode_steps": STEPS})
    person = Person(server, choice, tmp_path)
    def tell(what):
        s=person.snapshot; np.set_printoptions(precision=3, suppress=True)
        print(what, len(person.episode), "bucket", s.link_position_w[0,0], s.link_rotation_w[0,0,:,2], "tools", s.tool_position_w[0].ravel(), s.robot_qpos[0,:4], person.page.player.moment.end)
    bucket = lambda: person.snapshot.link_position_w[0, 0]  # noqa: E731
    base = lambda: person.snapshot.robot_qpos[0, :4]  # noqa: E731
    person.wait(20)
    person.use("Checkbox", "both hands as one (B)", True)
    person.wait(30); tell("joined")
    way = bucket() - (*base()[:2], 0.0)
    yaw = np.arctan2(way[1], way[0])
    ahead = np.array((np.cos(yaw), np.sin(yaw), 0.0))

    def before(metres: float) -> Callable[[], np.ndarray]:
        return lambda: np.array((*(bucket() - metres * ahead)[:2], yaw, 0.08)) - base()

    person.drive(before(1.1)); tell("back")
    heading = float(base()[2]); ahead = np.array((np.cos(heading), np.sin(heading), 0.0)); yaw=heading
    middle = np.array((*base()[:2], 0.0)) + 0.65 * ahead + (0.0, 0.0, 0.15)
    person.drag(0, middle)
    person.wait(40); tell("low")
    person.drive(before(0.65), 0.02); tell("around")
    person.drag(0, bucket() + (0.0, 0.0, 0.148))
    person.wait(10)
    for apart in range(60, 15, -1):
        person.use("Slider", "apart (cm; G, T)", apart)
        person.wait(3)
    person.wait(20); tell("pressed")
    person.drive(lambda: np.array((0, 0, 0, 0.2 - bucket()[2])), 0.02); tell("lifted")
    person.drive(lambda: np.array((*(-0.18 * ahead - bucket())[:2], 0.0, 0.0)), 0.05); tell("there")
    person.wait(20); tell("end")
    last = person.page.player.moment
    assert last.end == SOLVED
    print(person.page._hand.note.content)
    (result,) = verify(tmp_path)
    assert (result.trajectories, result.exact, result.faults) == (1, 1, ())

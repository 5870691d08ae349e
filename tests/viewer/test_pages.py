"""Pages without a browser: what their widgets do, what is exported."""

import base64
import re
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from artiskill.assets.catalog import load_object
from artiskill.assets.kinematics import link_poses
from artiskill.checks.context import at_most, failed, fine
from artiskill.demos.demos import PACK
from artiskill.errors import ConfigError
from artiskill.evaluation.evaluate import evaluate
from artiskill.evaluation.pictures import EpisodeChoice
from artiskill.evaluation.report import write_report
from artiskill.viewer.episode_page import EpisodePage
from artiskill.viewer.object_page import ObjectPage, faults_of_links, findings_text
from artiskill.viewer.pickers import DRAWN_BY_LEVEL, DemoPicker, LivePicker, ReportPicker
from artiskill.viewer.playback import NOT_SOLVED, LiveEpisode
from artiskill.viewer.replay import export_episode

PERSON = 7  # a client's number
ONLY_ONCE = """class Policy:
    obs_mode = 'state'
    begun = False
    def reset(self, observation, info):
        if self.begun:
            raise RuntimeError('only from the beginning')
        self.begun = True
    def act(self, observation):
        return [0.0] * 13
"""


def use(widget: Any, value: Any) -> None:
    """Do what a person does with a widget: set its value and have its callbacks called."""
    widget._impl.value = value
    for callback in widget._impl.update_cb:
        callback(SimpleNamespace(client_id=PERSON, client=None, target=widget))


def widget(server: Any, kind: str, label: str) -> Any:
    """Return a widget by its kind and label."""
    for handle in server.gui._gui_input_handle_from_uuid.values():
        if kind in type(handle).__name__ and getattr(handle, "label", None) == label:
            return handle
    raise AssertionError(f"no {kind} {label!r}")


@pytest.fixture
def page(server: Any, choice: EpisodeChoice) -> EpisodePage:
    return EpisodePage(server, LivePicker(choice), plays=False)


def poses_agree(server: Any, page: EpisodePage) -> None:
    snapshot, scene = page.player.moment.context.snapshot, page.player.timeline.scene
    for link, index in zip(scene.object.links, range(*scene.index.object_bodies.indices(10**6)), strict=True):
        handle = server.scene.get_handle_by_name(f"/scene/object/{link.name}")
        np.testing.assert_allclose(handle.position, snapshot.body_position_w[0, index], atol=2e-6)


def test_buttons_steer_the_player(server: Any, page: EpisodePage) -> None:
    buttons = widget(server, "Group", "")
    for name, position, playing in (
        ("step", 1, False),
        ("step", 2, False),
        ("back", 1, False),
        ("play", 1, True),
        ("pause", 1, False),
        ("restart", 0, False),
    ):
        use(buttons, name)
        page.update()
        assert (page.player.position, page.player.is_playing) == (position, playing), name
        assert widget(server, "Slider", "step").value == position
        poses_agree(server, page)


def test_the_slider_scrubs_and_its_own_moves_do_not(server: Any, page: EpisodePage) -> None:
    page.player.step(5)
    page.show()
    slider = widget(server, "Slider", "step")
    page.update()
    assert (slider.value, page.player.position) == (5, 5)
    use(slider, 2)
    page.update()
    assert page.player.position == 2
    poses_agree(server, page)


def test_it_plays_only_while_somebody_looks(
    server: Any, page: EpisodePage, monkeypatch: pytest.MonkeyPatch
) -> None:
    page.player.set_speed("4")
    page.player.play()
    page.player._since_s -= 100.0
    page.update()
    assert page.player.position == 0
    monkeypatch.setattr(server, "get_clients", lambda: {PERSON: None})
    page.update()
    assert page.player.position == 0  # time begins now
    page.player._since_s = page.player._clock() - 0.02
    page.update()
    assert page.player.position == 1


def test_pictures_points_and_layers_are_chosen(server: Any, page: EpisodePage) -> None:
    colour = page._picture.image
    assert colour.std() > 10
    use(widget(server, "Dropdown", "pictures"), "masks")
    page.update()
    assert (page._picture.image != colour).any()
    assert server.scene.get_handle_by_name("/sensors/points") is None
    use(widget(server, "Checkbox", "point cloud"), True)
    use(widget(server, "Dropdown", "pictures"), "off")
    use(widget(server, "Checkbox", "collision shapes"), True)
    use(widget(server, "Checkbox", "surfaces"), False)
    page.update()
    assert not page._picture.visible
    assert len(server.scene.get_handle_by_name("/sensors/points").points) > 1000
    assert "collision shapes" in page.view.shown
    assert not server.scene.get_handle_by_name("/scene/robot/torso/surface").visible


def test_plots_end_at_the_moment_that_is_shown(server: Any, page: EpisodePage) -> None:
    page.player.step(4)
    page.show()
    steps, rewards, *terms = page._plot.data
    assert steps.tolist() == [0, 1, 2, 3, 4]
    assert rewards[4] == page.player.moment.reward
    assert [term[4] for term in terms] == list(page.player.moment.reward_terms.values())


def test_another_episode_is_chosen(server: Any, page: EpisodePage) -> None:
    use(widget(server, "Checkbox", "joint axes"), True)
    use(widget(server, "Dropdown", "task"), "PushChair")
    page.update()
    objects = widget(server, "Dropdown", "object")
    assert all(name.startswith("chair-") for name in objects.options)
    use(objects, "chair-0013")
    page.update()
    assert widget(server, "Dropdown", "target").value == DRAWN_BY_LEVEL
    use(widget(server, "Number", "level"), 4)
    use(widget(server, "Dropdown", "policy"), "still")
    use(widget(server, "Button", "load"), True)
    page.update()
    timeline = page.player.timeline
    assert timeline.title == "PushChair: chair-0013, base, level 4, still"
    assert page.view.shown == {"target", "joint axes"}
    assert len(page._plot.data) == 2 + len(page.player.moment.reward_terms) == len(page._plot.series)
    poses_agree(server, page)
    assert server.scene.get_handle_by_name("/scene/object/drawer_0") is None


def test_an_episode_that_cannot_be_loaded_is_told_on_the_page(server: Any, page: EpisodePage) -> None:
    before = page.player.timeline
    use(widget(server, "Number", "level"), -1)
    use(widget(server, "Button", "load"), True)
    page.update()
    assert (page._problem.visible, "error" in page._problem.content) == (True, True)
    assert page.player.timeline is before
    use(widget(server, "Number", "level"), 2)
    use(widget(server, "Button", "load"), True)
    page.update()
    assert not page._problem.visible
    assert "level 2" in page._title.content


def test_a_task_that_knows_another_value_is_told_on_the_page(server: Any, choice: EpisodeChoice) -> None:
    page = EpisodePage(server, LivePicker(replace(choice, config={"success.open_fraction": 0.8})), plays=False)
    use(widget(server, "Dropdown", "task"), "PushChair")
    page.update()
    assert "unknown key &#x27;open_fraction&#x27;" in page._problem.content
    assert widget(server, "Dropdown", "task").value == choice.task


def test_a_policy_that_cannot_begin_in_the_middle_ends_the_episode(
    server: Any, choice: EpisodeChoice, tmp_path: Path
) -> None:
    path = tmp_path / "once.py"
    path.write_text(ONLY_ONCE)
    page = EpisodePage(server, LivePicker(replace(choice, policy=str(path))), plays=False)
    page.player.step(3)
    use(widget(server, "Button", "drive"), True)
    page.update()
    page.player.step(3)
    use(widget(server, "Button", "hand back"), True)
    page.update()
    assert "only from the beginning" in page.player.moment.end
    assert "only from the beginning" in page._state.content
    assert (page.player.position, page.player.is_playing, page.player.at_end) == (6, False, True)


def test_an_episode_that_has_ended_stays_as_it_ended(tmp_path: Path, choice: EpisodeChoice) -> None:
    path = tmp_path / "once.py"
    path.write_text(ONLY_ONCE)
    episode = LiveEpisode(replace(choice, policy=str(path), config={"episode_steps": 3}))
    for _ in range(3):
        episode.extend()
    episode.take_over(3, False)
    assert episode.moment(3).end == NOT_SOLVED


def test_nobody_drives_after_the_end(server: Any, choice: EpisodeChoice) -> None:
    page = EpisodePage(server, LivePicker(choice), plays=True)
    page.player.step(1000)
    assert page.player.at_end
    end = page.player.position
    use(widget(server, "Button", "drive"), True)
    page.update()
    assert "go back to an earlier one" in page._hand.note.content
    assert server.scene.get_handle_by_name("/hand-0") is None
    assert (page.player.position, page.player.is_playing) == (end, False)
    page.player.seek(end - 2)
    use(widget(server, "Button", "drive"), True)
    page.update()
    assert page._hand.note.content == ""
    assert server.scene.get_handle_by_name("/hand-0") is not None


def test_a_damaged_demonstration_is_told_on_the_page(server: Any, tmp_path: Path) -> None:
    pytest.importorskip("h5py")
    source = next((PACK / "OpenCabinetDoor").glob("*.h5"))
    shutil.copy(source, tmp_path)
    page = EpisodePage(server, DemoPicker(tmp_path / source.name), plays=False)
    length = len(page.player.timeline) - 1
    page.player.timeline._trajectory.actions[length - 5] += 0.1  # as in a file that was changed
    slider = widget(server, "Slider", "step")
    use(slider, length)
    page.update()
    assert f"step {length - 4} is another one than was recorded" in page._problem.content
    assert (page.player.position, slider.value) == (0, 0)
    use(slider, 2)
    page.update()
    assert (page.player.position, page._problem.visible) == (2, False)


def test_demonstrations_are_chosen(server: Any) -> None:
    page = EpisodePage(server, DemoPicker(PACK / "OpenCabinetDoor", 1), plays=False)
    assert "cabinet-0006" in page.player.timeline.title
    assert "demonstration 1 of" in page.player.timeline.title
    use(widget(server, "Dropdown", "object"), "cabinet-0041")
    use(widget(server, "Slider", "demonstration"), 0)
    use(widget(server, "Button", "load"), True)
    page.update()
    assert "cabinet-0041" in page.player.timeline.title
    slider = widget(server, "Slider", "step")
    assert slider.max == len(page.player.timeline) - 1
    use(slider, slider.max)
    page.update()
    assert page.player.moment.end == "solved"
    with pytest.raises(ConfigError, match=r"demonstrations 0 to \d+, not 99"):
        DemoPicker(PACK / "OpenCabinetDoor", 99).load()


def recording_of(page: str) -> dict[str, Any]:
    """Return what an exported page plays."""
    msgspec, zstandard = pytest.importorskip("msgspec"), pytest.importorskip("zstandard")
    found = re.search(r'__VISER_EMBED_DATA__="([^"]+)"', page)
    assert found is not None
    data = base64.b64decode(found[1])
    inner = zstandard.ZstdDecompressor().decompress(data[8:], max_output_size=int.from_bytes(data[:8], "little"))
    size = int.from_bytes(inner[:8], "little")
    recording: dict[str, Any] = msgspec.msgpack.decode(inner[8 : 8 + size])
    return recording


def test_an_exported_episode_has_every_step_in_one_small_file(choice: EpisodeChoice, tmp_path: Path) -> None:
    pytest.importorskip("viser")
    episode, steps = LiveEpisode(choice), []
    path = export_episode(episode, tmp_path / "new" / "episode.html", steps.append)
    page = path.read_text(encoding="utf-8")
    assert steps == list(range(len(episode)))
    assert len(page) < 3e6
    assert "<title>OpenCabinetDrawer: cabinet-0002" in page
    recording = recording_of(page)
    assert recording["durationSeconds"] == pytest.approx(0.05 * len(episode) + 1.5)
    last = len(episode) - 1
    link = episode.scene.index.object_bodies.start + episode.scene.object.link_index(episode.target)
    name = f"/scene/object/{episode.target}"
    moves = [m for _, m in recording["messages"] if m["type"] == "SetPositionMessage" and m["name"] == name]
    wanted = episode.moment(last).context.snapshot.body_position_w[0, link]
    np.testing.assert_allclose(moves[-1]["position"], wanted, atol=2e-6)
    captions = [m["updates"]["text"] for _, m in recording["messages"] if "text" in m.get("updates", {})]
    assert captions[-1].endswith("solved")
    of_caption = [m for _, m in recording["messages"] if m.get("name", "").endswith("/caption")]
    shown = [m["visible"] for m in of_caption if "visible" in m]
    assert shown == [False, True, False], "hidden at first and at last"
    outside = re.findall(r'(?:src|href)="(https?://[^"]+)"', page)
    assert not outside  # nothing is fetched


@pytest.mark.parametrize("name", ["episode.mp4", "episode"])
def test_an_export_is_html(choice: EpisodeChoice, tmp_path: Path, name: str) -> None:
    with pytest.raises(ConfigError, match=r"must end in \.html"):
        export_episode(LiveEpisode(choice), tmp_path / name)


def test_sliders_move_the_joints_of_an_object(server: Any) -> None:
    page = ObjectPage(server, ["cabinet-0005", "chair-0001"])
    obj = load_object("cabinet-0005")
    values = obj.rest_qpos
    for k, joint in enumerate(obj.joints):
        unit = "m" if joint.kind == "prismatic" else "rad"
        values[k] = joint.limits[0] + 0.3 * (joint.limits[1] - joint.limits[0])
        use(widget(server, "Slider", f"{joint.name} ({unit})"), values[k])
    positions, _ = link_poses(obj, values)
    for k, link in enumerate(obj.links):
        handle = server.scene.get_handle_by_name(f"/scene/object/{link.name}")
        np.testing.assert_allclose(handle.position, positions[k], atol=2e-6)
    use(widget(server, "Group", ""), "open")
    assert [slider.value for slider in page._sliders] == pytest.approx([joint.limits[1] for joint in obj.joints])
    use(widget(server, "Checkbox", "joint axes"), True)
    use(widget(server, "Dropdown", "object"), "chair-0001")
    assert page.object.id == "chair-0001"
    assert len(page._sliders) == len(page.object.joints)
    assert page.view.shown == {"joint axes"}


def test_findings_are_told_and_stand_where_they_are(server: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    results = [
        at_most("link_1", 7.0, 5.0, "mm"),
        failed("link_0, link_1", "they touch"),
        failed("object", "all of it"),
        fine("link_2", "good"),
    ]
    monkeypatch.setattr("artiskill.viewer.object_page.check_object", lambda obj: results)
    page = ObjectPage(server, ["cabinet-0005"])
    assert page.findings is None
    use(widget(server, "Button", "check"), True)
    assert page.findings == results
    assert "**3 faults:**" in page._results.content
    assert "they touch" in page._results.content
    assert server.scene.get_handle_by_name("/scene/object/link_1/fault-text").text.count(";") == 1
    assert server.scene.get_handle_by_name("/scene/object/link_2/fault") is None
    assert faults_of_links(results, ["link_0", "link_2"]) == {"link_0": [""]}
    assert findings_text(results[3:]) == "1 results, no fault."


def test_a_person_drives(server: Any, page: EpisodePage) -> None:
    page.player.step(3)
    assert server.scene.get_handle_by_name("/hand-0") is None
    use(widget(server, "Button", "drive"), True)
    page.update()
    hand = page.player.timeline.hand  # type: ignore[attr-defined]
    assert page.player.timeline.by_hand  # type: ignore[attr-defined]
    gizmo = server.scene.get_handle_by_name("/hand-0")
    tool, up = page.player.moment.context.snapshot.tool_position_w[0, 0], np.array((0.0, 0.0, 0.06))
    np.testing.assert_allclose(gizmo.position, tool, atol=1e-6)
    gizmo._impl.position = tool + up
    for callback in gizmo._impl_aux.update_cb:
        callback(SimpleNamespace(client_id=PERSON, client=None, target=gizmo))
    use(widget(server, "Slider", "fingers (mm; N)"), 10)
    page.update()
    np.testing.assert_allclose(hand.positions_w[0], tool + up, atol=1e-6)
    page.player.step(40)
    snapshot = page.player.moment.context.snapshot
    np.testing.assert_allclose(snapshot.tool_position_w[0, 0], hand.positions_w[0], atol=0.01)
    np.testing.assert_allclose(snapshot.robot_qpos[0, -2:], 0.01, atol=1e-3)
    for callback in widget(server, "Button", "up (Y)")._button_impl.hold_cbs_from_freq[10.0]:
        callback(SimpleNamespace(client_id=PERSON, client=None))
    page.update()
    page.player.step(5)
    page.show()
    np.testing.assert_allclose(gizmo.position, hand.positions_w[0], atol=1e-6)
    use(widget(server, "Button", "hand back"), True)
    page.update()
    assert server.scene.get_handle_by_name("/hand-0") is None
    assert not page.player.timeline.by_hand  # type: ignore[attr-defined]


def test_what_is_solved_by_hand_is_stored_once_and_the_page_says_where(
    server: Any, choice: EpisodeChoice, tmp_path: Path
) -> None:
    pytest.importorskip("h5py")
    page = EpisodePage(server, LivePicker(choice), plays=False, record=tmp_path / "mine")
    page.player.step(10)
    for button in ("drive", "hand back"):
        use(widget(server, "Button", button), True)
        page.update()
        page.player.step(3)
    page.player.step(200)
    assert page.player.at_end
    for _ in range(3):
        page.show()
    assert page._hand.note.content == f"stored: demonstration 0 in {tmp_path}/mine/cabinet-0002.h5"
    use(widget(server, "Dropdown", "task"), "PushChair")
    use(widget(server, "Button", "load"), True)
    page.update()
    assert "holds demonstrations of OpenCabinetDrawer, not of PushChair" in page._problem.content


def test_contacts_are_shown_and_told(server: Any, page: EpisodePage) -> None:
    page.player.step(30)
    use(widget(server, "Checkbox", "contacts and forces"), True)
    page.update()
    assert re.fullmatch(r"4 contacts; the strongest \d+\.\d N, together \d+\.\d N", page._forces.content)
    assert len(server.scene.get_handle_by_name("/contacts/points").points) == 4
    use(widget(server, "Checkbox", "contacts and forces"), False)
    page.update()
    assert server.scene.get_handle_by_name("/contacts/points") is None


def test_failures_of_a_report_are_found(server: Any, tmp_path: Path) -> None:
    config = {"episode_steps": 56}
    played = evaluate("OpenCabinetDrawer", "expert", ["cabinet-0002", "cabinet-0003"], 2, 3, config=config)
    assert 0 < played.total.successes < 4
    page = EpisodePage(server, ReportPicker(write_report(played, tmp_path)), plays=False)
    assert not page._hand_folder.visible
    use(widget(server, "Checkbox", "only unsolved"), True)
    page.update()
    unsolved = [e for e in played.episodes if not e.success]
    assert widget(server, "Dropdown", "object").options[0] == f"{unsolved[0].object}, any"
    assert len(widget(server, "Dropdown", "episode").options) == sum(
        e.object == unsolved[0].object for e in unsolved
    )
    use(widget(server, "Button", "load"), True)
    page.update()
    timeline = page.player.timeline
    assert timeline.title.startswith(f"OpenCabinetDrawer: {unsolved[0].object}, ")
    assert timeline.moment(len(timeline) - 1).end == NOT_SOLVED

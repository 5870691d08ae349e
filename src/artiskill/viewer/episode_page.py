"""The page of an episode: what is chosen, played, switched on and read in the panel beside the scene.

Callbacks of the browser come in threads of their own. They only put commands into a queue, which `run` obeys: all
of the page's state has one thread.
"""

import contextlib
import html
import queue
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from artiskill.errors import ArtiSkillError
from artiskill.evaluation.recording import shown_points
from artiskill.sensors.pictures.framing import framing_camera
from artiskill.sensors.render_config import load_render_config
from artiskill.sim.simulation import contacts_of
from artiskill.viewer.driving import Do, HandPanel, from_browser
from artiskill.viewer.overlays import CONTACTS, PICTURES, ContactView, SensorView
from artiskill.viewer.playback import (
    SOLVED,
    SPEEDS,
    LiveEpisode,
    Moment,
    Player,
    Timeline,
    contact_text,
    reward_text,
    state_text,
)
from artiskill.viewer.scene_view import (
    LAYERS,
    TARGET,
    SceneView,
    add_stage,
    blended_poses,
    place_camera,
    scene_bodies,
    show_above_panel,
)

_POSES_PER_S, _TEXT_PER_S, _SENSORS_PER_S, _UPDATES_PER_S = 30.0, 10.0, 5.0, 60.0
# Okabe and Ito's colours, as of masks
_COLOURS = ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7f7f7f", "#000000")
# from where scenes are looked at first: cabinets face -x, and robots stand before them
_DIRECTION_DEG, _SIZE_PX = (226.0, 22.0), (640, 480)
_OVER = "the episode ends at this step: go back to an earlier one"


class Picker(Protocol):
    """What chooses an episode: its widgets, and what they stand at."""

    def add_to(self, server: Any, do: Do) -> None:
        """Add the widgets."""

    def take_over(self) -> None:
        """Choose what the widgets stand at."""

    def load(self) -> Timeline:
        """Return the chosen episode from its beginning."""


class EpisodePage:
    """One episode in the browser, and the panel that steers it.

    Args:
        server: of viser.
        picker: which episode is shown, and can be chosen.
        plays: whether it plays as soon as somebody looks.
        record: folder of demonstrations that episodes solved by hand join; None to store nothing.

    Attributes:
        player: which moment is shown.
        view: what is drawn.
        frames: how often poses have been shown.

    Raises:
        ArtiSkillError: the first episode cannot be loaded.
    """

    def __init__(self, server: Any, picker: Picker, plays: bool = True, record: Path | None = None) -> None:
        self._server, self._picker, self._plays, self._record = server, picker, plays, record
        self._commands: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._sensors: SensorView | None = None
        self._touching = ContactView(server)
        self._next_s = {"poses": 0.0, "text": 0.0, "sensors": 0.0}
        self._is_shown = False
        self._ended: Moment | None = None  # the last end that was shown
        self.frames = 0
        self.player = Player(self._load())
        with server.atomic():
            add_stage(server, load_render_config())
            look_at_episode(server, self.player.timeline)
            self.view = self._enter()
            self._show_poses()
        show_above_panel(server)
        self._add_panel()
        self._hand_folder.visible = isinstance(self.player.timeline, LiveEpisode)
        self.show()
        if plays:
            self.player.play()

    # -- what is shown -------------------------------------------------------------------------------------------

    def _enter(self) -> SceneView:
        timeline = self.player.timeline
        scene = timeline.scene
        view = SceneView(
            self._server, scene_bodies(scene), scene.object, scene.index.object_bodies.start, timeline.target
        )
        view.show_layer(TARGET, True)
        return view

    def _load(self) -> Timeline:
        timeline = self._picker.load()
        if self._record is not None and isinstance(timeline, LiveEpisode):
            try:
                timeline.check_store(self._record)  # before anybody drives
            except BaseException:
                timeline.close()
                raise
        return timeline

    def load(self) -> None:
        """Show the episode that the picker stands at, from its beginning.

        Raises:
            ArtiSkillError, IndexError: it cannot be loaded; what was shown stays.
        """
        self._picker.take_over()
        timeline = self._load()
        before = self.player.timeline
        before.close()
        if timeline.task.name != before.task.name:
            look_at_episode(self._server, timeline, moves_pages=True)
        layers, speed = self.view.shown, self.player.speed
        self.view.remove()
        self._hand.detach()
        if self._sensors is not None:
            self._sensors.remove()
            self._sensors = None
        self.player = Player(timeline)
        self.player.set_speed(speed)
        self.view = self._enter()
        for layer in layers:
            self.view.show_layer(layer, True)
        self.view.show_surfaces(self._surfaces.value)
        self._title.content, self._hand.note.content = _title(timeline), ""
        self._plot.series = self._series()
        self._hand_folder.visible = isinstance(timeline, LiveEpisode)
        if self._plays:
            self.player.play()
        self.show()

    def show(self) -> None:
        """Show the present moment whole."""
        self._next_s = dict.fromkeys(self._next_s, 0.0)
        self._show_moment()

    def _show_moment(self) -> None:
        """Show the present moment; text and what cameras see not more often than people can follow."""
        moment = self.player.moment
        if self._is_due("poses", _POSES_PER_S):
            self._show_poses()
            self._hand.follow()
        if self._is_due("text", _TEXT_PER_S):
            self._show_text(moment)
            self._show_contacts(moment)
        if self._is_due("sensors", _SENSORS_PER_S):
            self._show_sensors(moment)
        if self.player.at_end and moment is not self._ended:
            self._ended = moment
            self._store()

    def _store(self) -> None:
        """Store the episode if a person has solved it, and say where, or why not."""
        timeline, folder = self.player.timeline, self._record
        if folder is None or not isinstance(timeline, LiveEpisode) or not timeline.was_driven:
            return
        if self.player.moment.end != SOLVED:
            return
        try:
            said = f"stored: {timeline.store(folder)}"
        except ArtiSkillError as error:
            said = f"not stored: {error}"
        self._hand.note.content = html.escape(said)

    def _show_poses(self) -> None:
        before, moment, share = self.player.between()
        self.view.set_poses(*blended_poses(before.context.snapshot, moment.context.snapshot, share))
        self.frames += 1

    def _is_due(self, what: str, per_s: float) -> bool:
        now = time.monotonic()
        if now < self._next_s[what] and self.player.is_playing:
            return False
        self._next_s[what] = max(self._next_s[what] + 1.0 / per_s, now)  # on average, though updates come late
        return True

    def _show_text(self, moment: Moment) -> None:
        player = self.player
        timeline = player.timeline
        self._slider.max = len(timeline) - 1 if timeline.is_complete else timeline.task.config.episode_steps
        self._slider.value = player.position
        self._state.content = state_text(moment)
        self._rewards.content = reward_text(moment)
        self._plot.data = self._plotted()

    def _show_contacts(self, moment: Moment) -> None:
        self._forces.visible = self._contacts.value
        if not self._contacts.value:
            self._touching.remove()
            return
        contacts = contacts_of(self.player.timeline.scene, moment.state.simulation)
        self._touching.show(contacts)
        self._forces.content = contact_text(contacts)

    def _show_sensors(self, moment: Moment) -> None:
        kind, is_cloud = self._pictures.value, self._cloud.value
        self._picture.visible = kind != "off"
        if kind == "off" and not is_cloud:
            if self._sensors is not None:
                self._sensors.show_cloud(False)
            return
        if self._sensors is None:
            timeline = self.player.timeline
            self._sensors = SensorView(self._server, timeline.task, timeline.scene, timeline.target)
        self._sensors.observe(moment.context)
        if kind != "off":
            self._picture.image = self._sensors.picture(kind)
        self._sensors.show_cloud(is_cloud)

    def _plotted(self) -> tuple[np.ndarray, ...]:
        """Return time and reward terms up to the present moment, a row each."""
        player = self.player
        moments = [player.timeline.moment(k) for k in range(player.position + 1)]
        moments = moments if len(moments) > 1 else moments * 2  # a plot needs two points
        steps = np.array([moment.context.elapsed for moment in moments], dtype=float)
        chosen = [
            [moment.reward for moment in moments],
            *([moment.reward_terms[name] for moment in moments] for name in self._terms()),
        ]
        return (steps, *(np.array(values, dtype=float) for values in chosen))

    def _terms(self) -> Sequence[str]:
        return list(self.player.moment.reward_terms)

    # -- the panel -----------------------------------------------------------------------------------------------

    def _add_panel(self) -> None:
        gui = self._server.gui
        self._title = gui.add_markdown(_title(self.player.timeline))
        self._problem = gui.add_markdown("", visible=False)
        with gui.add_folder("playback"):
            self._add_playback(gui)
        self._state = gui.add_markdown("")
        with gui.add_folder("by hand", expand_by_default=False, visible=False) as self._hand_folder:
            self._hand = HandPanel(self._server, self.do, self._switch_hand)
        with gui.add_folder("robot's cameras"):
            self._pictures = gui.add_dropdown("pictures", PICTURES, initial_value=PICTURES[0])
            self._cloud = gui.add_checkbox("point cloud", initial_value=False)
            self._picture = gui.add_image(np.full((8, 8, 3), 255, np.uint8))
            for widget in (self._pictures, self._cloud):
                widget.on_update(lambda event: from_browser(event, self.do, self.show))
        with gui.add_folder("show"):
            self._add_layers(gui)
        with gui.add_folder("rewards", expand_by_default=True):
            self._plot = self._add_plot(gui)
            self._rewards = gui.add_markdown("")
        with gui.add_folder("choose an episode", expand_by_default=False):
            self._picker.add_to(self._server, self.do)
            gui.add_button("load").on_click(lambda event: from_browser(event, self.do, self.load))

    def _add_playback(self, gui: Any) -> None:
        buttons = gui.add_button_group("", ("restart", "back", "play", "pause", "step"))
        self._slider = gui.add_slider("step", 0, 1, 1, 0)
        speeds = gui.add_dropdown("speed", tuple(SPEEDS), initial_value="1")
        acts: Mapping[str, Callable[[], None]] = {
            "restart": lambda: self.player.seek(0),
            "back": lambda: self.player.step(-1),
            "play": lambda: self.player.play(),
            "pause": lambda: self.player.pause(),
            "step": lambda: self.player.step(),
        }

        def press(name: str) -> None:
            acts[name]()
            self.show()

        def seek(position: int) -> None:
            self.player.seek(position)
            self.show()

        buttons.on_click(lambda event: from_browser(event, self.do, partial(press, event.target.value)))
        self._slider.on_update(lambda event: from_browser(event, self.do, partial(seek, int(event.target.value))))
        speeds.on_update(lambda event: from_browser(event, self.do, lambda: self.player.set_speed(speeds.value)))

    def _switch_hand(self, by_hand: bool) -> None:
        """Take over from the step that is shown, or hand back there."""
        timeline = self.player.timeline
        assert isinstance(timeline, LiveEpisode), "only live episodes are driven"
        timeline.take_over(self.player.position, by_hand)
        is_over = timeline.is_complete  # it ends here, or the policy cannot begin here
        if by_hand and not is_over:
            self._hand.attach(timeline.hand)
        else:
            self._hand.detach()
        self._hand.note.content = _OVER if by_hand and is_over else ""
        if is_over:
            self.player.pause()
        elif self._plays:
            self.player.play()
        self.show()

    def _add_layers(self, gui: Any) -> None:
        self._surfaces = gui.add_checkbox("surfaces", initial_value=True)
        self._surfaces.on_update(
            lambda event: from_browser(event, self.do, lambda: self.view.show_surfaces(self._surfaces.value))
        )
        for layer in LAYERS:
            box = gui.add_checkbox(layer, initial_value=layer in self.view.shown)

            def switch(event: Any, layer: str = layer, box: Any = box) -> None:
                from_browser(event, self.do, lambda: self.view.show_layer(layer, box.value))

            box.on_update(switch)
        self._contacts = gui.add_checkbox(CONTACTS, initial_value=False)
        self._contacts.on_update(lambda event: from_browser(event, self.do, self.show))
        self._forces = gui.add_markdown("", visible=False)

    def _add_plot(self, gui: Any) -> Any:
        scales = {"x": {"time": False, "auto": True}, "y": {"auto": True}}
        return gui.add_uplot(self._plotted(), self._series(), scales=scales, aspect=1.6)

    def _series(self) -> tuple[dict[str, Any], ...]:
        """Return labels and colours of what is plotted."""
        names = enumerate(("reward", *self._terms()))
        lines = ({"label": name, "stroke": _COLOURS[k % len(_COLOURS)], "width": 2} for k, name in names)
        return ({"label": "step"}, *lines)

    # -- the loop ------------------------------------------------------------------------------------------------

    def do(self, command: Callable[[], None]) -> None:
        """Have something done by the thread that runs the page."""
        self._commands.put(command)

    def update(self) -> None:
        """Obey what was asked for, and go on with time, if anybody looks; errors are told on the page."""
        while not self._commands.empty():
            self._problem.visible = False
            self._guard(self._commands.get())
        is_watched = bool(self._server.get_clients())
        if is_watched and not self._is_shown:
            self.player.set_speed(self.player.speed)  # time begins when the first one looks
        self._is_shown = is_watched
        if is_watched and self.player.is_playing:
            self._guard(self._go_on)

    def _go_on(self) -> None:
        self.player.update()
        self._show_moment() if self.player.is_playing else self.show()

    def _guard(self, command: Callable[[], None]) -> None:
        """Do something; an error stops the episode and stands on the page, which goes on."""
        try:
            command()
        except (ArtiSkillError, LookupError) as error:
            self.player.pause()
            self._problem.content, self._problem.visible = f"**error:** {html.escape(str(error))}", True
            with contextlib.suppress(ArtiSkillError):
                self.show()  # as it was: the slider may stand elsewhere

    def run(self) -> None:
        """Show the episode until the process is interrupted."""
        try:
            while True:
                started = time.monotonic()
                self.update()
                time.sleep(max(0.001, 1.0 / _UPDATES_PER_S - (time.monotonic() - started)))
        finally:
            self.player.timeline.close()


def _title(timeline: Timeline) -> str:
    return f"**{html.escape(timeline.title)}**"


def look_at_episode(server: Any, timeline: Timeline, has_panel: bool = True, moves_pages: bool = False) -> None:
    """Have the camera see robot and object whole."""
    scene, snapshot = timeline.scene, timeline.moment(0).context.snapshot
    points = shown_points(scene, [snapshot])[0]
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    eye = framing_camera(points, *_DIRECTION_DEG, *_SIZE_PX).position_w
    place_camera(server, eye, middle, has_panel, moves_pages)

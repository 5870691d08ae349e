"""The page of objects alone: joints as sliders, and what the checks find, where it is."""

import html
import math
import threading
from collections.abc import Sequence
from typing import Any

from artiskill.assets.articulated_object import ArticulatedObject, Joint
from artiskill.assets.catalog import object_id_of, object_of
from artiskill.assets.kinematics import drawn_points, link_poses
from artiskill.checks.context import CheckResult
from artiskill.checks.runner import check_object
from artiskill.errors import ArtiSkillError
from artiskill.sensors.pictures.framing import framing_camera
from artiskill.sensors.pictures.objects import AZIMUTH_DEG, ELEVATION_DEG
from artiskill.sensors.render_config import load_render_config
from artiskill.viewer.scene_view import (
    LAYERS,
    TARGET,
    SceneView,
    add_stage,
    object_bodies,
    place_camera,
    show_above_panel,
)

Item = str | ArticulatedObject
_TURN_RAD = math.pi  # what a slider of a joint without limits covers each way
_STEPS = 200  # of a slider
_SIZE_PX = 640, 480  # of the window for which the camera stands as near as it can


class ObjectPage:
    """One of several objects in the browser, its joints anywhere in their ranges.

    Args:
        server: of viser.
        items: ids or objects.

    Attributes:
        object: that is shown.
        view: what is drawn of it.
        findings: of the checks of that object; None until they are done.
    """

    def __init__(self, server: Any, items: Sequence[Item]) -> None:
        self._server = server
        self._items = {object_id_of(item): item for item in items}
        self._lock = threading.RLock()  # callbacks come in threads of their own
        self._widgets: list[Any] = []
        self._marks: list[Any] = []
        self.findings: Sequence[CheckResult] | None = None
        self.object, self.view = self._enter(next(iter(self._items)))
        show_above_panel(server)
        self._add_panel()

    def _enter(self, name: str) -> tuple[ArticulatedObject, SceneView]:
        item = self._items[name]
        obj = object_of(item)
        view = SceneView(self._server, object_bodies(obj), obj)
        poses = link_poses(obj, obj.rest_qpos)
        view.set_poses(*poses)
        points = drawn_points(obj, obj.rest_qpos)
        camera = framing_camera(points, AZIMUTH_DEG, ELEVATION_DEG, *_SIZE_PX)
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        add_stage(self._server, load_render_config())
        place_camera(self._server, camera.position_w, middle)
        return obj, view

    def choose(self, name: str) -> None:
        """Show another object.

        Raises:
            ArtiSkillError: it cannot be loaded.
        """
        with self._lock:
            layers = self.view.shown
            self._clear_marks()
            self.view.remove()
            self.object, self.view = self._enter(name)
            for layer in layers:
                self.view.show_layer(layer, True)
            self.findings = None
            self._results.content = ""
            self._about.content = about_text(self.object)
            self._add_sliders()

    def set_joints(self) -> None:
        """Move the links to where the sliders stand."""
        with self._lock:
            self.view.set_poses(*link_poses(self.object, [float(slider.value) for slider in self._sliders]))

    def check(self) -> None:
        """Run the checks, and mark the links that they find fault with."""
        with self._lock:
            obj, self._results.content = self.object, "checking ..."
        results = check_object(obj)
        with self._lock:
            if obj is self.object:
                self._show_findings(results)

    def _show_findings(self, results: Sequence[CheckResult]) -> None:
        self.findings = results
        self._results.content = findings_text(results)
        self._clear_marks()
        links = [link.name for link in self.object.links]
        for link, texts in faults_of_links(results, links).items():
            self._marks += self.view.mark(link, "fault", "; ".join(texts))

    def _clear_marks(self) -> None:
        for handle in self._marks:
            handle.remove()
        self._marks = []

    # -- the panel -----------------------------------------------------------------------------------------------

    def _add_panel(self) -> None:
        gui, names = self._server.gui, tuple(self._items)
        if len(names) > 1:
            chooser = gui.add_dropdown("object", names, initial_value=names[0])
            chooser.on_update(lambda event: self._try_to_choose(chooser.value))
        self._about = gui.add_markdown(about_text(self.object))
        self._folder = gui.add_folder("joints")
        self._add_sliders()
        with gui.add_folder("show"):
            for layer in LAYERS:
                if layer != TARGET:
                    box = gui.add_checkbox(layer, initial_value=False)
                    box.on_update(lambda event, layer=layer, box=box: self._switch(layer, box.value))
            surfaces = gui.add_checkbox("surfaces", initial_value=True)
            surfaces.on_update(lambda event: self.view.show_surfaces(surfaces.value))
        with gui.add_folder("checks"):
            gui.add_button("check").on_click(lambda event: self.check())
            self._results = gui.add_markdown("")

    def _try_to_choose(self, name: str) -> None:
        try:
            self.choose(name)
        except ArtiSkillError as error:
            self._about.content = f"**error:** {html.escape(str(error))}"

    def _switch(self, layer: str, is_visible: bool) -> None:
        with self._lock:
            self.view.show_layer(layer, is_visible)

    def _add_sliders(self) -> None:
        for widget in self._widgets:
            widget.remove()
        gui = self._server.gui
        with self._folder:
            self._sliders = [gui.add_slider(*_slider(joint)) for joint in self.object.joints]
            close = gui.add_button_group("", ("close", "half", "open"))
        for slider in self._sliders:
            slider.on_update(lambda event: self.set_joints())
        close.on_click(lambda event: self._open({"close": 0.0, "half": 0.5, "open": 1.0}[event.target.value]))
        self._widgets = [*self._sliders, close]

    def _open(self, share: float) -> None:
        for slider, joint in zip(self._sliders, self.object.joints, strict=True):
            slider.value = joint.rest + share * (slider.max - joint.rest)


def _slider(joint: Joint) -> tuple[str, float, float, float, float]:
    """Return label, lowest and highest value, step and first value of a joint's slider."""
    low, high = (float(v) if math.isfinite(v) else math.copysign(_TURN_RAD, v) for v in joint.limits)
    unit = "m" if joint.kind == "prismatic" else "rad"
    return f"{joint.name} ({unit})", low, high, (high - low) / _STEPS, float(joint.rest)


def about_text(obj: ArticulatedObject) -> str:
    """Return what is known of an object, as Markdown."""
    size = " x ".join(f"{v:.2f}" for v in obj.bounds[1] - obj.bounds[0])
    facts = f"{obj.category}, {size} m, {len(obj.joints)} joints, {len(obj.handles)} handles"
    return f"**{html.escape(obj.id)}**\n\n{facts}"


def findings_text(results: Sequence[CheckResult]) -> str:
    """Return the faults that checks found, as Markdown."""
    faults = [result for result in results if not result.passed]
    if not faults:
        return f"{len(results)} results, no fault."
    rows = [f"| {r.check} | {html.escape(r.subject)} | {r.measured} | {html.escape(r.note)} |" for r in faults]
    head = [f"{len(results)} results, **{len(faults)} faults:**", "", "| check | where | measured | |"]
    return "\n".join([*head, "|:--|:--|--:|:--|", *rows])


def faults_of_links(results: Sequence[CheckResult], links: Sequence[str]) -> dict[str, list[str]]:
    """Return by link the checks that found fault with it; a fault may concern several links, or none."""
    found: dict[str, list[str]] = {}
    for result in results:
        words = set(result.subject.replace(",", " ").replace("/", " ").split())
        for link in links:
            if not result.passed and link in words:
                found.setdefault(link, []).append(f"{result.check} {result.measured}".strip())
    return found

"""What chooses the episode that a page shows: one that is played, or a demonstration of a file."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.assets.catalog import list_objects, load_object
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demos import Demos
from artiskill.errors import ConfigError
from artiskill.evaluation.pictures import EpisodeChoice
from artiskill.evaluation.policies import POLICY_NAMES
from artiskill.sensors.pictures.objects import OrbitView, render_object
from artiskill.tasks.registry import make_task, task_names
from artiskill.viewer.episode_page import Do, Picker, from_browser
from artiskill.viewer.playback import LiveEpisode, Timeline, recorded_episode

DRAWN_BY_LEVEL = "drawn by the level"
_PICTURE = OrbitView(width=320, height=240)
_SPLITS = ("train", "test", "ood")


class LivePicker(Picker):
    """Task, object with its picture, target, level and policy.

    Args:
        choice: what is chosen at first.
    """

    def __init__(self, choice: EpisodeChoice) -> None:
        self._choice = choice

    def load(self) -> Timeline:
        """Return the chosen episode from its beginning."""
        return LiveEpisode(self._choice)

    def add_to(self, server: Any, do: Do) -> None:
        """Add the widgets."""
        gui, choice = server.gui, self._choice
        policies = tuple(dict.fromkeys((str(choice.policy), *POLICY_NAMES)))
        self._task = gui.add_dropdown(
            "task", tuple(dict.fromkeys((choice.task, *task_names()))), initial_value=choice.task
        )
        self._object = gui.add_dropdown("object", self._objects(), initial_value=self._object_name())
        self._target = gui.add_dropdown("target", self._targets(), initial_value=choice.target or DRAWN_BY_LEVEL)
        self._level = gui.add_number("level", choice.level, min=0, step=1)
        self._policy = gui.add_dropdown("policy", policies, initial_value=str(choice.policy))
        self._picture = gui.add_image(self._draw(), label="object")
        self._task.on_update(lambda event: from_browser(event, do, self._choose_task))
        self._object.on_update(lambda event: from_browser(event, do, self._choose_object))

    def take_over(self) -> None:
        """Take over what the widgets stand at."""
        target = self._target.value
        self._choice = replace(
            self._choice,
            target=None if target == DRAWN_BY_LEVEL else target,
            level=int(self._level.value),
            policy=self._policy.value,
        )

    def _choose_task(self) -> None:
        task = self._task.value
        names = _object_names(task)
        self._choice = replace(self._choice, task=task, object=names[0], target=None)
        self._object.options, self._object.value = names, names[0]
        self._show_object()

    def _choose_object(self) -> None:
        self._choice = replace(self._choice, object=self._object.value, target=None)
        self._show_object()

    def _show_object(self) -> None:
        self._target.options, self._target.value = self._targets(), DRAWN_BY_LEVEL
        self._picture.image = self._draw()

    def _object_name(self) -> str:
        given = self._choice.object
        return given if isinstance(given, str) else given.id

    def _objects(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys((self._object_name(), *_object_names(self._choice.task))))

    def _found(self) -> Any:
        given = self._choice.object
        return load_object(given) if isinstance(given, str) else given

    def _targets(self) -> tuple[str, ...]:
        return (DRAWN_BY_LEVEL, *make_task(self._choice.task, self._choice.config).targets(self._found()))

    def _draw(self) -> np.ndarray:
        return render_object(self._found(), 0.3, _PICTURE)


def _object_names(task: str) -> tuple[str, ...]:
    return tuple(name for split in _SPLITS for name in list_objects(split=split, task=task))


class DemoPicker(Picker):
    """An object's file of demonstrations, and one of them.

    Args:
        source: a file, or a folder with several.
        number: of the demonstration that is shown first.
    """

    def __init__(self, source: Path, number: int = 0) -> None:
        self._folder = None if source.suffix == ".h5" else Demos(source)
        self._source, self._number = source, number
        self._object = source.stem if self._folder is None else self._folder.objects[0]
        self._count = self._counted()

    def _open(self) -> DemoFile:
        return DemoFile(self._source) if self._folder is None else self._folder.open(self._object)

    def _counted(self) -> int:
        with self._open() as file:
            return len(file)

    def load(self) -> Timeline:
        """Return the chosen demonstration."""
        if not 0 <= self._number < self._count:
            raise ConfigError(f"{self._object} has the demonstrations 0 to {self._count - 1}, not {self._number}")
        with self._open() as file:
            return recorded_episode(file, self._number)

    def add_to(self, server: Any, do: Do) -> None:
        """Add the widgets."""
        names = (self._object,) if self._folder is None else tuple(self._folder.objects)
        self._objects = server.gui.add_dropdown("object", names, initial_value=self._object)
        self._numbers = server.gui.add_slider("demonstration", 0, max(self._count - 1, 1), 1, self._number)
        self._objects.on_update(lambda event: from_browser(event, do, self._choose_object))

    def take_over(self) -> None:
        """Take over what the widgets stand at."""
        self._number = int(self._numbers.value)

    def _choose_object(self) -> None:
        self._object = self._objects.value
        self._count, self._number = self._counted(), 0
        self._numbers.value, self._numbers.max = 0, max(self._count - 1, 1)

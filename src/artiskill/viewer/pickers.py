"""What chooses the episode that a page shows: one that is played, a demonstration, or an episode of a report."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.assets.catalog import list_objects, object_id_of, object_of
from artiskill.config import check
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demos import Demos
from artiskill.errors import ArtiSkillError, ConfigError
from artiskill.evaluation.pictures import EpisodeChoice
from artiskill.evaluation.policies import POLICY_NAMES
from artiskill.evaluation.stored_report import read_report
from artiskill.evaluation.verify import plan_again
from artiskill.sensors.pictures.objects import OrbitView, render_object
from artiskill.tasks.registry import make_task, task_names
from artiskill.viewer.driving import Do, from_browser
from artiskill.viewer.episode_page import Picker
from artiskill.viewer.playback import (
    NOT_SOLVED,
    SOLVED,
    LiveEpisode,
    Timeline,
)
from artiskill.viewer.recorded import ReportedEpisode, recorded_episode

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
        try:
            make_task(task, self._choice.config)
        except ArtiSkillError:  # what was set is no value of this task
            self._task.value = self._choice.task
            raise
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
        return object_id_of(self._choice.object)

    def _objects(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys((self._object_name(), *_object_names(self._choice.task))))

    def _found(self) -> Any:
        return object_of(self._choice.object)

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
        self._count = self._counted(self._object)

    def _open(self, name: str) -> DemoFile:
        return DemoFile(self._source) if self._folder is None else self._folder.open(name)

    def _counted(self, name: str) -> int:
        with self._open(name) as file:
            return len(file)

    def load(self) -> Timeline:
        """Return the chosen demonstration."""
        if not 0 <= self._number < self._count:
            raise ConfigError(f"{self._object} has the demonstrations 0 to {self._count - 1}, not {self._number}")
        with self._open(self._object) as file:
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
        name = self._objects.value
        try:
            self._count = self._counted(name)
        except ArtiSkillError:  # the file is damaged
            self._objects.value = self._object
            raise
        self._object, self._number = name, 0
        self._numbers.value, self._numbers.max = 0, max(self._count - 1, 1)


class ReportPicker(Picker):
    """An episode of a report: its object, and then the episode, of all or only of those that were not solved.

    Args:
        folder: of the report.
        number: of the episode that is shown first, as episodes.csv counts them from 0.

    Raises:
        ConfigError: the folder holds no whole report, or it was changed.
        ArtiSkillError: this version makes other episodes of what it says.
    """

    def __init__(self, folder: Path, number: int = 0) -> None:
        stored = read_report(folder)
        plan = plan_again(stored.report)
        self._policy = stored.report.policy
        self._results, self._actions = stored.episodes(), stored.actions()
        per_row = len(plan.batches[0].levels)
        self._batches = [batch for batch in plan.batches for _ in range(per_row)]
        if not len(self._batches) == len(self._results) == len(self._actions):
            raise ConfigError(f"{str(folder)!r} is damaged: `artiskill report verify` says where")
        check(
            0 <= number < len(self._results),
            f"the report has the episodes 0 to {len(self._results) - 1}, not {number}",
        )
        self._number = number

    def load(self) -> Timeline:
        """Return the chosen episode."""
        batch = replace(self._batches[self._number], obs_mode="state", sampling=None)
        return ReportedEpisode(
            batch.make_env(), self._actions[self._number], self._results[self._number], self._policy
        )

    def add_to(self, server: Any, do: Do) -> None:
        """Add the widgets."""
        gui, labels = server.gui, self._labels(False)
        self._failures = gui.add_checkbox("only unsolved", initial_value=False)
        self._rows = gui.add_dropdown("object", tuple(labels), initial_value=self._row(self._number))
        self._episodes = gui.add_dropdown(
            "episode", tuple(labels[self._rows.value]), initial_value=self._label(self._number)
        )
        self._failures.on_update(lambda event: from_browser(event, do, self._filter))
        self._rows.on_update(lambda event: from_browser(event, do, self._choose_row))

    def take_over(self) -> None:
        """Take over what the widgets stand at."""
        self._number = self._labels(False)[self._rows.value][self._episodes.value]

    def _filter(self) -> None:
        labels = self._labels(self._failures.value)
        if not labels:  # all were solved
            self._failures.value = False
            return
        self._rows.options = tuple(labels)
        if self._rows.value not in labels:
            self._rows.value = next(iter(labels))
        self._choose_row()

    def _choose_row(self) -> None:
        found = tuple(self._labels(self._failures.value)[self._rows.value])
        self._episodes.options, self._episodes.value = found, found[0]

    def _labels(self, only_unsolved: bool) -> dict[str, dict[str, int]]:
        """Return by object (and target) the episodes, label -> number."""
        found: dict[str, dict[str, int]] = {}
        for number, result in enumerate(self._results):
            if not (only_unsolved and result.success):
                found.setdefault(self._row(number), {})[self._label(number)] = number
        return found

    def _row(self, number: int) -> str:
        return ", ".join(self._batches[number].row)

    def _label(self, number: int) -> str:
        result = self._results[number]
        end = SOLVED if result.success else result.fault or NOT_SOLVED
        return f"level {result.level}, {result.target}: {end}, {result.length} steps"

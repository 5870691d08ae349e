"""Demonstrations by a person: an episode that was driven by hand joins those of its object in a folder.

The files are those of `collect`; their settings name the person, `expert.kind` is `human`. There is no plan: every
episode that is solved is stored, and the counts of a target say how many there are.
"""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from artiskill.demos.collect import check_same, with_unlisted
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demonstrator import DemoAttempt, RecordedActions
from artiskill.demos.demos import MANIFEST, Manifest, entry_of, file_name, read_manifest, write_manifest
from artiskill.demos.file_format import TargetCount, make_header, write_object_file
from artiskill.demos.recording import record
from artiskill.demos.settings import HUMAN, ExpertInfo, Settings, load_demos_config, plain, task_hash
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import DemoError
from artiskill.files import check_output_folder, lock_folder
from artiskill.tasks.task import Task
from artiskill.versions import versions

PERSON = "person"


def human_settings(task: Task, control_mode: str) -> Settings:
    """Return the settings of a person's demonstrations of a task."""
    demos = load_demos_config()
    return Settings(
        task=task.name,
        control_mode=control_mode,
        per_object=None,
        per_target=None,
        first_level=0,
        targets=None,
        keep_failures=False,
        variety=False,
        config=plain(task.config),
        config_hash=task_hash(task),
        expert=ExpertInfo(PERSON, HUMAN, ""),
        store=demos.store,
        patience=demos.patience,
        versions=versions(),
    )


def check_recording(folder: Path | str, task: Task, control_mode: str) -> None:
    """Check that a person's demonstrations could join those of a folder, without making it.

    Raises:
        DemoError: it holds demonstrations of other settings, or is damaged.
        ConfigError: it cannot be written to.
    """
    check_output_folder(Path(folder))
    _manifest(Path(folder), human_settings(task, control_mode))


def add_demonstration(
    folder: Path | str, task: Task, env: ManipulationEnv, actions: np.ndarray, by_hand: np.ndarray
) -> tuple[Path, int]:
    """Play an episode's actions again, and add what comes of them to a folder.

    Args:
        folder: of demonstrations by a person of this task and control mode; it is made if there is none.
        task: as it is stored; a policy may have had other cameras.
        env: that has just played the episode; it is left as it is.
        actions: (T, A) of the whole episode; they are stored as float32.
        by_hand: (T,) which of them the person chose; the others count as disturbed.

    Returns:
        The file, and the number of the demonstration in it.

    Raises:
        DemoError: the actions as they are stored do not solve the episode; or the folder holds demonstrations of
            other settings, is damaged, or cannot be written to.
        ConfigError: a collector is at the folder.
        DivergedError: the physics ran away.
    """
    folder, state, obj = Path(folder), env.save_state(), env.scene.object
    settings = human_settings(task, env.control.mode)
    actor = RecordedActions(actions.astype(np.float32), ~by_hand)
    recording = record(settings.make_env([obj]), obj, state.level, state.target, actor, settings.store)
    if not recording.success or len(recording.actions) != len(actions):
        raise DemoError("with the actions as a demonstration stores them, the episode is not solved")
    new = DemoAttempt(obj.id, state.target, state.level, True, len(actions), "", recording)
    with lock_folder(folder, "collector or replay"):
        manifest = with_unlisted(_manifest(folder, settings), folder)
        path = folder / file_name(obj.id)
        attempts = [*(_stored(path, obj.content_hash) if path.exists() else ()), new]
        header = make_header(obj, settings, _counts(attempts, task.targets(obj)), task.flag_names, attempts)
        write_object_file(path, header, attempts)
        with DemoFile(path) as file:
            write_manifest(manifest.with_file(path.name, entry_of(file)), folder)
    return path, len(attempts) - 1


def _manifest(folder: Path, settings: Settings) -> Manifest:
    """Return the folder's manifest, which must be of these settings; a new one where there is none."""
    if not (folder / MANIFEST).exists():
        return Manifest(settings)
    manifest = read_manifest(folder)
    check_same(folder, manifest.settings, settings)
    return manifest


def _stored(path: Path, content_hash: str) -> list[DemoAttempt]:
    """Return what a file holds, all of it solved."""
    with DemoFile(path) as file:
        if file.header.content_hash != content_hash:
            raise DemoError(
                f"{str(path)!r} holds demonstrations of another {file.header.object!r}; choose another folder"
            )
        return [
            DemoAttempt(file.header.object, one.target, one.level, one.success, len(one), "", one.recording)
            for one in file
        ]


def _counts(attempts: Sequence[DemoAttempt], targets: Sequence[str]) -> tuple[TargetCount, ...]:
    """Return how many there are of each target, in the object's order."""
    found = Counter(attempt.target for attempt in attempts)
    return tuple(
        TargetCount(name, found[name], found[name], found[name], False) for name in targets if found[name]
    )

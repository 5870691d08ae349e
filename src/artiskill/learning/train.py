"""`train`: a run from its data to its last checkpoint, or on from where it was stopped."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import torch

from artiskill.config import differing, dump_yaml
from artiskill.errors import ConfigError, DemoError, RunError
from artiskill.files import LOCK_FILE, lock_folder, output_path
from artiskill.jobs.parallel import available_cores
from artiskill.learning.loading import check_split
from artiskill.learning.processes import Processes, check_alone, joined_processes
from artiskill.learning.run import CONFIG, INFO, KEPT, SET, RunInfo, read_info, write_info, write_whole
from artiskill.learning.train_config import TrainConfig, read_train_config
from artiskill.learning.trainer import Develop, OnStep, SetSource, Source, Trainer, describe_run
from artiskill.learning.training_set import TrainingSet, is_training_set
from artiskill.versions import versions

OnSet = Callable[[str, int, int], None]  # what is done, how many trajectories of how many
_ENGINE = ("mujoco", "numba", "llvmlite", "h5py")


@dataclass(frozen=True)
class TrainData:
    """Where the data come from, and how a training set is made of what is none yet.

    Attributes:
        path: of a training set, of training files with point clouds, or of demonstrations.
        num_points: of a cloud; None for those of the training set, else 256, or all where files have fewer.
        frame: of the points; None for `world`, or that of the training files or set.
        workers: processes that replay demonstrations.
    """

    path: Path
    num_points: int | None = None
    frame: str | None = None
    workers: int = 1

    @property
    def name(self) -> str:
        """What messages call it."""
        return repr(str(self.path))

    def prepare(self, config: TrainConfig, folder: Path, on_set: OnSet | None) -> Source:
        """Return what a run learns from; a training set is made where there is none."""
        return SetSource(_make_set(config, self, folder, on_set))

    def open(self, config: TrainConfig, folder: Path) -> Source:
        """Return what `prepare` has prepared, in another process perhaps."""
        return SetSource(TrainingSet(self.path if is_training_set(self.path) else folder / SET))


@dataclass(frozen=True)
class RolloutData:
    """That a policy learns from rollouts, which are collected in between.

    Attributes:
        workers: processes that collect.
        on_note: called with a line about each round.
    """

    workers: int = 1
    on_note: Callable[[str], None] = print

    @property
    def name(self) -> str:
        """What messages call it."""
        return "these objects"

    def prepare(self, config: TrainConfig, folder: Path, on_set: OnSet | None) -> Source:
        """Return what a run learns from; there is nothing to be made beforehand."""
        return self.open(config, folder)

    def open(self, config: TrainConfig, folder: Path) -> Source:
        """Return what a run learns from."""
        from artiskill.learning.rollouts import Rollouts  # it needs the engine

        return Rollouts(config, folder, self.workers, self.on_note)


def train(
    config: TrainConfig,
    data: TrainData | RolloutData,
    folder: Path | str,
    device: str = "auto",
    threads: int | None = None,
    make_develop: Callable[[RunInfo], Develop] | None = None,
    on_lines: Callable[[list[str]], None] = lambda lines: None,
    on_set: OnSet | None = None,
    on_start: Callable[[int], None] = lambda step: None,
    on_step: OnStep = lambda step, text: None,
) -> Trainer:
    """Train, or go on with a run of the same values; `torchrun` may start several processes that call this.

    Args:
        config: see `load_train_config`.
        data: see `TrainData`; a training set is made in the run's folder where there is none. Of an interactive
            algorithm, `RolloutData`.
        folder: of the run.
        device: `auto`, `cpu` or `cuda`.
        threads: of the CPU, in each process; None for all cores.
        make_develop: returns what measures success on development objects; None if nothing does.
        on_lines: called with lines that say what will be trained, before the first step.
        on_set: called while a training set is made.
        on_start: called with the number of steps that were taken before.
        on_step: called after each step.

    Returns:
        The trainer, at its end.

    Raises:
        RunError: the folder holds a run of other values or data, or of another version, or something else; a loss
            is not finite; the disk is full.
        DemoError: the data are missing, damaged, of another task, or of no point clouds.
        ConfigError: an illegal value or device, another process trains in the folder, or several processes that
            `torchrun` has started are to collect rollouts, or cannot have as many steps of a batch each.
        KeyboardInterrupt: a signal came; a checkpoint was saved.
    """
    folder = output_path(folder)
    if isinstance(data, RolloutData):
        check_alone(config.name)
    with joined_processes(device) as processes:
        torch.set_num_threads(_thread_count(threads, processes))
        check_split(config.batch_size, processes.world_size)
        with lock_folder(folder, "training run") if processes.is_first else nullcontext():
            if processes.is_first:
                _prepare(config, data, folder, on_set)
            processes.wait()
            source, info = data.open(config, folder), read_info(folder)
            develop = make_develop(info) if make_develop is not None and processes.is_first else None
            trainer = Trainer(config, info, source, folder, processes, develop)
            if processes.is_first:
                notes = _version_notes(info, trainer.state.step > 0)
                on_lines(describe_run(trainer, source) + notes)
            on_start(trainer.state.step)
            trainer.run(on_step)
    return trainer


def _thread_count(given: int | None, processes: Processes) -> int:
    if given is None:
        return max(1, available_cores() // processes.world_size)
    if isinstance(given, bool) or not isinstance(given, int) or given < 1:
        raise ConfigError(f"threads must be a whole number of at least 1, not {given!r}")
    return given


def _prepare(config: TrainConfig, data: TrainData | RolloutData, folder: Path, on_set: OnSet | None) -> None:
    """Write what the run's folder says of itself, or compare it with what is asked for."""
    try:
        is_new = not (folder / INFO).exists()
        if is_new:
            _check_empty(folder)
        else:
            read_train_config(folder).check_continues(config, folder)
        info = data.prepare(config, folder, on_set).info(config, _versions())
        if not is_new and read_info(folder).data != info.data:
            raise RunError(
                f"{str(folder)!r} holds a run on other data than {data.name}; choose another folder, or the data "
                "of before"
            )
        write_whole(folder / CONFIG, dump_yaml(config).encode())
        if is_new:  # last: from now on the folder holds a run
            write_info(info, folder)
    except OSError as error:
        raise RunError(f"cannot write to {str(folder)!r}: {error.strerror or error}; {KEPT}") from error


def _check_empty(folder: Path) -> None:
    """Raise `RunError` if a folder without a run has something that no run has left before it began."""
    others = sorted({path.name for path in folder.iterdir()} - {LOCK_FILE, CONFIG, SET})
    if others:
        raise RunError(f"{str(folder)!r} holds no training run, but {others[0]!r}; choose another folder")


def _versions() -> dict[str, str]:
    return versions() | {"torch": version("torch")}


def _version_notes(info: RunInfo, is_resumed: bool) -> list[str]:
    """Return a line about versions that are not those that a run began with."""
    found = differing(info.versions, _versions()) if is_resumed else []
    return [
        f"note: other versions than at the run's beginning, so its bits may differ: {'; '.join(found)}"
    ] * bool(found)


def _make_set(config: TrainConfig, data: TrainData, folder: Path, on_set: OnSet | None) -> TrainingSet:
    """Return the training set: the one given, or one made in the run's folder."""
    if is_training_set(data.path):
        found = TrainingSet(data.path)
        found.require(task=config.task, num_points=data.num_points, frame=data.frame)
        return found
    if not data.path.is_dir():
        raise DemoError(
            f"there is no folder {str(data.path)!r}; data are training sets, training files of mode "
            "pointcloud, or demonstrations"
        )
    try:
        from artiskill.learning.building import build_training_set
        from artiskill.learning.set_sources import SetOptions
    except ImportError as error:
        if (error.name or "").split(".")[0] not in _ENGINE:
            raise
        raise DemoError(
            f"{str(data.path)!r} is no training set, and making one needs {error.name}, which is not installed "
            "here: make the set on another machine and copy it"
        ) from error
    options = SetOptions(num_points=data.num_points, frame=data.frame)
    return build_training_set(data.path, folder / SET, options, config.task, data.workers, on_set)

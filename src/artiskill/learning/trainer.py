"""`Trainer`: the loop. What happens in step i depends on the weights, the data, the seed and i alone.

So a run that was stopped in any way goes on from its last checkpoint, and on a CPU ends with the same bits.
"""

import hashlib
import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor

from artiskill.assets.catalog import object_id_of
from artiskill.config import to_mapping
from artiskill.errors import RunError
from artiskill.learning.algorithm import Algorithm
from artiskill.learning.batch import Batch
from artiskill.learning.checkpoints import (
    Records,
    TrainState,
    acting_copy,
    load_checkpoint,
    make_algorithm,
    save_checkpoint,
    save_weights,
)
from artiskill.learning.loading import BatchLoader
from artiskill.learning.processes import Processes
from artiskill.learning.run import BEST, KEPT, LATEST, RunInfo
from artiskill.learning.stopping import StopSignal
from artiskill.learning.train_config import OF_COMMANDS, TrainConfig, check_development, measured_among
from artiskill.learning.training_set import TrainingSet, manifest_text
from artiskill.tasks.levels import FIRST_DEMONSTRATED

# rows of development.csv for the weights in a file: an object, its episodes and its successes each
Develop = Callable[[Path, "StopSignal"], list[tuple[str, int, int]]]
OnStep = Callable[[int, str], None]  # steps so far, and the latest numbers as text

_CHECKPOINT_S = 300.0  # besides those every so many steps: what a crash may cost
_POLL_STEPS = 10  # of several processes, between asking one another whether to stop
_MOST_NAMED = 5  # development objects, in the line about them


class Source(Protocol):
    """What a run learns from."""

    @property
    def text(self) -> str:
        """What that is, in a line."""

    @property
    def notes(self) -> Sequence[str]:
        """Lines that warn about it."""

    def info(self, config: TrainConfig, versions: dict[str, str]) -> RunInfo:
        """Return what a new run says of itself."""

    def batches(self, trainer: "Trainer") -> AbstractContextManager[Iterator[Batch]]:
        """Return an endless iterator of batches, from where a run stands."""


class Trainer:
    """A run that trains, from its latest checkpoint if it has one.

    Args:
        config: resolved.
        info: of the run.
        source: of its batches.
        folder: of the run; locked by the caller, and written to by the first process only.
        processes: that train together.
        develop: measures success on development objects; None if nothing can, or shall.

    Attributes:
        state: where the run stands.
        algorithm: that is trained.
        info: of the run.

    Raises:
        RunError: the checkpoint is damaged, or further than the configuration's steps.
    """

    def __init__(
        self,
        config: TrainConfig,
        info: RunInfo,
        source: Source,
        folder: Path,
        processes: Processes,
        develop: Develop | None = None,
    ) -> None:
        self.config, self.info, self.processes = config, info, processes
        self._source, self._folder, self._stop = source, folder, StopSignal()
        self.algorithm: Algorithm = make_algorithm(config, info).to(processes.device).train()
        self._average = acting_copy(self.algorithm) if config.ema else None
        self._base_rates = [group["lr"] for group in self._groups]  # a checkpoint has those of its step
        self.state = TrainState()
        if (folder / LATEST).is_file():
            self.state = load_checkpoint(folder / LATEST, self.algorithm, self._average)
        if self.state.step > config.steps:
            raise RunError(
                f"{str(folder)!r} has trained for {self.state.step} steps already, more than the {config.steps} "
                "asked for; choose another folder, or more steps"
            )
        self._develop = develop if processes.is_first else None
        self._saved_step, self._saved_at = self.state.step, time.perf_counter()
        self._failed_step = torch.full((), -1, device=processes.device)
        self._sums: dict[str, Tensor] = {
            name: torch.tensor(total, dtype=torch.float64, device=processes.device)
            for name, (total, _) in self.state.sums.items()
        }
        self._counts = {name: count for name, (_, count) in self.state.sums.items()}

    @property
    def measures(self) -> bool:
        """Whether success is measured during training."""
        return self._develop is not None

    @property
    def parameters(self) -> int:
        """Numbers that are trained."""
        return sum(one.numel() for one in self.algorithm.parameters() if one.requires_grad)

    @property
    def acting(self) -> Algorithm:
        """The weights to act by."""
        return self._average or self.algorithm

    def check_stop(self) -> None:
        """Raise `KeyboardInterrupt` if a signal came; for work between two steps that takes long."""
        self._stop.check()

    def run(self, on_step: OnStep = lambda step, text: None) -> None:
        """Train until the configuration's number of steps.

        Raises:
            RunError: a loss is not finite, or the disk is full; earlier checkpoints are as they were.
            KeyboardInterrupt: a signal came; a checkpoint was saved.
        """
        with self._stop as stop:
            try:
                with Records(self._folder, self.state, self.processes.is_first) as records:
                    self._run(records, stop, on_step)
            except OSError as error:
                raise RunError(
                    f"cannot write to {str(self._folder)!r}: {error.strerror or error}; {KEPT}"
                ) from error

    def _run(self, records: Records, stop: StopSignal, on_step: OnStep) -> None:
        with self._source.batches(self) as loader:
            text = ""
            while True:
                self._develop_if_due(records, stop)
                if self._is_asked_to_stop(stop):
                    self.save()
                    self.processes.wait()
                    raise KeyboardInterrupt(f"interrupted after step {self.state.step}, which is saved")
                if self.state.step == self.config.steps:
                    break
                text = self._take_step(loader, records) or text
                on_step(self.state.step, text)
        if self._saved_step != self.state.step:
            self.save()
        self.processes.wait()

    def _is_asked_to_stop(self, stop: StopSignal) -> bool:
        if self.processes.world_size == 1:
            return stop.is_set
        at_end = self.state.step == self.config.steps
        return (at_end or self.state.step % _POLL_STEPS == 0) and self.processes.any(stop.is_set)

    def _take_step(self, loader: Iterator[Batch], records: Records) -> str:
        """Take one step, log and save if it is time; return the numbers as text if there are new ones."""
        start, step = time.perf_counter(), self.state.step
        self._set_rates(step)
        batch = next(loader)  # first: collecting it may draw from torch's own generator
        torch.manual_seed(self._noise_seed(step, 1))  # of dropout
        noise = torch.Generator().manual_seed(self._noise_seed(step, 0))
        numbers = self.algorithm.update(batch, step, noise, self.processes.sync, self._autocast)
        self._follow()
        self.state.step += 1
        self._add_numbers(numbers)
        is_logged = self.state.step % self.config.log_every == 0
        if is_logged or self.processes.device.type == "cpu":
            self._check_losses()
        self.state.seconds += time.perf_counter() - start
        text = self._log(records) if is_logged else ""
        is_late = time.perf_counter() - self._saved_at > _CHECKPOINT_S
        if self.state.step % self.config.checkpoint_every == 0 or is_late:
            self.save()
        return text

    @property
    def _groups(self) -> list[dict[str, Any]]:
        """Return the optimizers' groups of parameters."""
        return [group for one in self.algorithm.optimizers.values() for group in one.param_groups]

    def _set_rates(self, step: int) -> None:
        """Set the learning rates of the step that comes."""
        if self.config.schedule == "cosine":
            factor = 0.5 * (1.0 + math.cos(math.pi * step / self.config.steps))
            for group, rate in zip(self._groups, self._base_rates, strict=True):
                group["lr"] = rate * factor

    def _noise_seed(self, step: int, purpose: int) -> int:
        words = np.random.SeedSequence([self.config.seed, step, self.processes.rank, purpose])
        return int(words.generate_state(1, np.uint64)[0] >> np.uint64(1))

    def _autocast(self) -> AbstractContextManager[object]:
        if self.config.precision == "float32":
            return nullcontext()
        return torch.autocast(self.processes.device.type, dtype=torch.bfloat16)

    @torch.no_grad()
    def _follow(self) -> None:
        """Let the averaged weights follow."""
        if self._average is not None:
            followers, leaders = list(self._average.parameters()), list(self.algorithm.parameters())
            torch._foreach_lerp_(followers, leaders, 1.0 - self.config.ema)

    def _add_numbers(self, numbers: dict[str, Tensor]) -> None:
        is_finite = torch.stack([value.float() for value in numbers.values()]).isfinite().all()
        self._failed_step = torch.where(is_finite | (self._failed_step >= 0), self._failed_step, self.state.step)
        for name, value in numbers.items():
            self._sums[name] = self._sums[name] + value.double() if name in self._sums else value.double()
            self._counts[name] = self._counts.get(name, 0) + 1

    def _check_losses(self) -> None:
        step = int(self._failed_step.item())
        if step >= 0:
            raise RunError(
                f"a loss is not finite in step {step}: training diverged; the checkpoint of step "
                f"{self._saved_step} is kept. Try a lower learning rate, or another seed"
            )

    def _log(self, records: Records) -> str:
        means = {name: float(self._sums[name]) / self._counts[name] for name in sorted(self._sums)}
        self._sums, self._counts = {}, {}
        records.add_means(self.state, means, self._groups[0]["lr"])
        loss = means.get("imitation_loss")
        return (
            ", ".join(f"{name} {value:.3g}" for name, value in means.items())
            if loss is None
            else f"loss {loss:.4f}"
        )

    def save(self) -> None:
        """Write a checkpoint.

        Raises:
            RunError: a loss or a weight is not finite.
            OSError: it cannot be written.
        """
        self._check_losses()
        self.state.sums = {name: (float(total), self._counts[name]) for name, total in self._sums.items()}
        if self.processes.is_first:
            save_checkpoint(self._folder / LATEST, self.state, self.algorithm, self._average)
        self._saved_step, self._saved_at = self.state.step, time.perf_counter()

    def _develop_if_due(self, records: Records, stop: StopSignal) -> None:
        """Measure success on development objects where it is time; the best weights so far are kept."""
        state, every = self.state, self.config.development.every
        is_time = state.step % every == 0 or state.step == self.config.steps
        if self._develop is None or not is_time or state.developed == state.step or stop.is_set:
            return
        self.save()
        try:
            rows = self._develop(self._folder / LATEST, stop)
        except KeyboardInterrupt:  # a measurement that was not finished will be made anew
            return
        successes = sum(row[2] for row in rows)
        state.developed = state.step
        if successes >= state.best_successes:  # of equal ones the latest
            state.best_step, state.best_successes = state.step, successes
            save_weights(self._folder / BEST, state, self.acting)
        records.add_development(state, rows)
        self.save()


def describe_run(trainer: Trainer, source: Source) -> list[str]:
    """Return lines that say what will be trained, on what."""
    config, processes = trainer.config, trainer.processes
    number = f"{processes.world_size} processes, " if processes.world_size > 1 else ""
    device = str(processes.device)
    if processes.device.type == "cuda":
        device = f"{device} ({torch.cuda.get_device_name(processes.device)})"
    else:
        device = f"{device} ({torch.get_num_threads()} threads)"
    samples = config.steps * config.batch_size
    wanted = config.development
    few, others = wanted.objects[:_MOST_NAMED], len(wanted.objects[_MOST_NAMED:])
    named = ", ".join(few) + (f" and {others} others" if others else "")
    measured = f"success on {named} every {wanted.every} steps chooses the checkpoint"
    widths = ", ".join(map(str, config.network.point_layers))
    return [
        f"{config.name}, {config.task}: {source.text}",
        f"network {config.network.kind} ({widths} for points), {trainer.parameters} parameters; "
        f"{config.steps} steps of {config.batch_size}, {samples} samples; {config.precision} on {number}{device}",
        measured if trainer.measures else "no success is measured: the last checkpoint counts",
        *source.notes,
        *(_development_notes(trainer) if trainer.measures else ()),
    ]


def _development_notes(trainer: Trainer) -> list[str]:
    """Return a line if objects that are learned from choose the checkpoint."""
    both = sorted({*map(object_id_of, check_development(trainer.config))} & {*trainer.info.objects})
    if not both:
        return []
    more = f", as are {len(both) - 1} others" if len(both) > 1 else ""
    text = "so the checkpoint is not chosen by objects that the policy has never seen"
    return [f"note: development object {both[0]!r} is also learned from{more}, {text}"]


class SetSource:
    """Demonstrations, as what a run learns from.

    Args:
        training_set: that has them.
    """

    def __init__(self, training_set: TrainingSet) -> None:
        self._set = training_set

    @property
    def text(self) -> str:
        """What that is, in a line."""
        held = self._set.manifest
        objects = f"{len(held.objects)} objects" if len(held.objects) > 1 else held.objects[0]
        steps = f"{held.steps} steps of {held.trajectories} demonstrations"
        return f"{steps} on {objects}, {held.sizes.points} points each"

    @property
    def notes(self) -> Sequence[str]:
        """Lines if demonstrations are of objects that are measured, or begin where evaluations play."""
        found = []
        measured = list(measured_among(self._set.manifest.objects))
        if measured:
            more = f", and {len(measured) - 1} more of these" if len(measured) > 1 else ""
            found.append(
                f"note: {measured[0]}{more}, by which results are measured; on them, this policy's success says "
                "nothing of objects that it has never seen"
            )
        levels = self._set.trajectories["level"]
        count = int((levels < FIRST_DEMONSTRATED).sum())
        if count:
            where = f"{count} of {len(levels)} demonstrations begin at levels below {FIRST_DEMONSTRATED}"
            found.append(
                f"note: {where}, where evaluations play; a policy that recognises these starts does better there "
                "than at others"
            )
        return found

    def batches(self, trainer: Trainer) -> AbstractContextManager[Iterator[Batch]]:
        """Return the batches of a run from where it stands."""
        config, processes = trainer.config, trainer.processes
        loader = BatchLoader(
            self._set,
            config.batch_size,
            config.seed,
            trainer.algorithm.needs_next,
            processes.rank,
            processes.world_size,
            trainer.state.step,
            "cpu" if trainer.info.commands else processes.device,
            trainer.algorithm.end_steps,
        )
        if not trainer.info.commands:
            return loader
        from artiskill.learning.command_bc import CommandBatches  # it needs the engine's kernels

        return CommandBatches(loader, self._set, trainer)

    def info(self, config: TrainConfig, versions: dict[str, str]) -> RunInfo:
        """Return what a new run says of itself."""
        held = self._set.manifest
        statistics: dict[str, Any] = self._set.statistics._asdict()
        return RunInfo(
            task=held.task,
            algorithm=config.name,
            control_mode=held.control_mode,
            sampling=dict(held.sampling),
            sizes=dict(vars(held.sizes)),
            statistics={name: [float(x) for x in values] for name, values in statistics.items()},
            overrides=held.overrides,
            data=hashlib.sha256(manifest_text(held).encode()).hexdigest(),
            objects=list(held.objects),
            steps=held.steps,
            versions=versions,
            commands=self._commands(config),
        )

    def _commands(self, config: TrainConfig) -> dict[str, Any]:
        """Return the space of commands, where such are learned.

        Raises:
            ConfigError: these demonstrations tell no commands, or the values do not fit them.
            DemoError: they are too short to leave their ends out.
        """
        if config.name not in OF_COMMANDS:
            return {}
        from artiskill.learning.command_bc import check_demonstrated, demonstrated_space

        held = self._set.manifest
        space = demonstrated_space(config.task, held.control_mode, held.overrides)
        check_demonstrated(config, space, self._set)
        return to_mapping(space)

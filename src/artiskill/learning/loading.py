"""`BatchLoader`: batches of a training set, read ahead in threads; batch i depends on the seed and i alone."""

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple, Self

import numpy as np
import torch
from torch import Tensor

from artiskill.config import check
from artiskill.errors import DemoError
from artiskill.learning.batch import Batch, Observation
from artiskill.learning.observation import REAL, ObservationLayout
from artiskill.learning.training_set import TrainingSet

# Batches read before they are asked for: a disk answers several at once, and as many lie ready.
_READERS, _MOST_AHEAD, _LEAST_AHEAD = 8, 16, 2
_AHEAD_BYTES = 256_000_000  # that they may take


class StepSampler:
    """Draws steps: groups of object and target alike, the steps of a group alike.

    Args:
        training_set: whose steps are drawn.
        seed: of the draws.
        disturbed: also steps whose action was disturbed.
        end_steps: the last ones of each trajectory, which are not drawn.

    Raises:
        DemoError: there is no step to draw.
    """

    def __init__(self, training_set: TrainingSet, seed: int, disturbed: bool = False, end_steps: int = 0) -> None:
        steps, trajectories = training_set.steps, training_set.trajectories
        ends = (trajectories["first_step"] + trajectories["steps"])[steps["trajectory"]]
        is_legal = np.arange(len(steps)) < ends - end_steps
        legal = np.flatnonzero(is_legal if disturbed else is_legal & ~steps["disturbed"])
        if not len(legal):
            without = (
                f" without the last {end_steps} of each trajectory (algorithm.end_steps)" if end_steps else ""
            )
            raise DemoError(f"{str(training_set.folder)!r} has no step to learn from{without}")
        groups = training_set.group_of_trajectory[steps["trajectory"][legal]]
        counts = np.bincount(groups, minlength=training_set.group_of_trajectory.max() + 1)
        lost = int((counts == 0).sum()) if end_steps else 0
        if lost:
            raise DemoError(
                f"{str(training_set.folder)!r}: {lost} of {len(counts)} pairs of object and target have no step "
                f"without the last {end_steps} of each trajectory (algorithm.end_steps)"
            )
        self._seed = seed
        self._steps = legal[np.argsort(groups, kind="stable")]  # by group
        self._counts = counts[counts > 0]
        self._starts = np.cumsum(self._counts) - self._counts

    def draw(self, batch: int, size: int) -> np.ndarray:
        """Return the steps (size,) of the batch with a number.

        Every group occurs as often as any other, or once more.
        """
        rng = np.random.Generator(np.random.Philox(key=self._seed, counter=[0, 0, 0, batch]))
        count = len(self._counts)
        rounds = rng.random((-(-size // count), count)).argsort(axis=1, kind="stable")
        groups = rounds.reshape(-1)[:size]
        within = (rng.random(size) * self._counts[groups]).astype(np.int64)
        found: np.ndarray = self._steps[self._starts[groups] + within]
        return found


def check_split(batch_size: int, world_size: int) -> None:
    """Raise `ConfigError` if processes cannot have as many steps of a batch each."""
    text = f"a batch of {batch_size} cannot be split among {world_size} processes alike; choose a multiple"
    check(batch_size % world_size == 0, text)


class _Records(NamedTuple):
    """A batch as it lies on the disk, on its way to a device: fewer bytes travel."""

    records: Tensor  # (B, 1 or 2, bytes) uint8
    step: dict[str, Tensor]  # what `Batch` has besides observations


class BatchLoader:
    """An endless iterator of batches; a context manager that ends its threads.

    Resuming needs no state: a loader with `start_step=i` goes on with batch i.

    Args:
        training_set: read from.
        batch_size: steps of a batch, those of all ranks together.
        seed: of what is drawn.
        needs_next: also read what is seen next; disturbed steps are then drawn too, with weight 0.
        rank: of this process, which gets rows `rank`, `rank + world_size`, ... of each batch.
        world_size: number of processes.
        start_step: number of the first batch.
        device: where the batches go.
        end_steps: the last ones of each trajectory, which are left out.

    Raises:
        ConfigError: an illegal number.
        DemoError: the set has no step to learn from, or cannot be read.
    """

    def __init__(
        self,
        training_set: TrainingSet,
        batch_size: int,
        seed: int,
        needs_next: bool = False,
        rank: int = 0,
        world_size: int = 1,
        start_step: int = 0,
        device: torch.device | str = "cpu",
        end_steps: int = 0,
    ) -> None:
        check(batch_size >= 1, f"the batch size must be at least 1, not {batch_size}")
        check(0 <= rank < world_size, f"the rank must lie in [0, {world_size - 1}], not {rank}")
        check_split(batch_size, world_size)
        check(seed >= 0, f"the seed must be at least 0, not {seed}")
        check(start_step >= 0, f"the first batch's number must be at least 0, not {start_step}")
        self._set, self._size, self._next = training_set, batch_size, start_step
        self._needs_next, self._rank, self._ranks = needs_next, rank, world_size
        self._device = torch.device(device)
        self._sampler = StepSampler(training_set, seed, needs_next, end_steps)
        points = training_set.sizes.points * (3 + 3 + training_set.sizes.masks)
        batch_bytes = batch_size // world_size * (1 + needs_next) * points * np.dtype(np.float32).itemsize
        self._ahead = max(_LEAST_AHEAD, min(_MOST_AHEAD, _AHEAD_BYTES // batch_bytes))
        self._pool = ThreadPoolExecutor(_READERS, "artiskill-loader")
        self._waiting: deque[Future[Batch | _Records]] = deque()

    def __iter__(self) -> Self:
        """Return itself."""
        return self

    def __next__(self) -> Batch:
        """Return the next batch."""
        while len(self._waiting) < self._ahead:
            self._waiting.append(self._pool.submit(self._read, self._next))
            self._next += 1
        found = self._waiting.popleft().result()
        return found if isinstance(found, Batch) else self._decode(found)

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *error: object) -> None:
        """End the threads."""
        self.close()

    def rows(self, number: int) -> np.ndarray:
        """Return which steps of the set the batch with a number holds, for this process: (B,) indices."""
        return self._sampler.draw(number, self._size)[self._rank :: self._ranks]

    def close(self) -> None:
        """End the threads; what they have read is lost."""
        self._pool.shutdown(wait=True, cancel_futures=True)
        self._waiting.clear()

    def _read(self, number: int) -> Batch | _Records:
        """Return a batch, in a reader: by NumPy, as torch's own threads would be more than there are cores."""
        steps = self._set.steps[self.rows(number)]
        records = self._set.read(steps["frame"], int(self._needs_next))
        values = {name: steps[name] for name in ("action", "reward", "terminated")}
        values["weight"] = ~steps["disturbed"]
        step = {name: torch.from_numpy(np.array(v, np.float32)) for name, v in values.items()}
        if self._device.type != "cpu":
            as_bytes = torch.from_numpy(records.view(np.uint8).reshape(*records.shape, -1))
            return self._ready(_Records(as_bytes, step))
        seen = [self._set.layout.decode(records[:, k]) for k in range(records.shape[1])]
        return _batch([Observation(*map(torch.from_numpy, arrays)) for arrays in seen], step)

    def _ready(self, found: _Records) -> _Records:
        """Return it where a GPU can fetch it while others work."""
        if self._device.type != "cuda":
            return found
        return _Records(found.records.pin_memory(), {name: one.pin_memory() for name, one in found.step.items()})

    def _decode(self, found: _Records) -> Batch:
        records = found.records.to(self._device, non_blocking=True)
        step = {name: one.to(self._device, non_blocking=True) for name, one in found.step.items()}
        return _batch([decode(one, self._set.layout) for one in records.unbind(dim=1)], step)


def _batch(observations: list[Observation], step: dict[str, Tensor]) -> Batch:
    following = observations[1] if len(observations) > 1 else None
    return Batch(observation=observations[0], next_observation=following, **step)


def decode(records: Tensor, layout: ObservationLayout) -> Observation:
    """Return observations from the bytes of their records (B, bytes) uint8, on the same device."""
    count, n, fields = len(records), layout.points, layout.dtype.fields
    assert fields is not None

    def part(name: str) -> Tensor:
        kind, offset = fields[name][:2]
        return records[:, offset : offset + kind.itemsize].contiguous()

    codes = part("codes")
    bits = torch.arange(layout.masks, dtype=torch.uint8, device=records.device)
    return Observation(
        points=part("points").view(torch.float16).reshape(count, n, 3).float(),
        colors=part("colors").reshape(count, n, 3).float() / 255.0,
        masks=((codes[..., None] >> bits) & 1).float(),
        valid=codes >= int(REAL),
        agent=part("agent").view(torch.float32).reshape(count, layout.agent),
    )

"""Training by several processes: `torchrun` starts them, gradients are averaged, the first one keeps the books."""

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta

import torch
from torch import distributed as dist
from torch import nn

from artiskill.errors import ConfigError, UnknownNameError

DEVICES = ("auto", "cpu", "cuda")
_PATIENCE = timedelta(hours=24)  # while the first process makes a training set, or measures success


@dataclass(frozen=True)
class Processes:
    """This process among those that train together.

    Attributes:
        rank: 0 for the one that writes and prints.
        world_size: how many they are.
        device: of this process.
    """

    rank: int = 0
    world_size: int = 1
    device: torch.device = torch.device("cpu")  # noqa: RUF009 - immutable

    @property
    def is_first(self) -> bool:
        """Whether this is the one that writes and prints."""
        return self.rank == 0

    def sync(self, parameters: Iterable[nn.Parameter]) -> None:
        """Average gradients over all processes, in place."""
        gradients = [parameter.grad for parameter in parameters if parameter.grad is not None]
        if self.world_size == 1 or not gradients:
            return
        flat = torch.cat([gradient.reshape(-1) for gradient in gradients])
        dist.all_reduce(flat)
        flat /= self.world_size
        parts = flat.split([gradient.numel() for gradient in gradients])
        for gradient, part in zip(gradients, parts, strict=True):
            gradient.copy_(part.view_as(gradient))

    def any(self, flag: bool) -> bool:
        """Return whether the flag is set in any process."""
        if self.world_size == 1:
            return flag
        flags = torch.tensor(float(flag), device=self.device)
        dist.all_reduce(flags, dist.ReduceOp.MAX)
        return bool(flags.item())

    def wait(self) -> None:
        """Wait until all processes are here."""
        if self.world_size > 1:
            self.any(False)


def check_alone(algorithm: str) -> None:
    """Raise `ConfigError` if `torchrun` has started several processes, among which it cannot share its work."""
    if _world_size() > 1:
        raise ConfigError(f"{algorithm} trains in one process: start it without torchrun")


@contextmanager
def joined_processes(device: str) -> Iterator[Processes]:
    """Yield this process among those that `torchrun` started; alone if it did not.

    Args:
        device: `auto`, `cpu` or `cuda`; with several processes, each has a GPU of its own.

    Raises:
        UnknownNameError: no such device.
        ConfigError: no GPU can be used, or there are too few.
    """
    if device not in DEVICES:
        raise UnknownNameError("device", device, DEVICES)
    world_size = _world_size()
    if world_size == 1:
        yield Processes(device=_device(device, 0))
        return
    found = _device(device, int(os.environ.get("LOCAL_RANK", "0")))
    if found.type == "cuda":
        torch.cuda.set_device(found)
    dist.init_process_group("nccl" if found.type == "cuda" else "gloo", timeout=_PATIENCE)
    try:
        yield Processes(int(os.environ["RANK"]), world_size, found)
    finally:
        dist.destroy_process_group()


def _world_size() -> int:
    return int(os.environ.get("WORLD_SIZE", "1")) if "RANK" in os.environ else 1


def _device(name: str, number: int) -> torch.device:
    if name == "cpu" or (name == "auto" and not torch.cuda.is_available()):
        return torch.device("cpu")
    if not torch.cuda.is_available():
        build = "" if torch.version.cuda else ": this build of torch is for CPUs only"
        raise ConfigError(f"device 'cuda' cannot be used here{build}; legal: auto, cpu")
    if number >= torch.cuda.device_count():
        raise ConfigError(f"process {number} has no GPU: there are {torch.cuda.device_count()} here; start fewer")
    return torch.device("cuda", number)

"""Learning: how fast training sets are read.

`reading`: samples per second from a set that is ten times larger than the memory allowed to it. What the system
keeps of the set's files in memory is dropped whenever so much of it has been read; the process's own growth is
printed beside. The set is the demonstration pack's drawers, again and again.

    python benchmarks/learning.py --memory-mb 300 --points 256 --batch-size 128
"""

import argparse
import os
import resource
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from artiskill.demos.demos import PACK
from artiskill.learning.building import build_training_set
from artiskill.learning.loading import BatchLoader
from artiskill.learning.set_sources import SetOptions
from artiskill.learning.training_set import (
    FRAMES,
    MANIFEST,
    STEPS,
    TRAJECTORIES,
    SetFile,
    TrainingSet,
    manifest_text,
)

_RATIO = 10  # of the set to the memory allowed to it
_PAGE = 4096


def repeat(small: TrainingSet, folder: Path, times: int) -> TrainingSet:
    """Write a set that holds another one so many times, and forget what the system keeps of it."""
    held, frames = small.manifest, (small.folder / FRAMES).read_bytes()
    folder.mkdir()
    with (folder / FRAMES).open("wb") as file:
        for _ in range(times):
            file.write(frames)
    number = np.repeat(np.arange(times), held.steps)
    steps = np.tile(small.steps, times)
    steps["frame"] += number * held.frames
    steps["trajectory"] += (number * held.trajectories).astype(np.int32)
    trajectories = np.tile(small.trajectories, times)
    trajectories["first_step"] += np.repeat(np.arange(times), held.trajectories) * held.steps
    for name, rows in ((STEPS, steps), (TRAJECTORIES, trajectories)):
        np.save(folder / name, rows)
    files = {name: SetFile((folder / name).stat().st_size, "") for name in held.files}
    counts = {"trajectories": len(trajectories), "steps": len(steps), "frames": held.frames * times}
    (folder / MANIFEST).write_text(manifest_text(replace(held, files=files, **counts)))
    for name in files:
        drop(folder / name, written=True)
    return TrainingSet(folder)


def drop(path: Path, written: bool = False) -> None:
    """Have the system forget what it keeps of a file."""
    handle = os.open(path, os.O_RDONLY)
    if written:
        os.fsync(handle)
    os.posix_fadvise(handle, 0, 0, os.POSIX_FADV_DONTNEED)
    os.close(handle)


def bytes_from_disk() -> int:
    """What this process has read from disks so far."""
    lines = Path("/proc/self/io").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("read_bytes")).split()[1])


def resident_mb() -> float:
    """The most memory that this process has had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def report_reading(
    training_set: TrainingSet, batch_size: int, needs_next: bool, memory: float, seconds: float
) -> None:
    """Read for some time within so many bytes of memory."""
    record = training_set.layout.dtype.itemsize * (1 + needs_next)
    pages = (record + _PAGE - 1) / _PAGE + 1  # that a record lies in, on average
    most = max(1, int(memory / (pages * _PAGE * batch_size)))  # batches
    files = [training_set.folder / name for name in (FRAMES, STEPS)]
    for path in files:
        drop(path)
    before = resident_mb()
    with BatchLoader(training_set, batch_size, 0, needs_next) as loader:
        next(loader)
        count, disk, cpu, start = 0, bytes_from_disk(), time.process_time(), time.perf_counter()
        while time.perf_counter() < start + seconds:
            next(loader)
            count += 1
            if count % most == 0:
                for path in files:
                    drop(path)
        wall, cpu = time.perf_counter() - start, time.process_time() - cpu
    samples = count * batch_size
    print(
        f"reading{', with what is seen next' if needs_next else ''}: {samples / wall:,.0f} samples/s, "
        f"{samples / cpu:,.0f} per CPU-second, {(bytes_from_disk() - disk) / samples:,.0f} bytes from the disk "
        f"each; the process grew by {resident_mb() - before:.0f} MB"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--memory-mb", type=float, default=300, help="allowed to reading")
    parser.add_argument("--points", type=int, default=256)
    parser.add_argument("--batch-size", type=int, default=128)
    parser.add_argument("--seconds", type=float, default=8.0, help="of each measurement")
    parser.add_argument(
        "--folder", type=Path, help="on the disk that is measured (default: that of temporary files)"
    )
    arguments = parser.parse_args()
    memory = arguments.memory_mb * 1e6
    with tempfile.TemporaryDirectory(dir=arguments.folder) as name:
        start = time.perf_counter()
        small = build_training_set(
            PACK / "OpenCabinetDrawer", Path(name) / "small", SetOptions(num_points=arguments.points)
        )
        frames = small.manifest.frames
        print(f"building from demonstrations: {frames} frames in {time.perf_counter() - start:.1f} s")
        large = repeat(
            small, Path(name) / "large", int(_RATIO * memory / (small.folder / FRAMES).stat().st_size) + 1
        )
        size = (large.folder / FRAMES).stat().st_size
        print(f"a set of {len(large):,} steps, {size / 1e9:.1f} GB; {arguments.memory_mb:.0f} MB for reading it")
        for needs_next in (False, True):
            report_reading(large, arguments.batch_size, needs_next, memory, arguments.seconds)


if __name__ == "__main__":
    sys.exit(main())

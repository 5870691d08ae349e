"""Learning: how fast training sets are read, networks are trained, and policies act.

`reading`: samples per second from a set that is ten times larger than the memory allowed to it. What the system
keeps of the set's files in memory is dropped whenever so much of it has been read; the process's own growth is
printed beside. The set is the demonstration pack's drawers, again and again.

`training`: samples per core-second, one thread, of every network with every algorithm, on random clouds of 256
points for the small networks and of 1,200 for the others; processor time, everything of a step but reading.
`acting`: milliseconds of processor time for one observation, with torch and by an exported file. Of several rounds
the best counts: other work on the machine only slows. `pretrained`: the package's policies in an episode of their
own, with the environment's steps in between; median and 95th percentile.

    python benchmarks/learning.py reading --memory-mb 300 --points 256 --batch-size 128
    python benchmarks/learning.py training acting --networks small
"""

import argparse
import os
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch

import artiskill
from artiskill.demos.demos import PACK
from artiskill.envs.wrappers import Sampling
from artiskill.learning.algorithm import Algorithm
from artiskill.learning.array_policy import ArrayPolicy, Header, load_policy, write_policy
from artiskill.learning.batch import Batch, Observation, Sizes, Statistics
from artiskill.learning.building import build_training_set
from artiskill.learning.loading import BatchLoader
from artiskill.learning.network_config import NETWORKS, load_network_config
from artiskill.learning.networks import make_network
from artiskill.learning.observation import ObservationLayout
from artiskill.learning.set_sources import SetOptions
from artiskill.learning.train_config import (
    ALGORITHMS,
    OF_COMMANDS,
    algorithm_class,
    algorithm_config,
    load_train_config,
)
from artiskill.learning.training_set import (
    FRAMES,
    MANIFEST,
    STEPS,
    TRAJECTORIES,
    SetFile,
    TrainingSet,
    manifest_text,
)
from artiskill.tasks.registry import task_names

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


TASK = "OpenCabinetDrawer"
MASKS, AGENT, ACTION = 3, 38, 13  # of its observations and actions
POINTS = {"small": 256, "small_transformer": 256}
PAPERS_POINTS = 1200


def make_algorithm(network: str, algorithm: str) -> tuple[Algorithm, Sizes]:
    """An algorithm with fresh weights and its own values, for the task's sizes."""
    sizes = Sizes(POINTS.get(network, PAPERS_POINTS), MASKS, AGENT, ACTION)
    statistics = Statistics(np.zeros(3), np.ones(3), np.zeros(AGENT), np.ones(AGENT))
    generator = torch.Generator().manual_seed(0)
    values = replace(load_network_config(network), zero_output=False)
    config = load_train_config(algorithm, TASK, network)

    def make(outputs: int, extra: int) -> torch.nn.Module:
        return make_network(values, sizes, statistics, outputs, extra, generator)

    return algorithm_class(algorithm)(algorithm_config(config), make, sizes), sizes


def random_observation(sizes: Sizes, count: int) -> dict[str, object]:
    """Observations of an environment, a batch of so many."""
    rng = np.random.default_rng(0)
    n = sizes.points
    cloud = {
        "xyz": rng.normal(size=(count, n, 3)).astype(np.float32),
        "rgb": rng.integers(256, size=(count, n, 3), dtype=np.uint8),
        "seg": rng.integers(4, size=(count, n, 1))
        == np.arange(sizes.masks),  # two thirds of the points, as sampled
    }
    return {"pointcloud": cloud, "agent": rng.normal(size=(count, sizes.agent)).astype(np.float32)}


def observe(sizes: Sizes, observation: dict[str, object]) -> Observation:
    layout = ObservationLayout(sizes.points, sizes.masks, sizes.agent)
    return Observation(*map(torch.from_numpy, layout.observe(observation)))


def report_training(network: str, algorithm: str, batch_size: int, seconds: float) -> None:
    """Train for some time on one batch."""
    made, sizes = make_algorithm(network, algorithm)
    seen = observe(sizes, random_observation(sizes, batch_size))
    action = torch.rand((batch_size, ACTION), generator=torch.Generator().manual_seed(0)) * 2 - 1
    ones = torch.ones(batch_size)
    batch = Batch(seen, action, ones, -ones, torch.zeros(batch_size), seen if made.needs_next else None)
    noise = torch.Generator().manual_seed(0)

    def step(number: int) -> None:
        made.update(batch, number, noise, lambda parameters: None, nullcontext)

    step(0)
    count, start = 0, time.process_time()
    while time.process_time() < start + seconds or count % 2:  # pairs: TD3+BC moves its policy every second step
        step(count)
        count += 1
    rate = count * batch_size / (time.process_time() - start)
    weights = sum(parameter.numel() for parameter in made.parameters() if parameter.requires_grad)
    print(
        f"training {network}, {algorithm}: {rate:,.0f} samples per core-second ({weights:,} weights)", flush=True
    )


def act_ms(act: Callable[[], object], rounds: int = 8, calls: int = 10) -> float:
    """Processor time of a call in milliseconds, in the best round."""
    act()
    times = []
    for _ in range(rounds):
        start = time.process_time()
        for _ in range(calls):
            act()
        times.append((time.process_time() - start) / calls)
    return 1e3 * min(times)


def report_acting(network: str, algorithm: str, folder: Path) -> None:
    """Act on one observation, with torch and without."""
    made, sizes = make_algorithm(network, algorithm)
    made.requires_grad_(False).eval()
    seen = random_observation(sizes, 1)
    with_torch = act_ms(lambda: made.act(observe(sizes, seen)))
    header = Header(
        task=TASK,
        algorithm=algorithm,
        control_mode="joint",
        sampling={"num_points": sizes.points},
        observation_config={},
        frame="world",
        points=sizes.points,
        masks=MASKS,
        agent=AGENT,
        action=ACTION,
        network=load_network_config(network),
    )
    path = folder / f"{network}-{algorithm}.npz"
    write_policy(path, header, {name: value.numpy() for name, value in made.state_dict().items()})
    policy = ArrayPolicy(path)
    without = act_ms(lambda: policy.act(seen))
    print(f"acting {network}, {algorithm}: {with_torch:.2f} ms with torch, {without:.2f} ms without", flush=True)


def report_pretrained(task: str, steps: int = 150) -> None:
    """Play an episode and time each action of it."""
    policy, level = load_policy(task), {"level": 3, "object": artiskill.list_objects(task=task)[0]}
    env: Any = gym.make(f"ArtiSkill/{task}-v0", obs_mode=policy.obs_mode).unwrapped
    Sampling(**policy.sampling).wrap(env)
    observation, _ = env.reset(options=level)
    times = []
    for _ in range(steps):
        start = time.process_time()
        action = policy.act(observation)
        times.append(1e3 * (time.process_time() - start))
        observation, *_ = env.step(action)
    env.close()
    median, high = np.percentile(times[5:], (50, 95))  # what is loaded when first used is not counted
    print(f"acting {task}, of the package: {median:.2f} ms, 95 % within {high:.2f} ms", flush=True)


def report_set(arguments: argparse.Namespace) -> None:
    """Build a set, and read it without and with what is seen next."""
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parts = ("reading", "training", "acting", "pretrained")
    parser.add_argument("parts", nargs="*", default=parts, metavar="PART", help=f"{', '.join(parts)} (all)")
    parser.add_argument("--networks", nargs="+", choices=NETWORKS, default=NETWORKS)
    parser.add_argument("--memory-mb", type=float, default=300, help="allowed to reading")
    parser.add_argument("--points", type=int, default=256)
    parser.add_argument("--batch-size", type=int, default=128)
    parser.add_argument("--seconds", type=float, default=8.0, help="of each measurement")
    parser.add_argument(
        "--folder", type=Path, help="on the disk that is measured (default: that of temporary files)"
    )
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    for part in arguments.parts:
        if part not in parts:
            parser.error(f"unknown part {part!r}; legal: {', '.join(parts)}")
    pairs = [
        (network, algorithm)
        for network in arguments.networks
        for algorithm in ALGORITHMS
        if algorithm not in OF_COMMANDS
    ]
    if "reading" in arguments.parts:
        report_set(arguments)
    if "training" in arguments.parts:
        for network, algorithm in pairs:
            batch_size = arguments.batch_size if network in POINTS else arguments.batch_size // 4
            report_training(network, algorithm, batch_size, arguments.seconds)
    if "acting" in arguments.parts:
        with tempfile.TemporaryDirectory() as name:
            for network, algorithm in pairs:
                report_acting(network, algorithm, Path(name))
    if "pretrained" in arguments.parts:
        for task in task_names():
            report_pretrained(task)


if __name__ == "__main__":
    sys.exit(main())

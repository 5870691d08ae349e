"""What a first use costs: processor time for compiling kernels on an empty cache, by use and by kernel.

python benchmarks/first_use.py
python benchmarks/first_use.py --use pointcloud --kernels 20
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from typing import Any

# first uses, by name; each in a process of its own that has made the `state` environment before
USES: dict[str, dict[str, Any]] = {
    "state": {"obs_mode": "state"},
    "pointcloud": {"obs_mode": "pointcloud"},
    "rgbd": {"obs_mode": "rgbd"},
    "picture": {"obs_mode": "rgbd", "config": {"render.quality": "picture"}},
}
TASK = "ArtiSkill/OpenCabinetDrawer-v0"
Spent = dict[str, float]


def first_use(name: str) -> dict[str, Any]:
    """Seconds of processor time of a reset and a step in this process, and of each kernel that it compiled."""
    import gymnasium as gym

    import artiskill  # noqa: F401

    spent: Spent = {}
    listen(spent)
    before = time.process_time()
    if name != "state":
        gym.make(TASK, obs_mode="state").reset(seed=0)
    start = time.process_time()
    env = gym.make(TASK, **USES[name])
    env.reset(seed=0)
    env.step(env.action_space.sample())
    end = time.process_time()
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {"state_s": start - before, "use_s": end - start, "process_s": end, "mb": memory_mb, "kernels": spent}


def listen(spent: Spent) -> None:
    """Count each kernel's own seconds, without those that it calls, into `spent`."""
    from numba.core import event

    class Listener(event.Listener):
        def __init__(self) -> None:
            self.open: list[list[float]] = []

        def on_start(self, _: Any) -> None:
            self.open.append([time.process_time(), 0.0])

        def on_end(self, done: Any) -> None:
            start, within = self.open.pop()
            seconds = time.process_time() - start
            if self.open:
                self.open[-1][1] += seconds
            function = done.data["dispatcher"].py_func
            name = f"{function.__module__}.{function.__name__}"
            spent[name] = spent.get(name, 0.0) + seconds - within

    event.register("numba:compile", Listener())


def in_new_process(name: str, cache: str) -> dict[str, Any]:
    """`first_use` in a process of its own."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache, "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, __file__, "--inside", name]
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout)


def report(name: str, kernels: int, show: Callable[[str], None] = print) -> None:
    """Empty cache, then the same again."""
    with tempfile.TemporaryDirectory() as cache:
        cold, warm = in_new_process(name, cache), in_new_process(name, cache)
    show(
        f"{name:10}  first {cold['use_s']:5.1f} s of processor time ({len(cold['kernels'])} kernels, "
        f"{cold['mb']:.0f} MB), then {warm['use_s']:.2f} s ({warm['mb']:.0f} MB); "
        f"whole process {cold['process_s']:.1f} and {warm['process_s']:.1f} s"
    )
    for kernel, seconds in sorted(cold["kernels"].items(), key=lambda item: -item[1])[:kernels]:
        show(f"    {seconds:6.2f} s  {kernel}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--use", nargs="+", choices=USES, default=list(USES))
    parser.add_argument("--kernels", type=int, default=5, help="how many of the slowest to list")
    parser.add_argument("--inside", choices=USES, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.inside:
        json.dump(first_use(options.inside), sys.stdout)
        return
    for name in options.use:
        report(name, options.kernels)


if __name__ == "__main__":
    main()

"""Where a vector's step goes: engine, snapshot, rewards, observations, the rest (`cProfile`, one thread).

A profiler slows what is written in Python and leaves the engine alone, so that the engine's share is rather larger
than it says here. `--functions 20` also lists the functions that take most. `--help` lists the options.
"""

import argparse
import cProfile
import pstats
from typing import Any

import numpy as np

import artiskill
from artiskill.bench.cases import make_cases
from artiskill.bench.measure import make_bench_env
from artiskill.tasks.registry import task_names

# what a part is -> the functions whose whole time it is: end of the file's name, function
PARTS = {
    "engine": (("~", "<built-in method mujoco._batch.step>"),),
    "snapshot": (("sim/simulation.py", "snapshot"),),
    "flags and rewards": (("envs/core.py", "evaluate"),),
    "observation": (("envs/core.py", "observe"),),
}
WARM_UP = 5


def profiled(task: str, options: argparse.Namespace) -> pstats.Stats:
    """The profile of an episode's steps."""
    (case,) = make_cases([task], [options.obs], [options.num_envs], [1], ["train"], options.points)
    subject = make_bench_env(case)
    subject.start(np.arange(case.num_envs))
    rng = np.random.default_rng(0)
    shape = (WARM_UP + options.steps, case.num_envs, subject.action_size)
    actions = rng.uniform(-1, 1, shape).astype(np.float32)
    for values in actions[:WARM_UP]:
        subject.step(values)
    profiler = cProfile.Profile()
    profiler.enable()
    for values in actions[WARM_UP:]:
        subject.step(values)
    profiler.disable()
    return pstats.Stats(profiler)


def seconds_of(stats: Any, functions: tuple[tuple[str, str], ...]) -> float:
    """Time in these functions and in what they call."""
    return sum(
        cumulative
        for (file, _, name), (_, _, _, cumulative, _) in stats.stats.items()
        if (file, name) in functions or any(file.endswith(f) and name == n for f, n in functions)
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", nargs="+", choices=(*task_names(), "all"), default=["all"])
    parser.add_argument("--obs", default="state", help="observation mode")
    parser.add_argument("--points", type=int, help="down-sample point clouds")
    parser.add_argument("--num-envs", type=int, default=64, help="at least 2")
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("--functions", type=int, default=0, help="how many to list")
    options = parser.parse_args()
    if options.num_envs < 2:
        parser.error("--num-envs must be at least 2: one environment is no vector")
    for task in task_names() if "all" in options.task else options.task:
        stats = profiled(task, options)
        total = seconds_of(stats, (("envs/vector_env.py", "step"),))
        parts = {name: seconds_of(stats, functions) for name, functions in PARTS.items()}
        parts["the rest"] = total - sum(parts.values())
        told = ", ".join(f"{name} {spent / total:.1%}" for name, spent in parts.items())
        print(f"{task:18} {1e3 * total / options.steps:6.1f} ms a step of {options.num_envs}: {told}", flush=True)
        if options.functions:
            stats.sort_stats("tottime").print_stats(options.functions)
    print(f"artiskill {artiskill.__version__}, one thread")


if __name__ == "__main__":
    main()

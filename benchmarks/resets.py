"""Many auto-resets over all objects of a task: does memory grow, and how long does one take?

Every environment of a vector is over after one step and starts again at once (`same_step`), with any object of the
training, test and held-out splits. First each object is visited twice, which compiles its scene and fills whatever
is kept of it; memory is compared from then on. `reset` is the time of a whole step that resets all environments,
divided by their number, so the step itself is in it; `step` is that of a step without resets, for comparison.
`python benchmarks/resets.py --help` lists the options.
"""

import argparse
import gc
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import artiskill
from artiskill.bench.report import machine_facts, resident_mb
from artiskill.envs.vector_env import ManipulationVectorEnv
from artiskill.jobs.parallel import run_jobs
from artiskill.tasks.registry import task_names

SPLITS = ("train", "test", "ood")
GOAL_GROWTH_MB, GOAL_RESET_MS = 50.0, 20.0
REPORTS = 5  # on the way
VISITS = 2
Figures = dict[str, float | int | str | list[float]]


def all_objects(task: str) -> list[str]:
    """Ids of every object of the catalogue that a task can be done with."""
    return [name for split in SPLITS for name in artiskill.list_objects(split=split, task=task)]


def visit_all(env: ManipulationVectorEnv, objects: list[str]) -> None:
    """Begin an episode with each object, and take a step."""
    idle = np.zeros(env.action_space.shape, np.float32)
    for first in range(0, len(objects), env.num_envs):
        chosen = [objects[(first + i) % len(objects)] for i in range(env.num_envs)]
        env.reset(seed=first, options={"object": chosen})
        env.step(idle)


def step_ms(task: str, objects: list[str], options: argparse.Namespace) -> float:
    """Milliseconds per environment of a step without resets."""
    env = make(task, objects, options, episode_steps=200)
    env.reset(seed=0)
    return 1e3 * median_step_s(env, 10) / env.num_envs


def make(task: str, objects: list[str], options: argparse.Namespace, episode_steps: int) -> ManipulationVectorEnv:
    return ManipulationVectorEnv(
        options.num_envs,
        task,
        objects,
        obs_mode=options.obs,
        config={"episode_steps": episode_steps},
        num_threads=options.threads,
        copy=False,
        autoreset_mode="same_step",
    )


def median_step_s(env: ManipulationVectorEnv, steps: int) -> float:
    actions = np.random.default_rng(0).uniform(-1, 1, (steps, *env.action_space.shape)).astype(np.float32)
    spent = []
    for values in actions:
        start = time.perf_counter()
        env.step(values)
        spent.append(time.perf_counter() - start)
    return float(np.median(spent))


def resident() -> float:
    """Resident memory in MB, garbage collected before."""
    gc.collect()
    memory = resident_mb()
    if memory is None:
        raise SystemExit("this system does not say how much memory a process uses (no /proc/self/status)")
    return memory


def measure(job: tuple[str, argparse.Namespace], send: Callable[[Any], None]) -> Figures:
    """One task's figures, in a process of its own, so that its memory is its own."""
    task, options = job
    objects = all_objects(task)
    plain_ms = step_ms(task, objects, options)
    env = make(task, objects, options, episode_steps=1)
    for _ in range(VISITS):
        visit_all(env, objects)
    before, seen = resident(), set()
    send(f"{task}: {len(objects)} objects, {before:.0f} MB after warm-up")
    memory, rounds = [before], -(-options.resets // env.num_envs)
    actions = np.zeros(env.action_space.shape, np.float32)
    spent_s = 0.0
    for number in range(1, rounds + 1):
        start = time.perf_counter()
        _, _, _, truncated, info = env.step(actions)
        spent_s += time.perf_counter() - start
        assert truncated.all(), "every step ends every episode"
        seen.update(info["object"])
        if number % -(-rounds // REPORTS) == 0 or number == rounds:
            memory.append(resident())
            each_ms = 1e3 * spent_s / (number * env.num_envs)
            growth = memory[-1] - before
            send(f"  {number * env.num_envs:6} resets, {growth:+.1f} MB, {each_ms:.2f} ms each")
    return {
        "task": task,
        "obs_mode": options.obs,
        "objects": len(objects),
        "objects_seen": len(seen),
        "resets": rounds * env.num_envs,
        "memory_mb": memory,
        "growth_mb": memory[-1] - before,
        "reset_ms": 1e3 * spent_s / (rounds * env.num_envs),
        "step_ms": plain_ms,
    }


def main() -> None:
    import resets  # by its name, under which another process can import it

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", nargs="+", choices=(*task_names(), "all"), default=["all"])
    parser.add_argument("--resets", type=int, default=20_000)
    parser.add_argument("--num-envs", type=int, default=64)
    parser.add_argument("--threads", type=int, help="by default one per core")
    parser.add_argument("--obs", default="state", help="observation mode")
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    options = parser.parse_args()
    machine = machine_facts()
    figures = [
        run_jobs(resets.measure, [(task, options)], workers=1, on_message=print, isolated=True)[0]
        for task in (task_names() if "all" in options.task else options.task)
    ]
    for row in figures:
        print(
            f"{row['task']:18} {row['resets']} resets over {row['objects_seen']} of {row['objects']} objects: "
            f"{row['growth_mb']:+.1f} MB (at most {GOAL_GROWTH_MB:.0f}), {row['reset_ms']:.2f} ms each "
            f"(at most {GOAL_RESET_MS:.0f}; a step without reset {row['step_ms']:.2f} ms)"
        )
    print(f"artiskill {artiskill.__version__}, {machine['cores']} cores, load {machine['load']:.1f} at the start")
    if options.json:
        options.json.write_text(json.dumps({"machine": machine, "tasks": figures}, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()

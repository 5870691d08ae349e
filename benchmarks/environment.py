"""Steps and resets per second of one environment, against a bare loop of the engine, in one run.

Both loops start from the same states on the same model and apply the same controls; rounds alternate, so that a
machine whose speed drifts treats both alike. The environment's loop includes everything: checking and scaling
actions, snapshot, flags, dense reward with all terms, observation, info, and a reset every 200 steps. Time is the
process's CPU time, which other work on the machine hardly touches.

`--task` names one or several tasks, or `all`; `--objects median` takes the object of each task with the median
number of collision shapes. `python benchmarks/environment.py --help` lists the options.
"""

import argparse
import json
import os
import statistics
import time
from pathlib import Path

import gymnasium as gym
import mujoco
import numpy as np

import artiskill
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.evaluation.policies import load_policy
from artiskill.tasks.registry import task_names

EPISODE = 200
MEDIAN = "median"


def recorded_actions(env: ManipulationEnv, source: str, steps: int) -> np.ndarray:
    """Actions for `steps` steps of levels 0, 1, ...: random, or the expert's, which spends its time in contact."""
    if source == "random":
        return np.random.default_rng(0).uniform(-1, 1, (steps, *env.action_space.shape)).astype(np.float32)
    expert, actions = load_policy("expert"), []
    for i in range(steps):
        if i % EPISODE == 0:
            observation, info = env.reset(seed=i // EPISODE)
            expert.reset(env, observation, info)
        actions.append(np.asarray(expert.act(env, observation), dtype=np.float32))
        observation, *_ = env.step(actions[-1])
    return np.array(actions)


def environment_rate(env: gym.Env, actions: np.ndarray) -> float:
    """Environment steps per second, through `gym.make`'s wrappers as a user would."""
    start = time.process_time()
    for i, action in enumerate(actions):
        if i % EPISODE == 0:
            env.reset(seed=i // EPISODE)
        env.step(action)
    return len(actions) / (time.process_time() - start)


def engine_rate(env: ManipulationEnv, actions: np.ndarray) -> float:
    """The same with `mj_step` alone, 25 per action, on an episode's own model, joint parameters included."""
    targets = env.control.joint_scale.to_targets(actions.astype(float))
    spent = 0.0
    for first in range(0, len(actions), EPISODE):
        env.reset(seed=first // EPISODE)
        simulation = env.simulation
        model = simulation._models[0]
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = simulation._qpos[0], simulation._qvel[0]
        substeps = range(env.task.physics.physics_steps_per_step)
        start = time.process_time()
        for target in targets[first : first + EPISODE]:
            data.ctrl[:] = target
            for _ in substeps:
                mujoco.mj_step(model, data)
        spent += time.process_time() - start
    return len(actions) / spent


def measure_steps(task: str, object_id: str, source: str, steps: int, rounds: int) -> dict[str, float | str]:
    """Medians over the rounds of one object and one source of actions."""
    env = gym.make(f"ArtiSkill/{task}-v0", objects=object_id)
    actions = recorded_actions(env.unwrapped, source, steps)
    pairs = [(environment_rate(env, actions), engine_rate(env.unwrapped, actions)) for _ in range(rounds)]
    return {
        "task": task,
        "object": object_id,
        "shapes": collision_shapes(object_id),
        "actions": source,
        "steps_per_s": statistics.median(rate for rate, _ in pairs),
        "engine_steps_per_s": statistics.median(ceiling for _, ceiling in pairs),
        "ratio": statistics.median(rate / ceiling for rate, ceiling in pairs),
    }


def measure_resets(task: str, objects: list[str]) -> dict[str, float]:
    """Milliseconds to reset to another object, for the first time in the process and again."""
    env = gym.make(f"ArtiSkill/{task}-v0", objects=objects)
    times: dict[str, list[float]] = {"first": [], "again": []}
    for visit in times:
        for object_id in objects:
            start = time.process_time()
            env.reset(options={"level": 0, "object": object_id})
            times[visit].append(1e3 * (time.process_time() - start))
    return {
        f"{visit}_{name}_ms": f(ms)
        for visit, ms in times.items()
        for name, f in (("median", statistics.median), ("max", max))
    }


def collision_shapes(object_id: str) -> int:
    """How many shapes of an object can touch something."""
    return sum(len(link.collisions) for link in artiskill.load_object(object_id).links)


def chosen_objects(task: str, given: list[str] | None) -> list[str]:
    """The objects to step: those given, by default six of the test split."""
    if given == [MEDIAN]:
        ids = sorted(artiskill.list_objects(task=task), key=lambda name: (collision_shapes(name), name))
        return [ids[len(ids) // 2]]
    return given or artiskill.list_objects(split="test", task=task)[:6]


def measure_task(task: str, options: argparse.Namespace) -> tuple[dict[str, float], list[dict[str, float | str]]]:
    """Resets and steps of one task, printed as they come."""
    resets = measure_resets(task, artiskill.list_objects(split="test", task=task))
    told = ", ".join(f"{name} {value:.1f}" for name, value in resets.items())
    print(f"{task}: reset to another object: {told}")
    rows = []
    for source in options.actions:
        for object_id in chosen_objects(task, options.objects):
            row = measure_steps(task, object_id, source, options.steps, options.rounds)
            rows.append(row)
            rate, ceiling, ratio = row["steps_per_s"], row["engine_steps_per_s"], row["ratio"]
            print(
                f"{object_id} ({row['shapes']} shapes) {source:7} {rate:6.0f} steps/s, "
                f"bare engine {ceiling:6.0f}, ratio {ratio:.2f}",
                flush=True,
            )
        of_source = [row for row in rows if row["actions"] == source]
        rate, ratio = (statistics.median(row[key] for row in of_source) for key in ("steps_per_s", "ratio"))
        print(f"median {source:7} {rate:6.0f} steps/s, ratio {ratio:.2f}", flush=True)
    return resets, rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", nargs="+", choices=(*task_names(), "all"), default=["OpenCabinetDrawer"])
    parser.add_argument("--objects", nargs="+", help="ids, or `median`; by default six of the test split")
    parser.add_argument("--steps", type=int, default=600)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--actions", choices=("random", "expert"), nargs="+", default=["random", "expert"])
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    options = parser.parse_args()
    tasks = task_names() if "all" in options.task else options.task
    measured = {task: measure_task(task, options) for task in tasks}
    print(f"artiskill {artiskill.__version__}, mujoco {mujoco.__version__}, {os.cpu_count()} cores, one used")
    if options.json:
        figures = {task: {"resets": resets, "steps": rows} for task, (resets, rows) in measured.items()}
        options.json.write_text(json.dumps(figures, indent=2), encoding="utf-8")


if __name__ == "__main__":
    main()

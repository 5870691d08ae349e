"""Steps and resets per second of one environment, against a bare loop of the engine, in one run.

Both loops start from the same states on the same model and apply the same controls; rounds alternate, so that a
machine whose speed drifts treats both alike. The environment's loop includes everything: checking and scaling
actions, snapshot, flags, dense reward with all terms, observation, info, and a reset every 200 steps.
`python benchmarks/environment.py --help` lists the options.
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
from artiskill.experts.open_cabinet import OpenCabinetExpert

EPISODE = 200


def recorded_actions(env: ManipulationEnv, source: str, steps: int) -> np.ndarray:
    """Actions for `steps` steps of levels 0, 1, ...: random, or the expert's, which spends its time in contact."""
    if source == "random":
        return np.random.default_rng(0).uniform(-1, 1, (steps, *env.action_space.shape)).astype(np.float32)
    expert, actions = OpenCabinetExpert(env.task.robot), []
    for i in range(steps):
        if i % EPISODE == 0:
            env.reset(seed=i // EPISODE)
            expert.reset(env.snapshot, env.goal)
        actions.append(expert.act(env.snapshot, env.goal).astype(np.float32))
        env.step(actions[-1])
    return np.array(actions)


def environment_rate(env: gym.Env, actions: np.ndarray) -> float:
    """Environment steps per second, through `gym.make`'s wrappers as a user would."""
    start = time.perf_counter()
    for i, action in enumerate(actions):
        if i % EPISODE == 0:
            env.reset(seed=i // EPISODE)
        env.step(action)
    return len(actions) / (time.perf_counter() - start)


def engine_rate(env: ManipulationEnv, actions: np.ndarray) -> float:
    """The same with `mj_step` alone, 25 per action, on an episode's own model, joint parameters included."""
    targets = env.control.joint_scale.to_targets(actions.astype(float))
    spent = 0.0
    for first in range(0, len(actions), EPISODE):
        env.reset(seed=first // EPISODE)
        model = env._simulation._models[0]
        data = mujoco.MjData(model)
        data.qpos[:] = np.concatenate((env.snapshot.robot_qpos[0], env.snapshot.object_qpos[0]))
        substeps = range(env.task.physics.physics_steps_per_step)
        start = time.perf_counter()
        for target in targets[first : first + EPISODE]:
            data.ctrl[:] = target
            for _ in substeps:
                mujoco.mj_step(model, data)
        spent += time.perf_counter() - start
    return len(actions) / spent


def measure_steps(object_id: str, source: str, steps: int, rounds: int) -> dict[str, float | str]:
    env = gym.make("ArtiSkill/OpenCabinetDrawer-v0", objects=object_id)
    actions = recorded_actions(env.unwrapped, source, steps)
    pairs = [(environment_rate(env, actions), engine_rate(env.unwrapped, actions)) for _ in range(rounds)]
    return {
        "object": object_id,
        "actions": source,
        "steps_per_s": statistics.median(rate for rate, _ in pairs),
        "engine_steps_per_s": statistics.median(ceiling for _, ceiling in pairs),
        "ratio": statistics.median(rate / ceiling for rate, ceiling in pairs),
    }


def measure_resets(objects: list[str]) -> dict[str, float]:
    """Milliseconds to reset to another object, for the first time in the process and again."""
    env = gym.make("ArtiSkill/OpenCabinetDrawer-v0", objects=objects)
    times: dict[str, list[float]] = {"first": [], "again": []}
    for visit in times:
        for object_id in objects:
            start = time.perf_counter()
            env.reset(options={"level": 0, "object": object_id})
            times[visit].append(1e3 * (time.perf_counter() - start))
    return {
        f"{visit}_{name}_ms": f(ms)
        for visit, ms in times.items()
        for name, f in (("median", statistics.median), ("max", max))
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", nargs="+", help="ids; by default six of the test split")
    parser.add_argument("--steps", type=int, default=600)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--actions", choices=("random", "expert"), nargs="+", default=["random", "expert"])
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    arguments = parser.parse_args()
    catalogue = artiskill.list_objects(split="test", task="OpenCabinetDrawer")
    resets = measure_resets(catalogue)
    print("reset to another object: " + ", ".join(f"{name} {value:.1f}" for name, value in resets.items()))
    rows = []
    for source in arguments.actions:
        for object_id in arguments.objects or catalogue[:6]:
            row = measure_steps(object_id, source, arguments.steps, arguments.rounds)
            rows.append(row)
            rate, ceiling, ratio = row["steps_per_s"], row["engine_steps_per_s"], row["ratio"]
            print(
                f"{object_id} {source:7} {rate:6.0f} steps/s, bare engine {ceiling:6.0f}, ratio {ratio:.2f}",
                flush=True,
            )
        of_source = [row for row in rows if row["actions"] == source]
        rate, ratio = (statistics.median(row[key] for row in of_source) for key in ("steps_per_s", "ratio"))
        print(f"median       {source:7} {rate:6.0f} steps/s, ratio {ratio:.2f}", flush=True)
    print(f"artiskill {artiskill.__version__}, mujoco {mujoco.__version__}, {os.cpu_count()} cores, one used")
    if arguments.json:
        arguments.json.write_text(json.dumps({"resets": resets, "steps": rows}, indent=2), encoding="utf-8")


if __name__ == "__main__":
    main()

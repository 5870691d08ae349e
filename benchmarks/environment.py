"""Environment steps per second of one environment, against a bare loop of the engine, in one run.

Both loops take the same actions on the same object from the same state; rounds alternate, so that a machine whose
speed drifts treats both alike. `python benchmarks/environment.py --help` lists the options.
"""

import argparse
import json
import os
import statistics
import time

import gymnasium as gym
import mujoco
import numpy as np

import artiskill
from artiskill.envs.manipulation import ManipulationEnv


def environment_rate(env: gym.Env, actions: np.ndarray) -> float:
    """Environment steps per second, everything included; resets (one per 200 steps) too."""
    start = time.perf_counter()
    for i, action in enumerate(actions):
        if i % 200 == 0:
            env.reset(seed=i // 200)
        env.step(action)
    return len(actions) / (time.perf_counter() - start)


def engine_rate(env: ManipulationEnv, actions: np.ndarray) -> float:
    """The same with nothing but `mj_step`, 25 per action, called one by one."""
    simulation = env._simulation
    model, data = simulation.scene.model, mujoco.MjData(simulation.scene.model)
    joints = simulation.scene.index.object_joints
    substeps = env.task.physics.physics_steps_per_step
    starts = []
    for episode in range(0, len(actions), 200):
        env.reset(seed=episode // 200)
        starts.append((env.snapshot, simulation._models[0]))
    targets = env._scale.to_targets(actions.astype(float))
    start = time.perf_counter()
    for i, target in enumerate(targets):
        if i % 200 == 0:
            snapshot, parameters = starts[i // 200]
            mujoco.mj_resetData(model, data)
            data.qpos[:] = np.concatenate((snapshot.robot_qpos[0], snapshot.object_qpos[0]))
            model.dof_damping[joints] = parameters.dof_damping[joints]
            model.dof_frictionloss[joints] = parameters.dof_frictionloss[joints]
        data.ctrl[:] = target
        for _ in range(substeps):
            mujoco.mj_step(model, data)
    return len(actions) / (time.perf_counter() - start)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--objects", nargs="+", default=["cabinet-0001", "cabinet-0026"])
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--actions", choices=("random", "expert"), default="random")
    parser.add_argument("--json", help="also write the figures to this file")
    arguments = parser.parse_args()
    rng = np.random.default_rng(0)
    rows = []
    for name in arguments.objects:
        env = gym.make("ArtiSkill/OpenCabinetDrawer-v0", objects=name)
        env.reset(seed=0)
        actions = rng.uniform(-1, 1, (arguments.steps, *env.action_space.shape)).astype(np.float32)
        rates, ceilings = [], []
        for _ in range(arguments.rounds):
            rates.append(environment_rate(env, actions))
            ceilings.append(engine_rate(env.unwrapped, actions))
        ratio = statistics.median(r / c for r, c in zip(rates, ceilings, strict=True))
        rows.append({"object": name, "steps_per_s": statistics.median(rates), "engine_steps_per_s": statistics.median(ceilings), "ratio": ratio})
        print(f"{name}: {rows[-1]['steps_per_s']:7.0f} steps/s, bare engine {rows[-1]['engine_steps_per_s']:7.0f}, ratio {ratio:.2f}")
    print(f"artiskill {artiskill.__version__}, mujoco {mujoco.__version__}, {os.cpu_count()} cores")
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            json.dump(rows, file, indent=2)


if __name__ == "__main__":
    main()

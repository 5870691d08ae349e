"""Environment steps per second by observation mode: one process, one core, `gym.make`, everything included.

Random actions, a reset every 200 steps. Rounds go over all modes and objects in turn, and the best round of each
counts: other work on the machine only slows. `--stages` says where a visual step's time goes.
`python benchmarks/observations.py --help` lists the options.
"""

import argparse
import json
import os
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import gymnasium as gym
import numpy as np

import artiskill
from artiskill.envs.core import ObservationContext
from artiskill.envs.vision import CameraRig
from artiskill.envs.wrappers import PointCloudDownsample

EPISODE = 200
MODES = ("state", "rgbd", "pointcloud", "maniskill", "uniform", "voxel", "fps")
# environment steps per second to reach, see docs/observations.md
GOALS = {"rgbd": 330, "pointcloud": 330, "maniskill": 400}


def make(mode: str, object_id: str) -> gym.Env:
    """The environment of an observation mode, or of a sampling method, which means 1,200 points."""
    obs_mode = mode if mode in ("state", "rgbd", "pointcloud") else "pointcloud"
    env = gym.make("ArtiSkill/OpenCabinetDrawer-v0", objects=object_id, obs_mode=obs_mode)
    return env if mode == obs_mode else PointCloudDownsample(env, mode)


def rate(env: gym.Env, steps: int) -> float:
    """Steps per second; the first reset and step, which compile and build, are not timed."""
    actions = np.random.default_rng(0).uniform(-1, 1, (steps, *env.action_space.shape)).astype(np.float32)
    env.reset(seed=0)
    env.step(actions[0])
    start = time.perf_counter()
    for i, action in enumerate(actions):
        if i % EPISODE == 0:
            env.reset(seed=i // EPISODE)
        env.step(action)
    return steps / (time.perf_counter() - start)


def median_ms(work: Callable[[], object], rounds: int = 60) -> float:
    times = []
    for _ in range(rounds + 1):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return 1e3 * statistics.median(times[1:])


def stages(object_id: str) -> dict[str, float]:
    """Milliseconds of the parts of a visual step."""
    parts = {}
    for mode in MODES:
        env = make(mode, object_id)
        env.reset(seed=0)
        base = env.unwrapped
        if mode == "state":
            action = np.zeros(env.action_space.shape, np.float32)
            parts["step in mode state"] = median_ms(lambda e=env, a=action: e.step(a))
        elif mode == "rgbd":
            rig = CameraRig(base.task)
            felt = np.empty(rig.agent_space.shape, np.float32)
            instant = ObservationContext(base.snapshot, base.goal, 0, 0, 0)
            parts["the robot's part"] = median_ms(lambda: rig.proprioception(instant, felt))  # noqa: B023
        if mode != "state":
            parts[f"observation {mode}, rendering included"] = median_ms(lambda b=base: b._observe())
    return parts


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    catalogue = artiskill.list_objects(split="test", task="OpenCabinetDrawer")
    parser.add_argument("--objects", nargs="+", default=list(catalogue[:3]))
    parser.add_argument("--modes", nargs="+", choices=MODES, default=list(MODES))
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=6)
    parser.add_argument("--stages", action="store_true", help="also where the time of a step goes")
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    options = parser.parse_args()
    envs = {mode: {object_id: make(mode, object_id) for object_id in options.objects} for mode in options.modes}
    figures: dict[str, dict[str, float]] = {mode: dict.fromkeys(options.objects, 0.0) for mode in options.modes}
    for _ in range(options.rounds):
        for mode, of_mode in envs.items():
            for object_id, env in of_mode.items():
                figures[mode][object_id] = max(figures[mode][object_id], rate(env, options.steps))
    for mode in options.modes:
        goal = f", to reach {GOALS[mode]}" if mode in GOALS else ""
        each = ", ".join(f"{name} {value:.0f}" for name, value in figures[mode].items())
        print(f"{mode:10} {min(figures[mode].values()):5.0f} steps/s at least{goal} ({each})", flush=True)
    parts = stages(options.objects[0]) if options.stages else {}
    for name, ms in parts.items():
        print(f"{ms:6.2f} ms  {name}")
    print(f"artiskill {artiskill.__version__}, {os.cpu_count()} cores, one used")
    if options.json:
        options.json.write_text(json.dumps({"steps_per_s": figures, "ms": parts}, indent=2), encoding="utf-8")


if __name__ == "__main__":
    main()

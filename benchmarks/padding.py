"""What padding costs: the engine alone on padded scenes, against the same scenes without padding.

Both start from the same states and get the same drive targets; rounds alternate between them. What counts is the
median step of each round, and the best round. `--every 4` takes every fourth object of each split.
`python benchmarks/padding.py --help` lists the options.
"""

import argparse
import json
import statistics
import time
from pathlib import Path
from unittest import mock

import numpy as np

import artiskill
from artiskill.assets.articulated_object import CATEGORIES, ArticulatedObject
from artiskill.scene import scene as scene_module
from artiskill.scene.scene import Scene, build_scene
from artiskill.sim.simulation import BareEngine, Simulation
from artiskill.tasks.levels import RngStream, level_generator
from artiskill.tasks.registry import make_task
from artiskill.tasks.task import Task

TASK_OF = {"cabinet": "OpenCabinetDrawer", "chair": "PushChair", "bucket": "MoveBucket"}
SPLITS = ("train", "test", "ood")
GOAL = 1.10  # mean of a category, at most
LEVEL = 1
HOLD_STEPS = 10  # environment steps with the same targets
TARGET = 0.3  # largest, m/s or rad/s
Row = dict[str, float | int | str]


def scenes_of(task: Task, obj: ArticulatedObject) -> dict[str, Scene]:
    """The scene as it is, and without padding."""
    parts = (task.robot, obj, task.physics, task.props)
    padded = build_scene(*parts)
    with mock.patch.object(scene_module, "plan_padding", return_value=None):
        return {"padded": padded, "bare": build_scene(*parts)}


def step_seconds(scene: Scene, task: Task, steps: int) -> float:
    """Median seconds of an environment step by the engine alone."""
    simulation = Simulation(scene)
    state = task.sample_initial_state(scene.object, level_generator(LEVEL, RngStream.INITIAL_STATE))
    simulation.reset([state])
    engine, rng = BareEngine(simulation), np.random.default_rng(0)
    spent, targets = [], np.zeros((1, scene.model.nu))
    for number in range(steps):
        if number % HOLD_STEPS == 0:
            targets = rng.uniform(-TARGET, TARGET, targets.shape)
        start = time.perf_counter()
        engine.step(targets)
        spent.append(time.perf_counter() - start)
    return statistics.median(spent)


def measure(object_id: str, task: Task, steps: int, rounds: int) -> Row:
    scenes = scenes_of(task, artiskill.load_object(object_id))
    spent: dict[str, list[float]] = {name: [] for name in scenes}
    for _ in range(rounds):
        for name, scene in scenes.items():
            spent[name].append(step_seconds(scene, task, steps))
    return {
        "object": object_id,
        "dof": int(scenes["bare"].model.nv),
        "padded_dof": int(scenes["padded"].model.nv),
        "ratio": min(spent["padded"]) / min(spent["bare"]),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--category", nargs="+", choices=CATEGORIES, default=list(CATEGORIES))
    parser.add_argument("--every", type=int, default=4, help="of the objects")
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    options = parser.parse_args()
    figures: dict[str, list[Row]] = {}
    for category in options.category:
        task = make_task(TASK_OF[category], None)
        names = [
            name
            for split in SPLITS
            for name in artiskill.list_objects(category=category, split=split)[:: options.every]
        ]
        rows = figures[category] = [measure(name, task, options.steps, options.rounds) for name in names]
        ratios = [float(row["ratio"]) for row in rows]
        worst = max(rows, key=lambda row: row["ratio"])
        print(
            f"{category:8} {len(rows):3} objects: {statistics.mean(ratios) - 1:+.1%} on average (at most "
            f"{GOAL - 1:+.0%}), median {statistics.median(ratios) - 1:+.1%}, most {max(ratios) - 1:+.1%} "
            f"({worst['object']}, {worst['dof']} of {worst['padded_dof']} degrees of freedom)",
            flush=True,
        )
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()

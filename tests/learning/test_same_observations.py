"""A policy sees, when it acts, what it was trained on: every number of every step, after collection and replay."""

from pathlib import Path

import numpy as np
import pytest

from artiskill.demos.demos import PACK, Demos
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.wrappers import Sampling
from artiskill.learning.building import build_training_set
from artiskill.learning.set_sources import SetOptions
from artiskill.learning.training_set import TrainingSet

POINTS = 48


def play(training_set: TrainingSet, folder: Path) -> list[np.ndarray]:
    """Return records of what a policy would see in the episode of the set's only trajectory."""
    demos = Demos(folder)
    [(name, target)] = training_set.groups
    level = int(training_set.trajectories["level"][0])
    recorded = next(one for one in demos.open(name) if one.level == level and one.target == target)
    task = training_set.manifest.task
    env = ManipulationEnv(task, objects=name, target=target, obs_mode="pointcloud")
    seen_env = Sampling(**training_set.manifest.sampling).wrap(env)
    observation, _ = seen_env.reset(options={"level": level})
    records = []
    for action in recorded.actions:
        records.append(record_of(training_set, observation))
        observation, *_ = seen_env.step(action)
    return records


def record_of(training_set: TrainingSet, observation: dict[str, object]) -> np.ndarray:
    """Encode an observation as a set does."""
    cloud = observation["pointcloud"]
    arrays = [np.asarray(cloud[key])[None] for key in ("xyz", "rgb", "seg")]  # type: ignore[index]
    return training_set.layout.encode(*arrays, np.asarray(observation["agent"])[None])[0]


@pytest.mark.parametrize(("task", "frame"), [("OpenCabinetDrawer", "robot"), ("MoveBucket", "world")])
def test_what_a_policy_sees_is_what_it_was_trained_on(tmp_path: Path, task: str, frame: str) -> None:
    obj = Demos(PACK / task).objects[0]
    options = SetOptions(num_points=POINTS, objects=(obj,), count=1, frame=frame)
    training_set = build_training_set(PACK / task, tmp_path / "set", options)
    frames = training_set.steps["frame"]
    stored = training_set.read(frames)[:, 0]
    seen = play(training_set, PACK / task)
    assert len(seen) == len(stored) > 30
    for step, (one, other) in enumerate(zip(seen, stored, strict=True)):
        assert one.tobytes() == other.tobytes(), f"step {step}"

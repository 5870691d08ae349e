"""A training set of a few numbers, made without the engine, and a configuration that learns it in no time."""

from pathlib import Path
from typing import Any

import numpy as np
import torch

from artiskill.files import file_sha256
from artiskill.learning.batch import Sizes
from artiskill.learning.observation import ObservationLayout
from artiskill.learning.train_config import TrainConfig, load_train_config
from artiskill.learning.training_set import (
    FRAMES,
    MANIFEST,
    STEPS,
    TRAJECTORIES,
    TRAJECTORY_TYPE,
    SetFile,
    SetManifest,
    manifest_text,
    step_type,
)
from artiskill.tasks.levels import FIRST_DEMONSTRATED

torch.set_num_threads(1)  # of networks this small, a second thread makes slow ones; and tests share their cores

TASK = "OpenCabinetDrawer"
SIZES = Sizes(points=16, masks=3, agent=38, action=13)  # as of the task's environments
POSITIONS = [*range(6), *range(12, 15), *range(18, 22)]  # in the robot's state: networks may not see velocities
STEPS_EACH, TRAJECTORIES_HELD = 12, 4
# a network and a run that take milliseconds
TINY: dict[str, Any] = {
    "network.point_layers": [8],
    "network.head": [8],
    "batch_size": 4,
    "steps": 20,
    "schedule": "constant",  # so that more steps go on
    "log_every": 5,
    "checkpoint_every": 10,
    "development.objects": [],
}


def tiny_config(name: str = "bc", **values: Any) -> TrainConfig:
    """Values of a tiny run; underscores in pairs stand for dots."""
    given = {key.replace("__", "."): value for key, value in values.items()}
    return load_train_config(name, TASK, overrides=TINY | given)


def write_tiny_set(folder: Path, task: str = TASK, seed: int = 0, frame: str = "world") -> Path:
    """Write a set with two objects."""
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True)
    frames = TRAJECTORIES_HELD * (STEPS_EACH + 1)
    layout = ObservationLayout(SIZES.points, SIZES.masks, SIZES.agent)
    agent = rng.normal(size=(frames, SIZES.agent)).astype(np.float32)
    records = layout.encode(
        rng.normal(size=(frames, SIZES.points, 3)).astype(np.float32),
        rng.integers(0, 256, (frames, SIZES.points, 3), dtype=np.uint8),
        rng.random((frames, SIZES.points, SIZES.masks)) < 0.3,
        agent,
    )
    (folder / FRAMES).write_bytes(records.tobytes())
    steps = np.zeros(TRAJECTORIES_HELD * STEPS_EACH, step_type(SIZES.action))
    steps["trajectory"] = np.repeat(np.arange(TRAJECTORIES_HELD), STEPS_EACH)
    steps["frame"] = np.arange(len(steps)) + steps["trajectory"]
    steps["action"] = np.tanh(agent[steps["frame"]][:, POSITIONS])
    steps["reward"] = -rng.random(len(steps))
    steps["terminated"][STEPS_EACH - 1 :: STEPS_EACH] = True
    np.save(folder / STEPS, steps)
    rows = [(k % 2, 0, FIRST_DEMONSTRATED + k, k * STEPS_EACH, STEPS_EACH) for k in range(TRAJECTORIES_HELD)]
    np.save(folder / TRAJECTORIES, np.array(rows, TRAJECTORY_TYPE))
    manifest = SetManifest(
        task=task,
        control_mode="joint",
        sampling={"num_points": SIZES.points, "method": "maniskill", "frame": frame, "settings": {}},
        sizes=SIZES,
        objects=("cabinet-0002", "cabinet-0020"),
        targets=("link_0",),
        trajectories=TRAJECTORIES_HELD,
        steps=len(steps),
        frames=frames,
        point_mean=(0.0,) * 3,
        point_std=(1.0,) * 3,
        agent_mean=(0.0,) * SIZES.agent,
        agent_std=(1.0,) * SIZES.agent,
        action_std=(1.0,) * SIZES.action,
        options={},
        settings={"source": {"config": {}}, "seen": {}},
        sources={},
        files={
            name: SetFile((folder / name).stat().st_size, file_sha256(folder / name))
            for name in (FRAMES, STEPS, TRAJECTORIES)
        },
    )
    (folder / MANIFEST).write_text(manifest_text(manifest))
    return folder

"""Behaviour cloning of commands: what actions amount to, and a run that learns it from demonstrations."""
# ruff: noqa: E402

from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")

import gymnasium as gym
from tests.learning.tiny_set import SIZES, TASK, tiny_config, write_tiny_set

import artiskill  # noqa: F401 - registers the environments
from artiskill.errors import ConfigError, DemoError
from artiskill.experts.registry import make_expert
from artiskill.learning.array_policy import ArrayPolicy
from artiskill.learning.command_bc import DemonstratedCommands, demonstrated_space
from artiskill.learning.commands import ActionReader, CommandActor
from artiskill.learning.policy import RunPolicy, export_policy
from artiskill.learning.recovery import RecoveryConfig
from artiskill.learning.run import LATEST
from artiskill.learning.train import TrainData, train
from artiskill.learning.training_set import TrainingSet

ALL_VARIATIONS = {"stretch": 0.1, "jitter_m": 0.002, "drop": 0.2, "unmask": 0.1, "displace": 0.5}


@pytest.mark.parametrize("task", ["OpenCabinetDrawer", "OpenCabinetDoor", "PushChair", "MoveBucket"])
def test_an_expert_is_as_good_when_its_actions_go_through_commands(task: str) -> None:
    """What is lost on the way from actions to commands and back does not matter: an episode is still solved."""
    env: Any = gym.make(f"ArtiSkill/{task}-v0", obs_mode="pointcloud", objects="train").unwrapped
    space = demonstrated_space(task, "joint", {})
    reader, actor = ActionReader(space, 1.0), CommandActor(space)
    seen, info = env.reset(options={"level": 0})
    expert = make_expert(task, env.task.robot)
    expert.reset(env.snapshot, env.goal)
    ended, errors = False, []
    while not ended:
        action = expert.act(env.snapshot, env.goal)
        found = actor.action(seen["agent"], reader.labels(seen["agent"][None], action[None])[0])
        errors.append(np.abs(found - action))
        seen, _, terminated, truncated, info = env.step(found)
        ended = terminated or truncated
    assert info["success"]
    assert np.mean(errors) < 0.06


def test_commands_of_actions_of_another_control_mode() -> None:
    with pytest.raises(ConfigError, match="control mode 'joint', not 'operational_space'"):
        demonstrated_space("PushChair", "operational_space", {})


def run(folder: Path, data: Path, steps: int, **values: Any) -> Path:
    values = {
        "algorithm__end_steps": 0,
        "algorithm__augmentation__displace": 0,
    } | values  # of short demonstrations
    config = tiny_config("command_bc", steps=steps, **values)
    train(config, TrainData(data), folder, device="cpu", threads=1)
    return folder


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tiny_set(tmp_path_factory.mktemp("data") / "set")


@pytest.mark.parametrize("values", [{}, ALL_VARIATIONS], ids=["plain", "varied"])
def test_a_run_goes_on_bit_for_bit(data: Path, tmp_path: Path, values: dict[str, float]) -> None:
    changes = {f"algorithm__augmentation__{name}": value for name, value in values.items()}
    whole = run(tmp_path / "whole", data, 20, **changes)
    parts = run(run(tmp_path / "parts", data, 10, **changes), data, 20, **changes)
    one, other = (torch.load(path / LATEST, weights_only=False) for path in (whole, parts))
    plain = torch.load(run(tmp_path / "plain", data, 20) / LATEST, weights_only=False)["weights"]
    is_same = all(torch.equal(weight, plain[name]) for name, weight in one["weights"].items())
    assert is_same == (not values)
    for name, weight in one["weights"].items():
        assert torch.equal(weight, other["weights"][name]), name


def test_what_demonstrations_cannot_tell_is_refused_before_anything_is_written(data: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="two arms"):
        run(tmp_path / "run", data, 20, algorithm__augmentation__mirror=0.5)
    with pytest.raises(DemoError, match="without the last 500 of each trajectory"):
        run(tmp_path / "run", data, 20, algorithm__end_steps=500)
    assert not (tmp_path / "run" / "run.json").exists()
    run(tmp_path / "run", data, 20)
    other = write_tiny_set(tmp_path / "hand", frame="end_effector")
    with pytest.raises(ConfigError, match="'robot' or 'world', not 'end_effector'"):
        run(tmp_path / "other", other, 20)


def test_the_robot_is_the_one_that_demonstrated() -> None:
    slower = demonstrated_space("PushChair", "joint", {"physics.timestep_s": 0.001})
    assert slower.step_s == 0.025


def test_a_run_acts_with_and_without_torch(data: Path, tmp_path: Path) -> None:
    folder = run(tmp_path / "run", data, 20)
    header = export_policy(folder, tmp_path / "policy.npz")
    assert (header.algorithm, header.recovery) == ("command_bc", None)
    recovering = export_policy(folder, tmp_path / "recovering.npz", recovery=True).recovery
    assert recovering == ArrayPolicy(tmp_path / "recovering.npz").header.recovery == RecoveryConfig()
    rng = np.random.default_rng(1)
    cloud = {
        "xyz": rng.normal(size=(SIZES.points, 3)).astype(np.float32),
        "rgb": np.zeros((SIZES.points, 3), np.uint8),
        "seg": rng.random((SIZES.points, SIZES.masks)) < 0.3,
    }
    seen = {"pointcloud": cloud, "agent": rng.normal(size=SIZES.agent).astype(np.float32)}
    actions = [policy.act(seen) for policy in (RunPolicy(folder), ArrayPolicy(tmp_path / "policy.npz"))]
    assert actions[0].shape == (SIZES.action,)
    np.testing.assert_allclose(*actions, atol=1e-4)


def test_commands_do_not_depend_on_the_order_in_which_they_are_asked_for(data: Path) -> None:
    held, space = TrainingSet(data), demonstrated_space(TASK, "joint", {})
    rows = np.arange(len(held))
    at_once = DemonstratedCommands(held, space).labels(rows)
    agents = held.read(held.steps["frame"])["agent"][:, 0]
    np.testing.assert_array_equal(at_once, ActionReader(space, 1.0).labels(agents, held.steps["action"]))
    commands, mixed = DemonstratedCommands(held, space), np.random.default_rng(0).integers(0, len(held), (20, 7))
    for batch in mixed:
        np.testing.assert_array_equal(commands.labels(batch), at_once[batch])

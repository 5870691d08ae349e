"""docs/adding_a_task.md, followed: its code, as it stands there, makes a task that runs."""

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from artiskill.assets.catalog import list_objects, load_object
from artiskill.assets.needs import TASK_NEEDS, Needs
from artiskill.config import CONFIG_DIR, from_mapping, load_yaml
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.scene.scene import build_scene
from artiskill.sim.simulation import Simulation
from artiskill.tasks.levels import Stream, level_generator

PAGE = Path(__file__).resolve().parents[2] / "docs" / "adding_a_task.md"
VALUES: dict[str, Any] = {
    "angle_rad": 3.14,
    "max_speed_rad_s": 0.2,
    "hold_s": 0.5,
    "stage_bonus": [-2, 0],
    "weights": {"turning": 1, "slow": 1, "stage": 1},
}


@pytest.fixture(scope="module")
def page_code(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """The page's Python but for the line that goes into `needs.py`, as a module."""
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert blocks[0].startswith("Needs(")
    path = tmp_path_factory.mktemp("task") / "spin_chair.py"
    path.write_text("\n".join(blocks[1:]), encoding="utf-8")
    spec = importlib.util.spec_from_file_location("spin_chair", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["spin_chair"] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def env(page_code: ModuleType, monkeypatch: pytest.MonkeyPatch) -> ManipulationEnv:
    kept = load_yaml(CONFIG_DIR / "tasks" / "push_chair.yaml")
    wanted = ("robot", "episode_steps", "max_object_joints", "physics", "initial", "cameras", "world_camera")
    values = {"name": "SpinChair", **{key: kept[key] for key in wanted}, **VALUES}
    task = page_code.make_spin_chair(from_mapping(page_code.SpinChairConfig, values))
    monkeypatch.setattr("artiskill.envs.manipulation.make_task", lambda *_: task)
    monkeypatch.setitem(TASK_NEEDS, "SpinChair", Needs("SpinChair", "chair", None))
    seated = next(i for i in list_objects("chair") if page_code.swivels(load_object(i)))
    return ManipulationEnv("SpinChair", objects=seated)


def test_the_new_task_runs(env: ManipulationEnv) -> None:
    observation, info = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert info["flags"] == {"seat_turned": False, "seat_static": False}
    for action in np.random.default_rng(0).uniform(-1, 1, (10, env.control.size)):
        observation, reward, terminated, _, info = env.step(action)
        assert env.observation_space.contains(observation)
        assert -2 <= reward < 0
        assert not terminated
    assert set(info["reward_terms"]) == {"turning", "slow", "stage"}


def test_turning_the_seat_is_success(env: ManipulationEnv) -> None:
    """The seat spun by hand: flags and stages follow."""
    env.reset(seed=0)
    task, obj = env.task, env._simulation.scene.object  # type: ignore[union-attr]
    simulation = Simulation(build_scene(task.robot, obj, task.physics))
    state = task.sample_initial_state(obj, level_generator(0, Stream.INITIAL_STATE))
    state.object_qpos[env.goal.joint] = 3.2
    simulation.reset([state])
    snapshot = simulation.snapshot()
    flags = task.flags(snapshot, env.goal)
    assert bool(flags["seat_turned"][0])
    assert bool(flags["seat_static"][0])
    assert float(task.reward_terms(snapshot, env.goal, flags)["stage"][0]) == 0.0

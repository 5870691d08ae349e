"""Registering tasks: what is refused and why, what worker processes know, what the command line loads."""

import dataclasses
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import pytest

import artiskill
from artiskill.assets.catalog import list_objects
from artiskill.assets.needs import TASK_NEEDS
from artiskill.cli.main import main
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ConfigError, UnknownNameError
from artiskill.evaluation.evaluate import evaluate
from artiskill.experts.registry import make_expert
from artiskill.experts.variation import load_variation
from artiskill.tasks import registry
from artiskill.tasks.registry import INHERITED, load_task, make_task, task_names, task_spec

OWN = {"category": "chair", "entry_point": "artiskill.tasks.push_chair:make_push_chair"}
MODULE = """
from pathlib import Path
import artiskill
from artiskill.tasks.push_chair import PushChairConfig, make_push_chair

def make_far(config: PushChairConfig):
    return make_push_chair(config)

artiskill.register_task(
    "PushChairFar", category="chair", entry_point="far_chairs:make_far",
    config_file=Path(__file__).with_suffix(".yaml"),
    expert="artiskill.experts.push_chair:PushChairExpert",
)
"""


@pytest.fixture(autouse=True)
def clean(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Whatever is registered is forgotten afterwards."""
    monkeypatch.setenv(INHERITED, "{}")
    tables = (registry._TASKS, TASK_NEEDS, gym.registry)
    before = [dict(table) for table in tables]
    yield
    for table, known in zip(tables, before, strict=True):
        table.clear()
        table.update(known)


@pytest.fixture
def yaml(tmp_path: Path) -> Path:
    """A variant of PushChair."""
    path = tmp_path / "far_chairs.yaml"
    path.write_text("like: push_chair\nname: PushChairFar\ninitial: {chair_distance_m: [1.5, 1.6]}\n")
    return path


@pytest.fixture
def package(yaml: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A module in the working directory that registers it."""
    yaml.with_suffix(".py").write_text(MODULE)
    monkeypatch.chdir(yaml.parent)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.delitem(sys.modules, "far_chairs", raising=False)
    yield
    sys.modules.pop("far_chairs", None)


def test_a_variant_is_a_yaml_file(yaml: Path) -> None:
    for _ in range(2):  # again changes nothing
        artiskill.register_task("PushChairFar", config_file=yaml, **OWN)
    assert "PushChairFar" in task_names()
    task = make_task("PushChairFar")
    assert task.config.initial.chair_distance_m == (1.5, 1.6)
    assert task.config.success == make_task("PushChair").config.success
    env = ManipulationEnv("PushChairFar", objects="chair-0001")
    env.reset(seed=0)
    assert 1.5 <= float((env.snapshot.link_position_w[0, 0, :2] ** 2).sum() ** 0.5) <= 1.65
    assert list_objects(task="PushChairFar") == list_objects(task="PushChair")
    assert gym.spec("ArtiSkill/PushChairFar_chair-0001-v0").kwargs == {
        "task": "PushChairFar",
        "objects": "chair-0001",
    }


def test_a_task_that_is_like_another_one(yaml: Path) -> None:
    artiskill.register_task("PushChairFar", config_file=yaml, like="PushChair")
    mine, theirs = task_spec("PushChairFar"), task_spec("PushChair")
    assert mine == dataclasses.replace(theirs, name="PushChairFar", config_file=str(yaml.resolve()))
    assert load_variation("PushChairFar") == load_variation("PushChair")
    assert type(make_expert("PushChairFar", make_task("PushChairFar").robot)).__name__ == "PushChairExpert"

    yaml.write_text("like: open_cabinet_drawer\nname: EasyDrawer\nsuccess: {open_fraction: 0.5}\n")
    artiskill.register_task("EasyDrawer", config_file=yaml, like="OpenCabinetDrawer", expert="far_chairs:Mine")
    assert (task_spec("EasyDrawer").motion, task_spec("EasyDrawer").expert) == ("prismatic", "far_chairs:Mine")
    assert list_objects(task="EasyDrawer") == list_objects(task="OpenCabinetDrawer")


def test_what_a_task_must_have(yaml: Path) -> None:
    with pytest.raises(ConfigError, match=r"task Mine: give category=, or the task that it is like=: OpenCabinet"):
        artiskill.register_task("Mine", config_file=yaml)
    with pytest.raises(ConfigError, match="task Mine: give entry_point=, or the task"):
        artiskill.register_task("Mine", config_file=yaml, category="chair")


@pytest.mark.parametrize(
    ("changes", "error", "says"),
    [
        ({"like": "PushChairs"}, UnknownNameError, "unknown task 'PushChairs'; did you mean 'PushChair'"),
        (
            {"name": "Push Chair"},
            ConfigError,
            "a task's name is letters and digits, such as TurnChair; not 'Push Chair'",
        ),
        (
            {"name": "PushChair"},
            ConfigError,
            "there is a task 'PushChair' already, of artiskill.tasks.push_chair:make_",
        ),
        ({"category": "chairs"}, UnknownNameError, "unknown category 'chairs'; did you mean 'chair'"),
        ({"motion": "sliding"}, UnknownNameError, "unknown motion 'sliding'"),
        (
            {"entry_point": "far_chairs"},
            ConfigError,
            "task Mine: entry_point must be 'module:name', not 'far_chairs'",
        ),
        ({"expert": lambda: None}, ConfigError, "task Mine: expert must be 'module:name', not <function"),
        (
            {"config_file": "nowhere.yaml"},
            ConfigError,
            "task Mine: config_file: there is no file '.*nowhere.yaml'",
        ),
        ({"variation_file": "no.yaml"}, ConfigError, "task Mine: variation_file: there is no file '.*no.yaml'"),
    ],
)
def test_what_is_refused(changes: dict[str, Any], error: type[Exception], says: str, yaml: Path) -> None:
    with pytest.raises(error, match=says):
        artiskill.register_task(**({"name": "Mine", "config_file": yaml, **OWN} | changes))
    assert "Mine" not in task_names()


@pytest.mark.parametrize(
    ("entry_point", "says"),
    [
        ("no_such_module:make", "task PushChairFar: there is no module 'no_such_module'"),
        ("artiskill.tasks.push_chair:mak", "module 'artiskill.tasks.push_chair' has no 'mak'"),
        ("artiskill.tasks.push_chair:make_chair_goal", "must take one argument, annotated with its TaskConfig"),
    ],
)
def test_an_entry_point_is_looked_at_when_the_task_is_made(entry_point: str, says: str, yaml: Path) -> None:
    artiskill.register_task("PushChairFar", config_file=yaml, category="chair", entry_point=entry_point)
    with pytest.raises(ConfigError, match=says):
        make_task("PushChairFar")


def test_an_entry_point_returns_a_task(package: None) -> None:
    load_task("far_chairs:PushChairFar")
    sys.modules["far_chairs"].make_far.__code__ = (lambda config: None).__code__
    with pytest.raises(ConfigError, match="PushChairFar: far_chairs:make_far must return a Task, not None"):
        make_task("PushChairFar")


def test_the_file_must_be_the_tasks(yaml: Path) -> None:
    artiskill.register_task("Chairs", config_file=yaml, **OWN)
    with pytest.raises(
        ConfigError, match=r"task Chairs: its configuration has another name, 'PushChairFar', in .*\.yaml"
    ):
        make_task("Chairs")


def test_a_file_like_itself(yaml: Path) -> None:
    yaml.write_text("like: far_chairs.yaml\nname: PushChairFar\n")
    artiskill.register_task("PushChairFar", config_file=yaml, **OWN)
    with pytest.raises(
        ConfigError, match=r"far_chairs\.yaml is like itself: far_chairs\.yaml -> far_chairs\.yaml"
    ):
        make_task("PushChairFar")
    yaml.write_text("like: 3\n")
    with pytest.raises(ConfigError, match=r"like must be a name or the path of a YAML file, not 3"):
        make_task("PushChairFar")
    yaml.write_text("like: push_chairs\n")
    with pytest.raises(ConfigError, match=r"cannot read config file .*push_chairs\.yaml"):
        make_task("PushChairFar")


def test_without_variation(yaml: Path) -> None:
    artiskill.register_task("PushChairFar", config_file=yaml, **OWN)
    with pytest.raises(ConfigError, match=r"PushChairFar has no variation file, .* register it with .*like="):
        load_variation("PushChairFar")


def test_an_unknown_task_names_the_nearest_and_the_way() -> None:
    with pytest.raises(
        UnknownNameError, match=r"did you mean 'PushChair'\? .* on the command line, name it module:Task"
    ):
        task_spec("PushChairs")


def test_a_module_registers_what_the_command_line_names(package: None, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["config", "show", "far_chairs:PushChairFar"]) == 0
    assert "name: PushChairFar" in capsys.readouterr().out
    assert main(["objects", "--task", "PushChairFar"]) == 0
    assert main(["config", "show", "far_chair:PushChairFar"]) == 2
    assert "task 'far_chair:PushChairFar': there is no module 'far_chair'" in capsys.readouterr().err
    assert main(["config", "show", "far_chairs:PushChairFare"]) == 2
    assert "did you mean 'PushChairFar'?" in capsys.readouterr().err


def test_gymnasium_imports_the_module(package: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path.cwd()))
    env = gym.make("far_chairs:ArtiSkill/PushChairFar-v0", objects="chair-0001")
    env.reset(seed=0)
    envs = gym.make_vec("ArtiSkill/PushChairFar-v0", num_envs=2, vectorization_mode="vector_entry_point")
    envs.reset(seed=0)


def test_a_module_without_the_task_is_refused(package: None) -> None:
    with pytest.raises(
        UnknownNameError, match=r"'PushChairNear'; did you mean 'PushChairFar'\?.*importing 'far_chairs'"
    ):
        load_task("far_chairs:PushChairNear")


@pytest.mark.parametrize("is_variant", [False, True])
def test_worker_processes_know_it(package: None, yaml: Path, is_variant: bool) -> None:
    name = "PushChairFar"
    if is_variant:
        artiskill.register_task(
            name, config_file=yaml, **OWN, expert="artiskill.experts.push_chair:PushChairExpert"
        )
    else:
        assert load_task(f"far_chairs:{name}") == name
    reports = [
        evaluate(
            name, policy="expert", objects="chair-0001", episodes=2, workers=workers, config={"episode_steps": 3}
        )
        for workers in (1, 2)
    ]
    assert [report.task for report in reports] == ["PushChairFar"] * 2
    assert reports[0].rows == reports[1].rows

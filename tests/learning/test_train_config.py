# ruff: noqa: E402
import dataclasses
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

torch = pytest.importorskip("torch")

from tests.learning.tiny_set import TASK, tiny_config

from artiskill.assets.catalog import load_object
from artiskill.assets.scaling import scaled
from artiskill.cli.main import main
from artiskill.config import dump_yaml
from artiskill.errors import ConfigError, RunError, UnknownNameError
from artiskill.learning.reinforcement_config import load_reinforcement_config
from artiskill.learning.train_config import (
    check_development,
    check_not_measured,
    load_train_config,
    measured_among,
    read_train_config,
)


@pytest.mark.parametrize(
    ("name", "batch_size", "steps", "rates"),
    [
        ("bc", 128, 6000, {"learning_rate": 1e-3}),
        ("bcq", 64, 20_000, {"critic_learning_rate": 5e-4}),
        ("td3bc", 64, 20_000, {"policy_learning_rate": 5e-4}),
    ],
)
def test_values_that_the_package_comes_with(
    name: str, batch_size: int, steps: int, rates: dict[str, float]
) -> None:
    config = load_train_config(name, TASK)
    assert (config.batch_size, config.steps, config.schedule) == (batch_size, steps, "cosine")
    assert config.algorithm | rates == config.algorithm
    assert config.network.point_layers == (64, 128, 256)
    assert load_train_config(name, TASK, "pointnet").network.point_layers == (256, 512)


@pytest.mark.parametrize(
    ("name", "task", "seen"),
    [
        ("dagger", "PushChair", False),
        ("dagger", "MoveBucket", True),
        ("command_bc", "OpenCabinetDoor", False),
    ],
)
def test_an_algorithm_may_say_for_a_task_what_the_network_sees(name: str, task: str, seen: bool) -> None:
    assert load_train_config(name, task).network.input.velocities is seen
    other = load_train_config(name, task, overrides={"network.input.velocities": not seen})
    assert other.network.input.velocities is not seen


def test_a_saved_configuration_is_whole(tmp_path: Path) -> None:
    config = load_train_config("td3bc", "PushChair", overrides={"algorithm.alpha": 0.5, "network.head": [32]})
    assert config.development.objects == ("generated:chair:1000000..1000011",)
    (tmp_path / "config.yaml").write_text(dump_yaml(config))
    assert read_train_config(tmp_path) == config
    assert (config.algorithm["alpha"], config.network.head) == (0.5, (32,))


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"stepz": 5}, "unknown key 'stepz'; did you mean 'steps'?"),
        ({"algorithm.learning_rat": 1}, "did you mean 'learning_rate'?"),
        ({"network.hed": [1]}, "did you mean 'head'?"),
        ({"steps": 0}, "bc: steps must lie in [1, 1000000000], not 0"),
        ({"precision": "float16"}, "precision"),
        ({"network.input.frames": ["robto"]}, "network.input.frames' must be one of "),
        ({"network.input.frames": ["robto"]}, "not 'robto'; did you mean 'robot'?"),
        ({"algorithm.learning_rate": -1.0}, "learning_rate must be positive"),
        ({"development.every": 0}, "development.every must be positive"),
    ],
)
def test_illegal_values(values: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_train_config("bc", TASK, overrides=values)
    assert says in str(caught.value)


def test_unknown_names() -> None:
    with pytest.raises(UnknownNameError, match="unknown algorithm 'bqc'; did you mean 'bc'"):
        load_train_config("bqc", TASK)
    with pytest.raises(UnknownNameError, match="unknown task"):
        load_train_config("bc", "OpenDrawer")
    with pytest.raises(UnknownNameError, match="unknown network 'pointnett'"):
        load_train_config("bc", TASK, "pointnett")


@pytest.mark.parametrize("given", ["test", "ood", "all"])
def test_splits_that_are_measured_choose_no_checkpoint(given: str) -> None:
    says = f"nor what chooses the checkpoint may be of test and ood.*'{given}' is such a split"
    with pytest.raises(ConfigError, match=says):
        tiny_config(development__objects=["generated:cabinet:3", given])


def test_objects_that_are_measured_choose_no_checkpoint(tmp_path: Path) -> None:
    split = tmp_path / "mine.yaml"
    split.write_text("objects: [cabinet-0002, cabinet-0005]\n")
    for given in ("cabinet-0005", str(split)):
        with pytest.raises(ConfigError, match="'cabinet-0005' is of 'test'"):
            check_development(tiny_config(development__objects=[given]))
    assert check_development(tiny_config(development__objects=["cabinet-0002"])) == ["cabinet-0002"]


def test_nor_do_such_objects_of_another_size() -> None:
    twice = scaled(scaled(load_object("cabinet-0005"), 1.1), 1.1)
    with pytest.raises(ConfigError, match="'cabinet-0005' is of 'test'"):
        check_not_measured([twice])
    with pytest.raises(ConfigError, match="'cabinet-0005' is of 'test'"):
        check_not_measured([dataclasses.replace(twice, id="own")])
    check_not_measured([scaled(load_object("cabinet-0002"), 1.1)])
    assert list(measured_among([twice.id, "scaled-cabinet-0002-110"])) == ["'cabinet-0005' is of 'test'"]


def test_development_objects_by_default_fit_the_task() -> None:
    for task, least in (("OpenCabinetDrawer", 8), ("OpenCabinetDoor", 8)):
        assert len(check_development(load_train_config("bc", task))) >= least


def test_what_may_change_when_a_run_goes_on(tmp_path: Path) -> None:
    config = tiny_config()
    config.check_continues(tiny_config(steps=30), tmp_path)
    with pytest.raises(
        RunError, match=r"of other values \(seed 0 there, 1 here; algorithm.learning_rate 0.001 there"
    ):
        config.check_continues(tiny_config(seed=1, algorithm__learning_rate=1.0), tmp_path)
    with pytest.raises(RunError, match="steps 20 there, 10 here"):
        config.check_continues(tiny_config(steps=10), tmp_path)
    with pytest.raises(RunError, match="steps 20 there, 30 here"):  # all its learning rates would be other ones
        tiny_config(schedule="cosine").check_continues(tiny_config(schedule="cosine", steps=30), tmp_path)


def test_damaged_configurations(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="cannot read config file"):
        read_train_config(tmp_path)
    (tmp_path / "config.yaml").write_text("steps: 3\n")
    with pytest.raises(RunError, match="is missing"):
        read_train_config(tmp_path)


def test_importing_it_imports_no_torch() -> None:
    code = (
        "import sys, artiskill.learning.train_config, artiskill.evaluation.policies; print('torch' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120)
    assert done.stdout.strip() == "False"


def test_the_help_says_how_many_steps_agents_learn_from(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["train", "--help"])
    ppo, *sac = (
        load_reinforcement_config(name, task).steps
        for name, task in (("ppo", TASK), ("sac", TASK), ("sac", "OpenCabinetDoor"), ("sac", "MoveBucket"))
    )
    told = f"(sac: at most {sac[0]}, doors {sac[1]}, chairs and buckets {sac[2]}; ppo: {ppo})"
    assert told in " ".join(capsys.readouterr().out.split())

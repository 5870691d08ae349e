"""A task's whole configuration: filled in, overridden, written and read; goals of several environments as one."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from artiskill.assets.catalog import list_objects, load_object
from artiskill.config import dump_yaml, to_mapping
from artiskill.errors import ArtiSkillError, ConfigError, UnknownNameError
from artiskill.robots.config import load_robot
from artiskill.sensors.render_config import load_render_config
from artiskill.tasks.registry import make_task, task_names
from artiskill.tasks.task import ROW, put_goal, stack_goals

FIXED = ("name", "motion")


@pytest.mark.parametrize("name", task_names())
def test_the_resolved_configuration_is_whole_and_comes_back(name: str) -> None:
    config = make_task(name).config
    assert config.robot == load_robot(config.robot.name)
    assert config.render == load_render_config("fast")
    values = yaml.safe_load(dump_yaml(config))
    again = make_task(name, {key: value for key, value in values.items() if key not in FIXED})
    assert again.config == config
    assert again.robot == config.robot


def test_a_changed_configuration_comes_back_too() -> None:
    changes = {
        "robot": "two_arms",
        "robot.drives.arm_damping": 50,
        "robot.mounts": to_mapping(load_robot("two_arms"))["mounts"][:1],
        "render.lamps": [{"position_w": [0, 0, 2], "colour": [1, 1, 1], "strength": 1, "range_m": 5}],
        "physics.solver": "cg",
    }
    config = make_task("OpenCabinetDoor", changes).config
    assert config.robot.name == "two_arms"
    assert (config.robot.drives.arm_damping, len(config.robot.mounts)) == (50.0, 1)
    assert config.robot.actions == load_robot("two_arms").actions
    assert config.render.lamps[0].range_m == 5.0
    values = {key: value for key, value in yaml.safe_load(dump_yaml(config)).items() if key not in FIXED}
    assert make_task("OpenCabinetDoor", values).config == config


@pytest.mark.parametrize(
    "changes",
    [
        {"robot.drives.arm_damping": 50, "robot": "two_arms"},
        {"robot": "two_arms", "robot.drives.arm_damping": 50},
        {"robot.like": "two_arms", "robot.drives": {"arm_damping": 50}},
        {"robot": {"like": "two_arms", "drives": {"arm_damping": 50}}},
        {"robot": {"like": "two_arms", "drives.arm_damping": 50}},
    ],
)
def test_a_robot_is_changed_in_any_order_and_form(changes: dict[str, Any]) -> None:
    task = make_task("OpenCabinetDrawer", changes)
    assert (len(task.robot.mounts), task.robot.drives.arm_damping) == (2, 50.0)


def test_a_robot_of_ones_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "soft.yaml").write_text("like: one_arm\nname: soft\ndrives: {arm_damping: 30}\n")
    monkeypatch.chdir(tmp_path)
    for given in ("soft.yaml", tmp_path / "soft.yaml", {"like": "soft.yaml"}):
        task = make_task("OpenCabinetDrawer", {"robot": given, "robot.actions.yaw_rate_rad_s": 1})
        drives = task.robot.drives
        assert (task.robot.name, drives.arm_damping, drives.lift_damping) == ("soft", 30.0, 1000.0)
        assert task.robot.actions.yaw_rate_rad_s == 1.0
    assert "soft.yaml" not in dump_yaml(task.config)


@pytest.mark.parametrize(
    ("key", "value", "error", "says"),
    [
        ("robot", "one_amr", UnknownNameError, "did you mean 'one_arm'"),
        ("robot", 3, ConfigError, "a robot is a name, the path of a YAML file, or a mapping of values, not 3"),
        ("robot", None, ConfigError, "not None"),
        ("robot", "nowhere.yaml", ConfigError, r"cannot read config file .*nowhere\.yaml"),
        ("robot.drive.arm_damping", 3, ConfigError, r"robot: unknown key 'drive'; did you mean 'drives'\?"),
        ("robot.drives.arm_dampin", 3, ConfigError, r"robot\.drives: unknown key 'arm_dampin'; did you mean"),
        ("robot.drives.arm_damping", -1, ConfigError, r"config: robot\.drives\.arm_damping must be positive"),
        ("robot.mounts.side", "left", ConfigError, r"robot\.mounts is a list, which is given as a whole"),
        ("robot.mounts", "left", ConfigError, r"robot\.mounts must be a list, not 'left'"),
        ("render", 3, ConfigError, "render must be a mapping"),
        ("render.sun.strenght", 3, ConfigError, r"render\.sun: unknown key 'strenght'; did you mean 'strength'\?"),
        ("render.sun.strength", -1, ConfigError, r"render\.sun\.strength must not be negative"),
        ("render.quality", "pretty", ConfigError, "must be one of 'picture', 'fast', not 'pretty'"),
        ("render.lamps", [{"position_w": [0, 0, 1]}], ConfigError, r"key 'render\.lamps\[0\]\.colour' is missing"),
        ("physics.solver", "newtn", ConfigError, r"'physics\.solver' must be one of .* did you mean 'newton'\?"),
        ("physics.integrator", "Euler", ConfigError, "must be one of .* did you mean 'euler'"),
        ("physics.cone", "eliptic", ConfigError, "did you mean 'elliptic'"),
        ("physics.solver_tolerance", -1, ConfigError, r"physics\.solver_tolerance must lie in \[0, 1\)"),
        ("physics.noslip_iterations", -1, ConfigError, r"physics\.noslip_iterations must be at least 0"),
        ("physics.line_search_iterations", 0, ConfigError, r"physics\.line_search_iterations must be at least 1"),
        ("physics.contact.impratio", 0, ConfigError, r"physics\.contact\.impratio must be positive"),
        ("success.max_speed_m_s", -1, ConfigError, r"config: success\.max_speed_m_s must be positive"),
        ("reward.weights.opening", -1, ConfigError, r"config: reward\.weights must be"),
        ("cameras.fov_deg", 200, ConfigError, r"cameras\.fov_deg must lie in"),
    ],
)
def test_bad_values_name_their_place(key: str, value: object, error: type[ArtiSkillError], says: str) -> None:
    with pytest.raises(error, match=says):
        make_task("OpenCabinetDrawer", {key: value})


def test_a_task_that_needs_two_arms_says_so() -> None:
    with pytest.raises(ConfigError, match="MoveBucket needs a robot with two arms; one_arm has 1"):
        make_task("MoveBucket", {"robot": "one_arm"})


def goals_of(name: str) -> list[Any]:
    task = make_task(name)
    objects = [
        load_object(i)
        for i in (*list_objects(split="test", task=name)[:3], list_objects(split="ood", task=name)[0])
    ]
    return [
        task.make_goal(obj, target) for obj in objects for target in (task.targets(obj) or (obj.links[0].name,))
    ]


def assert_row_is(stacked: Any, row: int, goal: Any) -> None:
    for f in fields(goal):
        if f.name != ROW:
            value, place = getattr(goal, f.name)[0], getattr(stacked, f.name)[row]
            np.testing.assert_array_equal(place[: len(value)] if value.ndim else place, value, err_msg=f.name)


@pytest.mark.parametrize("name", task_names())
def test_each_row_is_its_goal(name: str) -> None:
    goals = goals_of(name)
    stacked = stack_goals(goals)
    np.testing.assert_array_equal(stacked.row, np.arange(len(goals)))
    for row, goal in enumerate(goals):
        assert_row_is(stacked, row, goal)


@pytest.mark.parametrize("name", task_names())
def test_putting_a_goal_is_stacking_it_there(name: str) -> None:
    goals = goals_of(name)
    longest = stack_goals(goals)
    for goal in reversed(goals):
        assert put_goal(longest, 1, goal)
        assert_row_is(longest, 1, goal)
        assert_row_is(longest, 0, goals[0])


def test_a_goal_that_is_too_long_is_not_put() -> None:
    goals = goals_of("OpenCabinetDrawer")
    by_planes = sorted(goals, key=lambda goal: goal.handle_planes.shape[1])
    short, long = by_planes[0], by_planes[-1]
    assert short.handle_planes.shape[1] < long.handle_planes.shape[1], "this test means handles of two kinds"
    stacked = stack_goals([short, short])
    assert not put_goal(stacked, 0, long)
    assert_row_is(stacked, 0, short)
    assert put_goal(stack_goals([short, long]), 0, long)


def test_an_added_term_counts_beside_the_others() -> None:
    task = make_task("PushChair")
    more = task.with_reward_term("fast", lambda snapshot, goal, flags: np.array([-0.5, 0.0]), 0.25)
    terms = dict.fromkeys(task.reward_weights, np.zeros(2)) | {"stage": np.array([-3.0, -1.0])}
    assert more.reward_weights == {**task.reward_weights, "fast": 0.25}
    np.testing.assert_array_equal(more.dense_reward(terms | {"fast": np.array([-0.5, 0.0])}), [-3.125, -1.0])
    for name, weight, message in (
        ("stage", 1.0, "there is a reward term 'stage' already"),
        ("x", -1.0, "the weight of 'x' must be a finite number of at least 0, not -1.0"),
        ("x", "1", "not '1'"),
        ("x", float("inf"), "not inf"),
    ):
        with pytest.raises(ConfigError, match=message):
            task.with_reward_term(name, lambda snapshot, goal, flags: np.zeros(1), weight)

"""Robots and arms from YAML: names, and values that make no sense, each one clear error."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from artiskill.config import from_mapping, load_config, to_mapping
from artiskill.errors import ConfigError, UnknownNameError
from artiskill.robots.arm_config import ROBOT_DIR, ArmConfig, load_arm
from artiskill.robots.config import RobotConfig, load_robot, robot_mapping

ONE_ARM, PANDA = ROBOT_DIR / "one_arm.yaml", ROBOT_DIR / "panda.yaml"
SHAPE = {"kind": "capsule", "size": [0.05, 0.1], "position_m": [0, 0, 0]}


def test_unknown_robot_names_the_nearest():
    with pytest.raises(UnknownNameError, match=r"unknown robot 'onearm'; did you mean 'one_arm'\?"):
        load_robot("onearm")


def test_an_arm_is_no_robot_and_a_robot_no_arm():
    with pytest.raises(UnknownNameError, match="unknown robot 'panda'"):
        load_robot("panda")
    with pytest.raises(UnknownNameError, match="unknown arm 'one_arm'"):
        load_arm("one_arm")


def test_a_robot_survives_the_way_to_plain_values_and_back():
    robot = load_robot("one_arm")
    assert from_mapping(RobotConfig, to_mapping(robot)) == robot
    assert from_mapping(ArmConfig, to_mapping(load_arm("panda"))) == load_arm("panda")


def test_a_file_changes_another_robot(tmp_path: Path):
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "soft.yaml").write_text("like: one_arm\nname: soft\ndrives: {arm_damping: 30}\n")
    (tmp_path / "softer.yml").write_text("like: robots/soft.yaml\nactions: {yaw_rate_rad_s: 1}\n")
    soft, plain = load_robot(tmp_path / "softer.yml"), load_robot("one_arm")
    drives, actions = replace(plain.drives, arm_damping=30.0), replace(plain.actions, yaw_rate_rad_s=1.0)
    assert soft == replace(plain, name="soft", drives=drives, actions=actions)
    assert load_robot({"like": str(tmp_path / "softer.yml"), "name": "one_arm"}).drives == drives
    assert robot_mapping(to_mapping(soft)) == to_mapping(soft), "without `like` a mapping stands for itself"


def test_robots_of_ones_own_that_make_no_sense(tmp_path: Path):
    one, two = tmp_path / "one.yaml", tmp_path / "two.yaml"
    one.write_text("like: two.yaml\n")
    two.write_text("like: one.yaml\n")
    with pytest.raises(ConfigError, match=r"is like itself: one\.yaml -> two\.yaml -> one\.yaml"):
        load_robot(one)
    two.write_text("name: nothing else\n")
    with pytest.raises(ConfigError, match=r"one\.yaml': key 'arm' is missing"):
        load_robot(one)
    two.write_text("like: [one_arm]\n")
    with pytest.raises(ConfigError, match=r"a robot is a name, .* not \['one_arm'\]"):
        load_robot(one)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("drives.arm_dampin", 3, "arm_damping"),
        ("drives.arm_damping", "much", "a number was expected"),
        ("drives.arm_damping", 0, "arm_damping must be positive"),
        ("drives.filter_cutoff_hz", -40, "filter_cutoff_hz must be positive"),
        ("drives.joint_friction", -0.1, "joint_friction must be finite and at least 0, not -0.1"),
        ("drives.arm_armature", math.nan, "arm_armature: a number was expected, not nan"),
        ("actions.yaw_rate_rad_s", 0, "yaw_rate_rad_s must be positive"),
        ("actions.yaw_rate_rad_s", math.inf, "yaw_rate_rad_s must be positive"),
        ("base.range_m", [10, -10], "range_m must be a lower and a higher number"),
        ("lift.range_m", [0], "range_m must be a lower and a higher number"),
        ("lift.collisions", [SHAPE | {"kind": "cone"}], "'box', 'capsule'"),
        ("lift.collisions", [SHAPE | {"kind": "box"}], "a box has 3 sizes, all positive"),
        ("lift.collisions", [SHAPE | {"size": [0.05, -1]}], "a capsule has 2 sizes, all positive"),
        ("lift.collisions", [SHAPE | {"position_m": [0, 0]}], "position_m needs 3 numbers"),
        ("torso.body.mass_kg", 0, "mass_kg must be positive"),
        ("torso.body.inertia_kgm2", [1, 1, 3], "no body has the principal moments"),
        ("torso.body.center_of_mass_m", [1, 1], "center_of_mass_m needs 3 numbers"),
        ("torso.position_m", [0, 0, 0, 1], "position_m needs 3 numbers"),
        ("mounts", [], "one or two different sides"),
        ("initial.arm_qpos_rad", [0] * 6, "initial.arm_qpos_rad needs 7 numbers"),
        ("initial.arm_qpos_rad", [9, 0, 0, -1.5, 0, 3, 0.78], "arm_qpos_rad: panda_joint1 must lie in"),
        ("initial.finger_qpos_m", 0.05, "finger_qpos_m"),
        ("arm", "pandora", "did you mean 'panda'"),
    ],
)
def test_bad_robot_values_give_one_clear_error(key, value, message):
    with pytest.raises((ConfigError, UnknownNameError), match=message):
        load_config(RobotConfig, ONE_ARM, {key: value})


def test_two_mounts_on_one_side_are_refused():
    robot = load_robot("one_arm")
    with pytest.raises(ConfigError, match=r"different sides, not \['right', 'right'\]"):
        replace(robot, mounts=robot.mounts * 2)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("joints", [], "one link per joint"),
        ("hand.rpy_rad", [0, 0], "rpy_rad needs 3 numbers"),
        ("finger.range_m", [0.04, 0], "range_m must be a lower and a higher number"),
        ("finger.effort_n", 0, "effort_n must be positive"),
        ("finger.tip_m", [0, 0], "tip_m needs 3 numbers"),
    ],
)
def test_bad_arm_values_give_one_clear_error(key, value, message):
    with pytest.raises(ConfigError, match=message):
        load_config(ArmConfig, PANDA, {key: value})


def test_bad_joint_values_give_one_clear_error():
    joint = load_arm("panda").joints[0]
    for change, message in (
        ({"range_rad": (1.0, 1.0)}, "panda_joint1: range_rad must be a lower and a higher number"),
        ({"effort_nm": -1.0}, "panda_joint1: effort_nm must be positive"),
        ({"position_m": (0.0,)}, "panda_joint1: position_m needs 3 numbers"),
    ):
        with pytest.raises(ConfigError, match=message):
            replace(joint, **change)

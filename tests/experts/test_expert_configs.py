"""Values that no expert can act with are refused, by the name of their key."""

from typing import Any

import pytest

from artiskill.config import from_mapping, merge_overrides, to_mapping
from artiskill.errors import ConfigError
from artiskill.experts.registry import make_expert
from artiskill.experts.variation import numbers_of
from artiskill.tasks.registry import make_task, task_names


@pytest.mark.parametrize(
    ("task", "key", "value"),
    [
        ("MoveBucket", "hands.position_gain_s", -5),
        ("MoveBucket", "hands.press_n", -50),
        ("MoveBucket", "hands.lead_m_s", 0),
        ("MoveBucket", "hands.yaw_share", -1),
        ("MoveBucket", "hands.arm_qpos_rad", [0.0] * 6),
        ("MoveBucket", "press.share", 1.5),
        ("MoveBucket", "press.bail_weight", -1),
        ("MoveBucket", "hands.whole_body.rotation_weight_m", 0),
        ("OpenCabinetDrawer", "reach_speed_m_s", 0),
        ("OpenCabinetDrawer", "overshoot", 21),
        ("OpenCabinetDrawer", "grip.close_speed_m_s", 0),
        ("OpenCabinetDrawer", "grip.astray_m", 0.001),
        ("OpenCabinetDoor", "door.follow", 1.5),
        ("OpenCabinetDoor", "door.push_gain", -1),
        ("PushChair", "hands.close_speed_m_s", -0.1),
        ("PushChair", "hands.roll_rad", 4),
        ("PushChair", "seat.turn_weight", -1),
        ("PushChair", "stop_m", 0),
    ],
)
def test_illegal_values_are_refused(task: str, key: str, value: Any) -> None:
    config = make_expert(task, make_task(task).robot).config
    with pytest.raises(ConfigError, match=f"^config: {key.replace('.', '[.]')} "):
        from_mapping(type(config), merge_overrides(to_mapping(config), {key: value}))


@pytest.mark.parametrize("task", task_names())
def test_no_value_may_be_infinite(task: str) -> None:
    config = make_expert(task, make_task(task).robot).config
    for key in numbers_of(to_mapping(config)):
        if not key.rpartition(".")[2].isdigit():  # a list is given as a whole
            with pytest.raises(ConfigError):
                from_mapping(type(config), merge_overrides(to_mapping(config), {key: float("inf")}))

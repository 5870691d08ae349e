"""What an environment can be asked for by name."""

from collections.abc import Callable, Mapping
from typing import Any

from artiskill.envs.control import CONTROL_MODES
from artiskill.envs.observation import Observer, StateObserver
from artiskill.envs.vision import PointCloudObserver, RgbdObserver
from artiskill.errors import ConfigError, check_name, shown
from artiskill.tasks.task import Task

OBSERVERS: dict[str, Callable[[Task], Observer]] = {
    "state": StateObserver,
    "pointcloud": PointCloudObserver,
    "rgbd": RgbdObserver,
}
OBSERVATION_MODES: tuple[str, ...] = tuple(OBSERVERS)
REWARD_MODES: tuple[str, ...] = ("dense", "sparse")
VECTOR_RENDER_MODES: tuple[str, ...] = ("rgb_array",)
HUMAN = "human"
RENDER_MODES: tuple[str, ...] = (*VECTOR_RENDER_MODES, HUMAN)


def check_modes(
    observation: str, reward: str, control: str, render: str | None, legal_render: tuple[str, ...] = RENDER_MODES
) -> None:
    """Raise UnknownNameError unless all are legal."""
    check_name("observation mode", observation, OBSERVATION_MODES)
    check_name("reward mode", reward, REWARD_MODES)
    check_name("control mode", control, CONTROL_MODES)
    if render is not None:
        check_name("render mode", render, legal_render)


def checked_options(given: object, legal: tuple[str, ...]) -> dict[str, Any]:
    """The options of a `reset`, as a dictionary of the caller's own.

    Raises:
        ConfigError: they are no mapping.
        UnknownNameError: an unknown option.
    """
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise ConfigError(f"reset options are a mapping with the keys {', '.join(legal)}, not {shown(given)}")
    for key in given:
        check_name("reset option", key, legal)
    return dict(given)

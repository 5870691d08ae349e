"""What an environment can be asked for by name."""

from collections.abc import Callable

from artiskill.envs.control import CONTROL_MODES
from artiskill.envs.observation import Observer, StateObserver
from artiskill.envs.vision import PointCloudObserver, RgbdObserver
from artiskill.errors import check_name
from artiskill.tasks.task import Task

OBSERVERS: dict[str, Callable[[Task], Observer]] = {
    "state": StateObserver,
    "pointcloud": PointCloudObserver,
    "rgbd": RgbdObserver,
}
OBSERVATION_MODES: tuple[str, ...] = tuple(OBSERVERS)
REWARD_MODES: tuple[str, ...] = ("dense", "sparse")
RENDER_MODES: tuple[str, ...] = ("rgb_array",)


def check_modes(observation: str, reward: str, control: str, render: str | None) -> None:
    """Raise UnknownNameError unless all are legal."""
    check_name("observation mode", observation, OBSERVATION_MODES)
    check_name("reward mode", reward, REWARD_MODES)
    check_name("control mode", control, CONTROL_MODES)
    if render is not None:
        check_name("render mode", render, RENDER_MODES)

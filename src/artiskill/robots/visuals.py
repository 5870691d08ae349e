"""What is drawn of the robot, part by part; all geometry is the project's own."""

from collections.abc import Callable
from functools import cache

from artiskill.assets.articulated_object import VisualMesh
from artiskill.errors import UnknownNameError
from artiskill.robots import panda_visuals, torso_visuals

_BUILDERS: dict[str, Callable[[], tuple[VisualMesh, ...]]] = {
    "mobile_base": torso_visuals.mobile_base,
    "lift": torso_visuals.lift,
    "torso": torso_visuals.torso,
    "panda_link1": panda_visuals.link1,
    "panda_link2": panda_visuals.link2,
    "panda_link3": panda_visuals.link3,
    "panda_link4": panda_visuals.link4,
    "panda_link5": panda_visuals.link5,
    "panda_link6": panda_visuals.link6,
    "panda_link7": panda_visuals.link7,
    "panda_hand": panda_visuals.hand,
    "panda_finger": panda_visuals.finger,
}
ROBOT_PARTS: tuple[str, ...] = tuple(_BUILDERS)


@cache
def robot_visuals(part: str) -> tuple[VisualMesh, ...]:
    """The drawn surfaces of a robot part, in the part's own body frame (metres).

    Args:
        part: one of `ROBOT_PARTS`, without a side: `panda_link3` serves both arms, `panda_finger` both fingers.

    Raises:
        UnknownNameError: there is no such part.
    """
    if part not in _BUILDERS:
        raise UnknownNameError("robot part", part, _BUILDERS)
    return _BUILDERS[part]()

"""Which drawn surfaces the masks of the cabinet tasks cover."""

import numpy as np

from artiskill.assets.handles import is_handle_part
from artiskill.scene.scene import Scene

MASK_NAMES = ("handle", "link", "robot")


def cabinet_masks(scene: Scene, target: str) -> np.ndarray:
    """The target link's handle, the whole target link (its handle included), the robot: (3, G) bool.

    A link with several handles has all of them masked.

    Raises:
        UnknownNameError: the object has no such link.
    """
    target_body = scene.index.object_bodies.start + scene.object.link_index(target)
    robot_bodies = [scene.model.body(name).id for name in scene.robot.bodies]
    body = np.array([body for body, _ in scene.visuals])
    is_handle = np.array([is_handle_part(visual.part) for _, visual in scene.visuals])
    on_target = body == target_body
    return np.stack((on_target & is_handle, on_target, np.isin(body, robot_bodies)))

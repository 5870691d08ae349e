"""What people see of a vector: every scene from the world camera."""

import numpy as np

from artiskill.envs.rendering import Viewpoint, WorldView
from artiskill.envs.vector.episodes import Episodes


class WorldViews:
    """A picture of each environment; its renderer is kept until the environment has another scene."""

    def __init__(self, episodes: Episodes) -> None:
        self._episodes = episodes
        self._views: dict[int, WorldView] = {}

    def forget(self, env: int) -> None:
        """An environment has another scene."""
        self._views.pop(env, None)

    def draw(self) -> tuple[np.ndarray, ...]:
        """B pictures, (480, 640, 3) uint8 each."""
        fleet, camera = self._episodes.fleet, self._episodes.task.world_camera
        pictures = []
        for env, slot in enumerate(fleet.slot.tolist()):
            if env not in self._views:
                self._views[env] = WorldView(fleet.scene_of(env), Viewpoint().camera(camera))
            pictures.append(self._views[env].draw(fleet.squad_of(env).snapshot, slot))
        return tuple(pictures)

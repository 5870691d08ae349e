"""Pictures of an object alone, its joints anywhere in their ranges: no robot, no task, no engine."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.kinematics import drawn_points, joint_values, link_poses
from artiskill.geometry.rotations import transform_points
from artiskill.sensors.camera import Camera
from artiskill.sensors.drawing.scene_tables import BodyVisual
from artiskill.sensors.pictures.framing import framing_camera, orbit_camera
from artiskill.sensors.render_config import RenderConfig, load_render_config
from artiskill.sensors.renderer import Renderer

AZIMUTH_DEG, ELEVATION_DEG, FOV_DEG = 212.0, 20.0, 35.0  # cabinets face -x: a little from the left
CLOSED = 0.0

Fractions = float | Sequence[float] | np.ndarray


@dataclass(frozen=True, eq=False)
class OrbitView:
    """Where a camera looks from; as near as the whole object allows, unless a distance or a target fix it.

    Attributes:
        width: pixels.
        height: pixels.
        azimuth_deg: where the camera stands, counter-clockwise from +x seen from above; cabinets face 180.
        elevation_deg: where it stands above the horizon, [-90, 90].
        fov_deg: vertical field of view, in (0, 180).
        distance_m: of the camera from the target; None for what the object needs.
        target_w: (3,) the middle of the picture; None for the object's middle, where a distance is given.
    """

    width: int = 640
    height: int = 480
    azimuth_deg: float = AZIMUTH_DEG
    elevation_deg: float = ELEVATION_DEG
    fov_deg: float = FOV_DEG
    distance_m: float | None = None
    target_w: Sequence[float] | np.ndarray | None = None


_DEFAULT_VIEW = OrbitView()


class ObjectView:
    """Draws one object; built once for several pictures of it."""

    def __init__(self, obj: ArticulatedObject, config: RenderConfig | None = None) -> None:
        """Build the renderer.

        Args:
            obj: the object.
            config: how to draw; by default as pictures for people.
        """
        self.object, self._config = obj, config or load_render_config()
        self._renderer = self._make_renderer(range(len(obj.links)))
        self._without_wall: Renderer | None = None  # built when first looked at from behind

    def _make_renderer(self, links: Iterable[int]) -> Renderer:
        visuals = [BodyVisual(i, visual) for i in links for visual in self.object.links[i].visuals]
        return Renderer(visuals, self._config)

    def camera(self, states: Sequence[Fractions] = (CLOSED,), view: OrbitView = _DEFAULT_VIEW) -> Camera:
        """The camera that sees the whole object in each of several states.

        Args:
            states: each as `joint_fractions` of `render_object`.
            view: where from; its distance or target fix the camera instead.

        Raises:
            ConfigError: a value out of range.
        """
        angles_and_lens = view.azimuth_deg, view.elevation_deg, view.width, view.height, view.fov_deg
        points = [drawn_points(self.object, joint_values(self.object, state)) for state in states]
        camera = framing_camera(np.concatenate(points), *angles_and_lens)
        distance_m, target_w = view.distance_m, view.target_w
        if distance_m is None and target_w is None:
            return camera
        target = self.object.bounds.mean(axis=0) if target_w is None else np.asarray(target_w, dtype=np.float64)
        if distance_m is None:
            distance_m = float(np.linalg.norm(camera.position_w - target))
        return orbit_camera(target, distance_m, *angles_and_lens)

    def draw(self, joint_fractions: Fractions, camera: Camera) -> np.ndarray:
        """The object in one state, (H, W, 3) uint8; from behind, without the wall that it hangs on."""
        poses = link_poses(self.object, joint_values(self.object, joint_fractions))
        return self._renderer_for(camera, *poses).render(*poses, [camera]).rgb[0]

    def _renderer_for(self, camera: Camera, positions: np.ndarray, quaternions: np.ndarray) -> Renderer:
        """The one without the wall, if the camera is behind its face: objects that hang face -x."""
        faces = [
            transform_points(positions[i], quaternions[i], visual.mesh.vertices)[:, 0].min()
            for i, link in enumerate(self.object.links)
            if link.is_wall
            for visual in link.visuals
        ]
        if not faces or camera.position_w[0] <= min(faces):
            return self._renderer
        if self._without_wall is None:
            self._without_wall = self._make_renderer(self.object.own_links)
        return self._without_wall


def render_object(
    obj: ArticulatedObject,
    joint_fractions: Fractions = CLOSED,
    view: OrbitView = _DEFAULT_VIEW,
    config: RenderConfig | None = None,
) -> np.ndarray:
    """A picture of an object on the ground, with soft shadows.

    The camera is as near as it can be to see the whole object both at rest and as drawn, so that two pictures of
    one object differ little in scale; a distance or a target fix it instead.

    Args:
        obj: the object.
        joint_fractions: where each joint is between its lower limit, 0, and its upper, 1: one number for all, or
            one per joint in the order of `obj.jointed_links`. A joint that turns without end turns once.
        view: where the camera looks from.
        config: how to draw; by default as pictures for people.

    Returns:
        (H, W, 3) uint8.

    Raises:
        ConfigError: a value out of range, or another number of fractions than joints.
        AssetError: a surface that cannot be drawn.
    """
    drawn = ObjectView(obj, config)
    return drawn.draw(joint_fractions, drawn.camera((CLOSED, joint_fractions), view))

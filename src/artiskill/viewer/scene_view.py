"""What is drawn in the browser: bodies, and layers that can be switched on.

A body is a node of viser's scene tree; its surfaces, collision shapes and axes are below it and move with it.
"""

import asyncio
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape, VisualMesh
from artiskill.assets.kinematics import link_poses
from artiskill.checks.surfaces import collision_mesh
from artiskill.errors import check_name
from artiskill.exports.common import linear_to_srgb
from artiskill.exports.glb import body_glb
from artiskill.geometry.meshes import TriMesh, merge
from artiskill.scene.scene import Scene
from artiskill.sensors.render_config import BackgroundConfig, FloorConfig, RenderConfig
from artiskill.sim.snapshot import Snapshot

TARGET, SHAPES, AXES, GRASPS = "target", "collision shapes", "joint axes", "grasp poses"
LAYERS = (TARGET, SHAPES, AXES, GRASPS)

_ROOT = "/scene"
_ORANGE, _BLUE, _GREEN, _RED = (230, 120, 0), (60, 120, 220), (40, 160, 90), (220, 40, 40)
_LINE_M, _AXIS_M, _GRASP_M, _MARGIN_M = 0.006, 0.25, 0.05, 0.012
_ABOVE_M, _CAPTION_M = 0.0015, 0.1
_MOST_GRASPS = 12  # of a handle; the best ones
_FLOOR_M = 40.0  # half of a side
_ROOM, _ROOM_BESIDE = 1.15, 1.3  # the camera stands so many times as far away as it has to; beside a panel
_ASIDE = 0.34  # the camera stands so much of its distance to the right: the panel covers what robots go to
_FOV_RAD, _ASPECT = math.radians(45.0), 4 / 3  # of the camera; which part of what it sees is the scene
# pages that are not wider have viser's panel over the lower 60 %, so the scene is shown that share of them higher
_NARROW_PX, _HIGHER = 576, 0.28
_CAMERA_S = 0.3  # after which a new page has the camera that all begin with
# A directional light of intensity 1 makes a white surface that faces it 1 / pi as bright as our renderer's does.
_LIGHT = math.pi
_SAME_M, _SAME_QUATERNION = 1e-6, 1e-6  # smaller changes of a pose are not sent
_CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
_EDGES = [(a, b) for a in range(8) for b in range(a) if abs(_CORNERS[a] - _CORNERS[b]).sum() == 1]


@dataclass(frozen=True, eq=False)
class Body:
    """Something rigid that is drawn.

    Attributes:
        name: a path in the scene tree, `robot/torso`.
        visuals: its surfaces, in its frame.
        collisions: its collision shapes, in its frame.
    """

    name: str
    visuals: tuple[VisualMesh, ...]
    collisions: tuple[CollisionShape, ...] = ()


def scene_bodies(scene: Scene) -> dict[int, Body]:
    """Return what is drawn of a scene, by the index of its pose in a snapshot."""
    visuals: dict[int, list[VisualMesh]] = {}
    for body, visual in scene.visuals:
        visuals.setdefault(body, []).append(visual)
    shapes: dict[int, list[CollisionShape]] = {}
    for body, shape in scene.collision_shapes:
        shapes.setdefault(body, []).append(shape)
    found = {}
    for body in sorted({*visuals, *shapes}):
        name = scene.model.body(body).name
        path = name if "/" in name else f"robot/{name}"
        found[body] = Body(path, tuple(visuals.get(body, ())), tuple(shapes.get(body, ())))
    return found


def object_bodies(obj: ArticulatedObject) -> dict[int, Body]:
    """Return what is drawn of an object alone, by the index of the link."""
    return {
        i: Body(f"object/{link.name}", tuple(link.visuals), tuple(link.collisions))
        for i, link in enumerate(obj.links)
    }


def blended_poses(before: Snapshot, after: Snapshot, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Return poses (N, 3) and (N, 4) a share of the way from one snapshot to another, B = 1; 1 is the other's."""
    if share >= 1.0:
        return after.body_position_w[0], after.body_quaternion_w[0]
    first, last = before.body_quaternion_w[0], after.body_quaternion_w[0]
    last = np.where((first * last).sum(axis=1, keepdims=True) < 0.0, -last, last)  # the shorter way
    turned = first + share * (last - first)
    positions = before.body_position_w[0] + share * (after.body_position_w[0] - before.body_position_w[0])
    return positions, turned / np.linalg.norm(turned, axis=1, keepdims=True)


class SceneView:
    """Bodies in the browser, with layers that can be switched on; light and ground are the pictures'.

    Args:
        server: of viser.
        bodies: what is drawn, by the index of its pose.
        obj: the object among them.
        first_link: index of its first link's pose.
        target: link that the layer `target` marks; None for none.

    Attributes:
        shown: names of the layers that are switched on.
    """

    def __init__(
        self,
        server: Any,
        bodies: Mapping[int, Body],
        obj: ArticulatedObject,
        first_link: int = 0,
        target: str | None = None,
    ) -> None:
        self._server, self._bodies, self._object = server, bodies, obj
        self._first_link, self._target = first_link, target
        self._layers: dict[str, list[Any]] = {}
        self._poses: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self.shown: set[str] = set()
        self._root = server.scene.add_frame(_ROOT, show_axes=False)
        self._nodes, self._surfaces = {}, []
        for index, body in bodies.items():
            path = f"{_ROOT}/{body.name}"
            self._nodes[index] = server.scene.add_frame(path, show_axes=False)
            if body.visuals:
                glb = body_glb(body.visuals)  # shadows on curved surfaces would have stripes
                self._surfaces.append(server.scene.add_glb(f"{path}/surface", glb, receive_shadow=False))

    def set_poses(self, positions_w: np.ndarray, quaternions_w: np.ndarray) -> None:
        """Move the bodies, (N, 3) and (N, 4); only poses that have changed are sent."""
        with self._server.atomic():
            for index, node in self._nodes.items():
                position, quaternion = positions_w[index], quaternions_w[index]
                known = self._poses.get(index)
                if known is None or np.abs(known[0] - position).max() > _SAME_M:
                    node.position = position.astype(np.float32)
                if known is None or np.abs(known[1] - quaternion).max() > _SAME_QUATERNION:
                    node.wxyz = quaternion.astype(np.float32)
                self._poses[index] = position.copy(), quaternion.copy()

    def show_surfaces(self, is_visible: bool) -> None:
        """Draw the surfaces, or leave them out."""
        for handle in self._surfaces:
            handle.visible = is_visible

    def show_layer(self, layer: str, is_visible: bool) -> None:
        """Switch a layer on or off; it is made when it is first switched on.

        Raises:
            UnknownNameError: not one of `LAYERS`.
        """
        check_name("layer", layer, LAYERS)
        if layer not in self._layers and is_visible:
            make = {TARGET: self._mark_target, SHAPES: self._add_shapes, AXES: self._add_axes}
            self._layers[layer] = list(make.get(layer, self._add_grasps)())
        for handle in self._layers.get(layer, ()):
            handle.visible = is_visible
        (self.shown.add if is_visible else self.shown.discard)(layer)

    def remove(self) -> None:
        """Take everything away."""
        self._root.remove()

    def mark(self, link: str, name: str, text: str) -> list[Any]:
        """Put a box around a link, and a text beside it; return what `remove` takes away."""
        index = self._object.link_index(link)
        path = self._path(index)
        points = [
            visual.mesh.vertices for visual in self._object.links[index].visuals if len(visual.mesh.vertices)
        ]
        if not points:
            return []
        low, high = _bounds(np.concatenate(points))
        label = self._server.scene.add_label(
            f"{path}/{name}-text", text, position=(*(low + high)[:2] / 2, high[2])
        )
        return [self._add_box(f"{path}/{name}", low, high, _RED), label]

    def add_caption(self) -> Any:
        """Return a label above the object, which moves with it; its text is empty."""
        root = self._object.links[0]
        rest = link_poses(self._object, self._object.rest_qpos)[0][0]
        low, high = np.asarray(self._object.bounds)
        top = np.append((low + high)[:2] / 2, high[2] + _CAPTION_M) - rest
        return self._server.scene.add_label(f"{_ROOT}/object/{root.name}/caption", "", position=top)

    def _path(self, link: int) -> str:
        return f"{_ROOT}/{self._bodies[self._first_link + link].name}"

    def _add_box(self, path: str, low: np.ndarray, high: np.ndarray, colour: tuple[int, int, int]) -> Any:
        corners = low + _CORNERS * (high - low)
        lines = np.array([(corners[a], corners[b]) for a, b in _EDGES], dtype=np.float32)
        return self._server.scene.add_line_segments(path, lines, colour, thickness=_LINE_M)

    def _mark_target(self) -> Iterator[Any]:
        """Yield boxes around the handles of the target link."""
        handles = self._object.handles_of(self._target) if self._target is not None else ()
        for number, handle in enumerate(handles):
            path = f"{self._path(self._object.link_index(handle.link))}/target-{number}"
            yield self._add_box(path, *_bounds(handle.points), _ORANGE)

    def _add_shapes(self) -> Iterator[Any]:
        for body in self._bodies.values():
            if body.collisions:
                mesh = merge(_inflated(collision_mesh(shape)) for shape in body.collisions)
                yield self._server.scene.add_mesh_simple(
                    f"{_ROOT}/{body.name}/shapes",
                    mesh.vertices.astype(np.float32),
                    mesh.faces,
                    color=_BLUE,
                    opacity=0.4,
                    flat_shading=True,
                    cast_shadow=False,
                    receive_shadow=False,
                )

    def _add_axes(self) -> Iterator[Any]:
        for index, link in enumerate(self._object.links):
            if link.joint is not None:
                reach = _AXIS_M * np.asarray(link.joint.axis, dtype=float)
                line = np.array([[link.joint.origin - reach, link.joint.origin + reach]], dtype=np.float32)
                yield self._server.scene.add_arrows(
                    f"{self._path(index)}/axis",
                    line,
                    _GREEN,
                    shaft_radius=0.006,
                    head_radius=0.015,
                    head_length=0.04,
                )

    def _add_grasps(self) -> Iterator[Any]:
        for number, handle in enumerate(self._object.handles):
            path = f"{self._path(self._object.link_index(handle.link))}/grasps-{number}"
            yield self._server.scene.add_batched_axes(
                path,
                batched_wxyzs=np.asarray(handle.grasp_quaternions[:_MOST_GRASPS], dtype=np.float32),
                batched_positions=np.asarray(handle.grasp_positions[:_MOST_GRASPS], dtype=np.float32),
                axes_length=_GRASP_M,
                axes_radius=_GRASP_M / 20,
            )


def _inflated(mesh: TriMesh) -> TriMesh:
    """Return a convex mesh a little larger, lest it flicker where it lies on what is drawn."""
    outwards = np.sign(mesh.vertices - mesh.bounds.mean(axis=0))
    return TriMesh(mesh.vertices + _ABOVE_M * outwards, mesh.faces)


def _bounds(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of a box around points, with a margin."""
    return points.min(axis=0) - _MARGIN_M, points.max(axis=0) + _MARGIN_M


def add_stage(server: Any, config: RenderConfig) -> None:
    """Add light, sky and ground as pictures have them."""
    scene, sun, ambient = server.scene, config.sun, config.ambient
    scene.configure_default_lights(False)
    scene.configure_environment_map(None)
    scene.add_light_directional(
        "/light/sun",
        color=_bytes(sun.colour),
        intensity=_LIGHT * sun.strength,
        cast_shadow=config.shadows.enabled,
        position=tuple(10.0 * v for v in sun.direction_w),
    )
    scene.add_light_hemisphere(
        "/light/sky",
        sky_color=_bytes(ambient.sky),
        ground_color=_bytes(ambient.ground),
        intensity=_LIGHT,
        position=(0.0, 0.0, 1.0),
    )
    if config.floor.enabled:
        _add_floor(scene, config.floor, config.background)
    up = np.linspace(1.0, 0.0, 64)[:, None]
    sky = up * np.array(config.background.zenith) + (1 - up) * np.array(config.background.horizon)
    scene.set_background_image(np.tile((255 * sky).astype(np.uint8)[:, None], (1, 4, 1)), format="png")


def place_camera(
    server: Any, eye_w: Any, look_at_w: Any, has_panel: bool = True, moves_pages: bool = False
) -> None:
    """Place the camera from which pages look first, beside a panel if there is one, and that of open pages."""
    eye, look_at = np.asarray(eye_w, dtype=float), np.asarray(look_at_w, dtype=float)
    eye = look_at + (_ROOM_BESIDE if has_panel else _ROOM) * (eye - look_at)
    right = np.cross(look_at - eye, (0.0, 0.0, 1.0))  # as long as the distance, nearly
    aside = _ASIDE * right if has_panel else 0.0
    server.initial_camera.position = eye + aside
    server.initial_camera.look_at = look_at + aside
    server.initial_camera.fov = _FOV_RAD
    for client in server.get_clients().values() if moves_pages else ():
        _look_first(server, client.camera)


def show_above_panel(server: Any) -> None:
    """Have narrow pages, those that are open and all later ones, begin with the scene above the panel."""

    async def place(client: Any) -> None:
        await asyncio.sleep(_CAMERA_S)
        if client.camera.image_width <= _NARROW_PX:
            _look_first(server, client.camera)

    server.on_client_connect(place)


def _look_first(server: Any, camera: Any) -> None:
    """Have a page look from where pages look first."""
    eye, look_at = server.initial_camera.position, server.initial_camera.look_at
    if camera.image_width <= _NARROW_PX:
        eye, look_at = narrow_view(eye, look_at, camera.aspect)
    camera.position, camera.look_at = eye, look_at


def narrow_view(eye_w: np.ndarray, look_at_w: np.ndarray, aspect: float) -> tuple[np.ndarray, np.ndarray]:
    """Return from where, and where to, a narrow page looks, for the place of a camera beside a panel."""
    ahead = look_at_w - eye_w
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    look_at = look_at_w - _ASIDE * right
    ahead *= max(1.0, _ASPECT / aspect / _ROOM_BESIDE)
    up = np.cross(right, ahead) / np.linalg.norm(right)  # as long as the distance
    lower = 2.0 * math.tan(_FOV_RAD / 2.0) * _HIGHER * up
    return look_at - ahead - lower, look_at - lower


def _add_floor(scene: Any, floor: FloorConfig, background: BackgroundConfig) -> None:
    """Add a ground that hides what is below it, with lines for its tiles, and haze that it melts into."""
    corners = np.array([(x * _FLOOR_M, y * _FLOOR_M, 0.0) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    colour = _bytes(floor.colour)
    faces = np.array([(0, 1, 2), (0, 2, 3)])
    scene.add_mesh_simple("/ground", corners.astype(np.float32), faces, color=colour, cast_shadow=False)
    lines = tuple(round(c * (1.0 - floor.contrast / 2)) for c in colour)
    scene.add_grid(
        "/ground/tiles",
        width=2 * floor.fade_end_m,
        height=2 * floor.fade_end_m,
        cell_size=floor.tile_m,
        cell_color=lines,
        section_size=2 * floor.tile_m,
        section_color=lines,
        shadow_opacity=0.0,
        position=(0.0, 0.0, 0.003),
    )
    haze = tuple(round(255 * v) for v in background.horizon)
    scene.configure_fog(floor.fade_start_m + floor.fade_end_m / 2, 2 * floor.fade_end_m, color=haze)


def _bytes(linear: Sequence[float]) -> tuple[int, int, int]:
    """Return a linear colour as sRGB bytes."""
    red, green, blue = (round(255 * float(v)) for v in linear_to_srgb(np.asarray(linear)))
    return red, green, blue

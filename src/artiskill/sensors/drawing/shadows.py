"""Soft shadows: a shadow map (Williams 1978) and percentage-closer filtering (Reeves et al. 1987)."""

import math
from typing import NamedTuple

import numpy as np

from artiskill.geometry.kernel import Array, Point, kernel
from artiskill.sensors.drawing.buffers import Samples, ShadowBuffers
from artiskill.sensors.drawing.rasterise import point, scan_convert
from artiskill.sensors.drawing.scene_tables import Poses, SceneTables
from artiskill.sensors.drawing.shading import dot3

# the map's side grows in such steps, so that a moving scene does not change the size of its texels all the time
_SIDE_STEP_M = 0.5
_MAX_FILTER_TEXELS = 8
# a surface's own height error in the map, in texels, and what the drawn surface may differ from its triangle
_BIAS_TEXELS = 0.75
_BIAS_M = 0.001
_MIN_COSINE = 0.15


class ShadowMap(NamedTuple):
    """Heights towards a light at infinity, seen from there.

    `matrix` (3, 4) takes world points to texel column, texel row and height in metres; `heights` (S, S) float32,
    -inf where nothing is; `texel_m` the side of a texel, `filter_texels` the width of the soft edge, `bias_m` what
    a height must exceed to shade.
    """

    matrix: Array
    heights: Array
    texel_m: float
    filter_texels: int
    bias_m: float


class ShadowPass:
    """Draws shadow maps of a scene into the caller's buffers; never changes itself."""

    def __init__(
        self, scene: SceneTables, casts: np.ndarray, to_light: np.ndarray, resolution: int, softness_m: float
    ) -> None:
        """Prepare for a scene.

        Args:
            scene: the scene.
            casts: (G,) bool, which visuals cast shadows.
            to_light: (3,) unit vector.
            resolution: texels along each side of the map.
            softness_m: width of the shadows' edges.
        """
        self._faces = np.ascontiguousarray(scene.faces[casts[scene.face_geom]])
        self._casting = np.repeat(casts, np.diff(scene.geom_vertices))
        self.resolution = resolution
        self._softness_m = softness_m
        self._axes = _frame_towards(to_light)

    def draw(self, world: np.ndarray, buffers: ShadowBuffers) -> ShadowMap:
        """Draw the shadow map of the scene with vertices (V, 3) at `world`; it has the buffers' `heights`."""
        heights = buffers.heights
        heights.fill(-np.inf)  # what is nowhere shades nothing, however low it lies
        if len(self._faces) == 0:
            return ShadowMap(np.zeros((3, 4)), heights, 1.0, 1, 0.0)
        matrix, texel_m = self._fit(world[self._casting])
        project_affine(world, matrix, buffers.projected)
        draw_heights(buffers.projected, self._faces, heights, buffers.triangle)
        filter_texels = min(max(round(self._softness_m / texel_m), 1), _MAX_FILTER_TEXELS)
        return ShadowMap(matrix, heights, texel_m, filter_texels, _BIAS_TEXELS * texel_m + _BIAS_M)

    def _fit(self, world: np.ndarray) -> tuple[np.ndarray, float]:
        """Return the matrix whose map holds vertices (V, 3), and the side of a texel.

        It moves in whole texels only, so that edges do not crawl.
        """
        along = [(world * axis).sum(axis=1) for axis in self._axes]
        low, high = [float(a.min()) for a in along], [float(a.max()) for a in along]
        margin = 2.0 * self._softness_m
        side = max(high[0] - low[0], high[1] - low[1]) + 2.0 * margin
        side = math.ceil(side / _SIDE_STEP_M) * _SIDE_STEP_M
        texel = side / self.resolution
        matrix = np.zeros((3, 4))
        for k in range(2):
            centre = 0.5 * (low[k] + high[k])
            start = math.floor((centre - 0.5 * side) / texel)
            matrix[k, :3] = self._axes[k] / texel
            matrix[k, 3] = -float(start)
        matrix[2, :3] = self._axes[2]
        matrix[2, 3] = 1.0 - low[2]
        return matrix, texel


def _frame_towards(to_light: np.ndarray) -> np.ndarray:
    """Return rows: texel columns' direction, texel rows' direction, and the light's."""
    helper = np.array((0.0, 1.0, 0.0)) if abs(to_light[2]) > 0.99 else np.array((0.0, 0.0, 1.0))
    right = np.cross(helper, to_light)
    right /= math.sqrt(float((right * right).sum()))
    return np.stack((right, np.cross(right, to_light), to_light))


@kernel
def transform_vertices(scene: SceneTables, pose: Poses, world: Array) -> None:
    """Map all vertices from their bodies' frames to the world, (V, 3)."""
    vertices, rotations, positions = scene.vertices, pose.rotations, pose.positions
    for g in range(scene.geom_body.shape[0]):
        p = scene.geom_body[g] + 1
        for i in range(scene.geom_vertices[g], scene.geom_vertices[g + 1]):
            x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
            for k in range(3):
                world[i, k] = (
                    rotations[p, k, 0] * x + rotations[p, k, 1] * y + rotations[p, k, 2] * z + positions[p, k]
                )


@kernel
def project_affine(world: Array, matrix: Array, projected: Array) -> None:
    """Map world vertices through a (3, 4) matrix to screen x, y and a positive height."""
    for i in range(world.shape[0]):
        for k in range(3):
            projected[i, k] = (
                matrix[k, 0] * world[i, 0] + matrix[k, 1] * world[i, 1] + matrix[k, 2] * world[i, 2] + matrix[k, 3]
            )


@kernel
def draw_heights(projected: Array, faces: Array, heights: Array, triangle: Array) -> None:
    """Draw all triangles, whichever side they show, keeping the greatest height (S, S) and its triangle."""
    for t in range(faces.shape[0]):
        a, b, c = point(projected, faces[t, 0]), point(projected, faces[t, 1]), point(projected, faces[t, 2])
        scan_convert(a, b, c, t, True, heights, triangle)


@kernel
def add_visibility(count: int, shadow: ShadowMap, samples: Samples, visible: Array, weight: Array) -> None:
    """Add to `visible` (S,) how much light reaches each sample, times its cosine, and to `weight` the cosine.

    The first `count` samples are asked, but for those whose haze is 1.
    """
    matrix, heights, texel_m = shadow.matrix, shadow.heights, shadow.texel_m
    place_w, normal_w, haze = samples.place_w, samples.normal_w, samples.haze
    for i in range(count):
        if haze[i] >= 1.0:
            continue
        normal = (np.float64(normal_w[i, 0]), np.float64(normal_w[i, 1]), np.float64(normal_w[i, 2]))
        cosine = dot3(normal, (matrix[2, 0], matrix[2, 1], matrix[2, 2]))
        if cosine <= 0.0:
            continue
        place = (np.float64(place_w[i, 0]), np.float64(place_w[i, 1]), np.float64(place_w[i, 2]))
        # surfaces that the light only grazes would get unbounded slopes; they are nearly dark anyway
        slope = -texel_m * texel_m / max(cosine, _MIN_COSINE)
        du = slope * dot3(normal, (matrix[0, 0], matrix[0, 1], matrix[0, 2]))
        dv = slope * dot3(normal, (matrix[1, 0], matrix[1, 1], matrix[1, 2]))
        lit = light_visibility(place, (shadow.bias_m, du, dv), matrix, heights, shadow.filter_texels)
        visible[i] += np.float32(cosine * lit)
        weight[i] += np.float32(cosine)


@kernel
def light_visibility(place: Point, tangent: Point, matrix: Array, heights: Array, filter_texels: int) -> float:
    """Return how much of a light reaches a place, in [0, 1].

    The average over a square of texels, those at its rim by how much of them it covers, of whether each is higher
    than the place's tangent plane (receiver-plane bias, Isidoro 2006). Where corners, edges and middle of the
    square agree, the rest is not asked. `tangent` is the bias and the plane's growth per texel to the right and
    down.
    """
    half = 0.5 * filter_texels
    u = dot3(place, (matrix[0, 0], matrix[0, 1], matrix[0, 2])) + matrix[0, 3] - half
    v = dot3(place, (matrix[1, 0], matrix[1, 1], matrix[1, 2])) + matrix[1, 3] - half
    height = dot3(place, (matrix[2, 0], matrix[2, 1], matrix[2, 2])) + matrix[2, 3] + tangent[0]
    last = heights.shape[0] - filter_texels - 1
    if not (u >= 0.0 and v >= 0.0 and u < last and v < last):
        return 1.0
    column, row = int(u), int(v)
    # the plane's height at the centre of the square's first texel
    corner = height + (column + 0.5 - u - half) * tangent[1] + (row + 0.5 - v - half) * tangent[2]
    plane = (corner, tangent[1], tangent[2])
    agreed = probe(heights, row, column, filter_texels, plane)
    if agreed >= 0.0:
        return agreed
    return filtered(heights, row, column, (u - column, v - row), filter_texels, plane)


@kernel
def probe(heights: Array, row: int, column: int, span: int, plane: Point) -> float:
    """Return 1 if nine texels of the square are all lit, 0 if all are in shadow, else -1."""
    lit = 0
    for i in range(3):
        for j in range(3):
            r, c = (i * span) // 2, (j * span) // 2
            lit += int(heights[row + r, column + c] <= plane[0] + c * plane[1] + r * plane[2])
    if lit == 9:
        return 1.0
    return 0.0 if lit == 0 else -1.0


@kernel
def filtered(heights: Array, row: int, column: int, start: tuple[float, float], span: int, plane: Point) -> float:
    """Return the lit share of a square that begins at `start` (x, y) within the texel (row, column)."""
    lit = 0.0
    for r in range(span + 1):
        level = plane[0] + r * plane[2]
        inner = 0
        for c in range(1, span):
            inner += int(heights[row + r, column + c] <= level + c * plane[1])
        first, last = heights[row + r, column] <= level, heights[row + r, column + span] <= level + span * plane[1]
        share = inner + (1.0 - start[0]) * int(first) + start[0] * int(last)
        if r == 0:
            share *= 1.0 - start[1]
        elif r == span:
            share *= start[1]
        lit += share
    return lit / (span * span)

"""Cup pulls: a shell, open below, into which fingers reach from underneath."""

import numpy as np

from artiskill.assets.articulated_object import CollisionShape
from artiskill.assets.cabinets.pulls.pull import PART, Pull, Sinks
from artiskill.assets.cabinets.spec import HandleModel
from artiskill.assets.handles import HandleGrasp, grasp_depth
from artiskill.assets.parts import IDENTITY
from artiskill.geometry.arrays import power
from artiskill.geometry.meshes import TriMesh

_SHEET_M = 0.0022
_ALONG, _AROUND = 17, 9  # points of the drawn shell
_SECTORS = 3  # touched pieces along the cup, two around each
_POWERS = {"shell": 2.0, "box": 5.0}  # of the superellipse that bounds the cup as seen from the front


def build_cup(model: HandleModel, length_m: float, sinks: Sinks) -> Pull:
    """A cup whose opening faces +y; its shape is `shell` (half round) or `box` (nearly square)."""
    outer, inner = (_surface(model, length_m, inset, _ALONG, _AROUND) for inset in (0.0, _SHEET_M))
    shapes = []
    along = np.linspace(0, _ALONG - 1, _SECTORS + 1).astype(int)
    around = (0, _AROUND // 2, _AROUND - 1)
    for k in range(_SECTORS):
        for j in range(2):
            cut = (slice(along[k], along[k + 1] + 1), slice(around[j], around[j + 1] + 1))
            corners = np.concatenate((outer[cut].reshape(-1, 3), inner[cut].reshape(-1, 3)))
            centre = corners.mean(axis=0)
            shapes.append(CollisionShape("hull", (), centre, IDENTITY, corners - centre, PART))
    low, high = -model.size_m / 2, model.size_m / 2
    grasp = HandleGrasp(
        np.array((-model.projection_m + grasp_depth(model.projection_m), (low + high) / 2, 0.0)),
        np.array(((0.0, 1.0, 0.0),)),
        model.size_m,
    )
    return Pull(_skin(outer, inner), tuple(shapes), grasp, hookable=True)


def _surface(model: HandleModel, length_m: float, inset_m: float, along: int, around: int) -> np.ndarray:
    """Points of the shell, `inset_m` within its outer skin: (along, around, 3), from the face round to the lip."""
    half = length_m / 2 + model.overhang_m - inset_m
    height, out = model.size_m - inset_m, model.projection_m - inset_m
    s = -np.cos(np.linspace(0.0, np.pi, along))  # dense at the ends
    bend = _POWERS[model.shape]
    width = power(np.maximum(1.0 - power(np.abs(s), bend), 0.01), 1 / bend)
    angle = np.linspace(0.0, np.pi / 2, around)
    y = model.size_m / 2 - height * width[:, None] * np.cos(angle)
    x = -out * power(width, 0.7)[:, None] * np.sin(angle)
    z = np.broadcast_to((half * s)[:, None], y.shape)
    return np.stack((x, y, z), axis=-1)


def _skin(outer: np.ndarray, inner: np.ndarray) -> TriMesh:
    """Both skins, and the rim between them, closed: grids (N, M, 3)."""
    n, m = outer.shape[:2]
    index = np.arange(n * m).reshape(n, m)

    def quads(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
        a, b, c, d = (k.ravel() for k in (a, b, c, d))
        return np.concatenate((np.stack((a, b, c), axis=1), np.stack((a, c, d), axis=1)))

    skin = quads(index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
    rim = np.concatenate((index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]))
    after = np.roll(rim, -1)
    shift = n * m
    band = quads(rim, rim + shift, after + shift, after)
    faces = np.concatenate((skin, skin[:, ::-1] + shift, band))
    return TriMesh(np.concatenate((outer.reshape(-1, 3), inner.reshape(-1, 3))), faces)

"""The bail: its wire, bow or strap, its grip, and the handle that these are."""

from itertools import pairwise

import numpy as np

from artiskill.assets.articulated_object import Handle
from artiskill.assets.buckets.bail_path import bail_path
from artiskill.assets.buckets.materials import Materials
from artiskill.assets.buckets.rods import rod, slab, turn_to
from artiskill.assets.buckets.spec import Bail, BucketSpec
from artiskill.assets.handles import handle_from_mesh
from artiskill.assets.parts import LinkParts
from artiskill.geometry.meshes import TriMesh
from artiskill.geometry.primitives import cylinder, lathe, path_sweep, superellipse, tube

_UP = np.array((0.0, 0.0, 1.0))
_BEND_CHORDS = 8  # as drawn
_TOUCHED_CHORDS = 3
_WIRE_SIDES = 8
_PIN_M = 0.009  # how far a wire's bent end reaches into its ear
_IN_GRIP_M = 0.004  # how far a wire is seen to reach into the grip
_HOOK_M = 0.004  # radius of that bend


def add_bail(
    parts: LinkParts, spec: BucketSpec, bail: Bail, materials: Materials, name: str, rng: np.random.Generator
) -> Handle:
    """Draw and touch the bail in its own frame, upright about the pivots, and describe it as a handle."""
    path = bail_path(bail, _BEND_CHORDS)
    if bail.kind == "wire":
        for wire in _wires(bail, path):
            parts.add_visual(tube(wire, bail.half_width_m, _WIRE_SIDES), materials.bail, "handle")
    else:
        _draw_band(parts, bail, path, materials)
    coarse = bail_path(bail, _TOUCHED_CHORDS)
    for start, end in pairwise(coarse):
        if bail.kind == "wire":
            parts.add_collision(rod(start, end, bail.half_width_m, "handle"))
        else:
            parts.add_collision(slab(start, end, bail.half_width_m, bail.half_thickness_m, "handle"))
    grip = _grip_mesh(bail)
    if bail.grip.kind != "bare":
        parts.add_visual(grip, materials.grip, "handle")
        half = np.array((0.0, bail.grip.length_m / 2 - bail.grip.radius_m, 0.0))
        top = np.array((0.0, 0.0, bail.reach_m))
        parts.add_collision(rod(top - half, top + half, bail.grip.radius_m, "handle"))
    return handle_from_mesh(name, "bail", grip, _UP, rng, hookable=True)


def _wires(bail: Bail, path: np.ndarray) -> list[np.ndarray]:
    """The wire as seen: in one piece, or in two that end in the grip."""
    hooked = _hooked(path)
    if bail.grip.kind == "bare":
        return [hooked]
    end = np.array((0.0, bail.grip.length_m / 2 - _IN_GRIP_M, bail.reach_m))
    one = np.concatenate((hooked[: len(hooked) // 2], end[None]))
    return [one, one * (1.0, -1.0, 1.0)]


def _hooked(path: np.ndarray) -> np.ndarray:
    """The wire's path with its ends bent inwards, through the ears."""
    span = path[0, 1]
    start = [(0.0, span - _PIN_M, 0.0), (0.0, span - _HOOK_M, 0.0), (0.0, span - 0.3 * _HOOK_M, 0.3 * _HOOK_M)]
    first = np.array([*start, (0.0, span, _HOOK_M)])
    return np.concatenate((first, path[1:-1], first[::-1] * (1.0, -1.0, 1.0)))


def _draw_band(parts: LinkParts, bail: Bail, path: np.ndarray, materials: Materials) -> None:
    """A flat bow with round ends, each on a pin."""
    section = superellipse(bail.half_width_m, bail.half_thickness_m, 5.0, 12)
    parts.add_visual(path_sweep(path, section, (1.0, 0.0, 0.0)), materials.bail, "handle")
    for side in (-1.0, 1.0):
        eye = cylinder(1.1 * bail.half_width_m, bail.half_thickness_m, 16, 0.0008)
        parts.add_visual(
            eye.transformed((0.0, side * bail.half_span_m, 0.0), turn_to("y")), materials.bail, "handle"
        )
        pin = cylinder(0.5 * bail.half_width_m, bail.half_thickness_m + 0.004, 10, 0.0005)
        parts.add_visual(
            pin.transformed((0.0, side * bail.half_span_m, 0.0), turn_to("y")), materials.bail, "handle"
        )


def _grip_mesh(bail: Bail) -> TriMesh:
    """What the hand closes on, at the top of the upright bail."""
    half, radius = bail.grip.length_m / 2, bail.grip.radius_m
    if bail.grip.kind == "barrel":  # turned wood, thickest in the middle
        shares = (1.0, 0.94, 0.6, 0.0)
        swell = [(radius * (1 - 0.3 * s**2), half * s) for s in shares]
        profile = [(0.0, -half), *((r, -z) for r, z in swell), *reversed(swell[:-1]), (0.0, half)]
        mesh = lathe(profile, 14)
    elif bail.grip.kind == "sleeve":  # a tube with a collar at either end
        waist, collar = 0.86 * radius, 0.004
        side = [(waist, half - collar - 0.002), (radius, half - collar), (radius, half)]
        profile = [(0.0, -half), *((r, -z) for r, z in reversed(side)), *side, (0.0, half)]
        mesh = lathe(profile, 14)
    elif bail.kind == "wire":
        mesh = cylinder(bail.half_width_m, half, _WIRE_SIDES)
    else:
        line = np.array([(0.0, half, 0.0), (0.0, -half, 0.0)])
        band = superellipse(bail.half_width_m, bail.half_thickness_m, 5.0, 12)
        return path_sweep(line, band, (1.0, 0.0, 0.0)).transformed((0.0, 0.0, bail.reach_m))
    return mesh.transformed((0.0, 0.0, bail.reach_m), turn_to("y"))

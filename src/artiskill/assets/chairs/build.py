"""From a `ChairSpec` to an `ArticulatedObject`: links, joints, drawn and touched parts."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Joint, Link
from artiskill.assets.chairs.appearance import Skins, make_skins
from artiskill.assets.chairs.arms import add_arms
from artiskill.assets.chairs.back import add_back, add_recline_bracket, add_support, recline_axis
from artiskill.assets.chairs.base import add_disc, add_star, caster_places
from artiskill.assets.chairs.casters import (
    CasterPlace,
    add_caster,
    add_wheel,
    wheel_axis,
    wheel_centre,
    wheel_sides,
    wheel_top_m,
)
from artiskill.assets.chairs.column import add_mechanism, add_piston, add_tube, pivot
from artiskill.assets.chairs.frames import add_runners, add_sled, knee
from artiskill.assets.chairs.pen import Pen
from artiskill.assets.chairs.seat import add_seat
from artiskill.assets.chairs.spec import ChairSpec
from artiskill.assets.kinematics import density_for_mass
from artiskill.assets.parts import IDENTITY, LinkParts
from artiskill.geometry.rotations import quat_rotate

ENDLESS = (-math.inf, math.inf)
UP = (0.0, 0.0, 1.0)
BACKWARDS = (0.0, 1.0, 0.0)  # about +y what stands on the axis leans towards +x
_STANDING = -1


@dataclass(eq=False)
class _Draft:
    """A link in the making; `origin` is its frame's in the object frame."""

    name: str
    parent: int
    origin: np.ndarray
    joint: Joint | None
    parts: LinkParts
    mass_kg: float = 0.0


@dataclass(eq=False)
class _Assembly:
    """The links so far."""

    rng: np.random.Generator
    links: list[_Draft] = field(default_factory=list)

    def add(self, parent: int, origin: np.ndarray, mass_kg: float, joint: Joint | None = None) -> int:
        """Begin a link; a joint's name is completed with the link's. Returns its index."""
        name = f"link_{len(self.links) - 1}" if self.links else "base"
        if joint is not None:
            joint = replace(joint, name=f"{name}_{joint.name}")
        self.links.append(
            _Draft(name, parent, np.asarray(origin, float), joint, LinkParts(origin, self.rng), mass_kg)
        )
        return len(self.links) - 1

    def pen(self, index: int) -> Pen:
        """For parts in the object frame."""
        return Pen(self.links[index].parts)


def build_chair(spec: ChairSpec, object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """Build a chair.

    Link frames are parallel to the object frame at joint value 0: a caster's lies on its swivel axis at the top of
    its wheel, a wheel's in its middle, the others' on their joints' axes.

    Args:
        spec: the chair.
        object_id: name in catalogues and results.
        rng: draws surface samples.
    """
    skins = make_skins(spec.appearance)
    assembly = _Assembly(rng)
    base = assembly.add(_STANDING, np.zeros(3), spec.masses.base)
    _BASES[spec.base.kind](assembly.pen(base), spec, skins)
    _add_casters(assembly, spec, skins)
    below = base
    if spec.column is not None:
        below = _add_column(assembly, spec, skins)
    _add_upper(assembly, spec, skins, below)
    links = [_finished(draft, assembly.links) for draft in assembly.links]
    bounds = _bounds(assembly.links)
    return ArticulatedObject(object_id, "chair", tuple(links), (), bounds, _metadata(spec, bounds))


_BASES = {"star": add_star, "disc": add_disc, "sled": add_sled, "cantilever": add_runners}


def _add_casters(assembly: _Assembly, spec: ChairSpec, skins: Skins) -> None:
    casters = spec.casters
    if casters is None:
        return
    for place in caster_places(spec):
        stem = place.point((0.0, 0.0, wheel_top_m(casters)))
        index = assembly.add(0, stem, spec.masses.caster, _turning("swivel", UP))
        add_caster(assembly.links[index].parts, casters, place, skins)
        for side in wheel_sides(casters):
            _add_wheel(assembly, spec, place, index, side, skins)


def _add_wheel(
    assembly: _Assembly, spec: ChairSpec, place: CasterPlace, caster: int, side: int, skins: Skins
) -> None:
    assert spec.casters is not None
    axis = quat_rotate(place.turn, wheel_axis(spec.casters, side))
    origin = place.point(wheel_centre(spec.casters, side))
    index = assembly.add(caster, origin, spec.masses.wheel, _turning("roll", axis))
    add_wheel(assembly.links[index].parts, spec.casters, place, side, skins)


def _add_column(assembly: _Assembly, spec: ChairSpec, skins: Skins) -> int:
    """Tube and piston; returns the link that carries the mechanism."""
    column = spec.column
    assert column is not None
    add_tube(assembly.pen(0), spec, skins)
    lifts = column.travel_m > 0
    index = 0
    if lifts:
        reference = -column.force_n / column.stiffness_n_m
        limits = (0.0, column.travel_m)
        joint = Joint("lift", "prismatic", np.array(UP), np.zeros(3), limits, column.stiffness_n_m, reference)
        index = assembly.add(0, np.array((0.0, 0.0, spec.mechanism_bottom_m)), 0.0, joint)
    add_piston(assembly.pen(index), spec, skins)
    assembly.links[index].mass_kg += spec.masses.piston
    return index


def _add_upper(assembly: _Assembly, spec: ChairSpec, skins: Skins, below: int) -> None:
    """Mechanism, seat, back and armrests, on as many links as there are joints between them."""
    box, masses = spec.mechanism, spec.masses
    if spec.base.kind == "cantilever":
        joint = _sprung("tilt", box.tilt_rad, box.tilt_moment_n_m, box.tilt_stiffness_n_m)
        seat = assembly.add(below, knee(spec), 0.0, joint)
    else:
        bottom = np.array((0.0, 0.0, spec.mechanism_bottom_m))
        seat = assembly.add(below, bottom, masses.mechanism, _turning("swivel", UP))
        add_mechanism(assembly.pen(seat), spec, skins)
        if box.tilt_rad > 0:
            joint = _sprung("tilt", box.tilt_rad, box.tilt_moment_n_m, box.tilt_stiffness_n_m)
            seat = assembly.add(seat, pivot(spec), 0.0, joint)
    add_seat(assembly.pen(seat), spec, skins)
    assembly.links[seat].mass_kg += masses.seat
    back = seat
    if box.recline_rad > 0:
        add_recline_bracket(assembly.pen(seat), spec, skins)
        joint = _sprung("recline", box.recline_rad, box.recline_moment_n_m, box.recline_stiffness_n_m)
        back = assembly.add(seat, recline_axis(spec), 0.0, joint)
    add_support(assembly.pen(back), spec, skins)
    add_back(assembly.pen(back), spec, skins)
    add_arms(assembly.pen(back if spec.arms.kind == "cantilever" else seat), spec, skins)
    assembly.links[back].mass_kg += masses.back


def _turning(what: str, axis: tuple[float, ...] | np.ndarray) -> Joint:
    return Joint(what, "revolute", np.asarray(axis, dtype=float), np.zeros(3), ENDLESS)


def _sprung(what: str, limit_rad: float, moment_n_m: float, stiffness_n_m: float) -> Joint:
    """A joint that a preloaded spring holds at its lower limit."""
    reference = -moment_n_m / stiffness_n_m
    return Joint(what, "revolute", np.array(BACKWARDS), np.zeros(3), (0.0, limit_rad), stiffness_n_m, reference)


def _finished(draft: _Draft, links: list[_Draft]) -> Link:
    parts = draft.parts
    position = draft.origin - (links[draft.parent].origin if draft.parent >= 0 else 0.0)
    density = density_for_mass(draft.mass_kg, parts.collisions)
    shapes, points = tuple(parts.collisions), parts.surface_points()
    return Link(
        draft.name, draft.parent, position, IDENTITY, draft.joint, parts.visuals(), shapes, density, points
    )


def _bounds(links: list[_Draft]) -> np.ndarray:
    """Around everything drawn, at joint value 0."""
    corners = np.stack([v.mesh.bounds + link.origin for link in links for v in link.parts.visuals()])
    return np.stack((corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)))


def _metadata(spec: ChairSpec, bounds: np.ndarray) -> dict[str, object]:
    width, depth, height = (bounds[1] - bounds[0])[[1, 0, 2]]
    casters = spec.casters
    return {
        "source": "generated",
        "family": spec.family,
        "held_out": spec.held_out,
        "width_m": round(float(width), 4),
        "depth_m": round(float(depth), 4),
        "height_m": round(float(height), 4),
        "mass_kg": round(spec.mass_kg, 3),
        "joints": spec.joint_count,
        "handles": [],
        "tags": _tags(spec),
        "finish": f"{spec.appearance.seat.name} {spec.appearance.seat.finish}, {spec.appearance.base.finish} base",
        "base": f"{spec.base.legs} legs" if spec.base.kind == "star" else spec.base.kind,
        "casters": "none" if casters is None else casters.kind,
        "caster_diameter_m": 0.0 if casters is None else casters.diameter_m,
        "seat": spec.seat.kind,
        "seat_height_m": spec.seat.height_m,
        "back": spec.back.kind,
        "arms": spec.arms.kind,
        "lift_m": 0.0 if spec.column is None else spec.column.travel_m,
    }


def _tags(spec: ChairSpec) -> list[str]:
    """What a filter would ask for."""
    facts = {
        "casters": spec.casters is not None,
        "split_wheels": spec.casters is not None and spec.casters.split,
        "lift": spec.column is not None and spec.column.travel_m > 0,
        "tilt": spec.mechanism.tilt_rad > 0,
        "recline": spec.mechanism.recline_rad > 0,
        "back": spec.back.kind != "none",
        "headrest": spec.back.headrest is not None,
        "arms": spec.arms.kind != "none",
        "footrest": spec.column is not None and spec.column.footrest_m > 0,
        "upholstered": spec.seat.soft,
    }
    return [name for name, holds in facts.items() if holds]

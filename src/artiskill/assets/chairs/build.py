"""From a `ChairSpec` to an `ArticulatedObject`: links, joints, visuals and collision shapes."""

import math
from dataclasses import dataclass, replace

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject, Joint, Link
from artiskill.assets.chairs import base, upper
from artiskill.assets.chairs.casters import add_caster, add_wheel, caster_poses, wheel_axis, wheel_centre
from artiskill.assets.chairs.link_builder import LinkBuilder, make_tiled_materials
from artiskill.assets.chairs.spec import ChairSpec
from artiskill.assets.kinematics import density_for_mass
from artiskill.assets.parts import LinkParts
from artiskill.geometry.rotations import quat_rotate

_ENDLESS = (-math.inf, math.inf)
_UP = (0.0, 0.0, 1.0)
_BACKWARDS = (0.0, 1.0, 0.0)  # about +y what stands on the axis leans towards +x
_BASES = {"star": base.add_star, "disc": base.add_disc, "sled": base.add_sled, "cantilever": base.add_runners}


def build_chair(spec: ChairSpec, object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """Build a chair.

    Link frames are parallel to the object frame at joint value 0: a caster's lies on its swivel axis at the top of
    its wheel, a wheel's in its middle, the others' on their joints' axes.

    Args:
        spec: the chair.
        object_id: name in catalogues and results.
        rng: draws surface samples.
    """
    assembly = _Assembly(spec, rng)
    root = assembly.add(-1, np.zeros(3), spec.masses.base)
    _BASES[spec.base.kind](assembly.builder(root), spec)
    _add_casters(assembly)
    below = root if spec.column is None else _add_column(assembly)
    _add_upper(assembly, below)
    links = assembly.links()
    # around everything drawn, at joint value 0
    corners = np.stack(
        [v.mesh.bounds + draft.origin for draft, k in zip(assembly.drafts, links, strict=True) for v in k.visuals]
    )
    bounds = np.stack((corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)))
    return ArticulatedObject(object_id, "chair", links, (), bounds, _metadata(spec, bounds))


@dataclass(eq=False)
class _LinkDraft:
    """A link in the making; `origin` is its frame's in the object frame."""

    name: str
    parent: int
    origin: np.ndarray
    joint: Joint | None
    parts: LinkParts
    mass_kg: float


class _Assembly:
    """The links so far."""

    def __init__(self, spec: ChairSpec, rng: np.random.Generator) -> None:
        self.spec = spec
        self.drafts: list[_LinkDraft] = []
        self._materials = make_tiled_materials(spec.appearance)
        self._rng = rng

    def add(self, parent: int, origin: np.ndarray, mass_kg: float, joint: Joint | None = None) -> int:
        """Begin a link, -1 being the parent of the root; return its index. Its name begins the joint's."""
        name = f"link_{len(self.drafts) - 1}" if self.drafts else "base"
        if joint is not None:
            joint = replace(joint, name=f"{name}_{joint.name}")
        self.drafts.append(_LinkDraft(name, parent, origin, joint, LinkParts(origin, self._rng), mass_kg))
        return len(self.drafts) - 1

    def builder(self, index: int) -> LinkBuilder:
        """Return a builder for parts in the object frame."""
        return LinkBuilder(self.drafts[index].parts, self._materials)

    def links(self) -> tuple[Link, ...]:
        """Finish all links, in their order."""
        finished = []
        for draft in self.drafts:
            density = density_for_mass(draft.mass_kg, draft.parts.collisions)
            link = draft.parts.link(draft.name, draft.parent, draft.joint, density)
            start = self.drafts[draft.parent].origin if draft.parent >= 0 else 0.0
            finished.append(replace(link, position=draft.origin - start))
        return tuple(finished)


def _add_casters(assembly: _Assembly) -> None:
    spec, casters = assembly.spec, assembly.spec.casters
    if casters is None:
        return
    for pose in caster_poses(spec):
        foot, stem = pose.point((0.0, 0.0, 0.0)), pose.point((0.0, 0.0, casters.wheel_top_m))
        caster = assembly.add(0, stem, spec.masses.caster, _turning("swivel", _UP))
        add_caster(assembly.builder(caster).in_frame(foot, pose.rotation), casters)
        for side in casters.sides:
            joint = _turning("roll", quat_rotate(pose.rotation, wheel_axis(casters, side)))
            wheel = assembly.add(caster, pose.point(wheel_centre(casters, side)), spec.masses.wheel, joint)
            add_wheel(assembly.builder(wheel).in_frame(foot, pose.rotation), casters, side)


def _add_column(assembly: _Assembly) -> int:
    """Add tube and piston; return the link that carries the mechanism."""
    spec, column = assembly.spec, assembly.spec.column
    assert column is not None
    base.add_tube(assembly.builder(0), spec)
    index = 0
    if column.travel_m > 0:
        reference = -column.force_n / column.stiffness_n_m
        limits = (0.0, column.travel_m)
        joint = Joint("lift", "prismatic", np.array(_UP), np.zeros(3), limits, column.stiffness_n_m, reference)
        index = assembly.add(0, np.array((0.0, 0.0, spec.mechanism_bottom_m)), 0.0, joint)
    base.add_piston(assembly.builder(index), spec)
    assembly.drafts[index].mass_kg += spec.masses.piston
    return index


def _add_upper(assembly: _Assembly, below: int) -> None:
    """Add mechanism, seat, back and armrests, on as many links as there are joints between them."""
    spec, box = assembly.spec, assembly.spec.mechanism
    tilt = _sprung("tilt", box.tilt_rad, box.tilt_moment_n_m, box.tilt_stiffness_n_m)
    if spec.base.kind == "cantilever":
        seat = assembly.add(below, base.knee(spec), 0.0, tilt)
    else:
        bottom = np.array((0.0, 0.0, spec.mechanism_bottom_m))
        seat = assembly.add(below, bottom, spec.masses.mechanism, _turning("swivel", _UP))
        base.add_mechanism(assembly.builder(seat), spec)
        if box.tilt_rad > 0:
            seat = assembly.add(seat, base.pivot(spec), 0.0, tilt)
    upper.add_seat(assembly.builder(seat), spec)
    assembly.drafts[seat].mass_kg += spec.masses.seat
    back = seat
    if box.recline_rad > 0:
        upper.add_recline_bracket(assembly.builder(seat), spec)
        joint = _sprung("recline", box.recline_rad, box.recline_moment_n_m, box.recline_stiffness_n_m)
        back = assembly.add(seat, upper.recline_axis(spec), 0.0, joint)
    upper.add_support(assembly.builder(back), spec)
    upper.add_back(assembly.builder(back), spec)
    upper.add_arms(assembly.builder(back if spec.arms.kind == "cantilever" else seat), spec)
    assembly.drafts[back].mass_kg += spec.masses.back


def _turning(what: str, axis: tuple[float, ...] | np.ndarray) -> Joint:
    return Joint(what, "revolute", np.asarray(axis, dtype=float), np.zeros(3), _ENDLESS)


def _sprung(what: str, limit_rad: float, moment_n_m: float, stiffness_n_m: float) -> Joint:
    """Return a joint that a preloaded spring holds at its lower limit."""
    reference = -moment_n_m / stiffness_n_m
    return Joint(what, "revolute", np.array(_BACKWARDS), np.zeros(3), (0.0, limit_rad), stiffness_n_m, reference)


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
    """Return what a filter would ask for."""
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

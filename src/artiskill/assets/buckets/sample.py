"""From a random generator to a `BucketSpec`: sizes, profile, rim, foot, ears, bail, masses and colours."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from artiskill.assets.buckets.appearance import sample_bucket_appearance
from artiskill.assets.buckets.bail_fit import draw_bail
from artiskill.assets.buckets.config import NO_BAIL, BucketConfig, BucketFamilyConfig
from artiskill.assets.buckets.masses import bail_mass_kg, body_mass_kg
from artiskill.assets.buckets.profiles import draw_profile
from artiskill.assets.buckets.spec import BucketSpec, Ear, Foot, Hoop, Lip, Profile, Section
from artiskill.assets.buckets.surface import half_width
from artiskill.assets.generators import pick, within
from artiskill.errors import AssetError

MAX_DRAWS = 500
FLOOR_FACTOR = 1.2  # floors are a little thicker than walls
_CORNERS = {"square": (0.12, 0.38), "hexagon": (0.10, 0.30), "octagon": (0.08, 0.25)}
_ASPECT = (0.66, 0.8)  # of ovals: depth over width
# Of a rolled lip, what its bead is higher than wide.
_LIP_HEIGHT_M = {
    "rolled": (0.002, 0.003),
    "flange": (0.003, 0.005),
    "collar": (0.014, 0.035),
    "plain": (0.002, 0.003),
}
_SPOUT_M = (0.008, 0.014)
_TAB_HALF_M = 0.0015


def sample_bucket(rng: np.random.Generator, config: BucketConfig, held_out: bool = False) -> BucketSpec:
    """Draw one bucket; draws that break a rule (too narrow a floor, a bail in the wall's way) are drawn again.

    Args:
        rng: random generator.
        config: what to draw from.
        held_out: draw from the held-out families, which are left out otherwise.

    Raises:
        AssetError: the config leaves (nearly) no legal bucket.
    """
    families = config.families_of(held_out)
    name = pick(rng, {family.name: family.weight for family in families})
    family = next(f for f in families if f.name == name)
    for _ in range(MAX_DRAWS):
        spec = _draw_spec(rng, config, family)
        if spec is not None:
            return spec
    raise AssetError(
        f"no legal bucket of family {name!r} in {MAX_DRAWS} draws: the ranges of the config contradict each other"
    )


def _draw_spec(rng: np.random.Generator, config: BucketConfig, family: BucketFamilyConfig) -> BucketSpec | None:
    """One draw, or None where a rule is broken."""
    section = _draw_section(rng, family)
    height, top = within(rng, family.height_m), within(rng, family.top_m) / 2
    bottom = round(top - height * math.tan(math.radians(rng.uniform(*family.taper_deg))), 4)
    wall = within(rng, family.wall_m)
    lip = _draw_lip(rng, family)
    foot = _draw_foot(rng, config, family, wall)
    start = 0.0 if foot.kind == "skirt" else foot.height_m
    profile = draw_profile(rng, pick(rng, family.profiles), (start, height), (bottom, top), lip.height_m)
    spout = within(rng, _SPOUT_M) if rng.random() < family.spout_probability else 0.0
    floor = round(FLOOR_FACTOR * wall, 4)
    least = float(half_width(profile, np.linspace(foot.height_m + floor, height, 20)).min()) - wall
    stance = float(half_width(profile, foot.height_m)) - foot.inset_m
    if least * section.aspect < config.least_floor_m or stance * section.aspect < config.least_stance * height:
        return None
    ear = _draw_ear(rng, family, profile, lip)
    kind = pick(rng, family.bails)
    bail = None
    if kind != NO_BAIL:
        grip = pick(rng, family.grips)
        bail = draw_bail(rng, config.bail, kind, grip, (section, profile, lip, spout), ear)
        if bail is None:
            return None
        ear = replace(ear, reach_m=round(bail.half_span_m - bail.half_thickness_m - 0.0015, 4))
    material = config.material(family.material)
    gauge, density = rng.uniform(*material.gauge_m), rng.uniform(*material.density_kg_m3)
    appearance = sample_bucket_appearance(rng, family.material, kind != "moulded")
    return BucketSpec(
        family=family.name,
        held_out=family.held_out,
        material=family.material,
        section=section,
        profile=profile,
        foot=foot,
        lip=lip,
        ear=ear,
        height_m=height,
        wall_m=wall,
        floor_m=floor,
        spout_m=spout,
        staves=int(rng.integers(14, 19)) if family.material == "wood" else 0,
        hoops=_draw_hoops(rng, family, profile),
        bail=bail,
        body_kg=body_mass_kg(section, profile, gauge, density),
        bail_kg=bail_mass_kg(bail),
        appearance=appearance,
    )


def _draw_section(rng: np.random.Generator, family: BucketFamilyConfig) -> Section:
    kind: Any = pick(rng, family.sections)
    corner = within(rng, _CORNERS[kind]) if kind in _CORNERS else 0.0
    return Section(kind, corner, within(rng, _ASPECT) if kind == "oval" else 1.0)


def _draw_lip(rng: np.random.Generator, family: BucketFamilyConfig) -> Lip:
    kind: Any = pick(rng, family.lips)
    overhang = within(rng, family.lip_m)
    height = within(rng, _LIP_HEIGHT_M[kind])
    return Lip(kind, overhang, round(overhang + height, 4) if kind == "rolled" else height)


def _draw_foot(rng: np.random.Generator, config: BucketConfig, family: BucketFamilyConfig, wall: float) -> Foot:
    kind: Any = pick(rng, family.feet)
    height, inset = within(rng, config.foot_height_m), within(rng, (0.003, 0.006))
    if kind == "flat":
        return Foot(kind, 0.0, 0.0)
    return Foot(kind, height, inset if kind == "ring" else 0.0)


def _draw_ear(rng: np.random.Generator, family: BucketFamilyConfig, profile: Profile, lip: Lip) -> Ear:
    """Where the ears sit; how far those of a bail reach is known once the bail is fitted."""
    kind: Any = pick(rng, family.ears)
    rim = profile.knots[-1][0]
    below, above = float(rng.uniform(0.003, 0.014)), float(rng.uniform(0.008, 0.013))
    if kind == "boss":
        radius = within(rng, (0.010, 0.014))
        return Ear(kind, round(rim - lip.height_m - radius - below, 4), 0.0, radius, radius)
    if kind == "tab":
        return Ear(kind, round(rim + above, 4), 0.0, within(rng, (0.012, 0.018)), _TAB_HALF_M)
    z = round(rim * float(rng.uniform(0.68, 0.8)), 4)
    reach = max(float(half_width(profile, z)), profile.knots[-1][1] - 0.01) + float(rng.uniform(0.038, 0.048))
    return Ear(kind, z, round(reach, 4), within(rng, (0.045, 0.06)), within(rng, (0.0035, 0.005)))


def _draw_hoops(rng: np.random.Generator, family: BucketFamilyConfig, profile: Profile) -> tuple[Hoop, ...]:
    """Bands of a wooden wall, which hold its staves together."""
    if family.material != "wood":
        return ()
    low, high = profile.knots[0][0], profile.knots[-1][0]
    width = within(rng, (0.014, 0.022))
    places = (0.14, 0.76) if rng.random() < 0.6 else (0.1, 0.45, 0.8)
    starts = [round(low + share * (high - low), 4) for share in places]
    return tuple(Hoop(z, round(z + width, 4)) for z in starts)

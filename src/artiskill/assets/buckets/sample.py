"""From a random generator to a `BucketSpec`: sizes, profile, rim, foot, ears, bail, masses and colours."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from artiskill.assets.buckets.appearance import sample_bucket_appearance
from artiskill.assets.buckets.bail import draw_bail
from artiskill.assets.buckets.config import NO_BAIL, BucketConfig, BucketFamilyConfig, MaterialConfig
from artiskill.assets.buckets.shape import Rim, half_width, outline, polygon_area
from artiskill.assets.buckets.spec import Bail, BucketSpec, Ear, Foot, Hoop, Lip, Profile, Section
from artiskill.assets.generators import pick, pick_family, within
from artiskill.errors import AssetError
from artiskill.geometry.arrays import norm, power

_MAX_DRAWS = 500
_FLOOR_FACTOR = 1.2  # floors are a little thicker than walls
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
_CURVE_KNOTS = 9
_EDGE_M = 0.004  # the rounding between wall and floor
_Span = tuple[float, float]
_Knots = list[tuple[float, float]]
_RIM_FACTOR = 1.12  # lip, foot and ears, relative to wall and floor
_STEEL_KG_M3 = 7850.0
_PLASTIC_KG_M3 = 920.0
_GRIP_KG_M3 = 700.0  # beech, or a hollow plastic sleeve


def sample_bucket(rng: np.random.Generator, config: BucketConfig, held_out: bool = False) -> BucketSpec:
    """Draw one bucket; draws that break a rule (too narrow a floor, a bail in the wall's way) are drawn again.

    Args:
        rng: random generator.
        config: what to draw from.
        held_out: draw from the held-out families, which are left out otherwise.

    Raises:
        AssetError: the config leaves (nearly) no legal bucket.
    """
    family = pick_family(rng, config.families, held_out)
    for _ in range(_MAX_DRAWS):
        spec = _draw_spec(rng, config, family)
        if spec is not None:
            return spec
    raise AssetError(
        f"no legal bucket of family {family.name!r} in {_MAX_DRAWS} draws: "
        "the ranges of the config contradict each other"
    )


def _draw_spec(rng: np.random.Generator, config: BucketConfig, family: BucketFamilyConfig) -> BucketSpec | None:
    """Draw once; None where a rule is broken."""
    section = _draw_section(rng, family)
    height, top = within(rng, family.height_m), within(rng, family.top_m) / 2
    bottom = round(top - height * math.tan(math.radians(rng.uniform(*family.taper_deg))), 4)
    wall, lip = within(rng, family.wall_m), _draw_lip(rng, family)
    foot = _draw_foot(rng, config, family)
    start = 0.0 if foot.kind == "skirt" else foot.height_m
    profile = _draw_profile(rng, pick(rng, family.profiles), (start, height), (bottom, top), lip.height_m)
    rim = Rim(section, profile, lip, within(rng, _SPOUT_M) if rng.random() < family.spout_probability else 0.0)
    floor = round(_FLOOR_FACTOR * wall, 4)
    least = float(half_width(profile, np.linspace(foot.height_m + floor, height, 20)).min()) - wall
    stance = float(half_width(profile, foot.height_m)) - foot.inset_m
    if least * section.aspect < config.least_floor_m or stance * section.aspect < config.least_stance * height:
        return None
    if (fittings := _draw_fittings(rng, config, family, rim)) is None:
        return None
    ear, bail = fittings
    body_kg = _draw_body_mass_kg(rng, config.material(family.material), rim)
    appearance = sample_bucket_appearance(rng, family.material, bail is None or bail.kind != "moulded")
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
        spout_m=rim.spout_m,
        staves=int(rng.integers(14, 19)) if family.material == "wood" else 0,
        hoops=_draw_hoops(rng, family, profile),
        bail=bail,
        body_kg=body_kg,
        bail_kg=_bail_mass_kg(bail),
        appearance=appearance,
    )


def _draw_fittings(
    rng: np.random.Generator, config: BucketConfig, family: BucketFamilyConfig, rim: Rim
) -> tuple[Ear, Bail | None] | None:
    """Draw ears and, where the family has one, a bail; None where no bail fits."""
    ear = _draw_ear(rng, family, rim.profile, rim.lip)
    kind = pick(rng, family.bails)
    if kind == NO_BAIL:
        return ear, None
    bail = draw_bail(rng, config.bail, kind, pick(rng, family.grips), rim, ear)
    if bail is None:
        return None
    return replace(ear, reach_m=round(bail.half_span_m - bail.half_thickness_m - 0.0015, 4)), bail


def _draw_section(rng: np.random.Generator, family: BucketFamilyConfig) -> Section:
    kind: Any = pick(rng, family.sections)
    corner = within(rng, _CORNERS[kind]) if kind in _CORNERS else 0.0
    return Section(kind, corner, within(rng, _ASPECT) if kind == "oval" else 1.0)


def _draw_lip(rng: np.random.Generator, family: BucketFamilyConfig) -> Lip:
    kind: Any = pick(rng, family.lips)
    overhang = within(rng, family.lip_m)
    height = within(rng, _LIP_HEIGHT_M[kind])
    return Lip(kind, overhang, round(overhang + height, 4) if kind == "rolled" else height)


def _draw_foot(rng: np.random.Generator, config: BucketConfig, family: BucketFamilyConfig) -> Foot:
    kind: Any = pick(rng, family.feet)
    height, inset = within(rng, config.foot_height_m), within(rng, (0.003, 0.006))
    if kind == "flat":
        return Foot(kind, 0.0, 0.0)
    return Foot(kind, height, inset if kind == "ring" else 0.0)


def _draw_ear(rng: np.random.Generator, family: BucketFamilyConfig, profile: Profile, lip: Lip) -> Ear:
    """Draw where the ears sit; how far those of a bail reach is known once the bail is fitted."""
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
    """Draw the bands of a wooden wall, which hold its staves together."""
    if family.material != "wood":
        return ()
    low, high = profile.knots[0][0], profile.knots[-1][0]
    width = within(rng, (0.014, 0.022))
    places = (0.14, 0.76) if rng.random() < 0.6 else (0.1, 0.45, 0.8)
    starts = [round(low + share * (high - low), 4) for share in places]
    return tuple(Hoop(z, round(z + width, 4)) for z in starts)


def _draw_profile(rng: np.random.Generator, kind: Any, z: _Span, half: _Span, lip_m: float) -> Profile:
    """Draw the outer face of a wall.

    Args:
        rng: random generator.
        kind: as in `Profile`.
        z: heights of the lower edge and the rim.
        half: half widths there.
        lip_m: height of the lip; steps and ribs keep below it.
    """
    if kind in ("bellied", "flared"):
        knots, levels = _curve(rng, kind, z, half)
    elif kind == "stepped":
        knots, levels = _steps(rng, z, half, lip_m)
    elif kind == "ribbed":
        knots, levels = _ribs(rng, z, half, lip_m)
    else:
        knots, levels = [(z[0], half[0]), (z[1], half[1])], [z[0], z[1]]
    if kind != "ribbed":
        low, width = knots[0]
        first = float(np.interp(low + _EDGE_M, *np.array(knots).T))
        knots = [(low, width - 0.6 * _EDGE_M), (low + _EDGE_M, first), *knots[1:]]
    rounded = tuple((round(float(h), 5), round(float(w), 5)) for h, w in knots)
    return Profile(kind, rounded, tuple(round(float(level), 5) for level in levels))


def _curve(rng: np.random.Generator, kind: str, z: _Span, half: _Span) -> tuple[_Knots, list[float]]:
    """Draw a belly below the middle, or a rim that curves outwards."""
    share = np.linspace(0.0, 1.0, _CURVE_KNOTS)
    straight = half[0] + share * (half[1] - half[0])
    if kind == "bellied":
        bulge = rng.uniform(0.05, 0.10) * half[1]
        widths, breaks = straight + bulge * np.sin(np.pi * power(share, 0.9)), (0.45,)
    else:
        flare, bend = rng.uniform(0.3, 0.7) * (half[1] - half[0]), rng.uniform(3.0, 5.0)
        widths, breaks = straight - flare * (share - power(share, bend)), (0.6,)
    heights = z[0] + share * (z[1] - z[0])
    return list(zip(heights, widths, strict=True)), [z[0], *(z[0] + b * (z[1] - z[0]) for b in breaks), z[1]]


def _steps(rng: np.random.Generator, z: _Span, half: _Span, lip_m: float) -> tuple[_Knots, list[float]]:
    """Draw one or two ledges, on which nested buckets rest; the wall between them leans less."""
    count = int(rng.integers(1, 3))
    lean = half[1] - half[0]
    step = min(float(rng.uniform(0.003, 0.006)), 0.8 * lean / count)
    last = float(rng.uniform(0.66, 0.86))
    shares = [last] if count == 1 else [float(rng.uniform(0.25, 0.45)), last]
    slope = (lean - count * step) / (z[1] - z[0])
    top = z[1] - lip_m - 0.015
    knots, risen = [(z[0], half[0])], 0.0
    for share in shares:
        at = min(z[0] + share * (z[1] - z[0]), top)
        width = half[0] + slope * (at - z[0]) + risen
        knots += [(at - 0.0015, width), (at + 0.0015, width + step)]
        risen += step
    return [*knots, (z[1], half[1])], [z[0], z[1]]


def _ribs(rng: np.random.Generator, z: _Span, half: _Span, lip_m: float) -> tuple[_Knots, list[float]]:
    """Draw beads rolled into sheet metal: rings that stand out by two millimetres."""
    height = float(rng.uniform(0.0015, 0.0025))
    groups = ((0.3,), (0.72,), (0.28, 0.74), (0.3, 0.36), (0.68, 0.75))
    chosen = groups[int(rng.integers(len(groups)))]

    def on_line(at: float) -> float:
        return half[0] + (half[1] - half[0]) * (at - z[0]) / (z[1] - z[0])

    knots: _Knots = [(z[0], half[0])]
    for share in chosen:
        at = min(z[0] + share * (z[1] - z[0]), z[1] - lip_m - 0.02)
        knots += [
            (at + offset, on_line(at + offset) + rise * height)
            for offset, rise in ((-0.005, 0.0), (-0.0017, 1.0), (0.0017, 1.0), (0.005, 0.0))
        ]
    return [*knots, (z[1], half[1])], [z[0], z[1]]


def _draw_body_mass_kg(rng: np.random.Generator, material: MaterialConfig, rim: Rim) -> float:
    """Draw the mass without the bail: areas times the real thickness of the sheet."""
    gauge, density = rng.uniform(*material.gauge_m), rng.uniform(*material.density_kg_m3)
    points = outline(rim.section)
    perimeter = float(norm(np.roll(points, -1, axis=0) - points).sum())
    heights, widths = np.array(rim.profile.knots).T
    slant = np.hypot(np.diff(heights), np.diff(widths))
    area = (
        perimeter * float((slant * (widths[1:] + widths[:-1]) / 2).sum()) + polygon_area(points) * widths[0] ** 2
    )
    return round(float(area) * gauge * density * _RIM_FACTOR, 3)


def _bail_mass_kg(bail: Bail | None) -> float:
    """Return the mass of the bail and its grip."""
    if bail is None:
        return 0.0
    bends = 2 * (bail.reach_m - bail.corner_m) + math.pi * bail.corner_m
    length = bends + 2 * (bail.half_span_m - bail.corner_m)  # from pivot to pivot
    if bail.kind == "wire":
        mass = math.pi * bail.half_width_m**2 * length * _STEEL_KG_M3
    else:
        density = _STEEL_KG_M3 if bail.kind == "strap" else _PLASTIC_KG_M3
        mass = 4 * bail.half_width_m * bail.half_thickness_m * length * density
    if bail.grip.kind != "bare":
        mass += math.pi * bail.grip.radius_m**2 * bail.grip.length_m * _GRIP_KG_M3
    return round(mass, 3)

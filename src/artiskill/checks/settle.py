"""Chairs and buckets, set down at rest with joints that move freely, stay where they are and do not lean."""

import math

import numpy as np

from artiskill.checks.config import ChecksConfig
from artiskill.checks.result import CheckResult, at_most
from artiskill.checks.specimen import Specimen
from artiskill.checks.standing import free_model, watch

NAME = "settle"


def check_settle(specimen: Specimen, config: ChecksConfig) -> list[CheckResult]:
    """Drift and lean of the root after a while, without friction or damping in any joint."""
    settle = config.settle
    model = free_model(specimen)
    course = watch(model, specimen.scene.rest_data(), settle.time_s)
    along, up = 1e3 * float(np.linalg.norm(course.moved[:2])), 1e3 * float(course.moved[2])
    where = (
        f"in {settle.time_s:g} s: {along:.1f} mm along the ground, {abs(up):.1f} mm {'down' if up < 0 else 'up'}"
    )
    drift = 1e3 * float(np.linalg.norm(course.moved))
    return [
        at_most(NAME, "drift", drift, settle.drift_m * 1e3, "mm", where),
        at_most(NAME, "lean", math.degrees(course.tilt_rad), settle.tilt_deg, "deg", f"in {settle.time_s:g} s"),
    ]

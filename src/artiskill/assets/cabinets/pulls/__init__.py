"""Handles of cabinets: what they look like, what the hand touches and how it takes hold, one builder per kind."""

from artiskill.assets.cabinets.pulls.build import BUILDERS, build_pull, pull_shapes
from artiskill.assets.cabinets.pulls.pull import Pull, Sinks

__all__ = ["BUILDERS", "Pull", "Sinks", "build_pull", "pull_shapes"]

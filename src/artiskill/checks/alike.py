"""No two objects of a category are nearly alike; how that is measured stands in `assets.similarity`."""

from collections.abc import Sequence

from artiskill.assets.similarity import NEAR_DUPLICATE_M, Descriptor, nearest_neighbours
from artiskill.checks.result import CheckResult, at_least

NAME = "alike"


def check_alike(descriptors: Sequence[Descriptor]) -> dict[str, CheckResult]:
    """For each object that is not alone in its category, how far its nearest neighbour among the given ones is."""
    categories = {one.id: one.category for one in descriptors}
    results = {}
    for found in nearest_neighbours(descriptors):
        limit = 1e3 * NEAR_DUPLICATE_M[categories[found.id]]
        note = "with the same joints" if found.same_joints else "with other joints"
        results[found.id] = at_least(NAME, found.nearest, 1e3 * found.distance_m, limit, "mm", note)
    return results

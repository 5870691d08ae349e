"""Too many convex hulls become few: those are joined whose common hull lies nearest to their own surfaces."""

from collections.abc import Sequence

import numpy as np

from artiskill.geometry.hulls import convex_hull
from artiskill.geometry.meshes import triangle_areas


def join_hulls(parts: Sequence[Sequence[np.ndarray]], groups: Sequence[int], most: int) -> list[list[np.ndarray]]:
    """Join hulls until there are `most`, or none are left that may be joined.

    Args:
        parts: hulls of each part, (V, 3) corners each.
        groups: of each part; only hulls of one group, and none of group -1, are joined.
        most: hulls of all parts together.

    Returns:
        The hulls of each part; a joined one belongs to the part of its first.
    """
    hulls = {k: (p, hull) for k, (p, hull) in enumerate((p, h) for p, part in enumerate(parts) for h in part)}
    volumes = {k: convex_hull(hull).volume_m3 for k, (_, hull) in hulls.items()} if len(hulls) > most else {}
    costs: dict[tuple[int, int], float] = {}

    def price(i: int, j: int) -> None:
        group = groups[hulls[i][0]]
        if group == groups[hulls[j][0]] and group != -1:
            joined = convex_hull(np.concatenate((hulls[i][1], hulls[j][1])))
            # a length, so that small parts are no cheaper than large ones: the added volume, spread out
            added = joined.volume_m3 - volumes[i] - volumes[j]
            costs[i, j] = added / float(triangle_areas(joined.mesh).sum())

    for i in volumes:
        for j in range(i):
            price(j, i)
    while len(hulls) > most and costs:
        first, second = min(costs, key=lambda pair: (costs[pair], pair))
        joined = convex_hull(np.concatenate((hulls[first][1], hulls[second][1])))
        part, number = hulls[first][0], max(hulls) + 1
        costs = {pair: cost for pair, cost in costs.items() if not {first, second} & set(pair)}
        del hulls[first], hulls[second]
        hulls[number], volumes[number] = (part, joined.mesh.vertices), joined.volume_m3
        for k in [k for k in hulls if k != number]:
            price(k, number)
    return [[hull for p, hull in hulls.values() if p == k] for k in range(len(parts))]

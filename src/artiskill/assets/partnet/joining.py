"""Too many convex hulls become few: those are joined whose common hull lies nearest to their own surfaces."""

from collections.abc import Sequence

import numpy as np

from artiskill.geometry.meshes import convex_hull, triangle_areas

# Hulls whose bounds are this near are tried first; further ones, in steps, where that leaves too many. To try all
# pairs of a few hundred takes minutes, and what is joined over a distance fills the room between.
_NEAR_M, _STEP = 0.02, 4.0


def join_hulls(parts: Sequence[Sequence[np.ndarray]], groups: Sequence[int], most: int) -> list[list[np.ndarray]]:
    """Join hulls until there are `most`, or none are left that may be joined.

    Args:
        parts: hulls of each part, (V, 3) corners each.
        groups: of each part; only hulls of one group, and none of group -1, are joined.
        most: hulls of all parts together.

    Returns:
        The hulls of each part; a joined one belongs to the part of its first.
    """
    pool = _Pool([(k, hull) for k, part in enumerate(parts) for hull in part], groups)
    reach_m = _NEAR_M
    while len(pool.hulls) > most and pool.price(reach_m):
        pool.join(most, reach_m)
        reach_m *= _STEP
    found: list[list[np.ndarray]] = [[] for _ in parts]
    for part, hull in pool.hulls.values():
        found[part].append(hull)
    return found


class _Pool:
    """Hulls by number, each with its part, and what it would cost to join two of them."""

    def __init__(self, hulls: Sequence[tuple[int, np.ndarray]], groups: Sequence[int]) -> None:
        self.hulls = dict(enumerate(hulls))
        self._groups = groups
        self._bounds = {k: np.stack((hull.min(axis=0), hull.max(axis=0))) for k, (_, hull) in self.hulls.items()}
        self._volumes: dict[int, float] = {}
        self._costs: dict[tuple[int, int], float] = {}

    def price(self, reach_m: float) -> bool:
        """Price all pairs so near; whether there is any pair at all that may be joined."""
        possible = False
        numbers = sorted(self.hulls)
        for at, i in enumerate(numbers):
            others = [j for j in numbers[at + 1 :] if self._may_join(i, j)]
            possible |= bool(others)
            self._price(i, others, reach_m)
        return possible

    def join(self, most: int, reach_m: float) -> None:
        """Join the cheapest pairs until there are `most` hulls, or no priced pair is left."""
        while len(self.hulls) > most and self._costs:
            first, second = min(self._costs, key=lambda pair: (self._costs[pair], pair))
            joined = convex_hull(np.concatenate((self.hulls[first][1], self.hulls[second][1])))
            part, number = self.hulls[first][0], max(self.hulls) + 1
            self._costs = {pair: cost for pair, cost in self._costs.items() if not {first, second} & set(pair)}
            del self.hulls[first], self.hulls[second]
            self.hulls[number], self._volumes[number] = (part, joined.mesh.vertices), joined.volume_m3
            self._bounds[number] = joined.mesh.bounds
            self._price(number, [k for k in self.hulls if k != number and self._may_join(k, number)], reach_m)

    def _may_join(self, i: int, j: int) -> bool:
        group = self._groups[self.hulls[i][0]]
        return group != -1 and group == self._groups[self.hulls[j][0]]

    def _price(self, i: int, others: Sequence[int], reach_m: float) -> None:
        if not others:
            return
        low, high = np.moveaxis(np.stack([self._bounds[j] for j in others]), 1, 0)
        gaps = np.maximum(low - self._bounds[i][1], self._bounds[i][0] - high).max(axis=1)
        for j in (other for other, gap in zip(others, gaps, strict=True) if gap <= reach_m):
            pair = (min(i, j), max(i, j))
            if pair in self._costs:
                continue
            joined = convex_hull(np.concatenate((self.hulls[pair[0]][1], self.hulls[pair[1]][1])))
            # a length, so that small parts are no cheaper than large ones: the added volume, spread out
            added = joined.volume_m3 - self._volume(i) - self._volume(j)
            self._costs[pair] = added / float(triangle_areas(joined.mesh).sum())

    def _volume(self, number: int) -> float:
        if number not in self._volumes:
            self._volumes[number] = convex_hull(self.hulls[number][1]).volume_m3
        return self._volumes[number]

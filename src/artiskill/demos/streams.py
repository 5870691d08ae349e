"""Which levels are tried for a target, in which order, and when enough were: pure bookkeeping, no simulation."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from artiskill.demos.config import PatienceConfig
from artiskill.tasks.levels import MAX_LEVEL


@dataclass
class Stream:
    """The levels of one target of one object.

    Target number k of n legal ones has the levels first + k, first + k + n, first + k + 2 n, ...: no two targets
    of an object start from the same place. What counts are the first `wanted` successes in this order, so that it
    does not matter who makes which attempt when. Attempts after a failed one are never more than the successes
    that are missing; so none is in vain unless the target is given up, and those made are all that come before
    the last success.

    Attributes:
        target: link.
        first: its first level.
        stride: between its levels.
        wanted: successes.
        patience: when it is given up.
        outcomes: level -> success, of those that were tried.
        handed_out: levels that are being tried.
    """

    target: str
    first: int
    stride: int
    wanted: int
    patience: PatienceConfig
    outcomes: dict[int, bool] = field(default_factory=dict)
    handed_out: set[int] = field(default_factory=set)

    def level(self, number: int) -> int:
        """The level that is tried as the `number`-th, from 0."""
        return self.first + number * self.stride

    def has(self, level: int) -> bool:
        """Whether it is one of the target's."""
        return level >= self.first and (level - self.first) % self.stride == 0

    def take(self, most: int) -> tuple[int, ...]:
        """Levels to try next; none if those that are being tried may be enough."""
        if self.end is not None:
            return ()
        missing = self.wanted - self.successes - len(self.handed_out)
        levels: list[int] = []
        number = 0
        while len(levels) < min(most, missing) and (level := self.level(number)) <= MAX_LEVEL:
            if level not in self.outcomes and level not in self.handed_out:
                levels.append(level)
            number += 1
        self.handed_out.update(levels)
        return tuple(levels)

    def tell(self, level: int, success: bool) -> None:
        """What came of a level."""
        self.handed_out.discard(level)
        self.outcomes[level] = success

    @property
    def successes(self) -> int:
        """So far, in whatever order."""
        return sum(self.outcomes.values())

    @property
    def end(self) -> int | None:
        """How many attempts count, in the levels' order; None if that is not known yet.

        A target that runs out of levels is given up.
        """
        successes = attempts = 0
        while successes < self.wanted and not self.patience.gives_up(attempts, successes):
            if self.level(attempts) > MAX_LEVEL:
                break
            success = self.outcomes.get(self.level(attempts))
            if success is None:
                return None
            attempts, successes = attempts + 1, successes + success
        return attempts

    @property
    def levels(self) -> tuple[int, ...]:
        """Those that count, in order, of a stream that has come to its end."""
        assert self.end is not None
        return tuple(self.level(number) for number in range(self.end))


def make_streams(
    targets: Sequence[str], chosen: Sequence[str], wanted: int, first_level: int, patience: PatienceConfig
) -> list[Stream]:
    """The streams of an object.

    Args:
        targets: its legal targets; they decide who has which levels.
        chosen: those that are demonstrated, in the same order; they share `wanted` evenly, the first ones take
            what is left over.
        wanted: successes of the object.
        first_level: of the object.
        patience: when a target is given up.
    """
    share, left = divmod(wanted, len(chosen))
    return [
        Stream(name, first_level + targets.index(name), len(targets), share + (k < left), patience)
        for k, name in enumerate(chosen)
    ]

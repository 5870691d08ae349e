"""Levels: the integer that seeds one episode, split into independent streams."""

from enum import IntEnum

import numpy as np

from artiskill.errors import ConfigError

MAX_LEVEL = 2**31 - 1


class Stream(IntEnum):
    """What a level decides, each from its own generator: fixing one leaves the others as they were."""

    OBJECT = 0
    TARGET = 1
    INITIAL_STATE = 2
    POINTS = 3


def level_generator(level: int, stream: Stream, *instant: int) -> np.random.Generator:
    """The generator of one stream of a level, or of one instant of it, given by its number of steps."""
    seed = np.random.SeedSequence(level, spawn_key=(int(stream), *instant))
    return np.random.Generator(np.random.PCG64(seed))


def check_level(level: object) -> int:
    """The level as an int.

    Raises:
        ConfigError: not an integer in [0, 2**31 - 1].
    """
    if isinstance(level, bool) or not isinstance(level, int | np.integer) or not 0 <= int(level) <= MAX_LEVEL:
        raise ConfigError(f"a level is an integer from 0 to {MAX_LEVEL}, not {level!r}")
    return int(level)

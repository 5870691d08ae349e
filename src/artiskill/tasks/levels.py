"""Levels: the integer that seeds one episode, split into independent streams."""

import zlib
from collections.abc import Sequence
from enum import IntEnum

import numpy as np

from artiskill.errors import ConfigError, shown

MAX_LEVEL = 2**31 - 1
# The first level of demonstrations, unless another is asked for. A level starts all objects alike: a policy that
# imitates would know the starts of evaluations, which play from 0 on, from other objects.
FIRST_DEMONSTRATED = 100_000


class RngStream(IntEnum):
    """What is drawn for a level, each from its own generator: fixing one leaves the others as they were.

    What an environment draws has small numbers, what those who act in it draw has great ones.
    """

    OBJECT = 0
    TARGET = 1
    INITIAL_STATE = 2
    POINTS = 3
    RANDOM_ACTIONS = 1000
    PLANNING = 2000
    DEMONSTRATING = 3000


def level_generator(level: int, stream: RngStream, *part: int, of: Sequence[str] = ()) -> np.random.Generator:
    """Return the generator of one stream of a level.

    Args:
        level: of the episode.
        stream: what is drawn.
        part: of the stream: the instant, given by its number of steps, or one of several uses.
        of: names that draw otherwise than others at the same level: of object and target link.
    """
    entropy = (level, *(zlib.crc32(name.encode()) for name in of))
    seed = np.random.SeedSequence(entropy, spawn_key=(int(stream), *part))
    return np.random.Generator(np.random.PCG64(seed))


def check_level(level: object) -> int:
    """Return the level as an int.

    Raises:
        ConfigError: not an integer in [0, 2**31 - 1].
    """
    if isinstance(level, bool) or not isinstance(level, int | np.integer) or not 0 <= int(level) <= MAX_LEVEL:
        raise ConfigError(f"a level is an integer from 0 to {MAX_LEVEL}, not {shown(level)}")
    return int(level)

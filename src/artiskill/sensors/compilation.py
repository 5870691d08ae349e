"""Tell who waits that kernels are being compiled."""

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_LOGGER = logging.getLogger("artiskill.sensors")
# loading compiled kernels from disk takes less
_PATIENCE_S = 1.5
_ready: set[str] = set()


@contextmanager
def announce_compilation(what: str) -> Iterator[None]:
    """Log (INFO, logger `artiskill.sensors`) what is going on if the body takes longer than loading would.

    Only the first time in a process: later calls find everything compiled.

    Args:
        what: is compiled, for people; also tells the first time.
    """
    if what in _ready:
        yield
        return
    message = "compiling %s: once per machine and version, up to a minute; Numba's cache keeps it"
    timer = threading.Timer(_PATIENCE_S, _LOGGER.info, (message, what))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
    _ready.add(what)

"""Decompositions by several processes, kept on disk: `<cache>/partnet/<hash>.npz`, a file per part and per object.

The name is a hash over the meshes' content and every parameter, so that a changed file, scale or setting is a new
entry and an old one is never wrong. Deleting the folder costs time only.

The processes do not run the caller's script again, as those of multiprocessing do, so that importing an object
needs no `if __name__ == "__main__"`. coacd and the linear algebra run on one thread in all of them, and even a
single worker is a process of its own: the bits do not depend on their number, and a part that crashes coacd ends
nothing else. Parts of a few flat boards are done at once, sooner than a process starts. (loky's executor, tried
instead, takes as long, 1.6 s for two parts, but cannot start in a process that is a daemon of multiprocessing.)
"""

import hashlib
import logging
import os
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as wait_for_any
from pathlib import Path

import numpy as np

from artiskill.assets.partnet.decompose import DecompositionPart, decompose, decompose_quickly
from artiskill.assets.partnet.meshes import join_hulls, limit_vertices
from artiskill.errors import ArtiSkillError, AssetError
from artiskill.files import atomic_write, check_archive, open_regular
from artiskill.jobs.parallel import available_cores
from artiskill.jobs.worker import in_worker

_LOGGER = logging.getLogger("artiskill.assets")
_MOST_BYTES = 100_000_000  # the largest entry has 100 kB
_VERSION = 6  # of the algorithm: a new number makes old cache files void
# results must not depend on how many threads there are, and the processes share the cores already
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "TBB_NUM_THREADS"), "1")
_POLL_S = 0.25
_COMMAND = "from artiskill.assets.partnet.hull_cache import serve; serve({})"

Hulls = list[np.ndarray]
OnProgress = Callable[[int, int], None]


def default_cache_dir() -> Path:
    """Return `$XDG_CACHE_HOME/artiskill`, or `~/.cache/artiskill`."""
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "artiskill"


def decompose_cached(
    parts: Sequence[DecompositionPart],
    cache_dir: Path,
    most: int | None = None,
    workers: int | None = None,
    on_progress: OnProgress | None = None,
) -> list[Hulls]:
    """Return the hulls of each of an object's parts, through files in `cache_dir / "partnet"`.

    Every part is kept as soon as it is done, so that an import that was ended goes on from there, and the whole
    object at the end. A file that cannot be read is computed anew and replaced; files appear whole or not at all.
    The result does not depend on the number of workers.

    Args:
        parts: of one object.
        cache_dir: any folder.
        most: hulls of all parts together; beyond, hulls of one group are joined.
        workers: processes; one per core where None, one alone in a process that is itself one of many.
        on_progress: called with the parts done and those in all, a few times a second.

    Raises:
        AssetError: a worker died.
        MissingExtraError: coacd is needed and not installed.
    """
    folder, keys = cache_dir / "partnet", [_part_key(part) for part in parts]
    whole = hashlib.sha256(f"artiskill-object-{_VERSION}-{most}".encode())
    for part, key in zip(parts, keys, strict=True):
        whole.update(f"{key}{part.group}".encode())
    path = folder / f"{whole.hexdigest()[:32]}.npz"
    hulls = _load(path, len(parts))
    if hulls is None:
        workers = workers or (1 if in_worker() else available_cores())
        paths = [folder / f"{key}.npz" for key in keys]
        hulls = _decompose(parts, paths, workers, on_progress or (lambda done, count: None))
        if most is not None and sum(map(len, hulls)) > most:
            hulls = join_hulls(hulls, [part.group for part in parts], most)
            limits = [part.config.max_vertices for part in parts]
            hulls = [[limit_vertices(hull, n) for hull in of] for n, of in zip(limits, hulls, strict=True)]
        _save(path, hulls)
    return hulls


def _decompose(
    parts: Sequence[DecompositionPart], paths: Sequence[Path], workers: int, on_progress: OnProgress
) -> list[Hulls]:
    """Return every part's hulls: those from disk that are there, the others decomposed, the largest first."""
    found = {k: kept[0] for k, path in enumerate(paths) if (kept := _load(path, 1)) is not None}
    sizes = [sum(len(mesh.faces) for mesh in part.meshes) for part in parts]
    waiting: deque[int] = deque()

    def keep(number: int, hulls: Hulls) -> None:
        found[number] = hulls
        _save(paths[number], [hulls])

    for number in sorted(set(range(len(parts))) - set(found), key=lambda k: (-sizes[k], k)):
        hulls = decompose_quickly(parts[number])
        if hulls is None:
            waiting.append(number)
        else:
            keep(number, hulls)
    pool = [_Worker() for _ in range(min(workers, len(waiting)))]
    try:
        for worker in pool:
            worker.give(waiting.popleft(), parts)
        while len(found) < len(parts):
            for connection in wait_for_any([w.connection for w in pool if w.number is not None], timeout=_POLL_S):
                worker = next(w for w in pool if w.connection is connection)
                number, hulls = worker.take()
                if waiting:
                    worker.give(waiting.popleft(), parts)
                keep(number, hulls)
            on_progress(len(found), len(parts))
    finally:
        for worker in pool:
            worker.stop()
    return [found[k] for k in range(len(parts))]


class _Worker:
    """One process.

    Attributes:
        connection: to it.
        number: of the part that it is working on; None if on none.
    """

    def __init__(self) -> None:
        self.connection, theirs = Pipe()
        self.number: int | None = None
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", _COMMAND.format(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,  # coacd logs there
                env={**os.environ, **_ONE_THREAD, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            )

    def give(self, number: int, parts: Sequence[DecompositionPart]) -> None:
        """Have a part decomposed."""
        self.number = number
        with suppress(BrokenPipeError):  # `take` finds that it is gone
            self.connection.send(parts[number])

    def take(self) -> tuple[int, Hulls]:
        """Return the part's number and its hulls.

        Raises:
            AssetError: the process is gone.
            ArtiSkillError: what it raised.
        """
        assert self.number is not None
        number, self.number = self.number, None
        try:
            answer = self.connection.recv()
        except (EOFError, ConnectionError) as error:
            code = self._process.wait()
            how = signal.Signals(-code).name if code < 0 else f"exit status {code}"
            raise AssetError(
                f"the decomposition of a part into convex hulls ended unexpectedly ({how}): memory ran out, or "
                "the part is more than coacd can do; what was done before is kept"
            ) from error
        if isinstance(answer, BaseException):
            raise answer
        return number, answer

    def stop(self) -> None:
        """End it, whatever it does."""
        self.connection.close()
        self._process.kill()
        self._process.wait()


def serve(descriptor: int) -> None:
    """Decompose what comes in by a connection, until it closes; called in the worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the parent, which ends this process
    connection = Connection(descriptor)
    with suppress(EOFError, ConnectionError):
        while True:
            part = connection.recv()
            try:
                connection.send(decompose(part))
            except ArtiSkillError as error:
                connection.send(error)


def _part_key(part: DecompositionPart) -> str:
    digest = hashlib.sha256(f"artiskill-part-{_VERSION}-{part.config}/{len(part.meshes)}".encode())
    for mesh in part.meshes:
        digest.update(f"{mesh.vertices.shape}{mesh.faces.shape}".encode())
        digest.update(mesh.vertices.tobytes() + mesh.faces.tobytes())
    return digest.hexdigest()[:32]


def _load(path: Path, count: int) -> list[Hulls] | None:
    """Read what `_save` wrote under this name; None if there is none, or a damaged one, which is logged."""
    try:
        with open_regular(path) as file:
            check_archive(file, _MOST_BYTES)
            with np.load(file, allow_pickle=False) as data:
                points, sizes, counts, digest = (data[name] for name in ("points", "sizes", "counts", "digest"))
        if digest.tobytes() != _digest(path, points, sizes, counts) or len(counts) != count:
            raise ValueError("it was changed since it was written")
        hulls = iter(np.split(points, np.cumsum(sizes)[:-1]))
        return [[next(hulls) for _ in range(number)] for number in counts]
    except FileNotFoundError:
        return None
    except Exception as error:  # what numpy and zipfile raise of damaged files cannot be listed
        _LOGGER.warning("%s cannot be used, and is made anew: %s", path, error)
        return None


def _digest(path: Path, *arrays: np.ndarray) -> bytes:
    """Return the SHA-256 of an entry's name and content: a file under another entry's name is noticed, too."""
    digest = hashlib.sha256(path.stem.encode())
    for array in arrays:
        digest.update(f"{array.dtype.str}{array.shape}".encode() + array.tobytes())
    return digest.digest()


def _save(path: Path, parts: list[Hulls]) -> None:
    """Write atomically; a cache that cannot be written (full or read-only disk) is no error, only slow."""
    hulls = [hull for part in parts for hull in part]
    points = np.concatenate([np.empty((0, 3)), *hulls])
    sizes = np.array([len(hull) for hull in hulls], dtype=np.int64)
    counts = np.array([len(part) for part in parts], dtype=np.int64)
    digest = np.frombuffer(_digest(path, points, sizes, counts), dtype=np.uint8)
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(path) as temporary:
            np.savez(temporary, points=points, sizes=sizes, counts=counts, digest=digest)

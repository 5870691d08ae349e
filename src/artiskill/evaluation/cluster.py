"""Evaluation on a Ray cluster: rows of the report are played at nodes, to which the policy's files travel.

A row is played as on this machine, in processes of its own, so that the numbers are the same bit for bit.
"""

import hashlib
import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.errors import ConfigError, PolicyError
from artiskill.evaluation.evaluate import BatchJob, check_plan_workers, prepare_workers, run_batch
from artiskill.evaluation.plan import WORKER_HINT, EpisodeBatch, EvaluationPlan
from artiskill.evaluation.policies import ARRAYS, is_run, solution_path
from artiskill.evaluation.report import Report, make_report
from artiskill.evaluation.statistics import EpisodeResult
from artiskill.files import DAMAGED_ARCHIVE, atomic_write, check_archive
from artiskill.jobs.fork_server import fork_server
from artiskill.jobs.parallel import run_jobs
from artiskill.jobs.ray_driver import facts
from artiskill.jobs.ray_jobs import RayCluster, connected
from artiskill.jobs.worker import Send
from artiskill.learning.run import CONFIG, INFO, run_folder, weights_file

UNFINISHED = ".unfinished-report"  # folder for rows of a report that is not whole yet
KEPT = "finished rows are kept: the same command goes on from there"
_MOST_FILES, _MOST_BYTES, _MB = 2000, 64 * 2**20, 2**20  # of a solution's folder
_MOST_ROW_BYTES = 2**30


def evaluate_on_cluster(
    plan: EvaluationPlan,
    cluster: RayCluster,
    on_episode: Callable[[EpisodeResult], None] | None = None,
    step_timeout_s: float | None = None,
    folder: Path | None = None,
) -> Report:
    """Run a checked evaluation on a cluster; the report is that of `run_evaluation`, up to its `timing`.

    Args:
        plan: its policy is given by name, path or address.
        cluster: where to work.
        on_episode: called after every row with each of its episodes.
        step_timeout_s: the time in which each action must come.
        folder: where finished rows are kept, and those of an earlier evaluation like this one are found;
            `remove_kept` when the report is written.

    Raises:
        ConfigError: a policy that lives in this process only, or has too large a folder.
        MissingExtraError: Ray is not installed.
        ClusterError: the cluster cannot be reached, breaks down, or would give other results.
        PolicyError: the policy raises, returns no legal action, takes too long, or ends its process. Of several
            such errors, the first in the order of rows that had been begun.
    """
    start = time.perf_counter()
    check_plan_workers(plan, cluster.most_jobs or 2, step_timeout_s)
    plan = plan.within(step_timeout_s)
    is_named = isinstance(plan.policy, str)  # else it is somebody else's server, whatever that may answer
    policy_files = pack_policy(plan.policy) if is_named else None
    jobs = [
        NodeJob(BatchJob(batch, plan.load_timeout_s, step_timeout_s, plan.sandbox), policy_files)
        for batch in plan.batches
    ]
    kept = KeptRows(folder, _key_of(plan, policy_files)) if folder is not None and is_named else None
    rows = _Rows(jobs, kept, on_episode or (lambda episode: None))
    if rows.waiting:
        with connected(cluster) as run:
            run(play_at_node, rows, describe=lambda job: job.job.batch.label)
    if rows.failures:
        raise rows.failures[min(rows.failures)]
    results = [rows.results[number] for number in range(len(jobs))]
    return make_report(plan, results, time.perf_counter() - start, cluster.most_jobs or len(jobs))


class _Rows:
    """The rows that are still to be played, for `run_source`; none is given out after one has failed."""

    def __init__(
        self, jobs: Sequence["NodeJob"], kept: "KeptRows | None", on_episode: Callable[[EpisodeResult], None]
    ) -> None:
        self._jobs, self._kept, self._on_episode = jobs, kept, on_episode
        self.results = {} if kept is None else kept.load([job.job.batch for job in jobs])
        self.failures: dict[int, PolicyError] = {}
        self.waiting = [number for number in range(len(jobs)) if number not in self.results]
        self._given: list[int] = []
        for number in sorted(self.results):
            self._tell(self.results[number])

    def next(self) -> "NodeJob | None":
        if self.failures or not self.waiting:
            return None
        self._given.append(self.waiting.pop(0))
        return self._jobs[self._given[-1]]

    def finished(self, number: int, result: list[EpisodeResult] | PolicyError) -> None:
        row = self._given[number]
        if isinstance(result, PolicyError):
            self.failures[row] = result
            return
        self.results[row] = result
        if self._kept is not None:
            self._kept.save(row, result)
        self._tell(result)

    def _tell(self, results: Sequence[EpisodeResult]) -> None:
        for result in results:
            self._on_episode(result)


# -- at a node ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class NodeJob:
    """A row that is to be played at a node.

    Attributes:
        job: with the policy as it was given.
        policy_files: that it needs; None if it needs none.
    """

    job: BatchJob
    policy_files: "PolicyFiles | None"


def play_at_node(job: NodeJob, send: Send) -> list[EpisodeResult] | PolicyError:
    """Play a row as on the evaluator's machine, in processes of its own; an error of the policy is returned."""
    if job.policy_files is None:
        return _play(job.job)
    with job.policy_files.unpacked() as path:
        found = _play(replace(job.job, batch=replace(job.job.batch, policy=path)))
        if not isinstance(found, PolicyError):
            return found
        named = PolicyError(str(found).replace(path, job.policy_files.given))
        for note in getattr(found, "__notes__", ()):
            named.add_note(note)
        return named


def _play(job: BatchJob) -> list[EpisodeResult] | PolicyError:
    prepare_workers(job.batch)
    if is_run(job.batch.policy):  # torch takes seconds to import
        fork_server().prepare(partial(import_module, "artiskill.learning.policy"))
    try:
        return run_jobs(
            run_batch, [job], 1, describe=lambda one: one.batch.label, isolated=True, hint=WORKER_HINT
        )[0]
    except PolicyError as error:
        return error


# -- the policy's files -------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class PolicyFiles:
    """The files that a policy needs, as they travel.

    Attributes:
        given: the policy's path on the evaluator's machine, for messages.
        main: its path among the files.
        content: path -> bytes.
    """

    given: str
    main: str
    content: Mapping[str, bytes]

    @property
    def digest(self) -> str:
        """SHA-256 of all names and bytes."""
        digest = hashlib.sha256(self.main.encode())
        for name, content in sorted(self.content.items()):
            digest.update(f"\0{name}\0{len(content)}\0".encode() + content)
        return digest.hexdigest()

    @contextmanager
    def unpacked(self) -> Iterator[str]:
        """Yield the policy's path in a folder that exists for as long."""
        with tempfile.TemporaryDirectory(prefix="artiskill-policy-") as folder:
            for name, content in self.content.items():
                path = Path(folder, name)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(content)
            yield str(Path(folder, self.main))


def pack_policy(policy: str) -> PolicyFiles | None:
    """Read the files of a policy: an exported file, what loading a run needs, or all of a solution's folder.

    Hidden files, `__pycache__` and linked folders are left out.

    Returns:
        None for a policy of the package, which nodes have.

    Raises:
        ConfigError: the solution's folder is too large.
        PolicyError: there is no such run, or a file cannot be read.
    """
    solution = solution_path(policy)
    if solution is None and not is_run(policy):
        return None
    try:
        if solution is not None:
            folder = solution.parent
            return PolicyFiles(
                policy, solution.name, {str(p.relative_to(folder)): p.read_bytes() for p in _files(folder)}
            )
        path = Path(policy)
        if path.suffix == ARRAYS:
            return PolicyFiles(policy, path.name, {path.name: path.read_bytes()})
        folder, weights = run_folder(path), weights_file(path)
        paths = (folder / INFO, folder / CONFIG, weights)
        main = "run" if path == folder else str(Path("run", weights.relative_to(folder)))
        return PolicyFiles(policy, main, {str(Path("run", p.relative_to(folder))): p.read_bytes() for p in paths})
    except OSError as error:
        raise PolicyError(f"cannot read {str(error.filename)!r}: {error.strerror}") from error


def _files(folder: Path) -> Iterator[Path]:
    """Yield the files of a solution's folder, as long as they are not too many."""
    number, size = 0, 0
    for root, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith(".") and name != "__pycache__")
        for path in (Path(root, name) for name in sorted(names) if not name.startswith(".")):
            if path.is_file():
                number, size = number + 1, size + path.stat().st_size
                if number > _MOST_FILES or size > _MOST_BYTES:
                    raise ConfigError(
                        f"the solution's folder {str(folder)!r} holds more than {_MOST_FILES} files or "
                        f"{_MOST_BYTES // _MB} MiB, and would travel to every node: put the solution, and what it "
                        "needs, into a folder of its own"
                    )
                yield path


# -- rows that are finished ---------------------------------------------------------------------------------------


def _key_of(plan: EvaluationPlan, policy_files: PolicyFiles | None) -> str:
    """Return a digest of all that a row's episodes depend on."""
    policy = plan.policy if policy_files is None else policy_files.digest
    about = [plan.protocol.digest, plan.policy_name, policy, repr(plan.batches[0].sampling), facts()]
    return hashlib.sha256(json.dumps(about).encode()).hexdigest()


class KeptRows:
    """Finished rows of a report that is not whole, in files beside it.

    Args:
        folder: of the report, for which the caller has `lock_folder`.
        key: of the evaluation; rows of another one count as none.
    """

    def __init__(self, folder: Path, key: str) -> None:
        self._folder, self._key = folder / UNFINISHED, key

    def load(self, batches: Sequence[EpisodeBatch]) -> dict[int, list[EpisodeResult]]:
        """Return the rows that are there, by number; a damaged file is none."""
        found = {}
        for number, batch in enumerate(batches):
            try:
                episodes = self._read(number)
            except DAMAGED_ARCHIVE:
                continue
            if [episode.level for episode in episodes] == list(batch.levels):
                found[number] = episodes
        return found

    def _read(self, number: int) -> list[EpisodeResult]:
        with (self._folder / f"{number}.npz").open("rb") as file:
            check_archive(file, _MOST_ROW_BYTES)
            with np.load(file, allow_pickle=False) as arrays:
                about = json.loads(str(arrays["about"]))
                if about["key"] != self._key:
                    return []
                names = [name.removesuffix("_0") for name in arrays.files if name.endswith("_0")]
                return [
                    EpisodeResult(**plain, **{name: arrays[f"{name}_{k}"] for name in names})
                    for k, plain in enumerate(about["episodes"])
                ]

    def save(self, number: int, episodes: Sequence[EpisodeResult]) -> None:
        """Keep a row.

        Raises:
            ConfigError: it cannot be written.
        """
        plain: list[dict[str, Any]] = [{} for _ in episodes]
        arrays: dict[str, Any] = {}
        for k, episode in enumerate(episodes):
            for field in fields(episode):
                value = getattr(episode, field.name)
                if isinstance(value, np.ndarray):
                    arrays[f"{field.name}_{k}"] = value
                else:
                    plain[k][field.name] = value
        about = json.dumps({"key": self._key, "episodes": plain})
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            with atomic_write(self._folder / f"{number}.npz") as temporary, temporary.open("wb") as file:
                np.savez(file, about=np.array(about), **arrays)
        except OSError as error:
            raise ConfigError(
                f"cannot write to {str(self._folder)!r}: {error.strerror or error}; {KEPT}"
            ) from error


def remove_kept(folder: Path) -> None:
    """Remove rows that a folder's report has now."""
    shutil.rmtree(folder / UNFINISHED, ignore_errors=True)

"""All checks of many objects, on several processes."""

import json
import multiprocessing
import signal
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from artiskill import __version__
from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object, object_id_of
from artiskill.assets.similarity import Descriptor, describe
from artiskill.checks.alike import check_alike
from artiskill.checks.config import ChecksConfig, default_checks_config
from artiskill.checks.result import CheckResult, failed
from artiskill.checks.specimen import Specimen
from artiskill.checks.table import CHECKS, Check
from artiskill.config import to_mapping
from artiskill.errors import ArtiSkillError, ConfigError
from artiskill.jobs.whole_files import whole_file

LOADS = "loads"
Item = str | ArticulatedObject


@dataclass(frozen=True)
class ObjectReport:
    """Everything that was found about one object.

    Attributes:
        id: the object's.
        category: the object's; empty if it could not be loaded.
        source: where it comes from, as its metadata say.
        results: in the order of the checks.
        seconds: that its checks took.
        remarks: what its importer had to decide: what was trimmed, made lighter or left out.
    """

    id: str
    category: str
    source: str
    results: tuple[CheckResult, ...]
    seconds: float
    remarks: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether everything is as it should be."""
        return all(result.passed for result in self.results)

    def failures(self) -> tuple[CheckResult, ...]:
        """What is not."""
        return tuple(result for result in self.results if not result.passed)


def check_object(obj: ArticulatedObject, config: ChecksConfig | None = None) -> list[CheckResult]:
    """All checks of one object but the comparison with others.

    Raises:
        UnknownNameError: the config knows nothing of the object's category.
    """
    config = config or default_checks_config()
    config.of(obj.category)
    specimen = Specimen(obj, config)
    results: list[CheckResult] = []
    compiles = True
    for check in CHECKS[obj.category]:
        if compiles or not check.needs_engine:
            results += _ask(check, specimen, config)
            compiles = compiles and all(result.passed for result in results if result.check == "compiles")
    return results


def check_objects(
    items: Sequence[Item],
    config: ChecksConfig | None = None,
    workers: int = 1,
    on_done: Callable[[ObjectReport], None] | None = None,
) -> list[ObjectReport]:
    """All checks of all objects, and the comparison of each with the others.

    Args:
        items: ids for `load_object`, or objects.
        config: limits and settings.
        workers: processes; with one, everything happens in this process.
        on_done: called with each object's report as soon as it is there, still without the comparison.

    Returns:
        One report per item, in their order.

    Raises:
        ConfigError: fewer than one worker.
    """
    if workers < 1:
        raise ConfigError(f"workers must be at least 1, not {workers}")
    config = config or default_checks_config()
    on_done = on_done or (lambda report: None)
    examine = partial(_examine, config=config)
    if min(workers, len(items)) <= 1:
        found = []
        for item in items:
            found.append(examine(item))
            on_done(found[-1][0])
    else:
        found = _examine_on_processes(examine, items, workers, on_done)
    alike = check_alike([descriptor for _, descriptor in found if descriptor is not None])
    return [
        replace(report, results=(*report.results, alike[report.id])) if report.id in alike else report
        for report, _ in found
    ]


def write_json(reports: Sequence[ObjectReport], config: ChecksConfig, path: Path) -> None:
    """Write reports and config; the file appears whole or not at all.

    Raises:
        ConfigError: it cannot be written.
    """
    content = {
        "version": __version__,
        "passed": all(report.passed for report in reports),
        "objects": [{"passed": report.passed, **to_mapping(report)} for report in reports],
        "config": to_mapping(config),
    }
    try:
        with whole_file(path) as temporary:
            temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"cannot write {str(path)!r}: {error.strerror or error}") from error


def _ask(check: Check, specimen: Specimen, config: ChecksConfig) -> list[CheckResult]:
    try:
        return check.ask(specimen, config)
    except ConfigError:  # that is no fault of the object
        raise
    except Exception as error:  # whatever a broken object leads to: the other checks and objects go on
        name = check.ask.__name__.removeprefix("check_")
        return [failed(name, "object", f"the check ended with {type(error).__name__}: {error}")]


def _examine(item: Item, config: ChecksConfig) -> tuple[ObjectReport, Descriptor | None]:
    """What a worker does for one object."""
    start = time.perf_counter()
    try:
        obj = load_object(item) if isinstance(item, str) else item
        results = check_object(obj, config)
        descriptor = describe(obj, config.descriptor) if any(link.visuals for link in obj.links) else None
    except ArtiSkillError as error:
        results = [failed(LOADS, "object", str(error))]
        return ObjectReport(object_id_of(item), "", "", tuple(results), time.perf_counter() - start), None
    source = str(obj.metadata.get("source", ""))
    remarks = tuple(map(str, obj.metadata.get("warnings", ())))
    report = ObjectReport(obj.id, obj.category, source, tuple(results), time.perf_counter() - start, remarks)
    return report, descriptor


def _examine_on_processes(
    examine: Callable[[Item], Any], items: Sequence[Item], workers: int, on_done: Callable[[ObjectReport], None]
) -> list[tuple[ObjectReport, Descriptor | None]]:
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(workers, len(items)), context, initializer=_leave_ctrl_c_to_the_parent)
    futures: list[Future[tuple[ObjectReport, Descriptor | None]]] = []
    try:
        futures = [pool.submit(examine, item) for item in items]
        for future in as_completed(futures):
            on_done(future.result()[0])
        return [future.result() for future in futures]
    finally:  # after an error or Ctrl-C, too: what has not begun never will
        pool.shutdown(wait=True, cancel_futures=True)


def _leave_ctrl_c_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)

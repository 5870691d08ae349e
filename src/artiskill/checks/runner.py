"""All checks of many objects, on several processes."""

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from artiskill import __version__
from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import object_id_of, object_of
from artiskill.assets.similarity import NEAR_DUPLICATE_M, Descriptor, describe, nearest_neighbours
from artiskill.checks.config import ChecksConfig, default_checks_config
from artiskill.checks.context import CheckContext, CheckResult, at_least, failed
from artiskill.checks.dynamics import check_ball, check_drive, check_roll, check_settle, check_swivel
from artiskill.checks.handles import check_handles, check_reach
from artiskill.checks.model import (
    check_closed,
    check_compiles,
    check_geoms,
    check_mass,
    check_sweep,
    check_triangles,
)
from artiskill.checks.surfaces import check_cavity, check_surfaces
from artiskill.config import to_mapping
from artiskill.errors import ArtiSkillError, ConfigError
from artiskill.files import atomic_write
from artiskill.jobs.parallel import check_workers, run_jobs
from artiskill.jobs.worker import Send

LOADS, COMPILES, DUPLICATES = "loads", "compiles", "duplicates"
Item = str | ArticulatedObject


@dataclass(frozen=True)
class Check:
    """A question to an object.

    Attributes:
        function: answers it.
        needs_engine: whether it makes sense only if the engine compiles the object.
        categories: of the objects that it is asked of.
    """

    function: Callable[[CheckContext], list[CheckResult]]
    needs_engine: bool = True
    categories: tuple[str, ...] = ("cabinet", "chair", "bucket")


# by name, in the order in which they are asked; besides these there are `LOADS` and `DUPLICATES`
CHECKS = {
    COMPILES: Check(check_compiles, needs_engine=False),
    "triangles": Check(check_triangles, needs_engine=False),
    "geoms": Check(check_geoms, needs_engine=False),
    "mass": Check(check_mass),
    "closed": Check(check_closed),
    "sweep": Check(check_sweep),
    "drive": Check(check_drive),
    "surfaces": Check(check_surfaces, needs_engine=False),
    "handles": Check(check_handles),
    "reach": Check(check_reach, needs_engine=False),
    "cavity": Check(check_cavity, needs_engine=False, categories=("cabinet",)),
    "settle": Check(check_settle, categories=("chair", "bucket")),
    "roll": Check(check_roll, categories=("chair",)),
    "swivel": Check(check_swivel, categories=("chair",)),
    "ball": Check(check_ball, categories=("bucket",)),
}


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
        """Whether all results are legal."""
        return not self.failures()

    def failures(self) -> tuple[CheckResult, ...]:
        """Return the results that are not legal."""
        return tuple(result for result in self.results if not result.passed)


def check_objects(
    items: Sequence[Item],
    config: ChecksConfig | None = None,
    workers: int = 1,
    on_done: Callable[[ObjectReport], None] | None = None,
) -> list[ObjectReport]:
    """Run all checks of all objects, and compare each with the others.

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
    check_workers(workers)
    config = config or default_checks_config()
    jobs = [(item, config) for item in items]
    found = run_jobs(_examine, jobs, workers, on_done, lambda job: object_id_of(job[0]))
    duplicates = _check_duplicates([descriptor for _, descriptor in found if descriptor is not None])
    return [
        replace(report, results=(*report.results, duplicates[report.id])) if report.id in duplicates else report
        for report, _ in found
    ]


def check_object(obj: ArticulatedObject, config: ChecksConfig | None = None) -> list[CheckResult]:
    """Run all checks of one object but the comparison with others.

    Raises:
        UnknownNameError: the config knows nothing of the object's category.
    """
    config = config or default_checks_config()
    config.of(obj.category)
    context = CheckContext(obj, config)
    results: list[CheckResult] = []
    compiles = True
    for name, check in CHECKS.items():
        if obj.category in check.categories and (compiles or not check.needs_engine):
            found = _run(name, check, context)
            results += found
            compiles = compiles and (name != COMPILES or all(result.passed for result in found))
    return results


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
        with atomic_write(path) as temporary:
            temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"cannot write {str(path)!r}: {error.strerror or error}") from error


def _run(name: str, check: Check, context: CheckContext) -> list[CheckResult]:
    """Run one check and enter its name in the results."""
    try:
        found = check.function(context)
    except ConfigError:  # that is no fault of the object
        raise
    except Exception as error:  # whatever a broken object leads to: the other checks and objects go on
        found = [failed("object", f"the check ended with {type(error).__name__}: {error}")]
    return [replace(result, check=name) for result in found]


def _check_duplicates(descriptors: Sequence[Descriptor]) -> dict[str, CheckResult]:
    """Check that no two objects of a category are nearly alike: by id, the distance to the nearest neighbour.

    Objects that are alone in their category are left out. `assets.similarity` says how it is measured.
    """
    categories = {one.id: one.category for one in descriptors}
    results = {}
    for found in nearest_neighbours(descriptors):
        limit = 1e3 * NEAR_DUPLICATE_M[categories[found.id]]
        note = "with the same joints" if found.same_joints else "with other joints"
        result = at_least(found.nearest, 1e3 * found.distance_m, limit, "mm", note)
        results[found.id] = replace(result, check=DUPLICATES)
    return results


def _examine(job: tuple[Item, ChecksConfig], send: Send) -> tuple[ObjectReport, Descriptor | None]:
    """Check one object and send its report."""
    (item, config), descriptor = job, None
    start = time.perf_counter()
    try:
        obj = object_of(item)
        results = check_object(obj, config)
        descriptor = describe(obj, config.descriptor) if any(link.visuals for link in obj.links) else None
    except ArtiSkillError as error:
        results = [replace(failed("object", str(error)), check=LOADS)]
        report = ObjectReport(object_id_of(item), "", "", tuple(results), time.perf_counter() - start)
    else:
        source = str(obj.metadata.get("source", ""))
        remarks = tuple(map(str, obj.metadata.get("warnings", ())))
        report = ObjectReport(obj.id, obj.category, source, tuple(results), time.perf_counter() - start, remarks)
    send(report)
    return report, descriptor

"""The tables as Markdown, for docs/learning.md, and how they get there."""

import functools
import operator
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from artiskill.config import check
from artiskill.errors import ConfigError
from artiskill.files import atomic_write, read_text
from artiskill.gallery.facts import markdown
from learning_tables.cells import METHODS, POINTS, TASKS, A, B, Method, Settings
from learning_tables.results import PAPER_A, PAPER_B, PAPER_STEPS, Measured, Result

MISSING = "missing"
NETWORKS = {
    "small": "small",
    "small_transformer": "small, Transformer",
    "pointnet": "PointNet",
    "pointnet_transformer": "PointNet+Transformer",
}
ALGORITHMS = {"bc": "BC", "bcq": "BCQ", "td3bc": "TD3+BC"}
PAPER = "ManiSkill paper"


def tables_text(results: Sequence[Result], settings: Settings) -> str:
    """Return both tables, each with what its policies have in common."""
    parts = [
        *("### One drawer", _about_a(results, settings), drawer_table(results, settings)),
        *("### Four tasks", _about_b(results, settings), tasks_table(results)),
    ]
    return "\n\n".join(parts)


def drawer_table(results: Sequence[Result], settings: Settings) -> str:
    """Return table a: a row per method, a column per number of demonstrations; the paper's rows below."""
    counts = list(settings.schedule)
    rows = []
    for method in METHODS:
        cells = [chosen(results, A, method, count) for count in counts]
        texts = [_rate(found, "new") for found in cells]
        rows.append([*names(method), *texts, *_training([one for found in cells for one in found])])
    for method, rates in PAPER_A.items():
        known = dict(zip(PAPER_STEPS, rates, strict=True))
        texts = [f"{known[count]:.0%}" if count in known else "" for count in counts]
        rows.append([*names(method, PAPER), *texts, "", ""])
    return markdown(["network", "algorithm", *counts, "minutes of training", "on"], rows)


def tasks_table(results: Sequence[Result]) -> str:
    """Return table b: a row per task and method, with the paper's numbers."""
    rows = []
    for number, task in enumerate(TASKS):
        for method in METHODS:
            found = chosen(results, B, method, task)
            tests = [one.measured["test"] for one in found]
            objects = range_text(sum_of(tests).objects_interval) if tests else MISSING
            paper = " / ".join(f"{rate:.0%}" for rate in PAPER_B[method][number]) if method in PAPER_B else ""
            texts = [_rate(found, "train"), _rate(found, "test"), objects, paper]
            rows.append([task, *names(method), *texts, *_training(found)])
    head = ["task", "network", "algorithm", "training objects", "test objects", "unseen objects in general"]
    return markdown([*head, f"{PAPER}: training / test", "minutes of training", "on"], rows)


def _about_a(results: Sequence[Result], settings: Settings) -> str:
    steps = {count: max(1, round(steps * settings.scale)) for count, steps in settings.schedule.items()}
    texts = [f"{number:,} for {count} demonstrations" for count, number in steps.items()]
    if len(set(steps.values())) == 1:
        texts = [f"{next(iter(steps.values())):,} for each number"]
    paper = "as in the paper" if steps == PAPER_STEPS else f"the paper's: {_numbers(PAPER_STEPS.values())}"
    return (
        f"Success on {settings.episodes} new levels of {settings.drawer[0]}, {settings.drawer[1]}, by the number "
        f"of demonstrations, with 95 % Wilson intervals. Gradient steps of {settings.batch_size} samples: "
        f"{', '.join(texts)} ({paper}). {_about_cells(results, A, len(settings.schedule))}"
    )


def _numbers(values: Iterable[int]) -> str:
    return ", ".join(f"{value:,}" for value in values)


def _about_b(results: Sequence[Result], settings: Settings) -> str:
    steps = max(1, round(settings.samples / settings.batch_size))
    objects = f"{' '.join(settings.train_objects)}; {' '.join(settings.test_objects)}"
    return (
        f"Success on training objects ({settings.train_levels} new levels each) and test objects "
        f"({settings.test_levels} levels each; objects: {objects}), with 95 % Wilson intervals over episodes; the "
        "interval for unseen objects in general is a bootstrap over test objects (none where all have one rate). "
        f"Every policy saw {steps * settings.batch_size:,} samples, in batches of {settings.batch_size}, of "
        f"{settings.per_object} demonstrations of each training object (the paper's BC: 19,200,000, of 300). "
        f"{_about_cells(results, B, len(TASKS))}"
    )


def _about_cells(results: Sequence[Result], table: str, columns: int) -> str:
    """Say how seeds count and what is missing."""
    found = {(one.cell.method, one.cell.column) for one in results if one.cell.table == table}
    total = len(METHODS) * columns
    missing = (
        "No cell is missing." if len(found) == total else f"{total - len(found)} of {total} cells are missing."
    )
    return (
        f"Clouds have {POINTS['small']} points for the small networks, {POINTS['pointnet']:,} for the others. The "
        "last checkpoint counts. Of several seeds the episodes are added, and ± is the standard deviation "
        f"between seeds. {missing}"
    )


def chosen(results: Sequence[Result], table: str, method: Method, column: str) -> list[Result]:
    """Return the results of one place of a table, of all seeds."""
    return [one for one in results if one.cell[:3] == (table, method, column)]


def names(method: Method, source: str = "") -> list[str]:
    """Return network and algorithm in words, with where the numbers are from."""
    network = NETWORKS[method.network]
    return [f"{source}: {network}" if source else network, ALGORITHMS[method.algorithm]]


def sum_of(measured: Sequence[Measured]) -> Measured:
    """Return the episodes of several policies together."""
    return functools.reduce(operator.add, measured)


def _rate(found: Sequence[Result], split: str) -> str:
    """Return a rate with what is known about its error."""
    if not found:
        return MISSING
    measured = [one.measured[split] for one in found]
    total = sum_of(measured)
    text = f"{total.rate:.0%} ({range_text(total.interval)})"
    if len(measured) == 1:
        return text
    return f"{text} ± {np.std([one.rate for one in measured], ddof=1):.0%}, {len(measured)} seeds"


def range_text(interval: tuple[float, float] | None) -> str:
    """Return bounds; nothing where objects that are all alike say nothing about others."""
    if interval is None:
        return ""
    low, high = interval
    return f"{low:.0%} to {high:.0%}"


def _training(found: Sequence[Result]) -> list[str]:
    """Return minutes of the shortest and the longest training, and the machines."""
    if not found:
        return ["", ""]
    minutes = [
        f"{value:.{1 if value < 9.95 else 0}f}" for value in (f(one.minutes for one in found) for f in (min, max))
    ]
    machines = sorted({one.trained["machine"] for one in found})
    return [" to ".join(dict.fromkeys(minutes)), ", ".join(machines)]


def read_marked(page: Path, *marks: str) -> str:
    """Return the text of a page.

    Raises:
        ConfigError: it cannot be read, or lacks one of the marks.
    """
    try:
        text = read_text(page)
    except (OSError, ValueError) as error:
        raise ConfigError(f"cannot read {str(page)!r}: {error}") from error
    missing = [mark for mark in marks if mark not in text]
    check(not missing, f"{str(page)!r} lacks the marks between which tables are written: {' '.join(missing)}")
    return text


def write_between(page: Path, begin: str, end: str, made: str) -> None:
    """Write what stands between the two marks of a page anew.

    Raises:
        ConfigError: the page cannot be read, or lacks a mark.
    """
    text = read_marked(page, begin, end)
    before, _, rest = text.partition(begin)
    _, _, after = rest.partition(end)
    with atomic_write(page) as path:
        path.write_text(f"{before}{begin}\n\n{made}\n\n{end}{after}", encoding="utf-8")

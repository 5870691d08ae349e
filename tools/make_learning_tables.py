"""Make the tables of docs/learning.md anew: `python tools/make_learning_tables.py --only a`.

Table a: one drawer by the number of demonstrations. Table b: four tasks on training and test objects. Each cell is
one policy: its demonstrations, training set, training and evaluation are commands of `artiskill`, printed as they
run. Whatever ends this script, the same command goes on. Finished cells are known by their reports, or by their
rows in the CSV file of the page: without them they are made anew. Other steps or numbers of demonstrations make
cells anew; what else they have in common must be as in the page's tables. Nothing is trained on, or chosen by,
test objects.
"""

import argparse
import json
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from artiskill.config import to_mapping
from artiskill.errors import ArtiSkillError, ConfigError
from artiskill.files import atomic_write, parse_json, read_bytes
from artiskill.jobs.parallel import available_cores
from learning_tables.cells import (
    POINTS,
    STAGES,
    TASKS,
    A,
    B,
    Cell,
    Resources,
    Settings,
    all_cells,
    check_cells,
    place_of,
)
from learning_tables.estimates import Estimator
from learning_tables.markdown import read_marked, tables_text, write_between
from learning_tables.queue import CommandError, Queue, locked
from learning_tables.results import (
    CSV_HEAD,
    PAPER_STEPS,
    Result,
    csv_rows,
    read_csv_rows,
    read_results,
    write_rows,
)

PAGE = Path(__file__).resolve().parents[1] / "docs" / "learning.md"
TABLE = Path("data", "learning.csv")  # beside the page
BEGIN, END = "<!-- made by tools/make_learning_tables.py -->", "<!-- end of what was made -->"
DEFAULTS: dict[str, Any] = {  # of settings, where there are no tables yet
    "drawer": ["cabinet-0002", "link_0"],
    "schedule": PAPER_STEPS,
    "scale": 1.0,
    "samples": 2_560_000,  # 20,000 batches of 128; the paper's BC had 19,200,000
    "batch_size": 128,
    "episodes": 100,
    "per_object": 40,
    "train_objects": ["train"],
    "test_objects": ["test"],
    "train_levels": 20,
    "test_levels": 50,
    "frame": "robot",
}
SMALL = ["small", "small_transformer"]  # networks that two cores can train
PARTS = {  # of settings, each kept in a file of its own
    "shared": ("batch_size", "frame"),
    A: ("drawer", "schedule", "scale", "episodes"),
    B: ("samples", "per_object", "train_objects", "test_objects", "train_levels", "test_levels"),
}
IN_ROWS = ("schedule", "scale", "samples", "per_object")  # each row of the CSV file tells them


def main(arguments: list[str]) -> int:
    """Run the queue, write the tables; the exit status is 1 if a cell failed, 2 if what is asked is not legal."""
    options = make_parser().parse_args(arguments)
    try:
        data = options.page.parent / TABLE.parent
        kept = kept_settings(data)
        settings = make_settings(options, kept)
        cells = chosen_cells(options, settings)
        check_cells(cells, settings)
        resources = Resources(options.device, options.precision, options.workers, options.threads)
        if options.list:
            print_list(cells, settings, options, resources)
            return 0
        read_marked(options.page, BEGIN, END)  # it will be written after hours
        with locked(options.work) as lock:
            tables = {cell.table for cell in cells}
            settings = keep_settings(settings, kept, tables, options.work, data)
            queue = Queue(settings, options.work, resources, options.stages, lock)
            return run_all(queue, cells, settings, options, resources)
    except ArtiSkillError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the script's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--work", type=Path, default=Path("results/learning-tables"), help="folder (default: %(default)s)")
    add("--page", type=Path, default=PAGE, help="with the two marks (default: docs/learning.md)")
    add("--only", choices=(A, B), help="one drawer, or four tasks (default: both)")
    add("--cells", nargs="+", metavar="CELL", help="names as --list prints them, * allowed")
    add("--tasks", nargs="+", choices=TASKS, default=TASKS, metavar="TASK", help="of table b (default: all four)")
    add("--networks", nargs="+", choices=POINTS, default=SMALL, help="(default: the small ones)")
    add("--seeds", nargs="+", type=int, default=[0], help="(default: 0)")
    add(
        "--stages",
        nargs="+",
        choices=STAGES,
        default=STAGES,
        help="of each cell, for machines without engine or GPU",
    )
    add("--list", action="store_true", help="print the cells with an estimate of minutes, and end")
    add("--time-limit", type=float, metavar="MINUTES", help="start no cell that would probably end later")
    group = parser.add_argument_group(
        "what cells have in common (default: as in the page's tables; in brackets: where there are none)"
    )
    add = group.add_argument
    samples = "of each policy of table b, and of the longest of table a, whose others shrink with it"
    add("--samples", type=int, help=f"{samples} ({DEFAULTS['samples']}, and the paper's schedule)")
    add("--schedule", nargs="+", metavar="COUNT:STEPS", help="demonstrations of table a (the paper's)")
    add("--batch-size", type=int, help=f"of all algorithms; steps of table a stay ({DEFAULTS['batch_size']})")
    add("--drawer", help=f"of table a ({'/'.join(DEFAULTS['drawer'])})")
    add("--episodes", type=int, help=f"of table a ({DEFAULTS['episodes']})")
    add("--per-object", type=int, help=f"demonstrations of table b ({DEFAULTS['per_object']})")
    add("--train-objects", nargs="+", help="of table b (train)")
    add("--test-objects", nargs="+", help="of table b (test)")
    add("--train-levels", type=int, help=f"episodes on each training object ({DEFAULTS['train_levels']})")
    add("--test-levels", type=int, help=f"episodes on each test object ({DEFAULTS['test_levels']})")
    add("--frame", help=f"of the points ({DEFAULTS['frame']})")
    add = parser.add_argument
    add("--device", default="auto", help="auto, cpu or cuda (default: %(default)s)")
    add("--precision", default="float32", help="float32 or bfloat16 (default: %(default)s)")
    add("--threads", type=int, help="of training on a CPU (default: one per core)")
    add("--workers", type=int, default=available_cores(), help="processes (default: one per core)")
    return parser


def kept_settings(data: Path) -> dict[str, Any]:
    """Return the settings that the tables beside a page were made with; none where there are no tables."""
    found: dict[str, Any] = {}
    for part in PARTS:
        found |= _read(data / f"learning-{part}.json")
    return found


def _read(path: Path) -> dict[str, Any]:
    return parse_json(read_bytes(path)) if path.is_file() else {}


def make_settings(options: argparse.Namespace, kept: Mapping[str, Any]) -> Settings:
    """Return the settings that options mean, and those kept or the defaults where they say nothing.

    Raises:
        ConfigError: a text of another form, or a number that is too small.
    """
    given = {name: getattr(options, name) for name in DEFAULTS if getattr(options, name, None) is not None}
    for name in ("batch_size", "episodes", "per_object", "train_levels", "test_levels", "workers"):
        if (number := getattr(options, name)) is not None and number < 1:
            raise ConfigError(f"--{name.replace('_', '-')} must be at least 1, not {number}")
    if "drawer" in given:
        obj, slash, target = given["drawer"].partition("/")
        if not slash:
            raise ConfigError(f"--drawer is OBJECT/TARGET, such as cabinet-0002/link_0, not {given['drawer']!r}")
        given["drawer"] = [obj, target]
    if "schedule" in given:
        given["schedule"], given["scale"] = dict(map(_schedule_item, given["schedule"])), 1.0
    found = {**DEFAULTS, **kept, **given}
    if found["samples"] < found["batch_size"]:
        raise ConfigError(
            f"--samples must be at least the batch size, {found['batch_size']}, not {found['samples']}"
        )
    if "samples" in given:
        found["scale"] = found["samples"] / (max(found["schedule"].values()) * found["batch_size"])
    return Settings(**found)


def _schedule_item(text: str) -> tuple[str, int]:
    count, _, steps = text.partition(":")
    if not (count.isdecimal() and steps.isdecimal() and int(count) and int(steps)):
        raise ConfigError(f"--schedule is COUNT:STEPS, such as 10:2000, not {text!r}")
    return str(int(count)), int(steps)


def chosen_cells(options: argparse.Namespace, settings: Settings) -> list[Cell]:
    """Return the cells that options choose.

    Raises:
        ConfigError: there are none.
    """
    patterns = options.cells or ["*"]
    cells = [
        cell
        for cell in all_cells(settings, options.seeds)
        if cell.method.network in options.networks
        and options.only in (None, cell.table)
        and (cell.table == A or cell.column in options.tasks)
        and any(fnmatchcase(cell.name, pattern) for pattern in patterns)
    ]
    if not cells:
        raise ConfigError("no cell is chosen; --list prints the names of those that --cells may choose from")
    return cells


def keep_settings(
    settings: Settings, kept: Mapping[str, Any], tables: set[str], work: Path, data: Path
) -> Settings:
    """Keep the settings in the work folder, and beside the CSV file, where those of before are `kept`.

    Returns:
        They, with those of before for tables that are not chosen.

    Raises:
        ConfigError: those of chosen tables differ from those of before.
    """
    for part, names in PARTS.items():
        places = work / f"settings-{part}.json", data / f"learning-{part}.json"
        of_work, of_page = _read(places[0]), {name: kept[name] for name in names if name in kept}
        if part in (A, B) and part not in tables:
            settings = replace(settings, **(of_work or of_page))
            continue
        ours = {name: value for name, value in to_mapping(settings).items() if name in names}
        if of_work:
            check_same(ours, of_work, f"{str(work)!r} holds cells", "choose another --work")
        if of_page:
            others = {name: value for name, value in ours.items() if name not in IN_ROWS}
            check_same(others, of_page, f"{str(data)!r} holds tables", "choose another --page")
        data.mkdir(parents=True, exist_ok=True)
        for path in places:
            with atomic_write(path) as temporary:
                temporary.write_text(json.dumps(ours, indent=1) + "\n", encoding="utf-8")
    return settings


def check_same(ours: dict[str, Any], theirs: dict[str, Any], where: str, advice: str) -> None:
    """Raise `ConfigError` if settings differ."""
    found = [
        f"{key} {theirs.get(key)!r}, not {value!r}" for key, value in ours.items() if theirs.get(key) != value
    ]
    if found:
        raise ConfigError(f"{where} with {'; '.join(found)}: {advice}")


def print_list(
    cells: Sequence[Cell], settings: Settings, options: argparse.Namespace, resources: Resources
) -> None:
    """Print the cells with minutes."""
    work, known = options.work, {one.cell for one in all_results(settings, options)}
    estimator = Estimator(cells, settings, work, resources)
    total, counted = 0.0, set[Path]()
    for cell in cells:
        if cell in known:
            print(f"{cell.name:55} finished")
            continue
        minutes, data = estimator.estimate(cell), place_of(cell, work).data
        if data in counted:  # shared with a cell above
            minutes = minutes._replace(data=0.0)
        counted.add(data)
        total += minutes.total
        parts = f"data {minutes.data:.1f}, training {minutes.training:.1f}, measuring {minutes.measuring:.1f}"
        source = "as measured here" if minutes.is_measured else "by rates of another machine"
        print(f"{cell.name:55} {minutes.total:7.1f} min: {parts} ({source})")
    print(f"{'all':55} {total:7.1f} min")


def run_all(
    queue: Queue, cells: Sequence[Cell], settings: Settings, options: argparse.Namespace, resources: Resources
) -> int:
    """Run cells one after the other, and write the tables after each one; the exit status is 1 if one failed."""
    estimator, start, failed = Estimator(cells, settings, options.work, resources), time.monotonic(), []
    known = write_tables(settings, options)
    for number, cell in enumerate(cells, 1):
        if cell in known:
            continue
        minutes, spent = estimator.estimate(cell).total, (time.monotonic() - start) / 60
        if options.time_limit is not None and spent + minutes > options.time_limit:
            print(f"not started, for lack of time: {cell.name}, about {minutes:.1f} min", flush=True)
            continue
        print(f"cell {number} of {len(cells)}: {cell.name}, about {minutes:.1f} min", flush=True)
        try:
            queue.run(cell)
        except CommandError as error:
            print(f"failed: {cell.name}: {error}", file=sys.stderr, flush=True)
            failed.append(cell.name)
            continue
        estimator.learn(cell)
        write_tables(settings, options)
    return int(bool(failed))


def all_results(settings: Settings, options: argparse.Namespace) -> list[Result]:
    """Return finished cells, in the order of the tables: those of the work folder, and others of the CSV file."""
    found = {one.cell: one for one in read_csv_rows(options.page.parent / TABLE, settings)}
    found |= {one.cell: one for one in read_results(options.work, settings)}
    order = [cell[:3] for cell in all_cells(settings, [0])]
    return sorted(found.values(), key=lambda one: (order.index(one.cell[:3]), one.cell.seed))


def write_tables(settings: Settings, options: argparse.Namespace) -> set[Cell]:
    """Write the CSV file and what stands between the marks of the page; return the finished cells."""
    results = all_results(settings, options)
    write_between(options.page, BEGIN, END, tables_text(results, settings))
    write_rows(options.page.parent / TABLE, [CSV_HEAD, *csv_rows(results, settings)])
    return {one.cell for one in results}


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        print("interrupted; the same command goes on", file=sys.stderr)
        sys.exit(130)

"""Make the tables of docs/experts.md anew from demonstrations: `python tools/make_expert_docs.py FOLDER ...`.

Each folder is one task's, as `artiskill demos collect` made it. Every trajectory is simulated again first: the
page counts those that come out bit for bit.
"""

import argparse
import csv
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from artiskill.assets.catalog import SPLITS, load_object
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demos import Demos
from artiskill.demos.file_format import TargetCount
from artiskill.demos.verify import verify
from artiskill.files import atomic_write
from artiskill.gallery.facts import markdown
from artiskill.jobs.parallel import available_cores

PAGE = Path(__file__).resolve().parents[1] / "docs" / "experts.md"
TABLE = Path("data", "experts.csv")  # beside the page
BEGIN, END = "<!-- made by tools/make_expert_docs.py -->", "<!-- end of what was made -->"
HEAD = ["task", "object", "split", "solved of attempts, by target", "steps", "stored, exact again"]
IMPORTED = "PartNet-Mobility"  # in place of a split


@dataclass(frozen=True)
class Row:
    """What the demonstrations of one object say.

    Attributes:
        object: id.
        split: of the catalogue, or `IMPORTED`.
        targets: attempts at each, and how many were solved.
        lengths: steps of every stored trajectory.
        exact: trajectories that came out bit for bit.
    """

    object: str
    split: str
    targets: tuple[TargetCount, ...]
    lengths: tuple[int, ...]
    exact: int


def main(arguments: list[str]) -> int:
    """Verify, write; the exit status is 1 if a target has no trajectory that holds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path, help="of demonstrations, one per task")
    parser.add_argument("--objects", nargs="+", default=[], help="imported objects that no name leads to")
    parser.add_argument("--page", type=Path, default=PAGE, help="(default: %(default)s)")
    options = parser.parse_args(arguments)
    imported = [load_object(name) for name in options.objects]
    tasks = {}
    for folder in options.folders:
        exact = {v.object: v.exact for v in verify(folder, available_cores(), objects=imported)}
        demos = Demos(folder)
        tasks[demos.manifest.settings.task] = [row_of(file, exact) for file in demos.files()]
    with atomic_write(options.page) as path:
        path.write_text(with_summary(options.page.read_text(encoding="utf-8"), tasks), encoding="utf-8")
    (options.page.parent / TABLE).parent.mkdir(exist_ok=True)
    with atomic_write(options.page.parent / TABLE) as path, path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([HEAD, *object_rows(tasks)])
    return int(any(is_missing(row) for rows in tasks.values() for row in rows))


def row_of(file: DemoFile, exact: dict[str, int]) -> Row:
    """Of one object's file."""
    header, attempts = file.header, file.attempts
    lengths = attempts["steps"][attempts["trajectory"] >= 0]
    split = header.facts.get("split", IMPORTED)
    return Row(header.object, split, header.targets, tuple(map(int, lengths)), exact[header.object])


def is_missing(row: Row) -> bool:
    """Whether a target has no trajectory, or one of the object's does not hold."""
    return row.exact < len(row.lengths) or any(count.successes == 0 for count in row.targets)


def with_summary(page: str, tasks: dict[str, list[Row]]) -> str:
    """Return the page with what stands between the two marks made anew."""
    before, _, rest = page.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n\n{summary_table(tasks)}\n\n{END}{after}"


def summary_table(tasks: dict[str, list[Row]]) -> str:
    """A row per task and split."""
    head = ["task", "split", "objects", "targets", "attempts", "solved", "mean of objects"]
    head += ["worst target", "steps", "stored, exact again"]
    rows = []
    for task, members in tasks.items():
        for split in (*SPLITS, IMPORTED):
            chosen = [row for row in members if row.split == split]
            if chosen:
                rows.append([task, split, *_summary(chosen)])
    return markdown(head, rows)


def _summary(rows: list[Row]) -> list[str]:
    targets = [count for row in rows for count in row.targets]
    attempts, solved = sum(c.attempts for c in targets), sum(c.successes for c in targets)
    mean = float(np.mean([_rate(row.targets) for row in rows]))
    worst = min(_rate((count,)) for count in targets)
    lengths = np.concatenate([row.lengths for row in rows])
    exact = sum(row.exact for row in rows)
    return [
        *(str(len(rows)), str(len(targets)), str(attempts), f"{solved / attempts:.1%}", f"{mean:.1%}"),
        *(f"{worst:.0%}", f"{lengths.mean():.0f}", f"{exact} of {len(lengths)}"),
    ]


def _rate(targets: tuple[TargetCount, ...]) -> float:
    attempts = sum(count.attempts for count in targets)
    return sum(count.successes for count in targets) / attempts if attempts else 0.0


def object_rows(tasks: dict[str, list[Row]]) -> Iterator[list[str]]:
    """Yield a row per task and object."""
    for task, rows in tasks.items():
        for row in rows:
            targets = ", ".join(f"{count.target} {count.successes}/{count.attempts}" for count in row.targets)
            lengths = row.lengths
            steps = f"{min(lengths)} .. {np.mean(lengths):.0f} .. {max(lengths)}" if lengths else ""
            yield [task, row.object, row.split, targets, steps, f"{row.exact} of {len(lengths)}"]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

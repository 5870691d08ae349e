"""Make the tables of reinforcement learning anew: `python tools/make_rl_tables.py --jobs 2`.

`one`: a policy per object and seed. `many`: one over 1, 5, 10, 20 or 25 cabinets. Their states say where handles
are (`state.handle`), or are what the base sees of free objects (`state.relative`); `plain` is `many` with the
paper's state. With `--algorithm sac-expert`, an expert takes over in some training episodes. Policies of which
`--set` or `--steps` change values have rows of their own. Each is trained, then measured on new levels, by printed
commands of `artiskill`. Whatever ends this script, the same command goes on.
Finished runs stay in docs/data/reinforcement.csv, also without the work folder; the tables are made from it.
"""

import argparse
import csv
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from artiskill.errors import ArtiSkillError
from artiskill.files import read_text
from artiskill.gallery.facts import markdown
from artiskill.jobs.parallel import available_cores
from learning_tables import curves
from learning_tables.cells import TASKS
from learning_tables.commands import finish, in_pool
from learning_tables.curves import POLICY
from learning_tables.markdown import read_marked, write_between
from learning_tables.results import read_cost, read_measured, read_rows, write_rows

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGE, EXPERTS = DOCS / "reinforcement_learning.md", DOCS / "data" / "experts.csv"
# beside the page
TABLE, CURVES = Path("data", "reinforcement.csv"), Path("data", "reinforcement_curves.csv")
PICTURE = Path("images", "reinforcement.png")
BEGIN, END = "<!-- made by tools/make_rl_tables.py -->", "<!-- end of the tables -->"
ONE, MANY, PLAIN = TABLES = ("one", "many", "plain")
CABINETS = ("OpenCabinetDoor", "OpenCabinetDrawer")
CABINET_VALUES, PLAIN_VALUES = ["config.state.handle=true"], ["config.state.handle=false"]
FREE_OBJECT_VALUES = ["config.state.relative=true"]
WITH_EXPERT = "sac-expert"
ALGORITHMS = ("sac", "ppo", WITH_EXPERT)
# what is set where no expert helps, and where one does; with noise, two hands drop what they carry
NO_EXPERT = ["algorithm.expert_share=0", "algorithm.action_entropy=-0.3"]
EXPERT_OF_CABINETS = ["algorithm.expert_share=0.25"]
EXPERT_OF_FREE_OBJECTS = ["algorithm.expert_share=0.5", "algorithm.action_entropy=-3"]
FREE_OBJECT_SAC = ["algorithm.gamma=0.98"]
COUNTS, MANY_TASK = (1, 5, 10, 20, 25), "OpenCabinetDrawer"
PAPER_MANY = {1: "100 %", 5: "82 %", 10: "2 %", 20: "0 %"}  # the ManiSkill paper, SAC, 10^6 steps
CSV_HEAD = [*POLICY, "steps", "minutes", "measured on", "episodes", "successes"]
STATES = {MANY: "with the handle", PLAIN: "the paper's"}
FIRST_LEVEL = 1_000_000  # training draws from 2^31 levels, so it hardly ever meets these
# of `sac` with many cabinets, of which each is then met in most batches
MANY_VALUES = ["algorithm.batch_size=256", "steps=500000"]
EPISODES = {ONE: 100, MANY: 10, PLAIN: 10}  # on each object
# objects and targets of table `one`: those that the expert solved in the fewest, the median and the most steps, or
# the median one. They stay when the expert changes: rows of other objects do not compare
GRADED = {
    "OpenCabinetDoor": [("cabinet-0059", "link_0"), ("cabinet-0064", "link_0"), ("cabinet-0029", "link_2")],
    "OpenCabinetDrawer": [("cabinet-0032", "link_0"), ("cabinet-0002", "link_0"), ("cabinet-0026", "link_0")],
    "PushChair": [("chair-0018", "")],
    "MoveBucket": [("bucket-0016", "")],
}


class Policy(NamedTuple):
    """One policy of the tables."""

    table: str
    task: str
    objects: tuple[str, ...]
    target: str  # empty: each episode draws one
    algorithm: str
    seed: int
    changed: tuple[str, ...] = ()  # KEY=VALUE

    @property
    def name(self) -> str:
        """The object, or how many there are."""
        return self.objects[0] if self.table == ONE else str(len(self.objects))

    def folder(self, work: Path) -> Path:
        """Where it is trained and measured."""
        changed = [",".join(self.changed)] * bool(self.changed)
        return Path(work, self.table, self.task, self.name, self.algorithm, *changed, f"seed-{self.seed}")

    @property
    def values(self) -> dict[str, str]:
        """What rows of CSV files begin with."""
        told = (self.table, self.task, self.name, self.target, self.algorithm, " ".join(self.changed), self.seed)
        return dict(zip(POLICY, map(str, told), strict=True))

    @property
    def splits(self) -> dict[str, tuple[str, ...]]:
        """What is measured, by name: the objects of training, and of many also the test objects."""
        return {"new": self.objects} | ({} if self.table == ONE else {"test": ("test",)})


def main(arguments: list[str]) -> int:
    """Train, measure, write; the exit status is 1 if a command failed, 2 if what is asked is not legal."""
    options = make_parser().parse_args(arguments)
    try:
        policies = list(wanted(options))
        read_marked(options.page, BEGIN, END)  # it will be written after hours
        succeeded = in_pool(lambda one: run(one, options.work), policies, options.jobs)
        write_tables(policies, options.work, options.page)
    except ArtiSkillError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return int(not succeeded)


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the script's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--work", type=Path, default=Path("results/reinforcement"), help="folder (default: %(default)s)")
    add("--page", type=Path, default=PAGE, help="with the two marks (default: docs/reinforcement_learning.md)")
    add("--tables", nargs="+", choices=TABLES, default=TABLES, help="(default: all)")
    add("--tasks", nargs="+", choices=TASKS, default=TASKS, metavar="TASK", help="of `one` (default: all four)")
    add(
        "--counts",
        nargs="+",
        type=int,
        choices=COUNTS,
        default=COUNTS,
        help="of `many` and `plain` (default: all)",
    )
    add("--algorithm", choices=ALGORITHMS, default="sac", help="(default: %(default)s)")
    add("--seeds", nargs="+", type=int, default=[0, 1, 2], help="(default: 0 1 2)")
    add("--steps", type=int, help="of each policy (default: those of algorithm and task)")
    add("--set", nargs="+", default=[], metavar="KEY=VALUE", help="as `artiskill train` takes it")
    add("--jobs", type=int, default=available_cores(), help="policies at once, a core each (default: all cores)")
    return parser


def wanted(options: argparse.Namespace) -> Iterator[Policy]:
    """Yield the first seed of everything first."""
    changed = (*([f"steps={options.steps}"] if options.steps else []), *options.set)
    for seed in options.seeds:
        for task in options.tasks if ONE in options.tables else ():
            for name, target in GRADED[task]:
                yield Policy(ONE, task, (name,), target, options.algorithm, seed, changed)
        for table in [name for name in (MANY, PLAIN) if name in options.tables]:
            for count in options.counts:
                names = tuple(name for name, _ in trained_on(MANY_TASK))[:count]
                yield Policy(table, MANY_TASK, names, "", options.algorithm, seed, changed)


def trained_on(task: str) -> list[tuple[str, str]]:
    """Return the training objects of a task by name, each with its first target."""
    rows = csv.DictReader(read_text(EXPERTS).splitlines())
    return sorted(
        (row["object"], row["solved of attempts, by target"].split()[0])
        for row in rows
        if row["task"] == task and row["split"] == "train"
    )


def run(policy: Policy, work: Path) -> bool:
    """Train and measure a policy, as far as that is missing; return whether all commands succeeded."""
    folder = policy.folder(work)
    results = {folder / split / "report.json": evaluate_command(policy, split, work) for split in policy.splits}
    return finish(folder, train_command(policy, work), results)


def train_command(policy: Policy, work: Path) -> list[str]:
    """Return the command that trains."""
    algorithm = policy.algorithm.partition("-")[0]
    command = ["train", algorithm, "--task", policy.task, "--objects", *policy.objects]
    command += ["--out", str(policy.folder(work) / "run"), "--seed", str(policy.seed), "--threads", "1"]
    command += ["--target", policy.target] if policy.target else []
    values = {one.partition("=")[0]: one for one in (*values_of(policy), *policy.changed)}
    return [*command, "--set", *values.values()]


def values_of(policy: Policy) -> list[str]:
    """Return what is set of a policy, also where it is the default of its task, but for what is changed of it."""
    algorithm, is_cabinet = policy.algorithm.partition("-")[0], policy.task in CABINETS
    values = PLAIN_VALUES if policy.table == PLAIN else CABINET_VALUES if is_cabinet else FREE_OBJECT_VALUES
    if algorithm == "sac":
        expert = EXPERT_OF_CABINETS if is_cabinet else EXPERT_OF_FREE_OBJECTS
        values = values + (expert if policy.algorithm == WITH_EXPERT else NO_EXPERT)
        values = values + ([] if is_cabinet else FREE_OBJECT_SAC) + (MANY_VALUES if policy.table != ONE else [])
    return values


def evaluate_command(policy: Policy, split: str, work: Path) -> list[str]:
    """Return the command that measures on new levels."""
    folder = policy.folder(work)
    command = ["evaluate", "--policy", str(folder / "run"), "--objects", *policy.splits[split]]
    command += ["--target", policy.target] if policy.target else []
    command += ["--first-level", str(FIRST_LEVEL), "--episodes", str(EPISODES[policy.table])]
    return [*command, "--out", str(folder / split), "--workers", "1"]


def rows_of(policies: Sequence[Policy], work: Path) -> Iterator[dict[str, str]]:
    """Yield a row of the CSV file per finished policy and split."""
    for policy in policies:
        folder = policy.folder(work)
        for split in policy.splits:
            if not (folder / "trained").is_file() or not (folder / split / "report.json").is_file():
                continue
            measured = read_measured(folder / split)
            steps, seconds = read_cost(folder / "run")
            own = {"steps": steps, "minutes": f"{float(seconds) / 60:.1f}", "measured on": split}
            counts = sum(measured.episodes.values()), sum(measured.successes.values())
            yield policy.values | own | dict(zip(CSV_HEAD[-2:], map(str, counts), strict=True))


def curves_of(policies: Sequence[Policy], work: Path) -> Iterator[dict[str, str]]:
    """Yield a row of the CSV file of curves per measurement of a finished policy's training."""
    for policy in policies:
        folder, counted = policy.folder(work), dict[str, list[tuple[int, int]]]()
        path = folder / "run" / "development.csv"
        if (folder / "trained").is_file() and path.is_file():
            for row in csv.DictReader(read_text(path).splitlines()):
                counted.setdefault(row["step"], []).append((int(row["episodes"]), int(row["successes"])))
        for step, counts in counted.items():
            totals = (str(sum(one)) for one in zip(*counts, strict=True))
            yield policy.values | dict(zip(curves.MEASURED, (step, *totals), strict=True))


def write_tables(policies: Sequence[Policy], work: Path, page: Path) -> None:
    """Write the CSV files, older rows included, the picture, and what stands between the marks of the page.

    Raises:
        ConfigError: the page cannot be read, or lacks the marks; a CSV file has other columns.
    """
    rows = merge(page.parent / TABLE, CSV_HEAD, [*POLICY, "measured on"], rows_of(policies, work))
    measured = merge(page.parent / CURVES, curves.CSV_HEAD, [*POLICY, "step"], curves_of(policies, work))
    write_between(page, BEGIN, END, tables_text(rows))
    if measured:  # last: it needs Matplotlib
        curves.draw(measured, page.parent / PICTURE)


def merge(path: Path, head: list[str], key: list[str], new: Iterator[dict[str, str]]) -> list[dict[str, str]]:
    """Add rows to a CSV file, in place of all of the same policies; return all of them, in the order of keys."""

    def policy_of(row: dict[str, str]) -> list[str]:
        return [row[name] for name in POLICY]

    added = list(new)
    anew = [policy_of(row) for row in added]
    kept = [row for row in read_rows(path, head) if policy_of(row) not in anew]
    rows = sorted((*kept, *added), key=lambda row: _by_number(row[name] for name in key))
    write_rows(path, [head, *([row[name] for name in head] for row in rows)])
    return rows


def _by_number(key: Iterable[str]) -> list[tuple[int, str]]:
    return [(int(one), "") if one.isdigit() else (0, one) for one in key]


def tables_text(rows: Sequence[dict[str, str]]) -> str:
    """Return the tables: of one object, and of many."""
    one = [row for row in rows if row["table"] == ONE]
    first = [
        [task, name, target or "any", _algorithm(*how), *_measured(chosen)]
        for (task, name, target, *how), chosen in _grouped(one, POLICY[1:6])
    ]
    many, second = [row for row in rows if row["table"] in STATES], []
    for (table, name, *how), chosen in _grouped(many, ["table", "objects", "algorithm", "changed"]):
        sides = {split: [row for row in chosen if row["measured on"] == split] for split in ("new", "test")}
        rates = [", ".join(_rates(side)) for side in sides.values()]
        paper, cost = PAPER_MANY.get(int(name), ""), _measured(sides["new"])[1:]
        second.append([name, STATES[table], _algorithm(*how), *rates, paper, *cost])
    costs = ["million steps, by seed", "minutes of a core"]
    head = ["task", "object", "target", "algorithm", "solved, by seed", *costs]
    parts = ["Nothing is measured yet."] if not rows else []
    parts += [markdown(head, first)] * bool(first)
    head = ["cabinets", "state", "algorithm", "solved, by seed", "test cabinets", "ManiSkill paper", *costs]
    return "\n\n".join([*parts, *[markdown(head, second)] * bool(second)])


def _grouped(
    rows: Sequence[dict[str, str]], names: Sequence[str]
) -> Iterator[tuple[list[str], list[dict[str, str]]]]:
    """Yield what rows have in common, and these rows by seed, in the order of what they have in common."""
    keys = sorted({tuple(row[name] for name in names) for row in rows}, key=_by_number)
    for key in keys:
        members = [row for row in rows if tuple(row[name] for name in names) == key]
        yield list(key), sorted(members, key=lambda row: int(row["seed"]))


def _algorithm(name: str, changed: str) -> str:
    return f"{name}, {changed}" if changed else name


def _measured(rows: Sequence[dict[str, str]]) -> list[str]:
    """Return the rates, millions of steps and minutes of rows."""
    steps = [f"{int(row['steps']) / 1e6:.2g}" for row in rows]
    return [", ".join(_rates(rows)), ", ".join(steps), ", ".join(f"{float(row['minutes']):.0f}" for row in rows)]


def _rates(rows: Sequence[dict[str, str]]) -> list[str]:
    return [f"{int(row['successes']) / int(row['episodes']):.0%}" for row in rows]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

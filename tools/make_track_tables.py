"""Make the table of generalising policies anew: `python tools/make_track_tables.py --jobs 2`.

Each policy is a track, a task and a seed: trained, exported, then measured on the standard protocols of `test` and
`ood`: its file acts with the same bits everywhere.
Everything is a command of `artiskill`, printed as it starts. Whatever ends this script, the same command goes on.
Policies whose rows are in the CSV file of the page are finished; with `--again`, the named ones are made again.
`--stages train` leaves the test objects alone until all policies are there; nothing is chosen by them.
"""

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.config import check
from artiskill.errors import ArtiSkillError, ConfigError
from artiskill.gallery.facts import markdown
from artiskill.jobs.parallel import available_cores
from artiskill.learning.train_config import DEVELOPMENT_SEEDS, ROLLOUT_SEEDS
from artiskill.learning.training_set import is_training_set, read_set_manifest
from artiskill.tasks.registry import task_spec
from learning_tables import commands
from learning_tables.cells import METHODS, TASKS, B, Settings
from learning_tables.commands import finish, in_pool
from learning_tables.markdown import MISSING, PAPER, chosen, names, range_text, read_marked, sum_of, write_between
from learning_tables.results import (
    PAPER_B,
    Measured,
    add_counts,
    read_csv_rows,
    read_measured,
    read_rows,
    rows_of_counts,
    write_rows,
)
from make_learning_tables import DEFAULTS, kept_settings
from make_learning_tables import TABLE as BASELINES
from make_rolled_cabinets import rolled_cabinets, write_folders
from make_scaled_objects import scaled_objects

PAGE = Path(__file__).resolve().parents[1] / "docs" / "generalization.md"
TABLE = Path("data", "tracks.csv")  # beside the page
BEGIN, END = "<!-- made by tools/make_track_tables.py -->", "<!-- end of the tracks -->"
BEGIN_SEEDS, END_SEEDS = "<!-- by seed, made by tools/make_track_tables.py -->", "<!-- end of the seeds -->"
SPLITS = ("test", "ood")
TRAIN, EVALUATE = STAGES = ("train", "evaluate")
NO_RESTRICTIONS, INTERACTIVE, NO_INTERACTIONS = "no-restrictions", "interactive-expert", "no-interactions"
TRACKS = {  # options of training; by DAgger, but for the last one
    NO_RESTRICTIONS: (),
    INTERACTIVE: ("--objects", "train"),
    NO_INTERACTIONS: ("--dev-objects", "none"),
}
CSV_HEAD = ["track", "task", "seed", "split", "object", "episodes", "successes"]
DOOR, CHAIR = "OpenCabinetDoor", "PushChair"
# options of training of one track and task
OTHERWISE = {(INTERACTIVE, "OpenCabinetDrawer"): ("--set", "network.input.velocities=true")}
POINTS, FRAME = "128", "robot"


class Imitation(NamedTuple):
    """What a policy of *no-interactions* learns from, and how."""

    algorithm: str = "command_bc"
    per_object: int = 40  # demonstrations
    method: str = "shares"  # by which points are chosen
    options: tuple[str, ...] = ()  # of training


IMITATION = {
    DOOR: Imitation(per_object=120),
    "OpenCabinetDrawer": Imitation(),
    "PushChair": Imitation("bc", method="maniskill", options=("--steps", "2000")),
    "MoveBucket": Imitation(),
}


class MadeObjects(NamedTuple):
    """Objects that policies of *no-restrictions* meet beside those of `train` and usual generated ones.

    Both are of two kinds: "train", which they train on, and "development", which choose the checkpoint.
    """

    objects: Callable[[str], Iterator[ArticulatedObject]]  # those of a kind
    words: str  # what they are
    generated: dict[str, str]  # seeds of the usual ones, by kind
    options: tuple[str, ...] = ()  # of training

    def lists(self, task: str, work: Path) -> dict[str, Path]:
        """Return the files that name them once they are made, by kind."""
        return {kind: work / "objects" / task / kind / "objects.yaml" for kind in self.generated}


ROLLED = {"train": "0..299", "development": DEVELOPMENT_SEEDS["cabinet"]}  # seeds
SCALED = {"train": ("train", "generated:chair:200..299"), "development": ("generated:chair:1000006..1000011",)}
LARGER = (1.05, 1.35)  # times their size
MADE = {
    DOOR: MadeObjects(
        lambda kind: rolled_cabinets(ROLLED[kind]),
        "generated cabinets on their side",
        {"train": ROLLOUT_SEEDS["cabinet"], "development": DEVELOPMENT_SEEDS["cabinet"]},
    ),
    CHAIR: MadeObjects(
        lambda kind: scaled_objects(SCALED[kind], CHAIR, LARGER),
        "larger chairs",
        {"train": ROLLOUT_SEEDS["chair"], "development": "1000000..1000005"},
        # the other half of the episodes: on those of `train`, and on larger ones
        ("--set", "algorithm.generated_share=0.5"),
    ),
}


class Policy(NamedTuple):
    """One policy of the table."""

    track: str
    task: str
    seed: int

    def folder(self, work: Path) -> Path:
        """Where it is trained and measured."""
        return work / self.track / self.task / f"seed-{self.seed}"

    def file(self, work: Path) -> Path:
        """What it is exported to."""
        return self.folder(work) / "policy.npz"

    def reports(self, work: Path) -> dict[str, Path]:
        """Return the folder of its report by split."""
        return {split: self.folder(work) / split for split in SPLITS}


def main(arguments: list[str]) -> int:
    """Train, measure, write; the exit status is 1 if a command failed, 2 if what is asked is not legal."""
    options = make_parser().parse_args(arguments)
    policies = [Policy(*one) for one in _product(options.tracks, options.tasks, options.seeds)]
    try:
        if options.jobs < 1:
            raise ConfigError(f"--jobs must be at least 1, not {options.jobs}")
        read_marked(options.page, BEGIN, END, BEGIN_SEEDS, END_SEEDS)  # it will be written after hours
        again = frozenset(policies if options.again else ())
        for policy in policies:
            if policy in again and is_finished(policy, options.work):
                print(f"taken as it is (remove it to train anew): {policy.folder(options.work)}", flush=True)
        known = read_all(options.work, options.page)
        missing = [one for one in policies if one in again or one not in known]
        if not missing:
            print("nothing to train or to measure: these rows are known; --again makes them anew", flush=True)
        failed = run_all(missing, options)
        write_table(options.work, options.page, again)
    except ArtiSkillError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return int(failed)


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the script's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--work", type=Path, default=Path("results/tracks"), help="folder (default: %(default)s)")
    add("--page", type=Path, default=PAGE, help="with the marks (default: docs/generalization.md)")
    add("--tracks", nargs="+", choices=TRACKS, default=list(TRACKS), metavar="TRACK", help="(default: all)")
    add("--tasks", nargs="+", choices=TASKS, default=TASKS, metavar="TASK", help="(default: all four)")
    add("--seeds", nargs="+", type=int, default=[0, 1, 2, 3, 4], help="(default: 0 1 2 3 4)")
    add("--stages", nargs="+", choices=STAGES, default=STAGES, help="(default: both)")
    add("--again", action="store_true", help="also those that have rows, which stay until new ones are there")
    add("--jobs", type=int, default=available_cores(), help="policies at once, a core each (default: all cores)")
    return parser


def _product(tracks: Sequence[str], tasks: Sequence[str], seeds: Sequence[int]) -> Iterator[tuple[str, str, int]]:
    """Yield the first seed of everything first."""
    for seed in seeds:
        for track in tracks:
            for task in tasks:
                yield track, task, seed


def run_all(policies: Sequence[Policy], options: argparse.Namespace) -> bool:
    """Run what is missing, several policies at once; return whether a command failed."""
    if TRAIN in options.stages:
        for task in sorted({one.task for one in policies if one.track == NO_INTERACTIONS}):
            if not all(commands.call(one, os.environ) for one in data_commands(task, options.work, options.jobs)):
                return True
        for task in sorted({one.task for one in policies if one.track == NO_RESTRICTIONS} & set(MADE)):
            make_objects(task, options.work)
    return not in_pool(lambda one: run(one, options.work, options.stages), policies, options.jobs)


def run(policy: Policy, work: Path, stages: Sequence[str]) -> bool:
    """Train and measure a policy, as far as that is missing; return whether all commands succeeded."""
    train = train_command(policy, work) if TRAIN in stages else None
    results = {policy.file(work): ["export-policy", str(policy.folder(work) / "run"), str(policy.file(work))]}
    if EVALUATE in stages:
        for split, report in policy.reports(work).items():
            results[report / "report.json"] = evaluate_command(policy, split, work)
    return finish(policy.folder(work), train, results)


def data_commands(task: str, work: Path, workers: int) -> list[list[str]]:
    """Return the commands that make a task's training set; none where it is there.

    Raises:
        ConfigError: it is there, and was made in another way.
    """
    demos, data, imitation = str(work / "demos" / task), str(work / "sets" / task), IMITATION[task]
    points = {"points": POINTS, "method": imitation.method, "frame": FRAME}
    options = [text for name, value in points.items() for text in (f"--{name}", value)]
    if is_training_set(Path(data)):
        held = read_set_manifest(Path(data))
        of_set = {"points": held.sampling["num_points"], **held.sampling}
        found = [text for name in points for text in (f"--{name}", str(of_set[name]))]
        check(found == options, f"{data!r} was made with {' '.join(found)}, not {' '.join(options)}: remove it")
        many = held.trajectories / len(held.objects)
        check(
            many == imitation.per_object,
            f"{data!r} has {many:g} demonstrations of each object, not {imitation.per_object}",
        )
        return []
    common, per_object = ["--workers", str(workers)], str(imitation.per_object)
    return [
        ["demos", "collect", "--task", task, "--per-object", per_object, "--out", demos, *common],
        ["training-set", demos, "--out", data, *options, *common],
    ]


def make_objects(task: str, work: Path) -> None:
    """Make the objects of `MADE` that are missing."""
    made = MADE[task]
    for kind, path in made.lists(task, work).items():
        if not path.is_file():  # it is written last
            write_folders(made.objects(kind), path, made.words)


def objects_options(task: str, work: Path) -> list[str]:
    """Return the options of training that name all objects, those of `MADE` included."""
    made, category = MADE[task], task_spec(task).category
    named = {
        kind: [f"generated:{category}:{made.generated[kind]}", str(path)]
        for kind, path in made.lists(task, work).items()
    }
    return ["--objects", "train", *named["train"], "--dev-objects", *named["development"], *made.options]


def train_command(policy: Policy, work: Path) -> list[str]:
    """Return the command that trains."""
    learns_alone = policy.track == NO_INTERACTIONS
    name = IMITATION[policy.task].algorithm if learns_alone else "dagger"
    out = str(policy.folder(work) / "run")
    command = ["train", name, "--task", policy.task, "--out", out, *TRACKS[policy.track]]
    if learns_alone:
        command += ["--data", str(work / "sets" / policy.task), *IMITATION[policy.task].options]
    command += OTHERWISE.get((policy.track, policy.task), ())
    if policy.track == NO_RESTRICTIONS and policy.task in MADE:
        command += objects_options(policy.task, work)
    return [*command, "--seed", str(policy.seed), "--threads", "1", "--workers", "1"]


def evaluate_command(policy: Policy, split: str, work: Path) -> list[str]:
    """Return the command that measures on a split."""
    protocol = f"artiskill-1/{policy.task}/{split}/joint/pointcloud"
    command = ["evaluate", "--policy", str(policy.file(work)), "--protocol", protocol]
    return [*command, "--track", policy.track, "--out", str(policy.reports(work)[split]), "--workers", "1"]


def read_csv(path: Path) -> dict[Policy, dict[str, Measured]]:
    """Return what a CSV file says that policies reached, by split; nothing if there is none.

    Raises:
        ConfigError: it has other columns.
    """
    found: dict[Policy, dict[str, Measured]] = {}
    for row in read_rows(path, CSV_HEAD):
        splits = found.setdefault(Policy(row["track"], row["task"], int(row["seed"])), {})
        add_counts(splits, row["split"], row)
    return found


def read_all(work: Path, page: Path, again: frozenset[Policy] = frozenset()) -> dict[Policy, dict[str, Measured]]:
    """Return what finished policies reached, by split: those of the CSV file, then those of the work folder.

    Of those in `again`, the folder's reports win over the file's rows. A policy that lacks a split in the file is
    left out, to be measured again; so is one of the folder that another command has trained.
    """
    known = read_csv(page.parent / TABLE)
    found = {policy: splits for policy, splits in known.items() if set(splits) >= set(SPLITS)}
    for track in TRACKS:
        for task in TASKS:
            names = (path.name.removeprefix("seed-") for path in (work / track / task).glob("seed-*"))
            for policy in (Policy(track, task, int(name)) for name in names if name.isdecimal()):
                if (policy in again or policy not in found) and is_finished(policy, work):
                    found[policy] = {split: read_measured(path) for split, path in policy.reports(work).items()}
    return dict(sorted(found.items(), key=_order))


def is_finished(policy: Policy, work: Path) -> bool:
    """Return whether the work folder has a policy's reports, and today's command has trained it."""
    files = [path / "report.json" for path in policy.reports(work).values()]
    return commands.is_finished(policy.folder(work), train_command(policy, work), files)


def _order(item: tuple[Policy, object]) -> tuple[int, int, int]:
    track, task, seed = item[0]
    return list(TRACKS).index(track), TASKS.index(task), seed


def table_text(found: dict[Policy, dict[str, Measured]], page: Path) -> str:
    """Return the table: a row per track and split, then one per baseline; a column per task."""
    rows = []
    for track in TRACKS:
        for split in SPLITS:
            cells = []
            for task in TASKS:
                seeds = [one[split] for policy, one in found.items() if policy[:2] == (track, task)]
                cells.append(_cell(seeds))
            rows.append([track, split, *cells])
    return markdown(["track, or baseline", "objects", *TASKS], [*rows, *_baseline_rows(page)])


def seeds_text(found: dict[Policy, dict[str, Measured]]) -> str:
    """Return the table of solved episodes by training seed: a row per track and split, a column per task."""
    rows = []
    for track in TRACKS:
        for split in SPLITS:
            cells = []
            for task in TASKS:
                seeds = {p.seed: one[split] for p, one in found.items() if p[:2] == (track, task)}
                cells.append(_solved_cell(seeds) if seeds else MISSING)
            rows.append([track, split, *cells])
    return markdown(["solved, by training seed", "objects", *TASKS], rows)


def _solved_cell(seeds: dict[int, Measured]) -> str:
    """Return the numbers of solved episodes; seeds are named unless they are 0, 1, 2 and so on."""
    counts = [(one.successes.total(), one.episodes.total()) for one in seeds.values()]
    episodes = {total for _, total in counts}
    if len(episodes) > 1:
        text = ", ".join(f"{solved} of {total}" for solved, total in counts)
    else:
        text = f"{', '.join(str(solved) for solved, _ in counts)} of {episodes.pop()}"
    in_order = list(seeds) == list(range(len(seeds)))
    return text if in_order else f"{text} (seeds {', '.join(map(str, seeds))})"


def _baseline_rows(page: Path) -> Iterator[list[str]]:
    """Yield a row per method of docs/learning.md that was measured, then the paper's: rates over all seeds."""
    path = page.parent / BASELINES
    found = read_csv_rows(path, Settings(**(DEFAULTS | kept_settings(path.parent))))
    for method in METHODS:
        tasks = [[one.measured["test"] for one in chosen(found, B, method, task)] for task in TASKS]
        if any(tasks):
            cells = [f"{sum_of(seeds).rate:.0%}" if seeds else MISSING for seeds in tasks]
            yield [", ".join(names(method)), "test", *cells]
    for method, rates in PAPER_B.items():
        cells = [f"{on_test:.0%}" for _, on_test in rates]
        yield [", ".join(names(method, PAPER)), "its own", *cells]


def _cell(seeds: Sequence[Measured]) -> str:
    """Return the mean over seeds, its spread, and the interval for unseen objects in general."""
    if not seeds:
        return MISSING
    rates = [one.rate for one in seeds]
    interval = sum_of(seeds).objects_interval
    spread = f" ± {np.std(rates, ddof=1):.1%}" if len(rates) > 1 else ""
    bounds = "" if interval is None else f" ({range_text(interval)})"
    return f"{np.mean(rates):.1%}{spread}{bounds}, {len(rates)} seed{'s' * (len(rates) > 1)}"


def write_table(work: Path, page: Path, again: frozenset[Policy] = frozenset()) -> None:
    """Write the CSV file and what stands between the marks of the page, of all that is finished.

    `again` is as of `read_all`.

    Raises:
        ConfigError: the page cannot be read, or lacks the marks.
    """
    found = read_all(work, page, again)
    write_rows(page.parent / TABLE, [CSV_HEAD, *rows_of_counts(found)])
    write_between(page, BEGIN, END, table_text(found, page))
    write_between(page, BEGIN_SEEDS, END_SEEDS, seeds_text(found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

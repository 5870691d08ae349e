"""Say what makes policies generalise: `python tools/make_variant_tables.py --jobs 2`.

DAgger on drawers: with other numbers of training objects and as many samples (96,000; with 1,600 objects, some 500
of them are never met), or with one thing changed at a time, from `ABLATION_SAMPLES`: with more, little is left to
gain.
Each variant is trained, then measured on generated cabinets that no policy trains on, and those of `COUNTS` also
on `test` and `ood`, by commands of `artiskill` that are printed. Whatever ends it, the same command goes on.
Variants whose rows are in docs/data/variants.csv are finished, also without the work folder.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from artiskill.errors import ArtiSkillError
from artiskill.gallery.facts import markdown
from artiskill.jobs.parallel import available_cores
from learning_tables.commands import finish, in_pool, is_finished
from learning_tables.markdown import range_text, read_marked, sum_of, write_between
from learning_tables.results import Measured, add_counts, read_measured, read_rows, rows_of_counts, write_rows
from make_track_tables import SPLITS

PAGE = Path(__file__).resolve().parents[1] / "docs" / "recipes.md"
TABLE = Path("data", "variants.csv")  # beside the page
BEGIN, END = "<!-- made by tools/make_variant_tables.py -->", "<!-- end of the variants -->"
TASK, NEW = "OpenCabinetDrawer", "generated"
NEW_OBJECTS, NEW_EPISODES = "generated:cabinet:7000000..7000059", 4  # nothing was chosen by these
ABLATION_SAMPLES = 38400  # in 8 rounds
# key -> what is changed, and the options that change it
ABLATIONS: dict[str, tuple[str, list[str]]] = {
    "as-it-is": ("nothing", []),
    "no-dagger": ("the expert alone acts: behaviour cloning", ["--set", "algorithm.expert_rounds=20"]),
    "one-kind": ("one command, not one for each kind", ["--set", "algorithm.one_kind=true"]),
    "base-frame": ("points in the base's frame alone", ["--set", "network.input.frames=[robot]"]),
    "hand-frame": ("points in the hand's frame alone", ["--set", "network.input.frames=[tool]"]),
    "32-points": ("32 points", ["--points", "32"]),
    "512-points": ("512 points", ["--points", "512"]),
    "half-width": (
        "a network half as wide",
        ["--set", "network.point_layers=[32,64,128]", "network.head=[256,128]"],
    ),
    "bc-network": ("the network of `bc`", ["--network", "small"]),
}
# the policies of the tables see velocities, as all of drawers did at first; with the network of `bc` none does
SEEN = ("--set", "network.input.velocities=true")
COUNTS = {25: 37, 100: 148, 400: 594, 1600: 2237}  # cabinets with drawers, and the seed of the last, from 0 on
_NAMES = [*map(str, COUNTS), *ABLATIONS]
CSV_HEAD = ["table", "variant", "seed", "measured on", "object", "episodes", "successes"]


class Variant(NamedTuple):
    """One policy of the tables: of an ablation by its key, or of a number of generated objects."""

    table: str  # ablations or counts
    name: str
    seed: int

    def folder(self, work: Path) -> Path:
        """Where it is trained and measured."""
        return work / self.table / self.name / f"seed-{self.seed}"

    @property
    def measured_on(self) -> tuple[str, ...]:
        """What success is measured on."""
        return (NEW,) if self.table == "ablations" else (NEW, *SPLITS)


Found = dict[Variant, dict[str, Measured]]


def main(arguments: list[str]) -> int:
    """Train, measure, write; the exit status is 1 if a command failed, 2 if what is asked is not legal."""
    options = make_parser().parse_args(arguments)
    wanted = list(wanted_of(options))
    try:
        read_marked(options.page, BEGIN, END)  # it will be written after hours
        known = read_all(wanted, options.work, options.page)
        missing = [one for one in wanted if one not in known]
        succeeded = in_pool(lambda one: run(one, options.work), missing, options.jobs)
        write_tables(read_all(wanted, options.work, options.page), options.page)
    except ArtiSkillError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return int(not succeeded)


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the script's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--work", type=Path, default=Path("results/variants"), help="folder (default: %(default)s)")
    add("--page", type=Path, default=PAGE, help="with the marks (default: docs/recipes.md)")
    keys = {"choices": list(ABLATIONS), "default": list(ABLATIONS), "metavar": "KEY"}
    add("--ablations", nargs="*", **keys, help=f"{', '.join(ABLATIONS)} (default: all)")
    add("--counts", nargs="*", type=int, choices=COUNTS, default=COUNTS, help="(default: all)")
    add("--seeds", nargs="+", type=int, default=[0], help="(default: 0)")
    add("--jobs", type=int, default=available_cores(), help="policies at once, a core each (default: all cores)")
    return parser


def wanted_of(options: argparse.Namespace) -> Iterator[Variant]:
    """Yield the first seed of everything first."""
    for seed in options.seeds:
        yield from (Variant("counts", str(count), seed) for count in options.counts)
        yield from (Variant("ablations", key, seed) for key in options.ablations)


def run(variant: Variant, work: Path) -> bool:
    """Train and measure a variant, as far as that is missing; return whether all commands succeeded."""
    folder = variant.folder(work)
    results = {
        folder / name / "report.json": evaluate_command(variant, name, work) for name in variant.measured_on
    }
    return finish(folder, train_command(variant, work), results)


def train_command(variant: Variant, work: Path) -> list[str]:
    """Return the command that trains."""
    command = ["train", "dagger", "--task", TASK, "--out", str(variant.folder(work) / "run")]
    if variant.table == "counts":
        command += ["--objects", f"generated:cabinet:0..{COUNTS[int(variant.name)]}"]
    else:
        command += ["--samples", str(ABLATION_SAMPLES), *ABLATIONS[variant.name][1]]
    if "--network" not in command:
        command += SEEN
    return [*command, "--seed", str(variant.seed), "--threads", "1", "--workers", "1"]


def evaluate_command(variant: Variant, name: str, work: Path) -> list[str]:
    """Return the command that measures on generated cabinets, or on a split by its protocol."""
    folder = variant.folder(work)
    what = ["--protocol", f"artiskill-1/{TASK}/{name}/joint/pointcloud"]
    if name == NEW:
        what = ["--objects", NEW_OBJECTS, "--episodes", str(NEW_EPISODES)]
    return ["evaluate", "--policy", str(folder / "run"), *what, "--out", str(folder / name), "--workers", "1"]


def read_all(wanted: Sequence[Variant], work: Path, page: Path) -> Found:
    """Return what finished variants reached: known ones of the CSV file, and the wanted ones of the work folder.

    Raises:
        ConfigError: the file has other columns.
    """
    found: Found = {}
    for row in read_rows(page.parent / TABLE, CSV_HEAD):
        variant = Variant(row["table"], row["variant"], int(row["seed"]))
        if variant.name not in _NAMES:
            continue
        add_counts(found.setdefault(variant, {}), row["measured on"], row)
    for variant in wanted:
        reports = {name: variant.folder(work) / name for name in variant.measured_on}
        files = [path / "report.json" for path in reports.values()]
        if is_finished(variant.folder(work), train_command(variant, work), files):
            found[variant] = {name: read_measured(path) for name, path in reports.items()}
    return {variant: sides for variant, sides in found.items() if set(sides) >= set(variant.measured_on)}


def write_tables(found: Found, page: Path) -> None:
    """Write the CSV file and what stands between the marks of the page.

    Raises:
        ConfigError: the page cannot be read, or lacks the marks.
    """
    texts = {"counts": counts_text, "ablations": ablations_text}
    tables = [text for table, text in texts.items() if any(variant.table == table for variant in found)]
    write_between(page, BEGIN, END, "\n\n".join(text(found) for text in tables) or "Nothing is measured yet.")
    ordered = sorted(found.items(), key=lambda item: (_NAMES.index(item[0].name), item[0].seed))
    write_rows(page.parent / TABLE, [CSV_HEAD, *rows_of_counts(dict(ordered))])


def counts_text(found: Found) -> str:
    """Return the table of numbers of training objects."""
    rows = []
    for count in COUNTS:
        chosen = [sides for variant, sides in found.items() if variant[:2] == ("counts", str(count))]
        if chosen:
            rows.append([f"{count:,}", *(_cell([sides[name] for sides in chosen]) for name in (NEW, *SPLITS))])
    return markdown(["generated cabinets to train on", "other generated ones", *SPLITS], rows)


def ablations_text(found: Found) -> str:
    """Return the table of ablations."""
    rows = []
    for key, (text, _) in ABLATIONS.items():
        chosen = [sides[NEW] for variant, sides in found.items() if variant[:2] == ("ablations", key)]
        if chosen:
            rows.append([text, _cell(chosen)])
    return markdown(["changed", "other generated cabinets"], rows)


def _cell(seeds: Sequence[Measured]) -> str:
    """Return the rate over the episodes of all seeds, and the interval for unseen objects in general."""
    total = sum_of(seeds)
    bounds = f" ({range_text(total.objects_interval)})" if total.objects_interval else ""
    return f"{total.rate:.1%}{bounds}" + (f", {len(seeds)} seeds" if len(seeds) > 1 else "")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

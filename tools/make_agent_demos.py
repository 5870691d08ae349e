"""Divide and conquer, as an example: `python tools/make_agent_demos.py --jobs 2`.

An agent per object learns to open one drawer (`sac-expert` of make_rl_tables.py, whose finished runs are used), is
measured on new levels, and demonstrates; its demonstrations are played again and compared bit for bit. What each
object costs goes to docs/data/agent_demos.csv and into docs/reinforcement_learning.md. Whatever ends this script,
the same command goes on.
"""

import argparse
import itertools
import json
import shutil
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import make_rl_tables
from artiskill.config import check
from artiskill.errors import ArtiSkillError
from artiskill.files import atomic_write, file_sha256, parse_json, read_bytes
from artiskill.gallery.facts import markdown
from artiskill.jobs.parallel import available_cores
from learning_tables import commands
from learning_tables.commands import in_pool
from learning_tables.markdown import read_marked, write_between
from learning_tables.results import read_cost, read_measured, read_rows, write_rows
from make_rl_tables import ALGORITHMS, MANY_TASK, ONE, PAGE, WITH_EXPERT, Policy, trained_on

TABLE = Path("data", "agent_demos.csv")  # beside the page
BEGIN, END = "<!-- made by tools/make_agent_demos.py -->", "<!-- end of the agents' demonstrations -->"
OBJECTS, PER_OBJECT = 10, 300
CSV_HEAD = ["object", "target", "algorithm", "training steps", "training seconds", "episodes", "successes"]
CSV_HEAD += ["asked for", "demonstrations", "attempts", "steps", "bytes", "collecting seconds"]
HEAD = ["object", "target", "algorithm", "thousand steps of training", "minutes", "solved of new levels"]
HEAD += ["demonstrations of attempts", "steps each", "kB each", "seconds of collecting"]
COST = "cost.json"  # beside the demonstrations, once they are verified


def main(arguments: list[str]) -> int:
    """Train, measure, collect, verify, write; exit status 1 if a command failed, 2 for an illegal option."""
    options = make_parser().parse_args(arguments)
    try:
        check(options.objects >= 0, f"--objects must be at least 0, not {options.objects}")
        check(options.per_object >= 1, f"--per-object must be at least 1, not {options.per_object}")
        asked = {row["asked for"] for row in read_rows(options.page.parent / TABLE, CSV_HEAD)}
        check(
            asked <= {str(options.per_object)},
            f"the table has agents of whom {', '.join(sorted(asked))} demonstrations were asked, not "
            f"{options.per_object}: name another --page and --work",
        )
        read_marked(options.page, BEGIN, END)  # it will be written after hours
        first = trained_on(MANY_TASK)[: options.objects]
        agents = [Policy(ONE, MANY_TASK, (name,), target, options.algorithm, 0) for name, target in first]
        succeeded = in_pool(lambda agent: run(agent, options), agents, options.jobs)
        write_table([agent for agent in agents if (demos_of(agent, options.work) / COST).is_file()], options)
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
    add("--objects", type=int, default=OBJECTS, help="the first ones of training (default: %(default)s)")
    add("--algorithm", choices=ALGORITHMS, default=WITH_EXPERT, help="(default: %(default)s)")
    add("--per-object", type=int, default=PER_OBJECT, help="demonstrations (default: %(default)s)")
    add("--jobs", type=int, default=available_cores(), help="agents at once, a core each (default: all cores)")
    return parser


def run(agent: Policy, options: argparse.Namespace) -> bool:
    """Train and measure an agent and have it demonstrate, as far as that is missing; return whether all worked."""
    return make_rl_tables.run(agent, options.work) and demonstrate(agent, options.work, options.per_object)


def demonstrate(agent: Policy, work: Path, per_object: int) -> bool:
    """Collect what is asked for and verify it, unless that is there; what an interruption left is made anew.

    An agent that solves too little gives up, as `artiskill demos collect` has it: its row says how far it got.
    """
    folder, environment = demos_of(agent, work), commands.one_thread()
    cost, counted = folder / COST, folder / "stats.json"
    weights = file_sha256(agent.folder(work) / "run" / "checkpoints" / "best.pt")
    if cost.is_file():
        found = parse_json(read_bytes(cost))
        if (found.get("weights"), found.get("asked for")) == (weights, per_object):
            return True
    shutil.rmtree(folder, ignore_errors=True)
    began = time.perf_counter()
    collected = commands.call(collect_command(agent, work, per_object), environment)
    seconds = time.perf_counter() - began
    count = ["demos", "stats", str(folder), "--json", str(counted)]
    if not folder.is_dir() or not commands.call(count, environment):
        return False
    (told,) = parse_json(read_bytes(counted))
    (row,) = told["objects"]
    if not collected and not row["gave_up"]:
        return False
    if not commands.call(["demos", "verify", str(folder), "--workers", "1"], environment):
        return False
    values = {
        "weights": weights,
        "asked for": per_object,
        "demonstrations": row["trajectories"],
        "attempts": row["attempts"],
        "steps": round(row["trajectories"] * row["mean_length"]),
        "bytes": round(row["trajectories"] * row["bytes_per_trajectory"]),
        "collecting seconds": round(seconds, 1),
    }
    with atomic_write(cost) as temporary:
        temporary.write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")
    return True


def demos_of(agent: Policy, work: Path) -> Path:
    """Return the folder of an agent's demonstrations."""
    return work / "demos" / agent.task / agent.name / agent.algorithm


def collect_command(agent: Policy, work: Path, per_object: int) -> list[str]:
    """Return the command that has an agent demonstrate."""
    command = ["demos", "collect", "--task", agent.task, "--objects", agent.name, "--targets", agent.target]
    command += ["--policy", str(agent.folder(work) / "run"), "--per-object", str(per_object)]
    return [*command, "--out", str(demos_of(agent, work)), "--workers", "1"]


def write_table(agents: Sequence[Policy], options: argparse.Namespace) -> None:
    """Write the CSV file, with its rows of other agents, and the page's table.

    Raises:
        ConfigError: the page cannot be read, or lacks the marks; the CSV file has other columns.
    """
    path = options.page.parent / TABLE
    known = [*read_rows(path, CSV_HEAD), *(row_of(agent, options.work) for agent in agents)]
    found = {(row["algorithm"], row["object"]): row for row in known}  # the new ones last: they stay
    rows = [found[key] for key in sorted(found)]
    write_rows(path, [CSV_HEAD, *([row[name] for name in CSV_HEAD] for row in rows)])
    write_between(options.page, BEGIN, END, table_text(rows))


def row_of(agent: Policy, work: Path) -> dict[str, str]:
    """Return the row of an object whose agent has demonstrated."""
    measured = read_measured(agent.folder(work) / "new")
    steps, seconds = read_cost(agent.folder(work) / "run")
    row = {"object": agent.name, "target": agent.target, "algorithm": agent.algorithm}
    row |= {"training steps": steps, "training seconds": seconds}
    row |= {"episodes": str(measured.episodes.total()), "successes": str(measured.successes.total())}
    return row | {name: str(value) for name, value in parse_json(read_bytes(demos_of(agent, work) / COST)).items()}


def table_text(rows: Sequence[dict[str, str]]) -> str:
    """Return the table: below the objects of an algorithm, all of them together."""
    if not rows:
        return "Nothing is measured yet."
    cells = []
    for algorithm, group in itertools.groupby(rows, key=lambda row: row["algorithm"]):
        members = list(group)
        cells += [_cells([row], row["object"], row["target"], algorithm) for row in members]
        cells.append(_cells(members, f"all {len(members)}", "", algorithm))
    return markdown(HEAD, cells)


def _cells(rows: Sequence[dict[str, str]], name: str, target: str, algorithm: str) -> list[str]:
    """Return the cells of a row of the page, of one object or of several together."""
    total = {key: sum(float(row[key]) for row in rows) for key in CSV_HEAD[3:]}
    made = total["demonstrations"]
    each = [f"{total['steps'] / made:.0f}", f"{total['bytes'] / made / 1000:.1f}"] if made else ["", ""]
    return [
        *(name, target, algorithm),
        *(f"{total['training steps'] / 1000:,.0f}", f"{total['training seconds'] / 60:.1f}"),
        *(f"{total['successes'] / total['episodes']:.0%}", f"{made:,.0f} of {total['attempts']:,.0f}"),
        *(*each, f"{total['collecting seconds']:,.0f}"),
    ]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""What came of collecting, verifying and counting demonstrations, as tables for a terminal."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from artiskill.cli.table import make_console, make_table

if TYPE_CHECKING:
    from artiskill.demos.demos import FileEntry, Manifest
    from artiskill.demos.file_format import TargetCount
    from artiskill.demos.plan import CollectionPlan
    from artiskill.demos.settings import Settings
    from artiskill.demos.stats import ObjectStats, Stats
    from artiskill.demos.training_file import TrainingEntry, TrainingManifest
    from artiskill.demos.verify import VerifyResult

COLLECTED = "collected"
_MOST_FAULTS = 5  # of a file


def print_collection(plan: "CollectionPlan", manifest: "Manifest", folder: Path) -> bool:
    """Print a row per object of a plan, and a line about each target with faults, or that was given up.

    Returns:
        Whether any was given up.
    """
    from artiskill.demos.demos import file_name

    console, table = make_console(), make_table(["object"], ["targets", "solved", "attempts", "rate", "kB each"])
    entries = [manifest.files[file_name(one.id)] for one in plan.objects]
    for entry in entries:
        table.add_row(entry.object, str(len(entry.targets)), *_counts([entry]))
    table.add_section()
    table.add_row("all", "", *_counts(entries), style="bold")
    console.print(table)
    for entry in entries:
        for count in entry.targets:
            if count.gave_up or count.faults:
                console.print(_trouble(entry.object, count), soft_wrap=True)
    console.print(f"demonstrations: {folder}", soft_wrap=True)
    return any(count.gave_up for entry in entries for count in entry.targets)


def print_verify_results(results: Sequence["VerifyResult"]) -> None:
    """Print a row per file, and what is wrong."""
    from rich.markup import escape

    console, table = make_console(), make_table(["file"], ["trajectories", "steps", "bit-exact", "faults"])
    for result in results:
        path = Path(result.path)
        share = f"{result.exact}/{result.trajectories}"
        style = "bold red" if result.faults else ""
        cells = (str(result.trajectories), str(result.steps), share, str(len(result.faults)))
        table.add_row(f"{path.parent.name}/{path.name}", *cells, style=style)
    console.print(table)
    for result in results:
        for fault in result.faults[:_MOST_FAULTS]:
            console.print(f"[bold red]{escape(Path(result.path).name)}[/]: {escape(fault)}", soft_wrap=True)
        if len(result.faults) > _MOST_FAULTS:
            console.print(f"... and {len(result.faults) - _MOST_FAULTS} more faults of this file")
    trajectories, exact = sum(v.trajectories for v in results), sum(v.exact for v in results)
    faulty = sum(bool(v.faults) for v in results)
    summary = f"[bold red]{faulty} of {len(results)} files fail[/]" if faulty else "[bold]all is as recorded[/]"
    if results:
        console.print(f"{exact} of {trajectories} trajectories bit-exact: {summary}", soft_wrap=True)
    else:
        console.print("there are no files yet: nothing was compared")


def print_stats(stats: "Stats") -> None:
    """Print a row per object."""
    settings = stats.settings
    table = make_table(
        ["object"], ["stored", "attempts", "solved", "steps", "from .. to", "kB each", "base", "object"]
    )
    for one in stats.objects:
        table.add_row(one.object, *_stats_cells(one))
    console = make_console()
    console.print(table)
    trajectories, objects = _number(stats.trajectories, "trajectory", "trajectories"), len(stats.objects)
    console.print(
        f"[bold]{settings.task}[/bold], {settings.control_mode}: {trajectories} of "
        f"{_number(objects, 'object', 'objects')}, {stats.success_rate:.1%} of the attempts solved, "
        f"{stats.mean_length:.1f} steps and {stats.bytes_per_trajectory / 1000:.1f} kB each",
        soft_wrap=True,
    )


def print_replay(manifest: "TrainingManifest", folder: Path, frames: int, seconds: float) -> None:
    """Print a row per training file, and how fast they were made."""
    table = make_table(["object"], ["replayed", "solved", "bit-exact", "clipped", "kept", "frames", "MB"])
    entries, restored = list(manifest.files.values()), manifest.settings.way == "restore"
    for entry in entries:
        table.add_row(entry.object, *_replay_cells([entry], restored))
    table.add_section()
    table.add_row("all", *_replay_cells(entries, restored), style="bold")
    console = make_console()
    console.print(table)
    if frames:
        console.print(f"{frames} frames in {seconds:.1f} s, {frames / seconds:.0f} per second")
    settings = manifest.settings
    others = sum(entry.counts.replayed - entry.counts.exact for entry in entries)
    if others and not restored and settings.control_mode == settings.source.control_mode:
        console.print(
            f"[bold red]{others} of {sum(entry.counts.replayed for entry in entries)}[/] trajectories came out "
            "otherwise than recorded; those that are solved are kept, with what happens now",
            soft_wrap=True,
        )
    console.print(f"training files: {folder}", soft_wrap=True)


def note_unfinished(folder: Path, doing: str = COLLECTED) -> None:
    """Print a line if what is being done in a folder has not come to its end, and one if files lie beside it."""
    from artiskill.demos.demos import unfinished_objects, unlisted_files

    count = len(unfinished_objects(folder))
    if count:
        objects = "1 object is" if count == 1 else f"{count} objects are"
        print(f"{folder} is not finished: {objects} still to be {doing}, and not counted here")
    others = ", ".join(path.name for path in unlisted_files(folder))
    if others and doing == COLLECTED:
        print(
            f"{folder}: {others}: not in the manifest, and not counted here; the next `collect` takes in what fits"
        )


def _trouble(object_id: str, count: "TargetCount") -> str:
    """Why there is less than was wanted, or what had to be tried again."""
    from rich.markup import escape

    solved = f"{count.successes} of {_number(count.wanted, 'trajectory', 'trajectories')}"
    tried = _number(count.attempts, "attempt", "attempts")
    reasons = [f"given up after {tried}, {solved}"] if count.gave_up else []
    if count.faults:
        faults = ", ".join(f"{number} by {kind}" for kind, number in count.faults.items())
        reasons.append(f"ended before their end, of {tried}: {faults}")
    return f"[bold red]{object_id}, {escape(count.target)}[/]: {'; '.join(reasons)}"


def _number(count: int, one: str, more: str) -> str:
    """So many of something."""
    return f"{count} {one if count == 1 else more}"


def note_versions(folder: Path, settings: "Settings") -> None:
    """Print a line if a collection was made with other versions than those that are here."""
    differing = settings.other_versions
    if differing:
        print(f"{folder} was collected with other versions, which may give other bits: {differing}")


def _replay_cells(entries: Sequence["TrainingEntry"], restored: bool) -> list[str]:
    counts = [entry.counts for entry in entries]
    replayed, steps = sum(c.replayed for c in counts), sum(c.steps for c in counts)
    clipped, exact = sum(c.clipped for c in counts), sum(c.exact for c in counts)
    return [
        str(replayed),
        f"{sum(c.solved for c in counts)}",
        str(exact) if exact or not restored else "-",  # restored ones are if the file has every state exactly
        f"{clipped / steps:.1%}" if steps else "-",
        str(sum(entry.trajectories for entry in entries)),
        str(sum(entry.frames for entry in entries)),
        f"{sum(entry.bytes for entry in entries) / 1e6:.1f}",
    ]


def _stats_cells(one: "ObjectStats") -> list[str]:
    return [
        str(one.trajectories),
        str(one.attempts),
        f"{one.success_rate:.0%}",
        f"{one.mean_length:.1f}",
        f"{one.shortest} .. {one.longest}",
        f"{one.bytes_per_trajectory / 1000:.1f}",
        f"{one.base_coverage:.0%}",
        f"{one.object_coverage:.0%}",
    ]


def _counts(entries: Sequence["FileEntry"]) -> list[str]:
    counts = [count for entry in entries for count in entry.targets]
    wanted, successes = sum(c.wanted for c in counts), sum(c.successes for c in counts)
    attempts, stored = sum(c.attempts for c in counts), sum(entry.trajectories for entry in entries)
    size = sum(entry.bytes for entry in entries) / stored / 1000 if stored else 0.0
    rate = f"{successes / attempts:.0%}" if attempts else "-"
    return [f"{successes}/{wanted}", str(attempts), rate, f"{size:.1f}" if stored else "-"]

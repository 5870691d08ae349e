"""Reports on disk: JSON, CSV, Markdown and the resolved configuration; each file appears whole or not at all."""

import csv
import io
import json
import os
import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path

from artiskill.config import dump_yaml
from artiskill.errors import ConfigError
from artiskill.evaluation.report import Report, Tally
from artiskill.files import lock_folder, output_path

REPORT_FILES = ("config.yaml", "episodes.csv", "report.csv", "report.md", "report.json")


def write_report(report: Report, folder: Path | str) -> Path:
    """Write the files of `REPORT_FILES`; those of an earlier report are replaced, other files left alone.

    Everything is written under a temporary name first. report.json comes last: where it is new, all others are.

    Returns:
        The folder.

    Raises:
        ConfigError: the folder cannot be made or written to, or another evaluation is writing to it.
    """
    folder = Path(folder)
    check_report_folder(folder)
    with lock_folder(folder):
        write_files(report, folder)
    return folder


def write_files(report: Report, folder: Path) -> None:
    """`write_report` to a folder that is there and already `lock_folder`.

    Raises:
        ConfigError: it cannot be written to; an earlier report is then as it was.
    """
    check_report_folder(folder)
    texts = {
        "config.yaml": dump_yaml(report.config),
        "episodes.csv": episodes_csv(report),
        "report.csv": report_csv(report),
        "report.md": report_markdown(report),
        "report.json": json.dumps(report.to_mapping(), indent=2) + "\n",
    }
    try:
        with tempfile.TemporaryDirectory(prefix=".report-", dir=folder) as name:
            temporary = Path(name)
            for file in REPORT_FILES:
                (temporary / file).write_text(texts[file], encoding="utf-8")
            _replace_all(temporary, folder)
    except OSError as error:
        raise ConfigError(f"cannot write the report to {str(folder)!r}: {error.strerror or error}") from error


def _replace_all(new: Path, folder: Path) -> None:
    """Move the new files to their places; if that is stopped halfway, put the old ones back."""
    old = new / "old"
    old.mkdir()
    for file in REPORT_FILES:
        if (folder / file).exists():
            shutil.copy2(folder / file, old / file)
    try:
        for file in REPORT_FILES:
            os.replace(new / file, folder / file)
    except BaseException:  # Ctrl-C, too
        for file in REPORT_FILES:
            if (old / file).exists():
                os.replace(old / file, folder / file)
            elif not (new / file).exists():  # was moved
                (folder / file).unlink()
        raise


def check_folder(folder: Path) -> None:
    """See whether a folder can be written to, or made, without making it.

    Raises:
        ConfigError: it cannot; better said before an evaluation than after it.
    """
    folder = output_path(folder)
    existing = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    if not existing.is_dir():
        raise ConfigError(f"cannot write to {str(folder)!r}: {str(existing)!r} is not a folder")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise ConfigError(f"cannot write to {str(folder)!r}: no permission for {str(existing)!r}")


def check_report_folder(folder: Path) -> None:
    """`check_folder`, and that all files of a report can have their places in it.

    Raises:
        ConfigError: they cannot.
    """
    check_folder(folder)
    for file in REPORT_FILES:
        if output_path(folder / file).is_dir():
            raise ConfigError(f"cannot write the report: {str(folder / file)!r} is a folder")


def report_csv(report: Report) -> str:
    """One line per object."""
    flags = list(report.total.flags)
    head = ["object", "target", "episodes", "successes", "success_rate", "interval_low", "interval_high"]
    rows = [
        [
            *(r.object, r.target, r.tally.episodes, r.tally.successes, r.tally.success_rate, *r.tally.interval),
            *(r.tally.mean_length, *(r.tally.flags[name] for name in flags), sum(r.tally.faults.values())),
        ]
        for r in report.rows
    ]
    return _csv([*head, "mean_length", *flags, "faults"], rows)


def episodes_csv(report: Report) -> str:
    """One line per episode."""
    flags = list(report.total.flags)
    rows = (
        [e.object, e.target, e.level, int(e.success), e.length, *(int(e.flags[name]) for name in flags), e.fault]
        for e in report.episodes
    )
    return _csv(["object", "target", "level", "success", "length", *flags, "fault"], rows)


def report_markdown(report: Report) -> str:
    """A table for people."""
    flags = list(report.total.flags)
    columns = ["object", "target", "solved", "rate", "95 % interval", *flags, "mean steps"]
    rows = [[r.object, r.target, *_cells(r.tally)] for r in report.rows]
    rows.append(["**all**", "", *_cells(report.total)])
    table = [columns, ["---"] * 2 + ["---:"] * (len(columns) - 2), *rows]
    lines = [f"| {' | '.join(row)} |" for row in table]
    first, last = report.levels
    used = ", ".join(f"{name} {number}" for name, number in report.versions.items())
    modes = f"`{report.obs_mode}`, `{report.control_mode}`"
    title = f"# {report.task}: {report.policy}\n\nLevels {first} to {last} of each object, {modes}."
    faults = f"\n\n{report.total.faults_text}" if report.total.faults else ""
    return f"{title}\n\n" + "\n".join(lines) + f"{faults}\n\nMade with {used}.\n"


def _cells(tally: Tally) -> list[str]:
    low, high = tally.interval
    flags = [f"{rate:.0%}" for rate in tally.flags.values()]
    rate, interval = f"{tally.success_rate:.1%}", f"{low:.1%} to {high:.1%}"
    return [f"{tally.successes}/{tally.episodes}", rate, interval, *flags, f"{tally.mean_length:.1f}"]


def _csv(head: list[str], rows: Iterable[list[object]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    return text.getvalue()

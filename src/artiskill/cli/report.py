"""`artiskill report`: what a report is worth, on which objects and how a policy fails; pages, comparisons."""

import argparse
from pathlib import Path
from typing import Any

from artiskill.cli.parser import add_command, add_group, add_stored_task, add_workers, workers_of

_VERIFY_EPILOG = """examples:
  artiskill report verify results/mine
  artiskill report verify results/mine --policy my/solution.py --sample 2

The exit status is 1 if anything is not as the report says. docs/evaluation.md says what this proves."""
_FAILURES_EPILOG = """examples:
  artiskill report failures results/mine
  artiskill report failures results/mine --out failures.csv

Failed episodes are played again from their actions. Stages are those of the task's reward, docs/tasks."""
_GROUPS_EPILOG = """examples:
  artiskill report groups results/mine

Families are those of the generators; handles and joints are those of the targets. Nothing is played."""
_PAGE_EPILOG = """examples:
  artiskill report page results/mine
  artiskill report page results/mine --verify --out mine.html

The page is one file without scripts or requests. Its films are played again from the report's actions."""
_LEADERBOARD_EPILOG = """examples:
  artiskill report leaderboard results
  artiskill report leaderboard results --verify --out board.html

Links lead to the reports' pages, page.html beside each report.json, where they were written."""
_COMPARE_EPILOG = """example:
  artiskill report compare results/old results/new"""

EXIT_FAULTS = 1


def add_commands(commands: Any) -> None:
    """Add the commands."""
    subcommands = add_group(commands, "report", "verify, show and compare reports")
    parser = add_command(subcommands, "verify", _run_verify, "play a report's actions again", _VERIFY_EPILOG)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of the report")
    parser.add_argument("--policy", help="also have the policy play some objects again, and compare its actions")
    parser.add_argument("--sample", type=int, default=1, help="how many objects (default: %(default)s)")
    _add_given_objects(parser)
    parser = add_command(subcommands, "failures", _run_failures, "say how episodes failed", _FAILURES_EPILOG)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of the report")
    parser.add_argument("--out", type=Path, metavar="FILE", help="also write a line for each of them as CSV")
    _add_given_objects(parser)
    summary = "success by family of objects, kind of handle and kind of joint"
    parser = add_command(subcommands, "groups", _run_groups, summary, _GROUPS_EPILOG)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of the report")
    _add_given_objects(parser, is_played=False)
    _add_pages(subcommands)
    parser = add_command(subcommands, "compare", _run_compare, "compare two reports", _COMPARE_EPILOG)
    parser.add_argument("first", type=Path, metavar="FIRST", help="folder of a report")
    parser.add_argument("second", type=Path, metavar="SECOND", help="folder of another one of the same protocol")


def _add_given_objects(parser: argparse.ArgumentParser, is_played: bool = True) -> None:
    """Add options of commands that make a report's objects again, and play them."""
    objects = "names, folders or lists of objects that their ids in the report do not lead to"
    parser.add_argument("--objects", nargs="+", default=[], help=objects)
    add_stored_task(parser)
    if is_played:
        add_workers(parser)


def _add_pages(subcommands: Any) -> None:
    summary = "write a page with pictures and films of a report"
    parser = add_command(subcommands, "page", _run_page, summary, _PAGE_EPILOG)
    add = parser.add_argument
    add("folder", type=Path, metavar="FOLDER", help="of the report")
    add("--out", type=Path, metavar="FILE", help="the page (default: FOLDER/page.html)")
    add("--films", type=int, help="number of objects with films, a success and a failure of each (default: 20)")
    add("--verify", action="store_true", help="play all actions again first; no page of a report that differs")
    _add_given_objects(parser)
    summary = "write a page that ranks the reports below a folder"
    parser = add_command(subcommands, "leaderboard", _run_leaderboard, summary, _LEADERBOARD_EPILOG)
    add = parser.add_argument
    add("folder", type=Path, metavar="FOLDER", help="with reports below it")
    add("--out", type=Path, metavar="FILE", help="the page (default: FOLDER/leaderboard.html)")
    add("--verify", action="store_true", help="play all actions again; reports that differ are not ranked")
    _add_given_objects(parser)


def _run_verify(arguments: argparse.Namespace) -> int:
    import numpy as np

    from artiskill.cli.progress import ProgressBar
    from artiskill.evaluation.stored_report import read_report
    from artiskill.evaluation.verify import verify_policy, verify_report

    folder, workers = arguments.folder, workers_of(arguments)
    with ProgressBar("playing again", read_report(folder).report.episodes, "episodes") as progress:
        found = verify_report(folder, workers, lambda result: progress.advance(result.success), arguments.objects)
    faults = found.faults
    print(f"{found.episodes} episodes, {found.steps} steps played again: {_verdict(faults)}", *faults, sep="\n  ")
    if arguments.policy is not None:
        generator = np.random.default_rng()  # nobody shall know which
        sample = arguments.sample
        again = verify_policy(folder, arguments.policy, sample, generator, workers, arguments.objects)
        verdict = _verdict(again.faults)
        print(
            f"{again.episodes} episodes played again by {arguments.policy}: {verdict}", *again.faults, sep="\n  "
        )
        faults += again.faults
    return EXIT_FAULTS if faults else 0


def _run_page(arguments: argparse.Namespace) -> None:
    from artiskill.cli.progress import ProgressBar
    from artiskill.errors import ConfigError
    from artiskill.evaluation.report_page import FILMS, read_page_source, write_report_page
    from artiskill.evaluation.verify import verify_report

    workers, verified = workers_of(arguments), None
    films = FILMS if arguments.films is None else arguments.films
    source = read_page_source(arguments.folder, films, arguments.objects)
    if arguments.verify:
        with ProgressBar("playing again", len(source.episodes), "episodes") as progress:
            verified = verify_report(
                arguments.folder, workers, lambda result: progress.advance(result.success), arguments.objects
            )
        if verified.faults:
            more = f" (and {len(verified.faults) - 1} more)" if len(verified.faults) > 1 else ""
            raise ConfigError(f"{str(arguments.folder)!r} is not what it says: {verified.faults[0]}{more}")
    with ProgressBar("drawing", len(source.films), "films") as progress:
        path = write_report_page(source, arguments.out, workers, lambda _: progress.advance(), verified)
    print(f"page: {path}")


def _run_leaderboard(arguments: argparse.Namespace) -> None:
    from artiskill.cli.progress import ProgressBar
    from artiskill.evaluation.leaderboard import find_reports, read_leaderboard, write_leaderboard

    folder, workers = arguments.folder, workers_of(arguments)
    with ProgressBar("reading", len(find_reports(folder)), "reports") as progress:
        board = read_leaderboard(
            folder, arguments.verify, workers, arguments.objects, lambda _: progress.advance()
        )
    path = write_leaderboard(board, arguments.out)
    for one in board.refused:
        print(f"not ranked: {one.folder}: {one.reasons[0]}")
    print(f"page: {path}")


def _verdict(faults: tuple[str, ...]) -> str:
    return f"{len(faults)} difference{'s' * (len(faults) > 1)}" if faults else "bit for bit as reported"


def _run_failures(arguments: argparse.Namespace) -> None:
    from artiskill.cli.progress import ProgressBar
    from artiskill.cli.table import print_failures
    from artiskill.evaluation.failures import find_failures, write_failures
    from artiskill.evaluation.stored_report import read_report
    from artiskill.files import check_output_folder, output_path

    report, out = read_report(arguments.folder).report, arguments.out
    if out is not None:
        check_output_folder(output_path(out).parent)
    with ProgressBar("playing again", report.episodes - report.successes, "episodes") as progress:
        objects = arguments.objects
        found = find_failures(arguments.folder, workers_of(arguments), lambda _: progress.advance(), objects)
    print_failures(found)
    if out is not None:
        write_failures(found, out)


def _run_groups(arguments: argparse.Namespace) -> None:
    from artiskill.cli.table import print_groups
    from artiskill.evaluation.groups import group_episodes

    print_groups(group_episodes(arguments.folder, arguments.objects))


def _run_compare(arguments: argparse.Namespace) -> None:
    from artiskill.cli.table import print_comparison
    from artiskill.evaluation.verify import compare_reports

    print_comparison(*compare_reports(arguments.first, arguments.second))

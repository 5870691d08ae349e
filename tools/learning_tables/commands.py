"""Policies that are commands of `artiskill`: trained, then measured, several at once, each step done once."""

import os
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

from artiskill.config import check
from artiskill.files import read_text

TRAINED = "trained"  # file of a policy that is; it holds the command

Policy = TypeVar("Policy")


def one_thread() -> dict[str, str]:
    """Return the environment of commands that share the cores with others."""
    return {**os.environ, "OMP_NUM_THREADS": "1"}


def call(command: list[str], environment: Mapping[str, str]) -> bool:
    """Run one of the package's commands; return whether it succeeded."""
    print(f"$ {shlex.join(['artiskill', *command])}", flush=True)
    done = subprocess.run(
        [sys.executable, "-m", "artiskill", *command], env=environment, stdout=subprocess.DEVNULL, check=False
    )
    if done.returncode:
        print(f"failed, exit status {done.returncode}: {shlex.join(command)}", file=sys.stderr, flush=True)
    return not done.returncode


def finish(folder: Path, train: list[str] | None, results: Mapping[Path, list[str]]) -> bool:
    """Train and measure a policy, as far as that is missing.

    Args:
        folder: of the policy, with a file `trained` once it is, which holds the command; nothing is measured
            before. After another command it is trained again: `artiskill train` goes on, or refuses.
        train: the command that trains; None to measure only what is trained.
        results: the commands that follow, in this order, by the file that each writes when it is done; files
            that are older than the training are made again.

    Returns:
        Whether all commands succeeded.
    """
    environment, trained = one_thread(), folder / TRAINED
    if train is None:
        if not trained.is_file():
            return True
    elif not _is_trained(folder, train):
        if not call(train, environment):
            return False
        trained.write_text(shlex.join(train))
    since = trained.stat().st_mtime_ns
    wanted = [command for file, command in results.items() if not _is_written(file, since)]
    return all(call(command, environment) for command in wanted)


def is_finished(folder: Path, train: list[str], files: Iterable[Path]) -> bool:
    """Return whether a policy was trained by this very command, and the files were written since."""
    if not _is_trained(folder, train):
        return False
    since = (folder / TRAINED).stat().st_mtime_ns
    return all(_is_written(file, since) for file in files)


def _is_trained(folder: Path, train: list[str]) -> bool:
    trained = folder / TRAINED
    return trained.is_file() and read_text(trained) == shlex.join(train)


def _is_written(file: Path, since_ns: int) -> bool:
    return file.is_file() and file.stat().st_mtime_ns >= since_ns


def in_pool(run: Callable[[Policy], bool], policies: Iterable[Policy], jobs: int) -> bool:
    """Run several policies at once, in their order; return whether all succeeded.

    Raises:
        ConfigError: an illegal number.
    """
    check(jobs >= 1, f"--jobs must be at least 1, not {jobs}")
    with ThreadPoolExecutor(jobs) as pool:
        return all([*pool.map(run, policies)])

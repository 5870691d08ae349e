"""Print how large and how winding the source is: lines, files, importers, functions, files that a run enters.

    .venv/bin/python tools/measure_structure.py            # as a table
    .venv/bin/python tools/measure_structure.py --json     # for scripts
    .venv/bin/python tools/measure_structure.py --list sim # lines per package; what is over a limit in `sim`

A file's importers are the other files of the package that import it or a name from it. A function's lines include
its signature and docstring. The files of a step and of a demonstration are those in which a Python function was
entered (compiled kernels do not show). Complexity is McCabe's, as ruff counts it.
"""

import argparse
import ast
import json
import statistics
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from types import FrameType
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / "src" / "artiskill"
MOST_LINES, MOST_ARGUMENTS, MOST_COMPLEXITY = 40, 8, 10

Function = ast.FunctionDef | ast.AsyncFunctionDef


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Print how large and how winding the source is.")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--list", metavar="PACKAGE", help="list what is over a limit in one package, or in `all`")
    options = parser.parse_args()
    if options.list:
        list_package(options.list)
        return
    figures = measure()
    if options.json:
        print(json.dumps(figures, indent=2))
        return
    width = max(map(len, figures))
    for name, value in figures.items():
        print(f"{name:<{width}}  {value:>7,}")


def list_package(package: str) -> None:
    """Print the lines of every package, and what is over a limit in one of them."""
    trees = parse_all()
    lines: dict[str, list[int]] = defaultdict(list)
    for path in trees:
        lines[package_of(path)].append(len(path.read_text(encoding="utf-8").splitlines()))
    for name, lengths in sorted(lines.items()):
        print(f"{name:<12} {len(lengths):>4} files {sum(lengths):>7,} lines")
    for path, users in importers_of(trees).items():
        if len(users) == 1 and path.name != "__init__.py" and package in ("all", package_of(path)):
            print(f"one importer: {path.relative_to(SOURCE)} <- {users.pop().relative_to(SOURCE)}")
    for path, tree in trees.items():
        for node in ast.walk(tree) if package in ("all", package_of(path)) else ():
            if isinstance(node, Function) and (lines_of(node) > MOST_LINES or arguments_of(node) > MOST_ARGUMENTS):
                where = f"{path.relative_to(SOURCE)}:{node.lineno} {node.name}"
                print(f"{where}: {lines_of(node)} lines, {arguments_of(node)} arguments")


def package_of(path: Path) -> str:
    """Return `sim` for a file in `sim/`, and `.` for one at the top."""
    return path.relative_to(SOURCE).parts[0] if path.parent != SOURCE else "."


def parse_all() -> dict[Path, ast.Module]:
    """Return the syntax tree of every source file."""
    return {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(SOURCE.rglob("*.py"))}


def measure() -> dict[str, int]:
    """Return every figure by its name."""
    trees = parse_all()
    lengths = [len(path.read_text(encoding="utf-8").splitlines()) for path in trees]
    importers = importers_of(trees)
    functions = [node for tree in trees.values() for node in ast.walk(tree) if isinstance(node, Function)]
    arguments = [arguments_of(node) for node in functions]
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    return {
        "source lines": sum(lengths),
        "source files": len(trees),
        "files with a single importer": sum(
            len(users) == 1 for path, users in importers.items() if path.name != "__init__.py"
        ),
        "longest file, lines": max(lengths),
        "90th percentile of files, lines": round(statistics.quantiles(lengths, n=10)[-1]),
        f"functions over complexity {MOST_COMPLEXITY}": too_complex(),
        f"functions over {MOST_LINES} lines": sum(lines_of(node) > MOST_LINES for node in functions),
        f"functions over {MOST_ARGUMENTS} arguments": sum(count > MOST_ARGUMENTS for count in arguments),
        "files that one step of one environment enters": len(files_entered(prepare_step())),
        "files that one collected demonstration enters": len(files_entered(prepare_demonstration())),
        "words of documentation": sum(len(page.read_text(encoding="utf-8").split()) for page in pages),
    }


def importers_of(trees: dict[Path, ast.Module]) -> dict[Path, set[Path]]:
    """Return file -> the other files that import it."""
    modules = {module_name(path): path for path in trees}
    found: dict[Path, set[Path]] = defaultdict(set)
    for path, tree in trees.items():
        for name in imported_names(tree):
            if name in modules and modules[name] != path:
                found[modules[name]].add(path)
    return found


def module_name(path: Path) -> str:
    """Return the dotted name under which a file is imported."""
    parts = path.relative_to(SOURCE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported_names(tree: ast.Module) -> Iterator[str]:
    """Yield every module that a file imports, and every name of one, which may be a module as well."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def lines_of(node: Function) -> int:
    """Return the lines of a function, from its `def` to its end."""
    return (node.end_lineno or node.lineno) - node.lineno + 1


def arguments_of(node: Function) -> int:
    """Return how many arguments a function takes, `self` and `cls` apart."""
    every = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
    return sum(argument.arg not in ("self", "cls") for argument in every)


def too_complex() -> int:
    """Return the number of functions over McCabe's limit."""
    command = [sys.executable, "-m", "ruff", "check", "--isolated", "--select", "C901", "--output-format", "json"]
    command += ["--config", f"lint.mccabe.max-complexity={MOST_COMPLEXITY}", str(SOURCE)]
    return len(json.loads(subprocess.run(command, capture_output=True, text=True).stdout))


def prepare_step() -> Callable[[], Any]:
    """Return one step of a single environment, ready to be called."""
    import gymnasium as gym

    import artiskill  # noqa: F401 - registers the environments

    env: Any = gym.make("ArtiSkill/OpenCabinetDrawer-v0", obs_mode="state", reward_mode="dense").unwrapped
    env.reset(seed=0)
    env.action_space.seed(0)
    env.step(env.action_space.sample())
    action = env.action_space.sample()
    return lambda: env.step(action)


def prepare_demonstration() -> Callable[[], Any]:
    """Return the collecting of one demonstration of an object that is loaded, ready to be called."""
    from artiskill.cli.main import main as artiskill_main

    def collect() -> None:
        names = ["--task", "OpenCabinetDrawer", "--objects", "cabinet-0001", "--per-object", "1", "--workers", "1"]
        with tempfile.TemporaryDirectory() as folder, redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            artiskill_main(["demos", "collect", *names, "--out", str(Path(folder) / "demos")])

    collect()
    return collect


def files_entered(run: Callable[[], Any]) -> set[Path]:
    """Return the files of the package in which a function was entered while something ran, in this process."""
    found: set[Path] = set()

    def note(frame: FrameType, event: str, _: Any) -> None:
        path = Path(frame.f_code.co_filename)
        if event == "call" and path.is_relative_to(SOURCE):
            found.add(path)

    sys.setprofile(note)
    try:
        run()
    finally:
        sys.setprofile(None)
    return found


if __name__ == "__main__":
    main()

"""The shape of the program: which layer may use which, what stands outside it, and how long a file may be."""

import ast
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src" / "artiskill"

# Each layer may use itself and the layers before it.
LAYERS = (
    *(
        "errors",
        "files",
        "config",
        "versions",
        "jobs",
        "geometry",
        "assets",
        "robots",
        "scene",
        "sim",
        "sensors",
        "tasks",
        "envs",
    ),
    *("checks", "exports", "experts", "demos", "learning", "compat", "evaluation", "gallery"),
    *("bench", "viewer", "cli"),
)
# Entry points of the package: they import every layer, no layer imports them.
ENTRY_POINTS = ("__init__", "__main__")

# The engine has three owners: who builds the robot's part of a model, who builds the model, who steps it.
ENGINE_LAYERS = {"robots", "scene", "sim", "checks", "exports"}
# These see the simulation as plain values only.
PLANNER = SOURCE / "experts" / "mpc.py"  # it simulates what would follow
VALUE_LAYERS = {"sensors", "tasks", "experts"}
SIM_VALUES = ("artiskill.sim.snapshot", "artiskill.sim.states")
TORCH_LAYERS = {"learning"}

LONGEST_FILE = 450
# file -> why it is one file all the same
LONG_FILES: dict[str, str] = {}

HEAVY = ("torch", "numba", "scipy", "coacd", "fast_simplification", "mujoco", "PIL", "rich", "imageio")


@dataclass(frozen=True)
class Import:
    """One imported module, or name in a module, and where that stands."""

    path: Path
    line: int
    name: str
    at_import_time: bool

    @property
    def layer(self) -> str:
        """The layer of the file that imports."""
        return layer_of(module_name(self.path))

    def __str__(self) -> str:
        return f"{self.path.relative_to(ROOT)}:{self.line} imports {self.name}"


def module_name(path: Path) -> str:
    parts = path.relative_to(SOURCE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" and len(parts) > 2 else parts)


def layer_of(module: str) -> str:
    """`artiskill.sim.snapshot` -> `sim`; `artiskill` -> `__init__`."""
    return [*module.split("."), "__init__"][1]


def modules() -> list[Path]:
    return sorted(SOURCE.rglob("*.py"))


def imports_of(path: Path, text: str | None = None) -> Iterator[Import]:
    """Every import of a file, wherever it stands, with relative ones resolved."""
    tree = ast.parse(path.read_text(encoding="utf-8") if text is None else text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = list(names_from(node, path))
        else:
            continue
        for name in names:
            yield Import(path, node.lineno, name, node in tree.body)


def names_from(node: ast.ImportFrom, path: Path) -> Iterator[str]:
    """`from a import b` -> `a.b`, be b a module or a name in one."""
    package = list(path.parent.relative_to(SOURCE.parent).parts)
    base = package[: len(package) - node.level + 1] if node.level else []
    origin = ".".join(base + ([node.module] if node.module else []))
    for alias in node.names:
        yield f"{origin}.{alias.name}"


def is_package(name: str, package: str) -> bool:
    return name == package or name.startswith(package + ".")


ALL_IMPORTS = [found for path in modules() for found in imports_of(path)]


def backward(found: Import) -> bool:
    """Whether an import goes against the order of the layers."""
    if not is_package(found.name, "artiskill") or found.layer in ENTRY_POINTS:
        return False
    target = layer_of(found.name)
    if target.startswith("__"):
        return False  # `artiskill.__version__` says no more than its name
    return LAYERS.index(target) > LAYERS.index(found.layer)


def test_every_layer_is_known() -> None:
    layers = {layer_of(module_name(path)) for path in modules()}
    assert layers - set(ENTRY_POINTS) <= set(LAYERS), (
        "a new layer needs its place in LAYERS and in docs/architecture.md"
    )


def test_imports_point_one_way() -> None:
    assert not [str(found) for found in ALL_IMPORTS if backward(found)]


def test_the_check_would_notice() -> None:
    """The tests here are only worth something if they can fail."""
    path = SOURCE / "geometry" / "imaginary.py"
    text = "def f():\n    from artiskill.assets.handles import x\n    from .. import sim\nfrom . import meshes\n"
    names = {found.name: backward(found) for found in imports_of(path, text)}
    assert names == {
        "artiskill.assets.handles.x": True,
        "artiskill.sim": True,
        "artiskill.geometry.meshes": False,
    }


def test_the_engine_stays_in_its_layers() -> None:
    strays = [f for f in ALL_IMPORTS if is_package(f.name, "mujoco") and f.layer not in ENGINE_LAYERS]
    assert not [str(found) for found in strays]


def test_simulation_is_seen_as_values() -> None:
    def breaks(found: Import) -> bool:
        if found.path == PLANNER or found.layer not in VALUE_LAYERS or not is_package(found.name, "artiskill.sim"):
            return False
        return not any(is_package(found.name, value) for value in SIM_VALUES)

    assert not [str(found) for found in ALL_IMPORTS if breaks(found)]


def test_torch_stays_in_learning() -> None:
    strays = [f for f in ALL_IMPORTS if is_package(f.name, "torch") and f.layer not in TORCH_LAYERS]
    assert not [str(found) for found in strays]


def test_core_modules_import_only_what_the_core_installs() -> None:
    """An optional dependency is imported inside the function that needs it, where its absence can be explained."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        wanted = tomllib.load(file)["project"]["dependencies"]
    core = {re.split(r"[<>=!~\[ ;]", name)[0].lower() for name in wanted}
    distributions = packages_distributions()
    ours = {"artiskill", *sys.stdlib_module_names}

    def is_foreign(found: Import) -> bool:
        top = found.name.split(".")[0]
        if not found.at_import_time or found.layer in TORCH_LAYERS or top in ours:
            return False
        return not core & {name.lower().replace("_", "-") for name in distributions.get(top, [])}

    assert not [str(found) for found in ALL_IMPORTS if is_foreign(found)]


def test_importing_the_package_is_light() -> None:
    code = f"import sys, artiskill; print(*[m for m in {HEAVY!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.strip() == ""


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(SOURCE)))
def test_files_stay_short(path: Path) -> None:
    lines = len(path.read_text(encoding="utf-8").splitlines())
    assert lines <= LONGEST_FILE or str(path.relative_to(SOURCE)) in LONG_FILES


def test_exceptions_are_still_needed() -> None:
    for name, reason in LONG_FILES.items():
        assert reason
        assert len((SOURCE / name).read_text(encoding="utf-8").splitlines()) > LONGEST_FILE, f"{name} is short now"

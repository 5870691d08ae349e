"""Measurements and the machine that they were made on, as JSON and as a plot (extra `bench`)."""

import json
import os
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from artiskill.bench.cases import Case
from artiskill.errors import ConfigError, MissingExtraError
from artiskill.files import atomic_write, output_path
from artiskill.jobs.parallel import available_cores
from artiskill.versions import entry_of, processor_name, versions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

JSON_FILE, PLOT_FILE = "bench.json", "bench.png"
_MEMORY_FILE, _STATUS_FILE = Path("/proc/meminfo"), Path("/proc/self/status")
_MB_PER_KB = 1024 / 1e6
# Okabe and Ito's colours, which the colour-blind can tell apart
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
_COLUMN_IN, _HEIGHT_IN, _DPI = 3.4, 5.6, 120
_GREY = "#6b7280"


@dataclass(frozen=True)
class Measurement:
    """What came out of a case.

    Attributes:
        case: what was measured.
        steps: timed environment steps, each environment's counted.
        steps_per_s: median over blocks, without resets.
        engine_steps_per_s: the same of the bare engine, on the same models with the same drive targets.
        ratio: median of the blocks' ratios of the two.
        ratio_quartiles: of the same.
        reset_ms: of one auto-reset, as many at a time as an average step of the vector has.
        steps_with_resets_per_s: with one reset for each `episode_steps` steps.
        physics_steps_per_s: `steps_per_s` times the physics steps of one.
        memory_mb: resident memory of a process with nothing but these environments; None where unknown.
    """

    case: Case
    steps: int
    steps_per_s: float
    engine_steps_per_s: float
    ratio: float
    ratio_quartiles: tuple[float, float]
    reset_ms: float
    steps_with_resets_per_s: float
    physics_steps_per_s: float
    memory_mb: float | None

    def to_mapping(self) -> dict[str, Any]:
        """Return plain values, for JSON; the case's stand beside the figures."""
        values = asdict(self)
        return values.pop("case") | values


@dataclass(frozen=True)
class BenchReport:
    """What a run of `artiskill bench` found.

    Attributes:
        machine: `machine_facts` at its start.
        measurements: in the order of the cases.
    """

    machine: dict[str, Any]
    measurements: Sequence[Measurement]

    def to_mapping(self) -> dict[str, Any]:
        """Return plain values, for JSON."""
        return {"machine": self.machine, "cases": [one.to_mapping() for one in self.measurements]}


def write_bench(report: BenchReport, folder: Path, plot: bool = True) -> list[Path]:
    """Write `bench.json` and, if wanted, `bench.png`.

    Raises:
        ConfigError: the folder cannot be written to.
        MissingExtraError: a plot without the extra `bench`.
    """
    paths = [output_path(folder) / JSON_FILE]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with atomic_write(paths[0]) as temporary:
            temporary.write_text(json.dumps(report.to_mapping(), indent=1) + "\n", encoding="utf-8")
        if plot:
            paths.append(folder / PLOT_FILE)
            with atomic_write(paths[1]) as temporary:
                draw(report.measurements, temporary)
    except OSError as error:
        raise ConfigError(f"cannot write to {str(folder)!r}: {error.strerror or error}") from error
    return paths


def machine_facts() -> dict[str, Any]:
    """Return what figures depend on besides the program; what cannot be known is None."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return {
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
        "processor": processor_name(),
        "cores": available_cores(),
        "memory_mb": _megabytes(_MEMORY_FILE, "MemTotal"),
        "load": load,
        "system": platform.platform(),
        "versions": versions(),
    }


def resident_mb() -> float | None:
    """Return the memory that this process uses (MB, 10^6 bytes); None where the system has no such file."""
    return _megabytes(_STATUS_FILE, "VmRSS")


def _megabytes(path: Path, key: str) -> float | None:
    entry = entry_of(path, key)
    return None if entry is None else int(entry.split()[0]) * _MB_PER_KB


@dataclass(frozen=True)
class Line:
    """What differs in the number of environments alone."""

    mode: str
    threads: int

    @property
    def label(self) -> str:
        """For the legend."""
        return f"{self.mode}, {self.threads} thread{'s' if self.threads > 1 else ''}"

    def has(self, one: Measurement) -> bool:
        """Whether a measurement is on the line."""
        return one.case.mode == self.mode and one.case.num_threads == min(self.threads, one.case.num_envs)


def figure_class() -> type["Figure"]:
    """Return Matplotlib's figure class, which needs no display.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("the plot of a benchmark", "bench") from error
    return Figure


def draw(measurements: Sequence[Measurement], path: Path) -> None:
    """Write a picture, in the format of the path's ending.

    Raises:
        MissingExtraError: as `figure_class`.
    """
    tasks = list(dict.fromkeys(one.case.task for one in measurements))
    lines = [Line(mode, count) for mode in _modes(measurements) for count in _threads(measurements)]
    figure = figure_class()(figsize=(max(2, len(tasks)) * _COLUMN_IN, _HEIGHT_IN), layout="constrained")
    axes = figure.subplots(2, len(tasks), squeeze=False, sharex=True, sharey="row", height_ratios=(3, 2))
    for column, task in enumerate(tasks):
        for color, line in zip(COLORS * len(lines), lines, strict=False):
            found = [one for one in measurements if one.case.task == task and line.has(one)]
            if found:
                _draw_line(axes[0][column], axes[1][column], found, line.label, color)
        axes[0][column].set_title(task, fontsize=10)
        _lay_out(axes[0][column], axes[1][column], sorted({one.case.num_envs for one in measurements}))
    axes[0][0].set_ylabel("environment steps per second")
    axes[1][0].set_ylabel("share of the bare engine")
    axes[0][0].plot([], [], "--", color=_GREY, label="bare engine")
    handles = {h.get_label(): h for axis in axes[0] for h in axis.get_legend_handles_labels()[0]}
    figure.legend(handles=[*handles.values()], loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    figure.savefig(path, dpi=_DPI)


def _modes(measurements: Sequence[Measurement]) -> list[str]:
    return list(dict.fromkeys(one.case.mode for one in measurements))


def _threads(measurements: Sequence[Measurement]) -> list[int]:
    """Return the numbers of threads asked for; one environment always has one thread."""
    return sorted({one.case.num_threads for one in measurements if one.case.num_envs > 1}) or [1]


def _draw_line(rates: Any, ratios: Any, found: Sequence[Measurement], label: str, color: str) -> None:
    found = sorted(found, key=lambda one: one.case.num_envs)
    sizes = [one.case.num_envs for one in found]
    rates.plot(sizes, [one.steps_per_s for one in found], "o-", color=color, label=label, ms=4)
    rates.plot(sizes, [one.engine_steps_per_s for one in found], "--", color=color, alpha=0.6)
    low, high = zip(*(one.ratio_quartiles for one in found), strict=True)
    ratios.plot(sizes, [one.ratio for one in found], "o-", color=color, ms=4)
    ratios.fill_between(sizes, low, high, color=color, alpha=0.2, linewidth=0)


def _lay_out(rates: Any, ratios: Any, sizes: Sequence[int]) -> None:
    for axis in (rates, ratios):
        axis.set_xscale("log", base=2)
        axis.set_xticks(sizes, [f"{size:,}" for size in sizes])
        axis.minorticks_off()
        axis.grid(color="#e5e7eb")
        axis.set_axisbelow(True)
        axis.spines[["top", "right"]].set_visible(False)
        axis.tick_params(labelsize=8)
    rates.set_ylim(bottom=0)
    ratios.set_ylim(0, 1.05)
    ratios.set_xlabel("environments")

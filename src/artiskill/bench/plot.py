"""Rates and ratios over the number of environments, a column per task (extra `bench`)."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from artiskill.bench.measure import Measurement
from artiskill.errors import MissingExtraError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito's colours, which the colour-blind can tell apart
_COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
_COLUMN_IN, _HEIGHT_IN, _DPI = 3.4, 5.6, 120
_GREY = "#6b7280"


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
    """Matplotlib's figure, which needs no display.

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
        for color, line in zip(_COLORS * len(lines), lines, strict=False):
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
    """What was asked for; one environment has one thread in any case."""
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

"""Learning curves of reinforcement learning: success on new levels over steps, with the band over seeds."""

from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path

import numpy as np

from artiskill.bench.report import COLORS, figure_class
from artiskill.files import atomic_write

CSV_HEAD = ["table", "task", "objects", "target", "algorithm", "changed", "seed", "step", "episodes", "successes"]
_PANEL = ("table", "task")
_LINE = ("objects", "target", "algorithm", "changed")
_WIDTH_IN, _HEIGHT_IN, _DPI = 3.6, 3.6, 110  # with legends below the axes
_COLUMNS = 3  # of panels


def draw(rows: Sequence[Mapping[str, str]], path: Path) -> None:
    """Draw a panel for each table and task, a line for each object or number of objects: the mean over seeds.

    Args:
        rows: of `CSV_HEAD`, at least one.
        path: of the picture.
    """
    panels = list(dict.fromkeys(tuple(row[name] for name in _PANEL) for row in rows))
    columns = min(len(panels), _COLUMNS)
    height = -(-len(panels) // columns)
    size = (columns * _WIDTH_IN, height * _HEIGHT_IN)
    figure = figure_class()(figsize=size, layout="constrained")
    places = figure.subplots(height, columns, sharey=True, squeeze=False).flat
    for axes, panel in zip(places, panels, strict=False):
        inside = [row for row in rows if tuple(row[name] for name in _PANEL) == panel]
        lines = list(dict.fromkeys(tuple(row[name] for name in _LINE) for row in inside))
        for line, color in zip(lines, cycle(COLORS), strict=False):
            chosen = [row for row in inside if tuple(row[name] for name in _LINE) == line]
            steps, rates = curves(chosen)
            label = f"{' '.join(filter(None, line))}, {len(rates)} seed{'s' * (len(rates) > 1)}"
            axes.plot(steps / 1e3, rates.mean(0), color=color, label=label)
            axes.fill_between(steps / 1e3, rates.min(0), rates.max(0), color=color, alpha=0.2, linewidth=0)
        axes.set(title=", ".join(panel), xlabel="thousand steps", ylim=(-0.02, 1.02))
        axes.legend(fontsize=7, frameon=False, loc="upper left", bbox_to_anchor=(0, -0.19), borderaxespad=0)
        axes.grid(alpha=0.2)
    for axes in figure.axes[len(panels) :]:
        axes.remove()
    for axes in figure.axes[::columns]:
        axes.set_ylabel("solved, of new levels")
    path.parent.mkdir(exist_ok=True)
    with atomic_write(path) as temporary:
        figure.savefig(temporary, dpi=_DPI, format="png")


def curves(rows: Sequence[Mapping[str, str]]) -> tuple[np.ndarray, np.ndarray]:
    """Return steps (T,) and success (seeds, T) of a line's rows; a run that has ended keeps its last value."""
    steps = np.array(sorted({int(row["step"]) for row in rows}))
    rates = []
    for seed in sorted({int(row["seed"]) for row in rows}):
        own = {int(row["step"]): row for row in rows if int(row["seed"]) == seed}
        solved = {step: int(row["successes"]) / int(row["episodes"]) for step, row in own.items()}
        before = [[one for one in solved if one <= step] for step in steps]
        rates.append([solved[max(one)] if one else np.nan for one in before])
    return steps, np.array(rates)

"""Learning curves of reinforcement learning: success on new levels over steps, with the band over seeds."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from artiskill.bench.report import COLORS, figure_class
from artiskill.files import atomic_write

POLICY = ["table", "task", "objects", "target", "algorithm", "changed", "seed"]  # what a row is of
MEASURED = ["step", "episodes", "successes"]
CSV_HEAD = [*POLICY, *MEASURED]
_PANEL = ("table", "task")
_OBJECTS, _HOW = ("objects", "target"), ("algorithm", "changed")
_LINE = (*_OBJECTS, *_HOW)
_STYLES = ("-", "--", ":", "-.", (0, (6, 1, 1, 1, 1, 1)))
_WIDTH_IN, _HEIGHT_IN, _DPI = 3.6, 2.9, 110  # of a panel, with the title; the legend comes below
_LINE_IN, _BELOW_IN = 0.155, 0.4  # of a legend's line; from the axes down to the legend
_COLUMNS = 3  # of panels


def draw(rows: Sequence[Mapping[str, str]], path: Path) -> None:
    """Draw a panel for each table and task, with lines that are means over seeds.

    The object, or the number of objects, has a colour; how they are learned has a style of line.

    Args:
        rows: of `CSV_HEAD`, at least one.
        path: of the picture.
    """
    from matplotlib.transforms import ScaledTranslation  # not needed where nothing is drawn

    panels = _distinct(rows, _PANEL)
    columns = min(len(panels), _COLUMNS)
    height = -(-len(panels) // columns)
    most = max(len(_distinct([row for row in rows if _values(row, _PANEL) == one], _LINE)) for one in panels)
    size = (columns * _WIDTH_IN, height * (_HEIGHT_IN + most * _LINE_IN))
    figure = figure_class()(figsize=size, layout="constrained")
    places = figure.subplots(height, columns, sharey=True, squeeze=False).flat
    hows = _distinct(rows, _HOW)
    for axes, panel in zip(places, panels, strict=False):
        inside = [row for row in rows if _values(row, _PANEL) == panel]
        objects = _distinct(inside, _OBJECTS)
        for line in _distinct(inside, _LINE):
            steps, rates = curves([row for row in inside if _values(row, _LINE) == line])
            color = COLORS[objects.index(line[:2]) % len(COLORS)]
            style = _STYLES[hows.index(line[2:]) % len(_STYLES)]
            label = f"{' '.join(filter(None, line))}, {len(rates)} seed{'s' * (len(rates) > 1)}"
            axes.plot(steps / 1e3, rates.mean(0), color=color, linestyle=style, label=label)
            axes.fill_between(steps / 1e3, rates.min(0), rates.max(0), color=color, alpha=0.2, linewidth=0)
        axes.set(title=", ".join(panel), xlabel="thousand steps", ylim=(-0.02, 1.02))
        below = axes.transAxes + ScaledTranslation(0, -_BELOW_IN, figure.dpi_scale_trans)
        place = {"loc": "upper left", "bbox_to_anchor": (0, 0), "bbox_transform": below, "borderaxespad": 0}
        axes.legend(fontsize=7, frameon=False, **place)
        axes.grid(alpha=0.2)
    for axes in figure.axes[len(panels) :]:
        axes.remove()
    for axes in figure.axes[::columns]:
        axes.set_ylabel("solved, of new levels")
    path.parent.mkdir(exist_ok=True)
    with atomic_write(path) as temporary:
        figure.savefig(temporary, dpi=_DPI, format="png")


def _values(row: Mapping[str, str], names: Sequence[str]) -> tuple[str, ...]:
    return tuple(row[name] for name in names)


def _distinct(rows: Sequence[Mapping[str, str]], names: Sequence[str]) -> list[tuple[str, ...]]:
    """Return the different values of some columns, in the order of rows."""
    return list(dict.fromkeys(_values(row, names) for row in rows))


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

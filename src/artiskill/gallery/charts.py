"""Distributions as SVG: small histograms of every measure, a row per split, and bars of kinds.

The pictures follow the reader's light or dark scheme and use no script.
"""

from collections.abc import Sequence
from html import escape

import numpy as np

from artiskill.gallery.facts import ObjectFacts
from artiskill.gallery.statistics import (
    KINDS,
    MEASURES,
    Measure,
    bin_edges,
    by_split,
    histogram,
    shares,
    told_kinds,
)

_WIDTH, _MARGIN, _COLUMNS = 900, 16, 3
_PANEL = (_WIDTH - _MARGIN * (_COLUMNS + 1)) // _COLUMNS
_TITLE, _ROW, _AXIS, _LEFT = 26, 34, 22, 46  # heights of a panel's pieces, and room for names on its left
_BAR, _BAR_GAP, _KIND_LEFT = 7, 8, 130
_STYLE = """
.os { font: 12px system-ui, sans-serif; }
.os text { fill: #3a3f47; } .os .dim { fill: #6b7280; font-size: 11px; } .os .head { font-weight: 600; }
.os line { stroke: #c9ced6; }
.os .train { fill: #2f7fb8; } .os .test { fill: #d97a1f; } .os .ood { fill: #8655c2; }
.os .generated, .os .imported, .os .own { fill: #5f8f5a; }
@media (prefers-color-scheme: dark) {
.os text { fill: #d7dbe2; } .os .dim { fill: #9aa3b0; } .os line { stroke: #444b56; }
.os .train { fill: #5aa6dc; } .os .test { fill: #eb9a4c; } .os .ood { fill: #a986dd; }
}
"""


def category_chart(facts: Sequence[ObjectFacts]) -> str:
    """One SVG of all distributions of one category's objects."""
    splits = by_split(facts)
    pieces: list[str] = []
    panel_height = _TITLE + _ROW * len(splits) + _AXIS
    y = _MARGIN
    told = [measure for measure in MEASURES if any(map(measure.of, facts))]
    for k, measure in enumerate(told):
        if k and k % _COLUMNS == 0:
            y += panel_height + _MARGIN
        x = _MARGIN + k % _COLUMNS * (_PANEL + _MARGIN)
        pieces.append(f'<g transform="translate({x} {y})">{_histograms(splits, measure)}</g>')
    y += panel_height + _MARGIN
    half = (_WIDTH - 3 * _MARGIN) // 2
    heights = []
    for k, title in enumerate(told_kinds(facts)):
        drawn, height = _bars(splits, title, half)
        pieces.append(f'<g transform="translate({_MARGIN + k * (half + _MARGIN)} {y})">{drawn}</g>')
        heights.append(height)
    height = y + max(heights) + _MARGIN
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" class="os" role="img">'
    title = f"<title>{escape(facts[0].category)}: distributions over {escape(', '.join(splits))}</title>"
    return f"{head}{title}<style>{_STYLE}</style>{''.join(pieces)}</svg>\n"


def _histograms(splits: dict[str, list[ObjectFacts]], measure: Measure) -> str:
    """A panel: one row of bars per split, all on one axis and one scale of shares."""
    values = {split: [measure.of(fact) for fact in members] for split, members in splits.items()}
    edges = bin_edges([v for row in values.values() for v in row], measure.is_count)
    counts = {split: histogram(row, edges) for split, row in values.items()}
    tallest = max(float(row.max()) / row.sum() for row in counts.values())
    unit = f", {measure.unit}" if measure.unit else ""
    pieces = [f'<text class="head" x="0" y="15">{escape(measure.name)}<tspan class="dim">{unit}</tspan></text>']
    width = (_PANEL - _LEFT) / (len(edges) - 1)
    for k, (split, row) in enumerate(counts.items()):
        floor = _TITLE + _ROW * (k + 1)
        pieces.append(f'<text class="dim" x="0" y="{floor - 4}">{split}</text>')
        pieces.append(f'<line x1="{_LEFT}" x2="{_PANEL}" y1="{floor}" y2="{floor}"/>')
        for i, count in enumerate(row.tolist()):
            if count:
                height = (_ROW - 6) * count / row.sum() / tallest
                place = f'x="{_LEFT + i * width + 0.5:.1f}" y="{floor - height:.1f}"'
                size = f'width="{width - 1:.1f}" height="{height:.1f}"'
                label = f"{_bin_label(edges, i, measure)}: {count} of {row.sum()} in {split}"
                pieces.append(f'<rect class="{split}" {place} {size}><title>{label}</title></rect>')
    return "".join([*pieces, *_axis(edges, measure, width, _TITLE + _ROW * len(counts) + 15)])


def _axis(edges: np.ndarray, measure: Measure, width: float, y: float) -> list[str]:
    """Numbers below the rows: some edges, or the whole numbers that bins of a count stand for."""
    by_one = measure.is_count and edges[1] - edges[0] == 1
    places = edges[:-1] + 0.5 if by_one else edges
    step = max(1, round(len(places) / (7 if by_one else 5)))
    pieces = []
    for i in range(0, len(places), step):
        x = _LEFT + (i + (0.5 if by_one else 0.0)) * width
        anchor = "end" if x > _PANEL - 8 else "middle"
        pieces.append(f'<text class="dim" x="{x:.1f}" y="{y}" text-anchor="{anchor}">{places[i]:.3g}</text>')
    return pieces


def _bin_label(edges: np.ndarray, i: int, measure: Measure) -> str:
    if measure.is_count and edges[i + 1] - edges[i] == 1:
        return f"{edges[i] + 0.5:.0f}"
    return f"{edges[i]:.3g} to {edges[i + 1]:.3g} {measure.unit}"


def _bars(splits: dict[str, list[ObjectFacts]], title: str, width: int) -> tuple[str, int]:
    """A panel: for each kind, a bar per split as long as its share of the split's objects; and its height."""
    counts = {split: shares(members, KINDS[title]) for split, members in splits.items()}
    kinds = sorted({kind for row in counts.values() for kind in row})
    longest = max(count / len(splits[split]) for split, row in counts.items() for count in row.values())
    note = f'<tspan class="dim">, share of objects, longest {longest:.0%}</tspan>'
    pieces = [f'<text class="head" x="0" y="15">{escape(title)}{note}</text>']
    y = _TITLE
    for kind in kinds:
        block = _BAR * len(splits)
        middle = y + block / 2 + 4
        name = escape(kind.replace("_", " "))
        pieces.append(f'<text x="{_KIND_LEFT - 8}" y="{middle:.1f}" text-anchor="end">{name}</text>')
        for k, split in enumerate(splits):
            count, total = counts[split].get(kind, 0), len(splits[split])
            length = (width - _KIND_LEFT - 40) * count / total / longest
            if not count:
                continue
            place = f'x="{_KIND_LEFT}" y="{y + k * _BAR}" width="{length:.1f}" height="{_BAR - 1}"'
            label = f"{escape(kind)}: {count} of {total} in {split}"
            pieces.append(f'<rect class="{split}" {place}><title>{label}</title></rect>')
        y += block + _BAR_GAP
    return "".join(pieces), y

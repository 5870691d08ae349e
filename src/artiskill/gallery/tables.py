"""The distributions as Markdown, for pages that are read without pictures."""

from collections.abc import Sequence

from artiskill.gallery.facts import ObjectFacts
from artiskill.gallery.statistics import KINDS, MEASURES, Measure, by_split, median, shares


def split_table(facts: Sequence[ObjectFacts]) -> str:
    """A row per split: how many objects, and each measure's smallest value, median and largest."""
    head = ["split", "objects", *(f"{m.name}, {m.unit}" if m.unit else m.name for m in MEASURES)]
    rows = [
        [split, str(len(members)), *(_spread([m.of(fact) for fact in members], m) for m in MEASURES)]
        for split, members in by_split(facts).items()
    ]
    return markdown(head, rows)


def kinds_table(facts: Sequence[ObjectFacts], title: str) -> str:
    """A row per kind: how many objects of each split have it."""
    splits = by_split(facts)
    counts = {split: shares(members, KINDS[title]) for split, members in splits.items()}
    kinds = sorted({kind for row in counts.values() for kind in row})
    rows = [[kind.replace("_", " "), *(str(counts[split].get(kind, 0)) for split in splits)] for kind in kinds]
    return markdown([title, *splits], rows)


def _spread(values: list[float], measure: Measure) -> str:
    low, middle, high = min(values), median(values), max(values)
    if measure.is_count:
        return f"{low:g} .. {middle:g} .. {high:g}"
    return f"{low:.2f} .. {middle:.2f} .. {high:.2f}" if high < 10 else f"{low:.1f} .. {middle:.1f} .. {high:.1f}"


def markdown(head: list[str], rows: list[list[str]]) -> str:
    """A table of texts."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)

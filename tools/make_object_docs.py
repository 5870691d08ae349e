"""Make the numbers and pictures of docs/objects.md anew: `python tools/make_object_docs.py`.

With `--check` it changes nothing and fails if the page's tables are not those of the catalogue.
"""

import sys
from pathlib import Path

import numpy as np

from artiskill.assets.articulated_object import CATEGORIES
from artiskill.assets.catalog import SPLITS, list_objects, load_object
from artiskill.assets.similarity import Descriptor, describe, nearest_neighbour
from artiskill.gallery.facts import (
    ObjectFacts,
    by_split,
    kinds_table,
    markdown,
    object_facts,
    present_kinds,
    split_table,
)
from artiskill.gallery.gallery import category_chart

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGE, IMAGES = DOCS / "objects.md", DOCS / "images"
BEGIN, END = "<!-- made by tools/make_object_docs.py -->", "<!-- end of what was made -->"


def main(arguments: list[str]) -> int:
    """Write, or compare; the exit status."""
    facts = {category: facts_of(category) for category in CATEGORIES}
    page = PAGE.read_text(encoding="utf-8")
    new = with_tables(page, facts)
    if "--check" in arguments:
        print("docs/objects.md is up to date" if new == page else "docs/objects.md is old: run this tool")
        return int(new != page)
    for category, members in facts.items():
        if members:
            chart_path(category).write_text(category_chart(members), encoding="utf-8")
    PAGE.write_text(new, encoding="utf-8")
    print(f"{PAGE}: {sum(map(len, facts.values()))} objects")
    return 0


def facts_of(category: str) -> list[ObjectFacts]:
    """Of every object of the catalogue."""
    names = [name for split in SPLITS for name in list_objects(category=category, split=split)]
    return [object_facts(load_object(name)) for name in names]


def chart_path(category: str) -> Path:
    """Where a category's picture is."""
    return IMAGES / f"objects_{category}.svg"


def with_tables(page: str, facts: dict[str, list[ObjectFacts]]) -> str:
    """The page with what stands between the two marks made anew."""
    before, _, rest = page.partition(BEGIN)
    _, _, after = rest.partition(END)
    made = "\n\n".join(section(category, members) for category, members in facts.items() if members)
    return f"{before}{BEGIN}\n\n{made}\n\n{END}{after}"


def section(category: str, facts: list[ObjectFacts]) -> str:
    """Heading, table, picture and lists of one category."""
    pieces = [f"### {category.capitalize()}s", split_table(facts)]
    pieces.append(f"![Distributions of the {category}s' sizes, masses, joints and handles]({image(category)})")
    pieces += [kinds_table(facts, title) for title in present_kinds(facts)]
    return "\n\n".join([*pieces, neighbours_table(facts)])


def neighbours_table(facts: list[ObjectFacts]) -> str:
    """Smallest and median distance of each split's objects to the most similar object, and training object."""
    described = {fact.id: describe(load_object(fact.id)) for fact in facts}
    splits = {split: [described[fact.id] for fact in members] for split, members in by_split(facts).items()}
    rows = [
        [split, *(_distances(members, list(others)) for others in (described.values(), splits["train"]))]
        for split, members in splits.items()
    ]
    return markdown(["nearest neighbour, mm", "any other object", "training object"], rows)


def _distances(members: list[Descriptor], others: list[Descriptor]) -> str:
    found = [nearest_neighbour(one, others) for one in members]
    distances = [1e3 * neighbour.distance_m for neighbour in found if neighbour is not None]
    return f"{min(distances):.1f}, median {np.median(distances):.1f}"


def image(category: str) -> str:
    """The picture's path from the page."""
    return chart_path(category).relative_to(DOCS).as_posix()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""The gallery's page: a template, its style and script, and the objects as data; all from the folder itself."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from importlib.resources import files as package_files
from pathlib import Path

from artiskill.assets.articulated_object import CATEGORIES
from artiskill.files import atomic_write
from artiskill.gallery.charts import category_chart
from artiskill.gallery.config import GalleryConfig
from artiskill.gallery.facts import ObjectFacts

PICTURES = "objects"
PAGE, DATA, ASSETS = "index.html", "objects.js", ("gallery.css", "gallery.js")


def write_page(
    facts: Sequence[ObjectFacts],
    pictures: Sequence[Path],
    sheets: Sequence[str],
    folder: Path,
    config: GalleryConfig,
) -> Path:
    """Write the page, last of all its files.

    Args:
        facts: of the objects, in the order in which they are shown.
        pictures: of each.
        sheets: contact sheets, paths relative to the folder.
        folder: the gallery's.
        config: sizes of the pictures.
    """
    data = {
        "width": config.width,
        "height": config.height,
        "steps": config.steps,
        "views": len(next(iter(config.views.values()))),
        "sheets": list(sheets),
        "objects": [
            asdict(fact) | {"picture": f"{PICTURES}/{file.name}"}
            for fact, file in zip(facts, pictures, strict=True)
        ],
    }
    texts = {DATA: f"window.GALLERY = {_script_safe(json.dumps(data, separators=(',', ':')))};\n"}
    texts |= {name: _template(name) for name in ASSETS}
    texts[PAGE] = _template(PAGE).replace("<!-- charts -->", _charts(facts))
    for name, text in texts.items():
        with atomic_write(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return folder / PAGE


def _charts(facts: Sequence[ObjectFacts]) -> str:
    """A figure per category that there are objects of."""
    figures = []
    for category in CATEGORIES:
        members = [fact for fact in facts if fact.category == category]
        if members:
            figures.append(f"<figure><figcaption>{category}s</figcaption>{category_chart(members)}</figure>")
    return "\n".join(figures)


def _script_safe(text: str) -> str:
    """JSON that no browser takes for the end of a script."""
    return text.replace("</", "<\\/").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _template(name: str) -> str:
    return (package_files("artiskill.gallery") / "web" / name).read_text(encoding="utf-8")

"""`make_gallery`: a folder with a page to browse objects, pictures of each, contact sheets and distributions.

What is drawn already is not drawn again: a picture's name holds a hash of its object and of the settings, so that
a gallery that was stopped, or whose objects have changed in part, is completed quickly.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from html import escape
from importlib.resources import files as package_files
from pathlib import Path

import numpy as np

from artiskill import __version__
from artiskill.assets.articulated_object import CATEGORIES, ArticulatedObject
from artiskill.assets.catalog import object_id_of, object_of
from artiskill.errors import ConfigError
from artiskill.files import atomic_write, output_path
from artiskill.gallery.facts import (
    KINDS,
    MEASURES,
    Measure,
    ObjectFacts,
    bin_edges,
    by_split,
    object_facts,
    present_kinds,
    shares,
)
from artiskill.gallery.pictures import (
    GalleryConfig,
    draw_frames,
    frames_name,
    load_gallery_config,
    write_frames,
    write_sheets,
)
from artiskill.jobs.parallel import run_jobs
from artiskill.jobs.worker import Send

MARKER = "gallery.json"  # stands in every folder that a gallery was begun in
SHEETS = "sheets"
PICTURES = "objects"
PAGE, DATA, ASSETS = "index.html", "objects.js", ("gallery.css", "gallery.js")
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


@dataclass(frozen=True, eq=False)
class _Job:
    """One object to draw."""

    item: str | ArticulatedObject
    folder: Path
    config: GalleryConfig


def make_gallery(
    objects: Sequence[str | ArticulatedObject],
    folder: Path | str,
    workers: int = 1,
    on_done: Callable[[], None] | None = None,
    force: bool = False,
    config: GalleryConfig | None = None,
) -> Path:
    """Draw objects and write the page; it is replaced last, so that an interrupted run leaves the old one usable.

    Args:
        objects: as `assets.catalog.resolve_objects` returns them.
        folder: made where it is missing; pictures of an earlier gallery that are no longer shown are removed.
        workers: processes.
        on_done: called after every object.
        force: also write into a folder with other files in it, which are left alone.
        config: sizes and views; by default those of configs/gallery.yaml.

    Returns:
        The page, `index.html`.

    Raises:
        ConfigError: the folder holds other files, or cannot be written.
        AssetError: an object that cannot be loaded or drawn.
    """
    folder, config = Path(folder), config or load_gallery_config()
    _claim(folder, force)
    jobs = [_Job(item, folder / PICTURES, config) for item in objects]

    on_message = None if on_done is None else lambda _: on_done()
    drawn = run_jobs(_draw, jobs, workers, on_message, lambda job: object_id_of(job.item))
    facts, files = [fact for fact, _ in drawn], [folder / PICTURES / name for _, name in drawn]
    try:
        sheets = write_sheets(facts, files, folder / SHEETS, config)
        page = write_page(facts, files, [sheet.relative_to(folder).as_posix() for sheet in sheets], folder, config)
        _remove_others(folder / PICTURES, files)
        _remove_others(folder / SHEETS, sheets)
    except OSError as error:
        raise _cannot_write(folder, error) from error
    return page


def _draw(job: _Job, send: Send) -> tuple[ObjectFacts, str]:
    """Draw one object unless its picture is there; its facts and the picture's name."""
    obj = object_of(job.item)
    path = job.folder / frames_name(obj, job.config)
    try:
        if not path.is_file():
            write_frames(draw_frames(obj, job.config), path, job.config)
    except OSError as error:
        raise _cannot_write(job.folder, error) from error
    send(obj.id)
    return object_facts(obj), path.name


def _claim(folder: Path, force: bool) -> None:
    """Make the folder and mark it as a gallery's."""
    folder = output_path(folder)
    if folder.exists() and not folder.is_dir():
        raise ConfigError(f"cannot write a gallery to {str(folder)!r}: it is not a folder")
    found = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    if found and MARKER not in found and not force:
        raise ConfigError(
            f"the folder {str(folder)!r} holds {found[0]!r}, which no gallery wrote: choose another folder, "
            "or use --force (`force=True`) to write beside it"
        )
    try:
        for name in (PICTURES, SHEETS):
            (folder / name).mkdir(parents=True, exist_ok=True)
        with atomic_write(folder / MARKER) as temporary:
            temporary.write_text(json.dumps({"made_by": f"ArtiSkill {__version__}"}) + "\n", encoding="utf-8")
    except OSError as error:
        raise _cannot_write(folder, error) from error


def _remove_others(folder: Path, files: Sequence[Path]) -> None:
    """Remove pictures that the page does not show, and what an interrupted run has left."""
    wanted = {file.name for file in files}
    for path in sorted(folder.glob("*.webp")) + sorted(folder.glob(".*.webp")):
        if path.name not in wanted:
            path.unlink()


def _cannot_write(folder: Path, error: OSError) -> ConfigError:
    return ConfigError(f"cannot write a gallery to {str(folder)!r}: {error.strerror or error}")


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
    """Return a figure for each category with objects."""
    figures = []
    for category in CATEGORIES:
        members = [fact for fact in facts if fact.category == category]
        if members:
            figures.append(f"<figure><figcaption>{category}s</figcaption>{category_chart(members)}</figure>")
    return "\n".join(figures)


def _script_safe(text: str) -> str:
    """Return JSON that no browser takes for the end of a script."""
    return text.replace("</", "<\\/").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _template(name: str) -> str:
    return (package_files("artiskill.gallery") / "web" / name).read_text(encoding="utf-8")


def category_chart(facts: Sequence[ObjectFacts]) -> str:
    """Return one SVG of all distributions of one category's objects."""
    splits = by_split(facts)
    pieces: list[str] = []
    panel_height = _TITLE + _ROW * len(splits) + _AXIS
    y = _MARGIN
    shown = [measure for measure in MEASURES if any(map(measure.of, facts))]
    for k, measure in enumerate(shown):
        if k and k % _COLUMNS == 0:
            y += panel_height + _MARGIN
        x = _MARGIN + k % _COLUMNS * (_PANEL + _MARGIN)
        pieces.append(f'<g transform="translate({x} {y})">{_histograms(splits, measure)}</g>')
    y += panel_height + _MARGIN
    half = (_WIDTH - 3 * _MARGIN) // 2
    heights = []
    for k, title in enumerate(present_kinds(facts)):
        drawn, height = _bars(splits, title, half)
        pieces.append(f'<g transform="translate({_MARGIN + k * (half + _MARGIN)} {y})">{drawn}</g>')
        heights.append(height)
    height = y + max(heights) + _MARGIN
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" class="os" role="img">'
    title = f"<title>{escape(facts[0].category)}: distributions over {escape(', '.join(splits))}</title>"
    return f"{head}{title}<style>{_STYLE}</style>{''.join(pieces)}</svg>\n"


def _histograms(splits: dict[str, list[ObjectFacts]], measure: Measure) -> str:
    """Return a panel: one row of bars per split, all on one axis and one scale of shares."""
    values = {split: [measure.of(fact) for fact in members] for split, members in splits.items()}
    edges = bin_edges([v for row in values.values() for v in row], measure.is_count)
    counts = {split: np.histogram(row, edges)[0] for split, row in values.items()}
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
    """Return the numbers below the rows: some edges, or the whole numbers that bins of a count stand for."""
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
    """Return a panel, for each kind a bar per split as long as its share of objects, and its height."""
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

"""`make_gallery`: a folder with a page to browse objects, pictures of each, contact sheets and distributions.

What is drawn already is not drawn again: a picture's name holds a hash of its object and of the settings, so that
a gallery that was stopped, or whose objects have changed in part, is completed quickly.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from artiskill import __version__
from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object, object_id_of
from artiskill.errors import ConfigError
from artiskill.files import atomic_write, output_path
from artiskill.gallery.config import GalleryConfig, load_gallery_config
from artiskill.gallery.facts import ObjectFacts, object_facts
from artiskill.gallery.frames import draw_frames, frames_name, write_frames
from artiskill.gallery.page import PICTURES, write_page
from artiskill.gallery.sheets import write_sheets
from artiskill.jobs.parallel import run_jobs

MARKER = "gallery.json"  # stands in every folder that a gallery was begun in
SHEETS = "sheets"


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
    on_done: Callable[[], object] | None = None,
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

    def tell(_: Any) -> None:
        if on_done is not None:
            on_done()

    drawn = run_jobs(_draw, jobs, workers, tell, lambda job: object_id_of(job.item))
    facts, files = [fact for fact, _ in drawn], [folder / PICTURES / name for _, name in drawn]
    try:
        sheets = write_sheets(facts, files, folder / SHEETS, config)
        page = write_page(facts, files, [sheet.relative_to(folder).as_posix() for sheet in sheets], folder, config)
        _remove_others(folder / PICTURES, files)
        _remove_others(folder / SHEETS, sheets)
    except OSError as error:
        raise _cannot_write(folder, error) from error
    return page


def _draw(job: _Job, tell: Callable[[Any], None]) -> tuple[ObjectFacts, str]:
    """Draw one object unless its picture is there; its facts and the picture's name."""
    obj = load_object(job.item) if isinstance(job.item, str) else job.item
    path = job.folder / frames_name(obj, job.config)
    try:
        if not path.is_file():
            write_frames(draw_frames(obj, job.config), path, job.config)
    except OSError as error:
        raise _cannot_write(job.folder, error) from error
    tell(obj.id)
    return object_facts(obj), path.name


def _claim(folder: Path, force: bool) -> None:
    """Make the folder and mark it as a gallery's."""
    folder = output_path(folder)
    if folder.exists() and not folder.is_dir():
        raise ConfigError(f"cannot write a gallery to {str(folder)!r}: it is not a folder")
    found = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    if found and MARKER not in found and not force:
        raise ConfigError(
            f"the folder {str(folder)!r} holds {found[0]!r}, which no gallery wrote: name another folder, or say "
            "--force (`force=True`) to write beside it"
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

"""A gallery folder: complete, small, resumable, and all of it inside the folder."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object
from artiskill.errors import ConfigError
from artiskill.gallery import gallery as gallery_module
from artiskill.gallery.gallery import make_gallery
from artiskill.gallery.pictures import GalleryConfig, load_gallery_config

NAMES = ("cabinet-0002", "generated-bucket-3")


@pytest.fixture(scope="module")
def config() -> GalleryConfig:
    """Small pictures: what is tested is not how they look."""
    return load_gallery_config({"width": 64, "height": 48, "steps": 3, "look": {"samples_per_axis": 1}})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, config: GalleryConfig) -> Path:
    """A gallery of two objects."""
    path = tmp_path_factory.mktemp("gallery") / "out"
    make_gallery(NAMES, path, config=config)
    return path


def data_of(folder: Path) -> dict:
    text = (folder / "objects.js").read_text()
    assert text.startswith("window.GALLERY = ")
    return json.loads(text.removeprefix("window.GALLERY = ").rstrip().rstrip(";"))


def test_every_picture_has_all_steps_and_views(folder: Path, config: GalleryConfig) -> None:
    data = data_of(folder)
    assert [entry["id"] for entry in data["objects"]] == list(NAMES)
    for entry in data["objects"]:
        with Image.open(folder / entry["picture"]) as image:
            assert image.size == (64 * 3, 48 * data["views"])
            pixels = np.asarray(image.convert("RGB")).astype(int)
        closed, opened = pixels[:48, :64], pixels[:48, -64:]
        assert np.abs(closed - opened).mean() > 1, "the joints move"


def test_facts_are_those_of_the_object(folder: Path) -> None:
    entry = data_of(folder)["objects"][0]
    obj = load_object(NAMES[0])
    assert entry["category"] == "cabinet"
    assert entry["split"] == "train"
    assert entry["content_hash"] == obj.content_hash
    assert [joint["link"] for joint in entry["joints"]] == [obj.links[i].name for i in obj.jointed_links]
    assert data_of(folder)["objects"][1]["split"] == "generated"


class Links(HTMLParser):
    """Collects everything that a page asks for."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [value or "" for name, value in attrs if name in ("src", "href")]


def test_the_page_needs_nothing_from_outside(folder: Path) -> None:
    links = Links()
    links.feed((folder / "index.html").read_text())
    files = [link for link in links.found if not link.startswith(("#", "data:"))]
    assert sorted(files) == ["gallery.css", "gallery.js", "objects.js"]
    for file in files:
        text = (folder / file).read_text()
        assert not re.search(r"https?:|//cdn|@import|fetch\(|XMLHttpRequest", text), file
    for sheet in data_of(folder)["sheets"]:
        assert (folder / sheet).is_file()


def test_the_page_has_what_the_script_looks_for(folder: Path) -> None:
    page, script = (folder / "index.html").read_text(), (folder / "gallery.js").read_text()
    for name in set(re.findall(r'byId\("([\w-]+)"\)', script)):
        assert f'id="{name}"' in page, name
    for name in re.findall(r"form\.elements\.(\w+)", script):
        assert f'name="{name}"' in page, name


def test_sheets_show_each_split_closed_and_open(folder: Path) -> None:
    names = sorted(Path(sheet).name for sheet in data_of(folder)["sheets"])
    assert names == [
        *("bucket-generated-closed.webp", "bucket-generated-open.webp"),
        *("cabinet-train-closed.webp", "cabinet-train-open.webp"),
    ]


def test_what_is_drawn_is_not_drawn_again(
    folder: Path, config: GalleryConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = []
    monkeypatch.setattr(gallery_module, "draw_frames", lambda obj, config: drawn.append(obj.id))
    make_gallery(NAMES, folder, config=config)
    assert drawn == []


def test_what_is_no_longer_shown_is_removed(tmp_path: Path, config: GalleryConfig) -> None:
    make_gallery(NAMES, tmp_path / "out", config=config)
    notes = tmp_path / "out" / "objects" / "notes.txt"
    notes.write_text("mine")
    make_gallery(NAMES[:1], tmp_path / "out", config=config)
    files = sorted(path.name.split(".")[0] for path in (tmp_path / "out" / "objects").glob("*.webp"))
    assert files == ["cabinet-0002"]
    assert notes.is_file()


def test_a_failure_leaves_the_old_page(
    tmp_path: Path, config: GalleryConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = make_gallery(NAMES[:1], tmp_path / "out", config=config)
    before = (tmp_path / "out" / "objects.js").read_bytes()

    def stop(obj: ArticulatedObject, config: GalleryConfig) -> np.ndarray:
        raise KeyboardInterrupt

    monkeypatch.setattr(gallery_module, "draw_frames", stop)
    with pytest.raises(KeyboardInterrupt):
        make_gallery(NAMES, tmp_path / "out", config=config)
    assert page.is_file()
    assert (tmp_path / "out" / "objects.js").read_bytes() == before
    assert len(list((tmp_path / "out" / "objects").iterdir())) == 1


def test_a_foreign_folder_is_left_alone_unless_forced(tmp_path: Path, config: GalleryConfig) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(ConfigError, match=r"thesis\.tex.*--force"):
        make_gallery(NAMES[:1], tmp_path, config=config)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]
    make_gallery(NAMES[:1], tmp_path, config=config, force=True)
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


def test_progress_counts_every_object(folder: Path, config: GalleryConfig) -> None:
    done = []
    make_gallery(NAMES, folder, config=config, on_done=lambda: done.append(1))
    assert len(done) == len(NAMES)


def test_several_views_per_category_or_an_error() -> None:
    views = {"cabinet": [], "chair": [{"azimuth_deg": 0, "elevation_deg": 0}], "bucket": []}
    with pytest.raises(ConfigError, match="views must name as many views"):
        load_gallery_config({"views": views})

"""Build the documentation site with the gallery of all objects and a film of each task: `make_site.py FOLDER`.

Takes some minutes the first time; the gallery draws only what has changed.
"""

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

from make_pictures import STRIPS  # the site shows the same episodes as films

ROOT = Path(__file__).resolve().parents[1]


def main(arguments: list[str]) -> int:
    """Build; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="the site appears here")
    site = parser.parse_args(arguments).folder
    pages = ["-W", "--keep-going", "-q", "-b", "html", "-t", "site", "-d", str(site / ".doctrees")]
    run("sphinx", *pages, str(ROOT / "docs"), str(site))
    run("artiskill", "assets", "gallery", "all", "ood", "--out", str(site / "gallery"))
    shutil.copytree(ROOT / "docs" / "replays", site / "replays", dirs_exist_ok=True)
    (site / "films").mkdir(exist_ok=True)
    for task, (object_id, level) in STRIPS.items():
        episode = ["--task", task, "--object", object_id, "--level", str(level)]
        run("artiskill", "render", *episode, "--out", str(site / "films" / f"{task}.webp"))
    (site / "films" / "index.html").write_text(films_page(), encoding="utf-8")
    print(f"open {site / 'index.html'}")
    return 0


def run(module: str, *arguments: str) -> None:
    """Run a module of this Python, and stop at its first error."""
    subprocess.run([sys.executable, "-m", module, *arguments], check=True)


def films_page() -> str:
    """Return the page that shows all films."""
    figure = '<figure><img src="{0}.webp" alt="{0}"><figcaption>{0}</figcaption></figure>'
    style = "body { font-family: sans-serif; margin: 2rem } figure { display: inline-block; margin: 1rem }"
    head = f'<!doctype html><meta charset="utf-8"><title>ArtiSkill: films</title><style>{style}</style>'
    return f'{head}<p><a href="../index.html">Documentation</a></p>{"".join(map(figure.format, STRIPS))}\n'


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

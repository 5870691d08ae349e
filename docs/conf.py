"""Configuration of Sphinx, which builds the site: `make docs`, or `make site` with the gallery and films.

MyST reads the same Markdown that people read in the repository. Autodoc makes the reference from the docstrings.
Nothing is fetched while it builds or while the site is read.
"""

import dataclasses
import inspect
import re
from importlib.metadata import version as installed_version

project = "ArtiSkill"
author = "the ArtiSkill authors"
project_copyright = "the ArtiSkill authors, Apache-2.0"
release = version = installed_version("artiskill")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
]
exclude_patterns = ["_build"]
source_suffix = {".md": "markdown"}

myst_heading_anchors = 3  # links to headings work as they do in the repository
myst_url_schemes = ["http", "https"]
suppress_warnings = ["myst.header"]  # a page may skip a level of headings

autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
napoleon_numpy_docstring = False
napoleon_preprocess_types = False

html_theme = "furo"
html_title = "ArtiSkill"
html_copy_source = False
html_static_path = ["_static"]
html_css_files = ["tables.css"]
html_theme_options = {"source_repository": "", "footer_icons": []}

# docstrings write code and tables as Markdown does, since people read them in a terminal
default_role = "code"


def _list_table(rows: list[str]) -> list[str]:
    """Return a Markdown table as a reStructuredText list-table."""
    lines = [".. list-table::", "   :header-rows: 1", ""]
    for row in rows[:1] + rows[2:]:
        cells = [cell.strip() for cell in row.strip().strip("|").split("|")]
        lines += [f"   {'  -' if column else '* -'} {cell}" for column, cell in enumerate(cells)]
    return ["", *lines, ""]


def _convert_markdown(app, what, name, obj, options, lines: list[str]) -> None:
    """Replace what reStructuredText writes differently in a docstring."""
    found: list[str] = []
    table: list[str] = []
    plurals = (re.sub(r"(`[\w.]+`)(?=s\b)", r"\1\\ ", line) for line in lines)  # `ArticulatedObject`s
    for line in (*plurals, ""):
        if line.lstrip().startswith("|"):
            table.append(line)
            continue
        if table:
            found += _list_table(table)
            table = []
        found.append(f".. rubric:: {line[3:]}" if line.startswith("## ") else line)
    lines[:] = found


def _list_fields(app, what, name, obj, options, lines: list[str]) -> None:
    """Make a section of the comments that the fields of a dataclass have instead of one."""
    if what == "class" and dataclasses.is_dataclass(obj) and "Attributes:" not in lines:
        source = inspect.getsource(obj)
        comments = dict(re.findall(r"^    (\w+): .*?  # (.*)$", source, re.MULTILINE))
        lines += [
            "Attributes:",
            *(f"    {f.name}: {comments.get(f.name, '')}" for f in dataclasses.fields(obj)),
            "",
        ]


def setup(app) -> None:
    """Connect what Sphinx calls while it reads docstrings."""
    app.connect("autodoc-process-docstring", _list_fields, priority=400)  # before sections are read
    app.connect("autodoc-process-docstring", _convert_markdown)

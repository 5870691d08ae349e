"""Pieces of pages in one file, without scripts or requests.

What comes from a report is a stranger's: `text` makes it harmless, and the pages' policy forbids a browser to load
or run anything all the same.
"""

import base64
import hashlib
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from html import escape
from importlib.resources import files as package_files
from typing import Any

from artiskill.evaluation.statistics import Interval

_MOST_CHARACTERS = 500  # of a name
_UNPRINTABLE = "\ufffd"


def text(value: object, most: int = _MOST_CHARACTERS) -> str:
    """Return a value as text that stays text: escaped, without control characters, not endless."""
    shown = str(value)
    shown = shown if len(shown) <= most else f"{shown[:most]} ..."
    kept = "".join(one if one.isprintable() or one in "\n\t" else _UNPRINTABLE for one in shown)
    return escape(kept, quote=True)


def percent(share: float) -> str:
    """Return a share with one decimal."""
    return f"{share:.1%}".replace("%", "&#8239;%")


def span_text(interval: Interval | None) -> str:
    """Return both bounds of an interval of shares."""
    return "none with one object" if interval is None else f"{percent(interval[0])} to {percent(interval[1])}"


def rate_bar(rate: float, interval: Interval | None) -> str:
    """Return a picture of a rate, and the interval around it, on a scale from 0 to 1."""
    low, high = interval or (rate, rate)
    label = f"{rate:.1%}" if interval is None else f"{rate:.1%}, interval {low:.1%} to {high:.1%}"
    mark = min(max(100.0 * rate - 0.6, 0.0), 98.8)
    return (
        f'<svg class="bar" viewBox="0 0 100 10" preserveAspectRatio="none" role="img" aria-label="{label}">'
        '<rect class="track" y="3" width="100" height="4"/>'
        f'<rect class="span" x="{100 * low:.2f}" y="1.5" width="{max(100 * (high - low), 0.0):.2f}" height="7"/>'
        f'<rect class="mark" x="{mark:.2f}" width="1.2" height="10"/></svg>'
    )


def image(webp: bytes, alternative: str) -> str:
    """Return a picture or film that is part of the page; its alternative text is escaped here."""
    data = base64.b64encode(webp).decode()
    return f'<img src="data:image/webp;base64,{data}" alt="{text(alternative)}">'


def facts(pairs: Iterable[tuple[str, str]]) -> str:
    """Return a list of names with what they say, the latter as HTML."""
    return f"<dl>{''.join(f'<dt>{text(name)}</dt><dd>{said}</dd>' for name, said in pairs)}</dl>"


def plain(value: Any) -> str:
    """Return plain values of any shape, of a part of a report that has its own layout, as HTML."""
    if isinstance(value, Mapping):
        return facts((str(name).replace("_", " "), plain(one)) for name, one in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(plain(one) for one in value) or "none"
    if value is None or isinstance(value, bool):
        return "unknown" if value is None else "yes" if value else "no"
    return text(value)


def row(cells: Sequence[str]) -> str:
    """Return a row of a table."""
    return f'<tr role="row">{"".join(cells)}</tr>'


def cell(content: str, head: str = "", kind: str = "number") -> str:
    """Return a cell; its column's head is shown beside it where the page is narrow.

    Args:
        content: HTML.
        head: of the column, HTML.
        kind: `number`, `name` (with `words` if they must not break), `wide`, `picture` or `empty`.
    """
    named = f' data-head="{head}"' if head else ""
    return f'<td role="cell" class="{kind}"{named}>{content}</td>'


def table(heads: Sequence[tuple[str, str]], body: Sequence[str], foot: Sequence[str] = ()) -> str:
    """Return a table that becomes a list of cards where the page is narrow.

    Args:
        heads: HTML and kind of each column.
        body: its rows.
        foot: the rows below.
    """
    titles = [f'<th role="columnheader" scope="col" class="{kind}">{head}</th>' for head, kind in heads]
    below = f'<tfoot role="rowgroup">{"".join(foot)}</tfoot>' if foot else ""
    return (
        f'<table role="table" class="cards"><thead role="rowgroup">{row(titles)}</thead>'
        f'<tbody role="rowgroup">{"".join(body)}</tbody>{below}</table>'
    )


def section(title: str, content: str, name: str = "", kind: str = "") -> str:
    """Return a part of a page under a title, both HTML."""
    mark = f' id="{name}"' if name else ""
    return f'<section class="card {kind}"{mark}><h2>{title}</h2>{content}</section>'


@cache
def _style() -> str:
    return package_files("artiskill.evaluation").joinpath("web", "report.css").read_text(encoding="utf-8")


def page(title: str, body: str) -> bytes:
    """Return a whole page.

    Args:
        title: text, escaped here.
        body: HTML.
    """
    digest = base64.b64encode(hashlib.sha256(_style().encode()).digest()).decode()
    policy = f"default-src 'none'; img-src data:; style-src 'sha256-{digest}'; base-uri 'none'; form-action 'none'"
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n<meta name="referrer" content="no-referrer">\n'
        f'<title>{text(title)}</title>\n<link rel="icon" href="data:,">\n'
        f"<style>{_style()}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    ).encode()

"""Small helpers for writing XML."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path


def numbers(values: Iterable[float]) -> str:
    """Numbers as XML has them, to twelve digits, without negative zeros."""
    return " ".join(format(float(value) + 0.0, ".12g") for value in values)


def add(parent: ET.Element, tag: str, **attributes: str | int) -> ET.Element:
    """A child with attributes; a trailing `_` of a name, for Python's keywords, is dropped."""
    return ET.SubElement(parent, tag, {name.rstrip("_"): str(value) for name, value in attributes.items()})


def write_xml(root: ET.Element, path: Path) -> None:
    """Write an indented document."""
    ET.indent(root)
    path.write_bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n")

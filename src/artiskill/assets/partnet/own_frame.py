"""Folders that are in metres already: `meta.json` says so, and the importer neither scales nor moves them."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from artiskill.assets.partnet.semantics import read_meta
from artiskill.errors import AssetError, shown

KEY = "artiskill"


@dataclass(frozen=True, eq=False)
class OwnFrame:
    """How a folder's root frame, z up, becomes the object frame: x to `scale * (x - origin)`.

    Attributes:
        scale: metres per unit of the file.
        origin: (3,) in the file's units.
    """

    scale: float
    origin: np.ndarray


def read_own_frame(folder: Path) -> OwnFrame | None:
    """What `meta.json` says under `artiskill`: `{"scale": 1.0, "origin": [0, 0, 0]}`; None where it says nothing.

    Raises:
        AssetError: it says something else.
    """
    given = read_meta(folder).get(KEY)
    if given is None:
        return None
    found: dict[str, Any] = {"scale": 1.0, "origin": [0.0, 0.0, 0.0], **given} if isinstance(given, dict) else {}
    scale: Any = found.get("scale")
    origin: Any = found.get("origin")
    legal = len(found) == 2 and _is_number(scale) and scale > 0  # nothing but these two
    if not legal or not isinstance(origin, list) or len(origin) != 3 or not all(map(_is_number, origin)):
        raise AssetError(
            f"{folder.name}/meta.json: {KEY!r} must be a mapping with a positive number 'scale' and three numbers "
            f"'origin', not {shown(given)}"
        )
    return OwnFrame(float(scale), np.array(origin, dtype=float))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)

"""What each mesh is: part names from the URDF, or from the annotation files where the URDF has none."""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from artiskill.assets.articulated_object import Category
from artiskill.assets.handles import is_handle_part
from artiskill.assets.partnet.urdf import UrdfMesh
from artiskill.errors import AssetError

UNKNOWN = "unknown"
CATEGORY_OF: dict[str, Category] = {"StorageFurniture": "cabinet", "Chair": "chair", "Bucket": "bucket"}

_NAME_AND_ID = re.compile(r"^(?P<name>.+)-(?P<id>\d+)$")


@dataclass(frozen=True)
class PartLabel:
    """A part's name and its annotation id, -1 where unknown; meshes of one part share both."""

    name: str
    id: int

    @property
    def is_handle(self) -> bool:
        """Whether the part is something to grip."""
        return is_handle_part(self.name)


class PartNames:
    """Finds the label of a mesh: by the visual's name, else by the mesh file through the annotations."""

    def __init__(self, by_stem: dict[str, PartLabel]) -> None:
        """`by_stem`: label of each mesh file, by its name without folder and ending."""
        self._by_stem = by_stem

    def label(self, mesh: UrdfMesh) -> PartLabel:
        """The label of a mesh; `PartLabel("unknown", -1)` where neither source knows it."""
        match = _NAME_AND_ID.match(mesh.name or "")
        if match:
            return PartLabel(match["name"], int(match["id"]))
        return self._by_stem.get(Path(mesh.file).stem, PartLabel(mesh.name or UNKNOWN, -1))


def read_part_names(folder: Path) -> PartNames:
    """Read `result.json` (which mesh belongs to which node) and `mobility_v2.json` (which nodes are parts).

    A mesh takes the nearest node above it that `mobility_v2.json` lists as a part, else the leaf that names it.
    Both files may be missing: then only the URDF's own names count.

    Raises:
        AssetError: a file is not JSON or not of the expected shape.
    """
    parts: dict[int, str] = {}
    for link in _read_list(folder / "mobility_v2.json"):
        for node in _walk(link.get("parts", ()), (), "mobility_v2.json"):
            parts[_node_id(node[-1])] = str(node[-1].get("name", UNKNOWN))
    by_stem: dict[str, PartLabel] = {}
    for path in _walk(_read_list(folder / "result.json"), (), "result.json"):
        leaf = path[-1]
        ids = [_node_id(node) for node in path]
        known = [i for i in ids if i in parts]
        label = (
            PartLabel(parts[known[-1]], known[-1]) if known else PartLabel(str(leaf.get("name", UNKNOWN)), ids[-1])
        )
        stems = leaf.get("objs", ())
        if not isinstance(stems, list | tuple):
            raise AssetError(f"result.json: 'objs' must be a list, not {stems!r}")
        for stem in stems:
            # an inner node may list its leaves' meshes again: leaves come later in the walk, and win
            by_stem[str(stem)] = label
    return PartNames(by_stem)


def read_category(folder: Path) -> tuple[Category, str]:
    """The benchmark's category and the data set's name for it, from `meta.json`.

    Raises:
        AssetError: the file is missing or not JSON, or the category is none of the benchmark's.
    """
    path = folder / "meta.json"
    data = _read_json(path)
    if data is None:
        raise AssetError(f"PartNet folder {str(folder)!r} has no file 'meta.json'; it must hold one")
    given = data.get("model_cat") if isinstance(data, dict) else None
    if not isinstance(given, str) or given not in CATEGORY_OF:
        raise AssetError(f"{folder.name}/meta.json: model_cat is {given!r}; legal: {', '.join(CATEGORY_OF)}")
    return CATEGORY_OF[given], str(given)


def _walk(nodes: Any, above: tuple[dict[str, Any], ...], file: str) -> Iterator[tuple[dict[str, Any], ...]]:
    """Every node of a tree, as the path of nodes from the top to it; parents before children."""
    if not isinstance(nodes, list | tuple):
        raise AssetError(f"{file}: 'children' and 'parts' must be lists, not {type(nodes).__name__}")
    for node in nodes:
        if not isinstance(node, dict):
            raise AssetError(f"{file}: a node must be a mapping, not {node!r}")
        path = (*above, node)
        yield path
        yield from _walk(node.get("children", ()), path, file)


def _node_id(node: dict[str, Any]) -> int:
    value = node.get("id", -1)
    return value if isinstance(value, int) else -1


def _read_list(path: Path) -> list[dict[str, Any]]:
    data = _read_json(path)
    if data is None:
        return []
    if not isinstance(data, list) or not all(isinstance(item, dict) for item in data):
        raise AssetError(f"{path.parent.name}/{path.name} must hold a list of mappings")
    return data


def _read_json(path: Path) -> Any:
    """The file's content, or None where it does not exist."""
    if not path.is_file():
        return None
    try:
        return json.loads(path.read_bytes())
    except ValueError as error:  # JSONDecodeError and UnicodeDecodeError alike
        raise AssetError(f"{path.parent.name}/{path.name} is not valid JSON: {error}") from error
    except OSError as error:
        raise AssetError(f"{path.parent.name}/{path.name} cannot be read: {error.strerror}") from error

"""What each mesh is: part names from the URDF, else from the annotation files; and the benchmark's names for them.

Tasks look for parts by name (a wheel rubs on the ground otherwise than a leg), so chairs and buckets of all
sources use the same few names: `star_leg_base` is `base`, `armrest_soft_surface` is `arm`. Cabinets keep the data
set's names, which say more.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from artiskill.assets.articulated_object import Category
from artiskill.assets.handles import is_handle_part
from artiskill.assets.partnet.urdf import UrdfMesh
from artiskill.errors import AssetError, shown
from artiskill.files import is_file, parse_json, read_bytes, read_text

UNKNOWN = "unknown"
CATEGORY_OF: dict[str, Category] = {"StorageFurniture": "cabinet", "Chair": "chair", "Bucket": "bucket"}

CHAIR_PARTS = ("wheel", "caster", "base", "column", "seat", "back", "arm", "headrest", "footrest")
BUCKET_PARTS = ("wall", "floor", "lip", "handle")
WHEEL, CASTER, HANDLE, WALL = "wheel", "caster", "handle", "wall"

# The first row with a word of the part's name decides; words are what stands between underscores.
_CHAIR_WORDS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("wheel", ("wheel", "wheels")),
    ("caster", ("caster", "castor", "casters")),
    ("headrest", ("headrest", "head")),
    ("footrest", ("footrest",)),
    ("arm", ("arm", "armrest", "arms")),
    ("back", ("back", "backrest", "lumbar")),
    ("column", ("column", "central", "mechanical", "pedestal", "gas", "lever", "knob", "button")),
    ("seat", ("seat", "cushion", "pillow")),
    ("base", ("base", "leg", "legs", "foot", "feet", "runner", "rocker", "stretcher", "star")),
)
_BUCKET_WORDS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("handle", ("handle", "bail", "grip", "knob")),
    ("floor", ("floor", "bottom", "base", "foot")),
    ("lip", ("lip", "rim", "edge", "spout")),
    ("wall", ("wall", "body", "side", "container", "bucket", "frame", "pail")),
)
_WORDS = {"chair": _CHAIR_WORDS, "bucket": _BUCKET_WORDS}

_NAME_AND_ID = re.compile(r"^(?P<name>.+)-(?P<id>\d+)$")


@dataclass(frozen=True)
class PartLabel:
    """What a mesh belongs to; meshes of one part share all three."""

    name: str  # the data set's
    id: int  # in its annotation, -1 where unknown
    part: str  # the benchmark's name

    @property
    def is_handle(self) -> bool:
        """Whether the part is something to grip."""
        return self.part == HANDLE or is_handle_part(self.name)


@dataclass(frozen=True)
class PartNames:
    """Finds the label of a mesh: by the visual's name, else by the mesh file, else by its link."""

    category: Category  # of the object
    # name and id of each mesh file's part, by the file's name without folder and ending
    by_stem: Mapping[str, tuple[str, int]]
    groups: Mapping[int, tuple[str, ...]]  # names of the nodes above each node of the annotation, inner ones first
    by_link: Mapping[str, str]  # names of whole links, the last resort

    def label(self, mesh: UrdfMesh) -> PartLabel:
        """Return the label of a mesh; its name is "unknown" where no source knows it."""
        match = _NAME_AND_ID.match(mesh.name or "")
        if match:
            name, number = match["name"], int(match["id"])
        elif mesh.name:
            name, number = mesh.name, -1
        else:
            name, number = self.by_stem.get(Path(mesh.file).stem, (self.by_link.get(mesh.link, UNKNOWN), -1))
        return PartLabel(name, number, benchmark_part(self.category, (name, *self.groups.get(number, ()))))


def benchmark_part(category: Category, names: Sequence[str]) -> str:
    """Return the benchmark's name of a part.

    Args:
        category: of the object; cabinets keep the data set's names.
        names: the part's own name, then those of the groups it belongs to, inner ones first.

    Returns:
        One of `CHAIR_PARTS` or `BUCKET_PARTS`; the part's own name where none of its names says anything.
    """
    if category == "cabinet":
        return names[0]
    for name in names:
        if category == "bucket" and is_handle_part(name):
            return HANDLE
        words = name.lower().replace("-", "_").replace(" ", "_").split("_")
        # an object's top node, `chair`, says nothing, and `chair_back` no more than its last word
        words = [word for word in words if word != "chair"]
        for part, legal in _WORDS[category]:
            if not set(legal).isdisjoint(words):
                return part
    return names[0]


def read_part_names(folder: Path, category: Category = "cabinet") -> PartNames:
    """Read `result.json`, `mobility_v2.json` and `semantics.txt`; each may be missing.

    `result.json` says which mesh belongs to which node, `mobility_v2.json` which nodes are parts: a mesh takes the
    nearest node above it that is a part, else the leaf that names it. `semantics.txt` names whole links.

    Args:
        folder: of the object.
        category: of the object; it decides the benchmark's part names.

    Raises:
        AssetError: a file is not JSON or not of the expected shape.
    """
    parts: dict[int, str] = {}
    for link in _read_list(folder / "mobility_v2.json"):
        for node in _walk(link.get("parts", ()), (), "mobility_v2.json"):
            parts[_node_id(node[-1])] = str(node[-1].get("name", UNKNOWN))
    by_stem: dict[str, tuple[str, int]] = {}
    groups: dict[int, tuple[str, ...]] = {}
    for path in _walk(_read_list(folder / "result.json"), (), "result.json"):
        leaf = path[-1]
        ids = [_node_id(node) for node in path]
        known = [i for i in ids if i in parts]
        label = (parts[known[-1]], known[-1]) if known else (str(leaf.get("name", UNKNOWN)), ids[-1])
        groups[ids[-1]] = tuple(str(node.get("name", UNKNOWN)) for node in reversed(path[:-1]))
        stems = leaf.get("objs", ())
        if not isinstance(stems, list | tuple):
            raise AssetError(f"result.json: 'objs' must be a list, not {shown(stems)}")
        for stem in stems:
            # an inner node may list its leaves' meshes again: leaves come later in the walk, and win
            by_stem[str(stem)] = label
    return PartNames(category, by_stem, groups, _read_link_names(folder / "semantics.txt"))


def _read_link_names(path: Path) -> dict[str, str]:
    """Read lines such as `link_0 hinge handle`: link, kind of joint, what the link is; others are skipped."""
    if not is_file(path):
        return {}
    try:
        lines = read_text(path, errors="replace").splitlines()
    except OSError as error:
        raise AssetError(f"{path.parent.name}/{path.name} cannot be read: {error.strerror}") from error
    rows = [line.split() for line in lines]
    return {row[0]: row[2] for row in rows if len(row) == 3}


def read_category(folder: Path) -> tuple[Category, str]:
    """Return the benchmark's category and the data set's name for it, from `meta.json`.

    Raises:
        AssetError: the file is missing or not JSON, or the category is none of the benchmark's.
    """
    given = read_meta(folder).get("model_cat")
    if not isinstance(given, str) or given not in CATEGORY_OF:
        raise AssetError(f"{folder.name}/meta.json: model_cat is {shown(given)}; legal: {', '.join(CATEGORY_OF)}")
    return CATEGORY_OF[given], str(given)


def read_meta(folder: Path) -> dict[str, Any]:
    """Read `meta.json`; the result is empty where it holds no mapping.

    Raises:
        AssetError: the file is missing or not JSON.
    """
    data = _read_json(folder / "meta.json")
    if data is None:
        raise AssetError(f"PartNet folder {str(folder)!r} has no file 'meta.json'; it must hold one")
    return data if isinstance(data, dict) else {}


def _walk(nodes: Any, above: tuple[dict[str, Any], ...], file: str) -> Iterator[tuple[dict[str, Any], ...]]:
    """Yield every node of a tree, as the path of nodes from the top to it; parents before children."""
    if not isinstance(nodes, list | tuple):
        raise AssetError(f"{file}: 'children' and 'parts' must be lists, not {type(nodes).__name__}")
    for node in nodes:
        if not isinstance(node, dict):
            raise AssetError(f"{file}: a node must be a mapping, not {shown(node)}")
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
    """Return the file's content, or None where it does not exist."""
    if not is_file(path):
        return None
    try:
        return parse_json(read_bytes(path))
    except ValueError as error:  # JSONDecodeError and UnicodeDecodeError alike
        raise AssetError(f"{path.parent.name}/{path.name} is not valid JSON: {error}") from error
    except OSError as error:
        raise AssetError(f"{path.parent.name}/{path.name} cannot be read: {error.strerror}") from error

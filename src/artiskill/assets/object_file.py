"""An `ArticulatedObject` as one file, every bit of it: its arrays, and a JSON text that says where each belongs.

A file may come from a stranger. It holds plain values only, is read within limits, and its numbers are checked:
what is wrong with one is an error, never a crash of the engine.
"""

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, cast, get_args

import numpy as np

from artiskill.assets.articulated_object import (
    CATEGORIES,
    ArticulatedObject,
    CollisionShape,
    Handle,
    Joint,
    JointKind,
    Link,
    Material,
    ShapeKind,
    VisualMesh,
)
from artiskill.errors import AssetError, shown
from artiskill.files import check_archive, open_regular, parse_json
from artiskill.geometry.arrays import norm
from artiskill.geometry.meshes import TriMesh

_VERSION = 1
_TYPES = {
    cls.__name__: cls
    for cls in (ArticulatedObject, CollisionShape, Handle, Joint, Link, Material, TriMesh, VisualMesh)
}
_MOST_BYTES, _MOST_TEXT_BYTES = (
    512 * 1024**2,
    20_000_000,
)  # unpacked; the catalogue's largest have 0.6 MB and 40 kB
_MOST_DEPTH = 40  # of nested values; an object without metadata has 14
_MOST_LINKS, _MOST_PIXELS = 1000, 8192**2  # as of what is imported
_FARTHEST = 1e4  # of coordinates
_LENGTH_TOLERANCE = 1e-3  # of quaternions
_SIZES: dict[str, int] = {"box": 3, "cylinder": 2, "capsule": 2, "sphere": 1, "hull": 0}  # numbers of a shape
assert set(_SIZES) == set(get_args(ShapeKind))


def write_object(obj: ArticulatedObject, path: Path) -> None:
    """Write an object to a new `.npz` file; the same object always gives the same bytes.

    Raises:
        AssetError: it holds what the file could not give back: a value that is no number, text, sequence, mapping
            or array, or a number that `read_object` would refuse.
        OSError: the file cannot be written.
    """
    check_values(obj)
    arrays: list[np.ndarray] = []
    text = json.dumps({"version": _VERSION, "object": _encode(obj, arrays, f"object {obj.id!r}", 0)})
    named = {f"array_{number}": array for number, array in enumerate(arrays)}
    np.savez_compressed(path, about=np.frombuffer(text.encode(), np.uint8), **cast(dict[str, Any], named))


def read_object(path: Path) -> ArticulatedObject:
    """Read what `write_object` wrote.

    Raises:
        AssetError: the file cannot be read, is damaged, or holds an illegal number.
    """
    try:
        with open_regular(path) as file:
            check_archive(file, _MOST_BYTES)
            with np.load(file, allow_pickle=False) as data:
                text = data["about"].tobytes()
                if len(text) > _MOST_TEXT_BYTES:
                    raise ValueError("it describes more than an object")
                about = parse_json(text)
                arrays = [data[f"array_{number}"] for number in range(len(data.files) - 1)]
        if about["version"] != _VERSION:
            raise ValueError(f"it is of version {shown(about['version'])}, not {_VERSION}")
        found = _decode(about["object"], arrays)
        if not isinstance(found, ArticulatedObject):
            raise ValueError("it holds no object")
        check_values(found)
    except Exception as error:  # what numpy, zipfile and wrong types raise cannot be listed
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        kind = "" if isinstance(error, AssetError | OSError | ValueError) else f"{type(error).__name__}: "
        raise AssetError(f"object file {shown(str(path))} cannot be read: {kind}{shown(reason)}") from error
    return found


def _encode(value: Any, arrays: list[np.ndarray], what: str, depth: int) -> Any:
    """Return plain values for a value; every mapping among them has one key, which says what it stands for.

    Args:
        value: to be written.
        arrays: to which its arrays are added; one that occurs twice is added once.
        what: begins the message of an error.
        depth: of the value in others.
    """
    if depth > _MOST_DEPTH:
        raise AssetError(f"{what} is nested too deeply to be written")
    if isinstance(value, np.ndarray) or (isinstance(value, np.generic) and not isinstance(value, float)):
        if value.dtype.kind not in "biufU":
            raise AssetError(f"{what} cannot be written: an array of {value.dtype}; legal are numbers and texts")
        return {"array" if isinstance(value, np.ndarray) else "scalar": _number(np.asanyarray(value), arrays)}
    if is_dataclass(value) and type(value) is _TYPES.get(type(value).__name__):
        parts = ((field.name, getattr(value, field.name)) for field in fields(value))
        return {type(value).__name__: {k: _encode(v, arrays, f"{what}: {k}", depth + 2) for k, v in parts}}
    if isinstance(value, Mapping) and all(type(key) is str for key in value):
        return {"mapping": {k: _encode(v, arrays, f"{what}: {k}", depth + 2) for k, v in value.items()}}
    if isinstance(value, tuple | list):
        items = [_encode(item, arrays, what, depth + 2) for item in value]
        return items if isinstance(value, tuple) else {"list": items}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise AssetError(
        f"{what} cannot be written: {shown(value)}; legal are numbers, texts, sequences, arrays, and mappings "
        "whose keys are texts"
    )


def _number(array: np.ndarray, arrays: list[np.ndarray]) -> int:
    """Return the array's place in the list, to which it is added unless it is there."""
    for place, other in enumerate(arrays):
        if other is array:
            return place
    arrays.append(array)
    return len(arrays) - 1


def _decode(value: Any, arrays: list[np.ndarray]) -> Any:
    """Return what `_encode` was given; whatever is wrong raises something."""
    if isinstance(value, list):
        return tuple(_decode(item, arrays) for item in value)
    if not isinstance(value, dict):
        return value
    ((kind, content),) = value.items()
    if kind in ("array", "scalar"):
        return arrays[content] if kind == "array" else arrays[content][()]
    if kind == "list":
        return [_decode(item, arrays) for item in content]
    parts = {name: _decode(part, arrays) for name, part in content.items()}
    return parts if kind == "mapping" else _TYPES[kind](**parts)


def check_values(obj: ArticulatedObject) -> None:
    """Refuse an object with a number, text or array that no scene could be built from.

    Raises:
        AssetError: naming it.
    """
    what = f"object {obj.id!r}"
    _check(obj.category in CATEGORIES, f"{what}: category", "one of " + ", ".join(CATEGORIES), obj.category)
    _check(len(obj.links) <= _MOST_LINKS, f"{what}: links", f"at most {_MOST_LINKS}", len(obj.links))
    _check_array(obj.bounds, (2, 3), f"{what}: bounds")
    _check(isinstance(obj.metadata, Mapping), f"{what}: metadata", "a mapping", obj.metadata)
    for link in obj.links:
        _check_link(link, f"{what}: link {shown(link.name)}")
    for handle in obj.handles:
        _check_handle(handle, f"{what}: handle of {shown(handle.link)}")


def _check_link(link: Link, what: str) -> None:
    _check_text(link.name, f"{what}: name")
    _check_array(link.position, (3,), f"{what}: position")
    _check_quaternions(link.quaternion, (4,), f"{what}: quaternion")
    _check_number(link.density_kg_m3, 0, np.inf, f"{what}: density_kg_m3")
    _check_array(link.surface_points, (None, 3), f"{what}: surface_points")
    if link.joint is not None:
        _check_text(link.joint.name, f"{what}: joint name")
        _check(link.joint.kind in get_args(JointKind), f"{what}: joint kind", "a joint's", link.joint.kind)
        _check_array(link.joint.origin, (3,), f"{what}: joint origin")
    for number, visual in enumerate(link.visuals):
        _check_visual(visual, f"{what}: visual {number}")
    for number, shape in enumerate(link.collisions):
        _check_shape(shape, f"{what}: collision shape {number}")


def _check_visual(visual: VisualMesh, what: str) -> None:
    mesh, material = visual.mesh, visual.material
    _check_text(visual.part, f"{what}: part")
    _check_text(material.name, f"{what}: material name")
    _check_array(mesh.vertices, (None, 3), f"{what}: vertices")
    inside = not mesh.faces.size or (mesh.faces.min() >= 0 and mesh.faces.max() < len(mesh.vertices))
    _check(inside, f"{what}: faces", f"indices of its {len(mesh.vertices)} vertices", mesh.faces)
    if mesh.uvs is not None:
        _check_array(mesh.uvs, (len(mesh.vertices), 2), f"{what}: uvs")
    _check(len(material.rgba) == 4, f"{what}: rgba", "four numbers", material.rgba)
    for value in (*material.rgba, material.shininess):
        _check_number(value, 0, 1, f"{what}: colour or shininess")
    if material.texture is not None:
        texture = material.texture
        legal = isinstance(texture, np.ndarray) and texture.dtype == np.uint8 and texture.ndim == 3
        legal = legal and texture.shape[2] == 3 and 0 < texture.size <= 3 * _MOST_PIXELS
        _check(legal, f"{what}: texture", "an image (H, W, 3) of uint8", texture)


def _check_shape(shape: CollisionShape, what: str) -> None:
    _check(shape.kind in _SIZES, f"{what}: kind", f"one of {', '.join(_SIZES)}", shape.kind)
    _check_text(shape.part, f"{what}: part")
    _check_array(shape.position, (3,), f"{what}: position")
    _check_quaternions(shape.quaternion, (4,), f"{what}: quaternion")
    _check(len(shape.size) == _SIZES[shape.kind], f"{what}: size", f"{_SIZES[shape.kind]} numbers", shape.size)
    for value in shape.size:
        _check_number(value, 0, _FARTHEST, f"{what}: size")
    if shape.kind == "hull":
        _check_array(shape.vertices, (None, 3), f"{what}: vertices")
    else:
        _check(shape.vertices is None, f"{what}: vertices", "None, as it is no hull", shape.vertices)


def _check_handle(handle: Handle, what: str) -> None:
    _check_text(handle.kind, f"{what}: kind")
    _check_array(handle.points, (None, 3), f"{what}: points", least=1)
    _check_array(handle.planes, (None, 4), f"{what}: planes", least=1)
    _check_array(handle.grasp_positions, (None, 3), f"{what}: grasp_positions", least=1)
    _check_quaternions(handle.grasp_quaternions, (len(handle.grasp_positions), 4), f"{what}: grasp_quaternions")
    _check_number(handle.grasp_width_m, 0, _FARTHEST, f"{what}: grasp_width_m")
    _check(isinstance(handle.hookable, bool | np.bool_), f"{what}: hookable", "True or False", handle.hookable)


def _check_array(value: Any, shape: tuple[int | None, ...], what: str, least: int = 0) -> None:
    """Refuse what is no array of moderate numbers of a shape, in which None stands for `least` or more."""
    legal = isinstance(value, np.ndarray) and value.dtype.kind in "fiu" and value.ndim == len(shape)
    legal = legal and all(n >= least if m is None else n == m for n, m in zip(value.shape, shape, strict=True))
    size = " x ".join("N" if m is None else str(m) for m in shape)
    _check(legal and bool((np.abs(value) <= _FARTHEST).all()), what, f"an array of {size} finite numbers", value)


def _check_quaternions(value: Any, shape: tuple[int, ...], what: str) -> None:
    _check_array(value, shape, what)
    legal = bool((np.abs(norm(value.astype(float)) - 1) <= _LENGTH_TOLERANCE).all())
    _check(legal, what, "of length 1", value)


def _check_number(value: Any, low: float, high: float, what: str) -> None:
    legal = isinstance(value, int | float | np.number) and low <= value <= high and value < np.inf
    _check(bool(legal), what, f"a finite number from {low:g}" + (f" to {high:g}" if high < np.inf else ""), value)


def _check_text(value: Any, what: str) -> None:
    _check(isinstance(value, str), what, "a text", value)


def _check(legal: bool, what: str, rule: str, value: Any) -> None:
    if not legal:
        raise AssetError(f"{what} must be {rule}, not {shown(value)}")

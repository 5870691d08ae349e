"""Materials of MTL files as PartNet-Mobility writes them, and their textures."""

from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from artiskill.assets.articulated_object import Material
from artiskill.errors import AssetError
from artiskill.files import is_file, is_folder, open_regular, read_text

# Statements of an MTL file that hold numbers, and how many; others are skipped or names.
_MTL_NUMBERS = {"Kd": 3, "d": 1, "Tr": 1, "Ns": 1}
# Options that may stand before a texture's file name, and how many words follow each.
_MAP_OPTIONS = {
    **dict.fromkeys(("-blendu", "-blendv", "-boost", "-bm", "-cc", "-clamp", "-imfchan", "-texres", "-type"), 1),
    "-mm": 2,
}
_MAP_VECTORS = ("-o", "-s", "-t")  # followed by one to three numbers
# A Phong exponent this high looks polished; the data set's wood has 30.
_POLISHED_EXPONENT = 200.0
_MOST_BYTES, _MOST_PIXELS = 20_000_000, 8192**2
_GREY = (0.7, 0.7, 0.7)


@dataclass(frozen=True)
class ObjMaterial:
    """What an MTL file says of a material."""

    rgb: tuple[float, float, float] = _GREY  # sRGB, 0 to 1
    alpha: float = 1.0  # opacity, 0 to 1
    texture: Path | None = None  # the image's path, or None
    exponent: float = 30.0  # of Phong's highlight
    # by which texture coordinates are multiplied: 2 repeats the image twice
    stretch: tuple[float, float] = (1.0, 1.0)


def read_mtl(path: Path, where: str) -> dict[str, ObjMaterial]:
    """Materials of an MTL file by name; empty where the file is missing.

    Args:
        path: the file.
        where: what it belongs to, for messages.

    Raises:
        AssetError: the file cannot be read, or a number in it is none; the message names file, line and statement.
    """
    if not is_file(path):
        return {}
    where = f"{where}: material file {path.name!r}"
    try:
        text = read_text(path, _MOST_BYTES, errors="replace")
    except OSError as error:
        raise AssetError(f"{where} cannot be read: {error.strerror}") from error
    materials: dict[str, dict[str, list[str]]] = {}
    entry: dict[str, list[str]] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split("#", 1)[0].split()
        if words and words[0] == "newmtl":
            entry = materials.setdefault(" ".join(words[1:]), {})
        elif words:
            _check_statement(words[0], words[1:], f"{where}, line {number}")
            entry[words[0]] = words[1:]
    return {name: _material(entry, path.parent) for name, entry in materials.items()}


def load_material(material: ObjMaterial, textures: dict[Path, np.ndarray | None]) -> Material:
    """The drawable material; `textures` keeps the images that are read already, None for unreadable ones."""
    image = None
    if material.texture is not None:
        if material.texture not in textures:
            textures[material.texture] = _read_image(material.texture)
        image = textures[material.texture]
    name = material.texture.stem if material.texture is not None else "plain"
    red, green, blue = (_srgb_to_linear(c) for c in material.rgb)
    shininess = float(np.clip(material.exponent / _POLISHED_EXPONENT, 0.0, 1.0))
    return Material(name, (red, green, blue, material.alpha), image, shininess)


def _check_statement(key: str, values: list[str], where: str) -> None:
    """Raises AssetError unless a statement with numbers has as many, all finite; `d` may have an option first."""
    count = _MTL_NUMBERS.get(key, 0)
    numbers = values[-count:] if key in ("d", "Tr") else values
    try:
        legal = len(numbers) == count and all(np.isfinite(float(number)) for number in numbers)
    except ValueError:
        legal = False
    if count and not legal:
        number = f"{count} finite numbers" if count > 1 else "a finite number"
        raise AssetError(f"{where}: {key} must be {number}, not {' '.join(values)!r}")


def _material(entry: dict[str, list[str]], folder: Path) -> ObjMaterial:
    red, green, blue = (min(max(float(c), 0.0), 1.0) for c in entry.get("Kd", map(str, _GREY)))
    alpha = float(entry["d"][-1]) if "d" in entry else 1.0 - float(entry.get("Tr", ["0"])[-1])
    name, stretch = _texture_name(entry.get("map_Kd", []))
    file = _find_texture(folder, name) if name else None
    exponent = float(entry.get("Ns", ["30"])[0])
    return ObjMaterial((red, green, blue), min(max(alpha, 0.0), 1.0), file, exponent, stretch)


def _texture_name(words: list[str]) -> tuple[str, tuple[float, float]]:
    """File name of a `map_Kd` statement, which may hold spaces, and its `-s`, which stretches coordinates."""
    words, stretch = list(words), [1.0, 1.0]
    while words and words[0] in (*_MAP_OPTIONS, *_MAP_VECTORS):
        option = words.pop(0)
        count = _MAP_OPTIONS.get(option, 0)
        if option in _MAP_VECTORS:
            while count < min(3, len(words) - 1) and _is_number(words[count]):
                count += 1
            if option == "-s":
                stretch[: min(count, 2)] = [float(word) for word in words[: min(count, 2)]]
        words = words[count:]
    return " ".join(words), (stretch[0], stretch[1])


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False


def _find_texture(folder: Path, name: str) -> Path:
    """The path, relative to the material file, of a texture; where the case differs, of the file that is there.

    A path from another machine (absolute, or with a drive) counts by its name, beside the material file or in
    `../images`.
    """
    pure = PurePosixPath(name.replace("\\", "/"))
    if pure.is_absolute() or ":" in pure.parts[0]:
        pure = PurePosixPath(pure.name)
        if not is_file(folder / pure) and is_folder(folder.parent / "images"):
            pure = PurePosixPath("../images") / pure.name
    path = folder.joinpath(*pure.parts)
    if not is_file(path) and is_folder(path.parent):
        same = sorted(entry for entry in path.parent.iterdir() if entry.name.lower() == path.name.lower())
        if same:
            return same[0]
    return path


def _read_image(path: Path) -> np.ndarray | None:
    from PIL import Image

    try:
        with open_regular(path) as file, Image.open(file) as image:
            return np.asarray(image.convert("RGB")) if image.width * image.height <= _MOST_PIXELS else None
    except (
        Exception
    ):  # what PIL's readers raise of damaged files cannot be listed, not even bombs and syntax errors
        return None


def _srgb_to_linear(value: float) -> float:
    """IEC 61966-2-1; MTL colours are display values."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4

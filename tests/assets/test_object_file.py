"""An object as a file: every bit comes back; what is damaged, illegal or foreign is one clear error."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject, CollisionShape
from artiskill.assets.object_file import read_object, write_object
from artiskill.errors import AssetError


def test_every_bit_comes_back(drawer_box, tmp_path):
    write_object(drawer_box, tmp_path / "a.npz")
    found = read_object(tmp_path / "a.npz")
    assert (found.id, found.category, found.content_hash) == ("drawer-box", "cabinet", drawer_box.content_hash)
    write_object(found, tmp_path / "b.npz")
    assert (tmp_path / "b.npz").read_bytes() == (tmp_path / "a.npz").read_bytes()


def test_metadata_keep_their_types(drawer_box, tmp_path):
    write_object(drawer_box, tmp_path / "a.npz")
    found = read_object(tmp_path / "a.npz").metadata
    assert found["sizes"] == [1, 2.5, (True, None)]
    assert type(found["seed"]) is np.int64
    assert found["origin"].tolist() == [0.0, 0.0, 0.0]


def test_a_texture_of_several_materials_stays_one(drawer_box, tmp_path):
    write_object(drawer_box, tmp_path / "a.npz")
    textures = [v.material.texture for link in read_object(tmp_path / "a.npz").links for v in link.visuals]
    assert len(textures) == 3
    assert all(texture is textures[0] for texture in textures)


@pytest.mark.parametrize(
    ("value", "said"),
    [(object(), "metadata: x cannot be written"), ({1: 2}, "keys are texts"), (np.array([{}]), "array of object")],
)
def test_what_a_file_cannot_hold_is_refused(value, said, drawer_box, tmp_path):
    with pytest.raises(AssetError, match=said):
        write_object(replace(drawer_box, metadata={"x": value}), tmp_path / "a.npz")
    assert not (tmp_path / "a.npz").exists()


def test_metadata_that_hold_themselves_are_refused(drawer_box, tmp_path):
    circle: dict[str, Any] = {}
    circle["again"] = circle
    with pytest.raises(AssetError, match="nested too deeply"):
        write_object(replace(drawer_box, metadata=circle), tmp_path / "a.npz")


def _base(**changes: Any) -> Callable[[ArticulatedObject], ArticulatedObject]:
    """Change the root link."""
    return lambda obj: replace(obj, links=(replace(obj.links[0], **changes), *obj.links[1:]))


def _mesh(**changes: Any) -> Callable[[ArticulatedObject], ArticulatedObject]:
    """Change the mesh of the root link."""

    def change(obj: ArticulatedObject) -> ArticulatedObject:
        visual = obj.links[0].visuals[0]
        return _base(visuals=(replace(visual, mesh=replace(visual.mesh, **changes)),))(obj)

    return change


def _material(**changes: Any) -> Callable[[ArticulatedObject], ArticulatedObject]:
    def change(obj: ArticulatedObject) -> ArticulatedObject:
        visual = obj.links[0].visuals[0]
        return _base(visuals=(replace(visual, material=replace(visual.material, **changes)),))(obj)

    return change


def _shape(*values: Any) -> Callable[[ArticulatedObject], ArticulatedObject]:
    return _base(collisions=(CollisionShape(*values),))


def _handle(**changes: Any) -> Callable[[ArticulatedObject], ArticulatedObject]:
    return lambda obj: replace(obj, handles=(replace(obj.handles[0], **changes),))


NOWHERE, STILL = np.zeros(3), np.array((1.0, 0.0, 0.0, 0.0))
WRONG: dict[str, tuple[Callable[[ArticulatedObject], ArticulatedObject], str]] = {
    "category": (lambda obj: replace(obj, category="oven"), "category must be one of cabinet, chair, bucket"),
    "bounds": (
        lambda obj: replace(obj, bounds=np.full((2, 3), np.nan)),
        "bounds must be an array of 2 x 3 finite",
    ),
    "metadata": (lambda obj: replace(obj, metadata=[]), "metadata must be a mapping"),
    "position": (_base(position=np.zeros(2)), "link 'base': position must be an array of 3 finite numbers"),
    "quaternion": (_base(quaternion=np.zeros(4)), "quaternion must be of length 1"),
    "density": (_base(density_kg_m3=float("inf")), "density_kg_m3 must be a finite number from 0"),
    "points": (_base(surface_points=np.full((2, 3), 1e9)), "surface_points must be an array of N x 3 finite"),
    "vertices": (_mesh(vertices=np.full((24, 3), np.inf)), "vertices must be an array of N x 3 finite numbers"),
    "faces": (_mesh(faces=[(0, 1, 10**6)]), r"visual 0: faces must be indices of its \d+ vertices"),
    "negative faces": (_mesh(faces=[(0, 1, -1)]), "faces must be indices"),
    "colour": (_material(rgba=(2.0, 0.0, 0.0, 1.0)), "colour or shininess must be a finite number from 0 to 1"),
    "texture": (_material(texture=np.zeros((4, 4, 3))), "texture must be an image"),
    "shape": (_shape("cone", (1.0,), NOWHERE, STILL), "kind must be one of box, cylinder, capsule, sphere, hull"),
    "size": (_shape("box", (1.0,), NOWHERE, STILL), "size must be 3 numbers"),
    "negative size": (_shape("sphere", (-1.0,), NOWHERE, STILL), "size must be a finite number from 0"),
    "hull": (_shape("hull", (), NOWHERE, STILL), "vertices must be an array of N x 3"),
    "no hull": (_shape("sphere", (1.0,), NOWHERE, STILL, np.eye(3)), "vertices must be None"),
    "grasps": (_handle(grasp_positions=np.zeros((0, 3))), "grasp_positions must be an array of N x 3"),
    "hands": (_handle(grasp_quaternions=np.zeros((1, 4))), "grasp_quaternions must be an array of"),
    "hookable": (_handle(hookable="yes"), "hookable must be True or False"),
}


@pytest.mark.parametrize(("change", "said"), WRONG.values(), ids=WRONG)
def test_illegal_values_are_neither_written_nor_read(change, said, drawer_box, tmp_path, monkeypatch):
    wrong = change(drawer_box)
    with pytest.raises(AssetError, match=said):
        write_object(wrong, tmp_path / "a.npz")
    with monkeypatch.context() as trusting:
        trusting.setattr("artiskill.assets.object_file.check_values", lambda obj: None)
        write_object(wrong, tmp_path / "a.npz")
    with pytest.raises(AssetError, match=said):
        read_object(tmp_path / "a.npz")


def _rewrite(path: Path, about: object, **arrays: np.ndarray) -> None:
    text = about if isinstance(about, str) else json.dumps(about)
    np.savez(path, about=np.frombuffer(text.encode(), np.uint8), **arrays)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("about", "said"),
    [
        ("[" * 100_000, "nested more than 50 levels"),
        ({"version": 2, "object": {}}, "of version 2, not 1"),
        ({"version": 1, "object": 3}, "holds no object"),
        ({"version": 1, "object": {"Material": {"name": "a"}}}, "missing 1 required"),
        ({"version": 1, "object": {"Path": {}}}, "KeyError: .*Path"),
        ({"version": 1, "object": {"array": 5}}, "out of range"),
        ({"version": 1, "object": {"mapping": {}, "list": []}}, "too many values"),
    ],
)
def test_damaged_texts_are_one_error(about, said, tmp_path):
    _rewrite(tmp_path / "a.npz", about)
    with pytest.raises(AssetError, match=f"cannot be read: .*{said}"):
        read_object(tmp_path / "a.npz")


def test_damaged_files_are_one_error(drawer_box, tmp_path):
    write_object(drawer_box, tmp_path / "a.npz")
    whole = (tmp_path / "a.npz").read_bytes()
    for damaged in (b"", whole[:200], whole[:-30], b"PK\x03\x04" + bytes(500)):
        (tmp_path / "a.npz").write_bytes(damaged)
        with pytest.raises(AssetError, match="cannot be read"):
            read_object(tmp_path / "a.npz")


def test_pickles_are_not_opened(tmp_path):
    _rewrite(tmp_path / "a.npz", {"version": 1, "object": {"array": 0}}, array_0=np.array([{}], dtype=object))
    with pytest.raises(AssetError, match="allow_pickle"):
        read_object(tmp_path / "a.npz")


def test_a_file_that_unpacks_to_much_is_refused(drawer_box, tmp_path, monkeypatch):
    write_object(drawer_box, tmp_path / "a.npz")
    monkeypatch.setattr("artiskill.assets.object_file._MOST_BYTES", 1000)
    with pytest.raises(AssetError, match="unpacks to"):
        read_object(tmp_path / "a.npz")

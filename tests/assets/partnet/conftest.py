"""A small cabinet in the data set's form, made of our own boxes, and where the real data set lies."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from benchmarks.partnet_folders import ToyLink, write_mesh, write_object
from PIL import Image

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.partnet import import_partnet
from artiskill.geometry.meshes import TriMesh, merge
from artiskill.geometry.primitives import box

ROOT = Path(__file__).resolve().parents[3]

# link: its (part name, part id, mesh stem, boxes as (low corner, high corner)); file frame: y up, front +z
PARTS: dict[str, list[tuple[str, int, str, list[tuple[tuple[float, ...], tuple[float, ...]]]]]] = {
    "link_0": [  # a door on the left, hinge at its left edge, x = -0.6
        ("door_surface", 3, "original-1", [((-0.6, -0.5, 0.4), (0.0, 0.1, 0.44))]),
        (
            "handle",
            4,
            "original-2",
            [
                ((-0.08, -0.3, 0.44), (-0.06, -0.28, 0.5)),
                ((-0.08, -0.12, 0.44), (-0.06, -0.1, 0.5)),
                ((-0.08, -0.3, 0.5), (-0.06, -0.1, 0.52)),
            ],
        ),
    ],
    "link_1": [  # a drawer over the whole width
        ("drawer_front", 5, "original-3", [((-0.6, 0.15, 0.4), (0.6, 0.5, 0.44))]),
        (
            "drawer_box",
            6,
            "original-4",
            [((-0.55, 0.2, -0.3), (-0.53, 0.4, 0.4)), ((0.53, 0.2, -0.3), (0.55, 0.4, 0.4))],
        ),
        (
            "handle",
            7,
            "original-5",
            [
                ((-0.2, 0.3, 0.44), (-0.18, 0.32, 0.5)),
                ((0.18, 0.3, 0.44), (0.2, 0.32, 0.5)),
                ((-0.2, 0.3, 0.5), (0.2, 0.32, 0.52)),
            ],
        ),
    ],
    "link_2": [
        (
            "frame",
            8,
            "original-6",
            [
                ((-0.65, -0.6, -0.4), (-0.6, 0.6, 0.4)),
                ((0.6, -0.6, -0.4), (0.65, 0.6, 0.4)),
                ((-0.6, 0.55, -0.4), (0.6, 0.6, 0.4)),
                ((-0.6, -0.6, -0.4), (0.6, -0.55, 0.4)),
                ((-0.6, -0.55, -0.4), (0.6, 0.55, -0.35)),
            ],
        ),
    ],
}
HINGE = (-0.6, 0.0, 0.42)


class ToyCabinet:
    """Writes the folder; its fields may be changed before `write`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.joints = {
            "link_0": '<joint name="joint_0" type="revolute"><origin xyz="-0.6 0 0.42"/><axis xyz="0 -1 0"/>'
            '<child link="link_0"/><parent link="link_2"/><limit lower="0" upper="1.5"/></joint>',
            "link_1": '<joint name="joint_1" type="prismatic"><origin xyz="0 0 0"/><axis xyz="0 0 1"/>'
            '<child link="link_1"/><parent link="link_2"/><limit lower="0" upper="0.5"/></joint>',
            "link_2": '<joint name="joint_2" type="fixed"><origin rpy="1.570796326794897 0 -1.570796326794897"/>'
            '<child link="link_2"/><parent link="base"/></joint>',
        }
        self.names = True
        self.parts = {link: list(parts) for link, parts in PARTS.items()}
        self.meta = {"model_cat": "StorageFurniture"}

    def set_limits(self, link: str, lower: str, upper: str) -> None:
        """Replace the limits of a link's joint."""
        head, _, _ = self.joints[link].partition("<limit")
        self.joints[link] = f'{head}<limit lower="{lower}" upper="{upper}"/></joint>'

    def write(self) -> Path:
        """Write all files; returns the folder."""
        (self.folder / "textured_objs").mkdir(parents=True, exist_ok=True)
        (self.folder / "images").mkdir(exist_ok=True)
        image = np.array([[[200, 10, 10], [10, 200, 10]]], dtype=np.uint8)
        Image.fromarray(image).save(self.folder / "images" / "texture_0.png")
        urdf = ['<?xml version="1.0" ?>', '<robot name="toy">', '<link name="base"/>']
        tree, mobility = [], []
        for k, (link, parts) in enumerate(self.parts.items()):
            urdf += [f'<link name="{link}">', *(self._visual(link, *part[:3]) for part in parts), "</link>"]
            urdf.append(self.joints[link])
            # original-5 hangs below the node that is the part
            tree += [_node(name, number, stem) for name, number, stem, _ in parts]
            mobility.append({"id": k, "parts": [{"id": p[1], "name": p[0], "children": []} for p in parts]})
            for _, _, stem, boxes in parts:
                _write_obj(self.folder / "textured_objs" / f"{stem}.obj", boxes)
        (self.folder / "mobility.urdf").write_text("\n".join([*urdf, "</robot>"]))
        (self.folder / "result.json").write_text(json.dumps([{"id": 1, "name": "root", "children": tree}]))
        (self.folder / "mobility_v2.json").write_text(json.dumps(mobility))
        (self.folder / "meta.json").write_text(json.dumps(self.meta))
        return self.folder

    def _visual(self, link: str, name: str, number: int, stem: str) -> str:
        attribute = f' name="{name}-{number}"' if self.names else ""
        origin = '<origin xyz="0.6 0 -0.42"/>' if link == "link_0" else ""
        mesh = f'<geometry><mesh filename="textured_objs/{stem}.obj"/></geometry>'
        return f"<visual{attribute}>{origin}{mesh}</visual><collision>{origin}{mesh}</collision>"


def _node(name: str, number: int, stem: str) -> dict[str, object]:
    leaf = {"id": number + 100, "name": "other_leaf", "objs": [stem]}
    node = {"id": number, "name": name}
    return {**node, "children": [leaf]} if number == 7 else {**node, "objs": [stem]}


def boxes_mesh(boxes: list[tuple[tuple[float, ...], tuple[float, ...]]]) -> TriMesh:
    """Boxes between corners as one mesh; a flat one is a sheet."""
    parts = []
    for low, high in boxes:
        low_, high_ = np.array(low), np.array(high)
        unit = box((0.5, 0.5, 0.5))
        parts.append(TriMesh(unit.vertices * (high_ - low_) + (low_ + high_) / 2, unit.faces))
    return merge(parts)


def _write_obj(path: Path, boxes: list[tuple[tuple[float, ...], tuple[float, ...]]]) -> None:
    mesh = boxes_mesh(boxes)
    lines = [f"mtllib {path.stem}.mtl", *(f"v {x} {y} {z}" for x, y, z in mesh.vertices)]
    lines += ["vt 0 0", "vt 1 0", "vt 0 1"]
    half = len(mesh.faces) // 2
    lines += ["usemtl wood", *(f"f {a + 1}/1 {b + 1}/2 {c + 1}/3" for a, b, c in mesh.faces[:half])]
    lines += ["usemtl paint", *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces[half:])]
    path.write_text("\n".join(lines))
    path.with_suffix(".mtl").write_text(
        "newmtl wood\nKd 1 1 1\nmap_Kd ../images/texture_0.png\nnewmtl paint\nKd 0.5 0 0\nd 0.75\nNs 30\n"
    )


@pytest.fixture
def toy(tmp_path: Path) -> ToyCabinet:
    """A cabinet that is not written yet."""
    return ToyCabinet(tmp_path / "toy")


@pytest.fixture(scope="session")
def writer() -> SimpleNamespace:
    """`ToyLink` and `write_object`, for tests that build objects of their own."""
    return SimpleNamespace(ToyLink=ToyLink, write_object=write_object, write_mesh=write_mesh)


@pytest.fixture(scope="session")
def cache_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A decomposition cache for the whole run."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture
def load(cache_dir: Path) -> Callable[..., ArticulatedObject]:
    """Writes and imports a toy cabinet."""
    return lambda toy, **options: import_partnet(toy.write(), cache_dir=cache_dir, **options)


@pytest.fixture(scope="session")
def dataset() -> Path:
    """The folder of the real data set."""
    given = os.environ.get("PARTNET_MOBILITY_DATASET")
    folder = Path(given) if given else ROOT.parent / "shared" / "partnet_mobility"
    if not (folder / "40147").is_dir():
        pytest.skip("set PARTNET_MOBILITY_DATASET to a PartNet-Mobility folder with object 40147 to try it")
    return folder

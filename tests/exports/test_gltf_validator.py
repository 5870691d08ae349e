"""Khronos' own validator reads the exported glTF; `make test-gltf` installs it."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from artiskill.assets.catalog import list_objects
from artiskill.exports.export import export_objects

SCRIPT = Path(__file__).with_name("validate_gltf.js")
PACKAGE = "gltf-validator"
DATASET = "PARTNET_MOBILITY_DATASET"
ERROR, WARNING = 0, 1  # severities of the validator; below are hints
Issues = list[dict[str, Any]]


@pytest.fixture(scope="module")
def validate() -> Callable[[list[Path]], list[Issues]]:
    """What the validator says of files, errors and warnings of each."""
    pytest.importorskip("trimesh", reason="needs the extra `export`")
    node = shutil.which("node")
    if node is None:
        pytest.skip("needs Node.js: there is no `node` on the path")
    beside_python = Path(sys.prefix) / "node_modules"  # where `make test-gltf` puts it
    places = [str(beside_python), os.environ.get("NODE_PATH", "")]
    environment = {**os.environ, "NODE_PATH": os.pathsep.join(filter(None, places))}
    found = subprocess.run([node, "-e", f"require.resolve('{PACKAGE}')"], env=environment, capture_output=True)
    if found.returncode:
        pytest.skip(f"needs Khronos' validator: `make test-gltf`, or npm install {PACKAGE} in NODE_PATH")

    def run(files: list[Path]) -> list[Issues]:
        command = [node, str(SCRIPT), *map(str, files)]
        output = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
        issues = [json.loads(line) for line in output.splitlines()]
        assert len(issues) == len(files)
        return [[issue for issue in of_file if issue["severity"] <= WARNING] for of_file in issues]

    return run


def test_it_finds_faults(validate: Callable[[list[Path]], list[Issues]], tmp_path: Path) -> None:
    """A file without a version: or else silence would say nothing."""
    broken = tmp_path / "broken.gltf"
    broken.write_text('{"asset": {}}')
    assert [issue["severity"] for issue in validate([broken])[0]] == [ERROR]


def test_a_texture_without_coordinates_is_left_out(
    validate: Callable[[list[Path]], list[Issues]], odd_chair: Any, tmp_path: Path
) -> None:
    # of the chair's two cloths, one has coordinates; bucket-0001 wears a textured material on a plain surface
    names = ("bucket-0001", "cabinet-0001", "chair-0001")
    written = {obj.id: file for obj, file in export_objects((odd_chair, *names), "glb", tmp_path)}
    assert dict(zip(written, validate(list(written.values())), strict=True)) == {name: [] for name in written}


@pytest.mark.slow
def test_every_object_of_the_catalogue_passes(
    validate: Callable[[list[Path]], list[Issues]], tmp_path: Path
) -> None:
    names = [*list_objects(), *list_objects(split="ood")]
    files = [file for _, file in export_objects(names, "glb", tmp_path)]
    found = dict(zip(names, validate(files), strict=True))
    assert len(found) == 193
    assert {name: issues for name, issues in found.items() if issues} == {}


@pytest.mark.slow
@pytest.mark.skipif(DATASET not in os.environ, reason=f"set {DATASET} to export objects 40147 and 179")
def test_real_objects_pass(validate: Callable[[list[Path]], list[Issues]], tmp_path: Path) -> None:
    """They have triangles without area, which have no normals."""
    names = ("partnet:40147", "partnet:179")
    written = [file for _, file in export_objects(names, "glb", tmp_path)]
    assert validate(written) == [[], []]

"""What every exported folder promises: read back, it is the same object, for checks, experts and all else."""

from pathlib import Path

import pytest

from artiskill import evaluate
from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import list_objects, load_object
from artiskill.assets.exported_folder import OBJECT_FILE
from artiskill.assets.object_file import write_object
from artiskill.checks.runner import check_object
from artiskill.exports.export import export_object

TASKS = {"cabinet": "OpenCabinetDrawer", "chair": "PushChair", "bucket": "MoveBucket"}
SAMPLE = (
    *(f"generated:{category}:{seed}" for category in TASKS for seed in (4, 5)),
    *(list_objects(category, split)[0] for category in TASKS for split in ("train", "ood")),
    "cabinet-0052",  # hangs on a wall
)
REST = [name for split in ("all", "ood") for name in list_objects(split=split) if name not in SAMPLE]


@pytest.mark.parametrize("name", [*SAMPLE, *(pytest.param(name, marks=pytest.mark.slow) for name in REST)])
def test_every_bit_comes_back(name, tmp_path):
    given = load_object(name)
    found, folder = _round_trip(given, tmp_path)
    assert (found.id, found.content_hash) == (given.id, given.content_hash)
    write_object(found, tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == (folder / OBJECT_FILE).read_bytes()


@pytest.mark.parametrize(("category", "task"), TASKS.items())
def test_checks_pass_and_the_expert_plays_the_same(category, task, tmp_path):
    given = load_object(list_objects(category, task=task)[0])
    found, _ = _round_trip(given, tmp_path)
    assert not [result for result in check_object(found) if not result.passed]
    mine, theirs = (evaluate(task, "expert", [obj], episodes=1) for obj in (given, found))
    assert theirs.success_rate == 1.0
    assert theirs.episodes == mine.episodes


def _round_trip(obj: ArticulatedObject, folder: Path) -> tuple[ArticulatedObject, Path]:
    written = export_object(obj, "urdf", folder / "out").parent
    return load_object(written), written

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.demos import demonstrator, recording
from artiskill.demos.collect import collect
from artiskill.demos.demos import Demos
from artiskill.demos.hdf5 import load_h5py
from artiskill.demos.plan import CollectionPlan
from artiskill.demos.recording import Recording
from artiskill.demos.stats import Coverage, folder_stats
from artiskill.errors import DemoError
from artiskill.tasks.levels import FIRST_DEMONSTRATED


def states(
    base_xy: list[list[float]], root_xy: list[float], yaw_rad: float, qpos: list[float]
) -> dict[str, np.ndarray]:
    count = len(base_xy)
    base = np.zeros((count, 13), dtype=np.float32)
    base[:, :2] = base_xy
    quaternion = [np.cos(yaw_rad / 2), 0.0, 0.0, np.sin(yaw_rad / 2)]
    return {
        "robot_qpos": base,
        "root_position_w": np.tile((*root_xy, 0.0), (count, 1)).astype(np.float32),
        "root_quaternion_w": np.tile(quaternion, (count, 1)).astype(np.float32),
        "object_qpos": np.array(qpos, dtype=np.float32)[:, None],
    }


def test_a_base_is_seen_from_the_object() -> None:
    coverage = Coverage(is_fixed=True)
    coverage.add(states([[1.0, 2.1], [1.0, 2.2]], [1.0, 1.0], np.pi / 2, [0.0, 0.0]), "link_1", 0, (0.0, 1.0))
    assert coverage.base == 1 / 400
    coverage.add(states([[2.1, 0.0]], [1.0, 0.0], 0.0, [0.0]), "link_1", 0, (0.0, 1.0))  # the same place
    assert coverage.base == 1 / 400
    coverage.add(states([[9.0, 0.0], [-2.4, 0.0]], [0.0, 0.0], 0.0, [0.0] * 2), "link_1", 0, (0.0, 1.0))
    assert coverage.base == 2 / 400  # the first is out of reach


def test_joints_count_in_shares_of_their_range() -> None:
    coverage = Coverage(is_fixed=True)
    opening = list(np.linspace(0.1, 0.6, 100))  # the lower half of the range
    coverage.add(states([[0.0, 0.0]] * 100, [0.0, 0.0], 0.0, opening), "link_1", 0, (0.1, 1.1))
    assert coverage.object == pytest.approx(0.5, abs=0.051)
    coverage.add(states([[0.0, 0.0]], [0.0, 0.0], 0.0, [5.0]), "link_2", 0, (0.1, 1.1))
    assert coverage.object == pytest.approx((0.525 + 0.05) / 2, abs=0.03)


def test_a_free_object_counts_by_its_place() -> None:
    coverage = Coverage(is_fixed=False)
    for x in (-0.1, 0.1, 0.2):
        coverage.add(states([[0.0, 0.0]], [x, 0.1], 0.0, [0.0]), "base", 0, (0.0, 1.0))
    assert coverage.object == 2 / 400


def test_a_folder_in_numbers(drawers: Path) -> None:
    seen: list[None] = []
    stats = folder_stats(drawers, lambda: seen.append(None))
    assert len(seen) == 2
    assert stats.trajectories == 6
    assert stats.success_rate == 1.0
    one = stats.objects[0]
    assert (one.object, one.wanted, one.trajectories, one.attempts, one.gave_up) == ("cabinet-0002", 3, 3, 3, ())
    assert 30 < one.shortest <= one.mean_length <= one.longest <= 200
    assert one.bytes_per_trajectory == (drawers / "cabinet-0002.h5").stat().st_size / 3
    assert 0.005 < one.base_coverage < 0.2
    assert one.object_coverage > 0.8  # drawers are opened by 90 %
    written = stats.to_mapping()
    assert written["objects"][1]["targets"][0]["attempts"] == 2
    assert written["mean_length"] == stats.mean_length


def test_failures_and_unequal_objects_count_by_number(
    plan: Callable[..., CollectionPlan], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of one object one of two attempts is solved, of the other both of two."""

    def record(env: Any, obj: ArticulatedObject, level: int, *rest: Any) -> Recording:
        if (obj.id, level) == ("cabinet-0002", FIRST_DEMONSTRATED):
            raise np.linalg.LinAlgError("Singular matrix")
        return recording.record(env, obj, level, *rest)

    monkeypatch.setattr(demonstrator, "record", record)
    collect(plan(per_object=None, per_target=1), tmp_path)
    stats = folder_stats(tmp_path)
    assert [one.success_rate for one in stats.objects] == [0.5, 1.0]
    assert stats.success_rate == 0.75
    lengths = [len(trajectory) for trajectory in Demos(tmp_path).trajectories()]
    assert len(lengths) == 3
    assert stats.mean_length == pytest.approx(np.mean(lengths))
    assert stats.mean_length != pytest.approx(np.mean([one.mean_length for one in stats.objects]))


def test_a_file_of_other_options_is_not_counted(
    own_drawers: Path, plan: Callable[..., CollectionPlan], tmp_path: Path
) -> None:
    collect(plan(objects=["cabinet-0002"], per_object=1), tmp_path / "other")
    (tmp_path / "other" / "cabinet-0002.h5").replace(own_drawers / "cabinet-0002.h5")
    with pytest.raises(
        DemoError, match="was made with other settings than its manifest says: per_object 1 there, 3"
    ):
        folder_stats(own_drawers)


@pytest.mark.parametrize("what", ["target", "dtype", "columns", "facts"])
def test_damaged_files_are_errors_of_ours(own_drawers: Path, what: str) -> None:
    with load_h5py().File(own_drawers / "cabinet-0002.h5", "r+") as file:
        table = file["attempts"][()]
        if what == "target":
            table["target"] = 7
            file["attempts"][...] = table
        elif what == "dtype":
            del file["attempts"]
            file["attempts"] = np.zeros(3)
        elif what == "columns":
            columns = json.loads(file.attrs["state_columns"])
            file.attrs["state_columns"] = json.dumps([[f"my_{name}", shape] for name, shape in columns])
        else:
            file.attrs["facts"] = "{}"
    with pytest.raises(DemoError, match=r"cabinet-0002.h5' is damaged"):
        folder_stats(own_drawers)

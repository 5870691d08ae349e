"""What LeRobot itself reads; it is large, wants versions of its own, and so is not in the extra `test`.

docs/demonstrations.md says how to make an environment for it.
"""

import importlib.util
import re
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.demos.test_export import training_files

from artiskill.demos.export import export_dataset
from artiskill.demos.training_file import TrainingFile

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]


def load_lerobot() -> None:
    """Import LeRobot, or skip the test.

    A torchvision that was built for CUDA cannot load its operators beside a torch without. Datasets need none of
    them; but they must be known, or it is not imported at all.
    """
    torch = pytest.importorskip("torch")
    found = importlib.util.find_spec("torchvision")
    if found is None or found.origin is None or importlib.util.find_spec("lerobot") is None:
        pytest.skip("LeRobot is not installed")
    if torch.version.cuda is None and "torchvision" not in sys.modules:
        text = (Path(found.origin).parent / "_meta_registrations.py").read_text()
        library = torch.library.Library("torchvision", "DEF")
        for name in set(re.findall(r'register_(?:meta|fake)\("(?:torchvision::)?(\w+)"\)', text)):
            library.define(f"{name}(Tensor x) -> Tensor")
        _LIBRARIES.append(library)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import lerobot.datasets.lerobot_dataset  # noqa: F401


_LIBRARIES: list[Any] = []  # the operators are forgotten with them


@pytest.fixture(scope="module")
def dataset_class() -> Any:
    """`LeRobotDataset`."""
    load_lerobot()
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    return LeRobotDataset


@pytest.fixture(autouse=True)
def offline(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")


@pytest.mark.parametrize("obs_mode", ["state", "pointcloud", "rgbd"])
def test_lerobot_reads_it(dataset_class: Any, obs_mode: str, tmp_path: Path) -> None:
    training = training_files(tmp_path / "t", obs_mode)
    path = export_dataset(training, tmp_path / "home", "lerobot", "mine/drawers")
    dataset = dataset_class("mine/drawers", root=path, video_backend="pyav")
    assert dataset.num_episodes == 2
    assert dataset.meta.tasks.index.tolist() == ["Open the marked drawer of the cabinet."]
    with TrainingFile(next(training.folder.glob("*.h5"))) as file:
        lengths = [len(file.array(k, "actions")) for k in range(2)]
        assert len(dataset) == sum(lengths)
        seen = 0
        for number, step in ((0, 0), (0, lengths[0] - 1), (1, 0), (1, 31)):
            frame = dataset[number * lengths[0] + step]
            group = file.groups[number]
            vector = group["obs/state"][step]
            np.testing.assert_array_equal(frame["observation.state"].numpy(), vector)
            np.testing.assert_array_equal(frame["action"].numpy(), group["actions"][step])
            assert (int(frame["episode_index"]), int(frame["frame_index"])) == (number, step)
            assert bool(frame["next.done"]) == (step == lengths[number] - 1)
            if obs_mode == "pointcloud":
                for name in ("xyz", "rgb", "seg"):
                    cloud = frame[f"observation.pointcloud.{name}"].numpy()
                    np.testing.assert_array_equal(cloud, group[f"obs/pointcloud/{name}"][step])
            if obs_mode == "rgbd":
                for camera, name in enumerate(("front", "left", "right")):
                    picture = frame[f"observation.images.{name}"].numpy().transpose(1, 2, 0)
                    own = group["obs/rgbd/rgb"][step][..., 3 * camera : 3 * camera + 3] / 255
                    assert np.abs(picture - own).mean() < 0.03
                    masks = frame[f"observation.images.{name}_masks"].numpy().transpose(1, 2, 0)
                    own = group["obs/rgbd/seg"][step][..., 3 * camera : 3 * camera + 3]
                    seen += int(own.sum())
                    np.testing.assert_array_equal(masks, own.astype(np.float32))
    assert seen or obs_mode != "rgbd"
    stats = dataset.meta.stats
    assert stats["action"]["mean"].shape == (13,)
    assert stats["observation.state"]["q99"].shape == stats["observation.state"]["mean"].shape

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from artiskill.demos.demo_pack import load_demo_pack
from artiskill.envs.rendering import Viewpoint
from artiskill.errors import ConfigError
from artiskill.evaluation.demo_pictures import most_different, picture_demos
from artiskill.evaluation.scene_pictures import PictureStyle

STYLE = PictureStyle(width=60, height=45)


def test_rows_and_moments(tmp_path: Path) -> None:
    demos = load_demo_pack("OpenCabinetDrawer")
    with demos.open(demos.objects[0]) as file:
        numbers = picture_demos(tmp_path / "a.png", file, STYLE, count=2, moments=3)
        assert numbers == most_different(file, [0, 1, 2, 3], 2)
        assert len(set(numbers)) == 2
        picture = np.asarray(Image.open(tmp_path / "a.png"))
        assert picture.shape == (2 * 45 + 6, 3 * 60 + 12, 3)
        first, last = picture[:30, :60].astype(int), picture[:30, -60:].astype(int)
        assert np.abs(first - last).mean() > 1  # something happens
        style = PictureStyle(width=60, height=45, viewpoint=Viewpoint(azimuth_deg=90))
        assert picture_demos(tmp_path / "b.jpg", file, style, count=9, moments=2) == [0, 1, 2, 3]


def test_the_same_way_is_not_drawn_twice() -> None:
    demos = load_demo_pack("PushChair")
    with demos.open(demos.objects[0]) as file:
        assert most_different(file, [2, 2, 2, 1], 2) == [1, 2]
        assert most_different(file, [3], 2) == [3]
        first, *others = most_different(file, [0, 1, 2, 3], 4)
        assert [first, *others] == [0, 1, 2, 3]


def test_bad_input(tmp_path: Path) -> None:
    demos = load_demo_pack("OpenCabinetDrawer")
    with demos.open(demos.objects[0]) as file:
        for path, changes, message in (
            ("a.gif", {}, "strips are still pictures"),
            ("a.bmp", {}, "must end in"),
            ("a.png", {"count": 0}, "number of demonstrations must be"),
            ("a.png", {"moments": 1}, "number of moments must be"),
            ("a.png", {"target": "link_9"}, "has no demonstrations of link_9"),
        ):
            with pytest.raises(ConfigError, match=message):
                picture_demos(tmp_path / path, file, STYLE, **changes)
    assert not list(tmp_path.iterdir())

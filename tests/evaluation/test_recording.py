from pathlib import Path

import pytest
from PIL import Image

from artiskill.errors import ConfigError
from artiskill.evaluation.evaluate import run_plan
from artiskill.evaluation.plan import make_plan
from artiskill.evaluation.recording import FrameDrawn, check_video, record_video


def test_a_short_film_that_changes_no_number(tmp_path: Path) -> None:
    plan = make_plan(
        "OpenCabinetDrawer", "expert", ["cabinet-0005", "cabinet-0010"], 1, config={"episode_steps": 5}
    )
    before = run_plan(plan)
    news: list[FrameDrawn] = []
    path = record_video(plan, tmp_path / "film.gif", count=1, on_frame=news.append)
    after = run_plan(plan)
    assert before.episodes == after.episodes
    assert [item.steps for item in news] == [0, 2, 4, 5]
    assert [item.done for item in news] == [False, False, False, True]
    with Image.open(path) as image:
        assert image.size == (640, 480)
        duration = 0
        for k in range(getattr(image, "n_frames", 1)):
            image.seek(k)
            duration += image.info["duration"]
    assert duration == 100 * 4 + 1000  # milliseconds: every second step, and the end for a second longer


@pytest.mark.parametrize(("name", "count"), [("film.avi", 1), ("film", 1), ("film.gif", 0), ("film.gif", 1.5)])
def test_impossible_films_are_refused_beforehand(tmp_path: Path, name: str, count: int) -> None:
    with pytest.raises(ConfigError):
        check_video(tmp_path / name, count)
    assert not list(tmp_path.iterdir())


def test_a_folder_is_no_film(tmp_path: Path) -> None:
    (tmp_path / "film.gif").mkdir()
    with pytest.raises(ConfigError, match="it is a folder"):
        check_video(tmp_path / "film.gif")

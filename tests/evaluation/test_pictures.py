"""Still and moving pictures of episodes and objects."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from artiskill.demos.demos import load_demo_pack
from artiskill.envs.core import ObservationContext
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.envs.rendering import Viewpoint
from artiskill.envs.wrappers import Sampling
from artiskill.errors import ConfigError, UnknownNameError
from artiskill.evaluation.pictures import (
    EpisodeChoice,
    check_picture,
    most_different,
    save_demos_picture,
    save_episode_picture,
    save_object_picture,
    write_picture,
)
from artiskill.evaluation.policies import StillActor
from artiskill.evaluation.recording import draw_moments
from artiskill.evaluation.scene_pictures import PictureStyle
from artiskill.sensors.pictures.compose import GAP_PX
from artiskill.sensors.render_config import load_render_config

TASK, OBJECT = "OpenCabinetDrawer", "cabinet-0005"
CAMERAS = {"cameras.width": 60, "cameras.height": 24}
SMALL = {"width": 80, "height": 60}


def episode(**changes) -> EpisodeChoice:
    return EpisodeChoice(**{"task": TASK, "object": OBJECT, "level": 3, "config": CAMERAS, **changes})


def shown(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def test_the_usual_picture_is_nearer_than_that_of_the_environment(tmp_path: Path) -> None:
    path = save_episode_picture(tmp_path / "a.png", episode(config={}), PictureStyle())
    env = ManipulationEnv(TASK, objects=OBJECT, render_mode="rgb_array")
    env.reset(seed=3)
    (picture,) = draw_moments(
        env.task,
        env.scene,
        env.save_state().target,
        [ObservationContext(env.snapshot, env.goal, 0, 3, 0)],
        PictureStyle(),
    )
    np.testing.assert_array_equal(shown(path), picture)
    assert (picture != env.render()).mean() > 0.2


@pytest.mark.parametrize(
    ("view", "size"),
    [
        ("world", (60, 80)),
        ("cloud", (60, 80)),
        ("sensor", (24, 3 * 60 + 2 * GAP_PX)),
    ],
)
def test_each_view_has_its_size_and_masks_change_it(tmp_path: Path, view: str, size: tuple[int, int]) -> None:
    sizes = {} if view == "sensor" else SMALL
    plain, masked = (
        shown(
            save_episode_picture(
                tmp_path / f"{masks}.png", episode(), PictureStyle(view=view, masks=masks, **sizes)
            )
        )
        for masks in (False, True)
    )
    assert plain.shape == masked.shape == (*size, 3)
    assert 0.001 < (plain != masked).any(axis=-1).mean() < 0.5


def test_the_sensor_view_is_what_the_policy_sees(tmp_path: Path) -> None:
    path = save_episode_picture(tmp_path / "a.png", episode(), PictureStyle(view="sensor"))
    env = ManipulationEnv(TASK, objects=OBJECT, obs_mode="rgbd", config=CAMERAS)
    rgb = env.reset(seed=3)[0]["rgbd"]["rgb"]
    np.testing.assert_array_equal(shown(path)[:, :60], rgb[..., :3])
    np.testing.assert_array_equal(shown(path)[:, -60:], rgb[..., 6:9])


def test_a_sheet_has_all_of_them(tmp_path: Path) -> None:
    style = PictureStyle(view="all", **SMALL)
    sheet = shown(save_episode_picture(tmp_path / "a.png", episode(), style))
    world = shown(save_episode_picture(tmp_path / "b.png", episode(), PictureStyle(**SMALL)))
    np.testing.assert_array_equal(sheet[:60, :80], world)
    strips = sheet.shape[0] - 60
    assert sheet.shape[1] == 160 + GAP_PX
    assert strips == 3 * (GAP_PX + round(24 * 166 / 192))


def test_viewpoint_and_look_matter(tmp_path: Path) -> None:
    usual = shown(save_episode_picture(tmp_path / "a.png", episode(), PictureStyle(**SMALL)))
    styles = (
        PictureStyle(**SMALL, viewpoint=Viewpoint(azimuth_deg=90.0)),
        PictureStyle(**SMALL, viewpoint=Viewpoint(distance_m=1.0)),
        PictureStyle(**SMALL, look=load_render_config("picture", {"sun.strength": 0.2})),
    )
    for style in styles:
        assert (shown(save_episode_picture(tmp_path / "b.png", episode(), style)) != usual).mean() > 0.2


def test_steps_are_played_and_end_with_the_episode(tmp_path: Path) -> None:
    first, tenth = (
        shown(save_episode_picture(tmp_path / "a.png", episode(), PictureStyle(**SMALL), step)) for step in (0, 10)
    )
    assert (first != tenth).any()
    short = episode(policy="still", config={"episode_steps": 4})
    save_episode_picture(tmp_path / "a.png", short, PictureStyle(**SMALL), 4)
    with pytest.raises(ConfigError, match="step 5 does not exist: the episode is cut off after 4 steps"):
        save_episode_picture(tmp_path / "a.png", short, PictureStyle(**SMALL), 5)
    with pytest.raises(ConfigError, match="negative"):
        save_episode_picture(tmp_path / "a.png", short, PictureStyle(**SMALL), -1)
    with pytest.raises(ConfigError, match="still pictures"):
        save_episode_picture(tmp_path / "a.gif", short, PictureStyle(**SMALL), 1)


def test_an_episode_moves(tmp_path: Path) -> None:
    config = {**CAMERAS, "episode_steps": 9}
    path = save_episode_picture(
        tmp_path / "a.webp", episode(policy="random", config=config), PictureStyle(**SMALL, view="cloud")
    )
    with Image.open(path) as film:
        frames = [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(film)]
    assert len(frames) >= 6  # at steps 0, 2, 4, 6, 8 and 9; equal ones at the end may be joined
    assert (frames[0] != frames[4]).any()


def test_an_object_alone_opens_and_closes(tmp_path: Path) -> None:
    closed, opened = (
        shown(save_object_picture(tmp_path / "a.png", OBJECT, share, **SMALL)) for share in (None, 0.8)
    )
    assert closed.shape == (60, 80, 3)
    assert (closed != opened).any(axis=-1).mean() > 0.05
    with Image.open(save_object_picture(tmp_path / "a.webp", OBJECT, **SMALL)) as film:
        frames = [np.asarray(frame.convert("RGB")).astype(int) for frame in ImageSequence.Iterator(film)]
    change = [np.abs(frame - frames[0]).mean() for frame in (frames[len(frames) // 2], frames[-1])]
    assert change[0] > 3
    assert change[1] < 0.25 * change[0]


def test_pictures_appear_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "new" / "a.png"
    write_picture(path, np.zeros((4, 5, 3), dtype=np.uint8))
    assert [p.name for p in path.parent.iterdir()] == ["a.png"]
    with pytest.raises(TypeError):
        write_picture(path, np.zeros((4, 5, 3)))
    assert [p.name for p in path.parent.iterdir()] == ["a.png"]
    assert shown(path).shape == (4, 5, 3)


def test_unwritable_places_are_named(tmp_path: Path) -> None:
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "file").write_text("")
    for path, message in (
        ("a.bmp", r"must end in \.png, .*\.mp4, not 'a\.bmp'"),
        ("a", "must end in"),
        ("folder.png", "it is a folder"),
        ("file/a.png", "is not a folder"),
        ("file/a.gif", "is not a folder"),
    ):
        with pytest.raises(ConfigError, match=message):
            check_picture(tmp_path / path)
    with pytest.raises(ConfigError, match="cannot write the picture"):
        write_picture(tmp_path / "file" / "a.png", np.zeros((4, 5, 3), dtype=np.uint8))


def test_impossible_styles_are_named() -> None:
    with pytest.raises(UnknownNameError, match="unknown view 'wrld'; did you mean 'world'"):
        PictureStyle(view="wrld")
    for wrong, message in (
        ({"width": 0}, "width"),
        ({"height": 5000}, "height"),
        ({"view": "sensor", "width": 80}, "cameras.width"),
        ({"view": "sensor", "viewpoint": Viewpoint(azimuth_deg=3.0)}, "takes no viewpoint"),
        ({"viewpoint": Viewpoint(elevation_deg=100.0)}, "elevation"),
        ({"viewpoint": Viewpoint(target_w=(0.0, 0.0, float("nan")))}, "target"),
    ):
        with pytest.raises(ConfigError, match=message):
            PictureStyle(**wrong)


def test_impossible_episodes_are_named(tmp_path: Path) -> None:
    for wrong, message in (
        ({"object": "train"}, "one object"),
        ({"object": "cabinet-9999"}, "unknown object"),
        ({"target": "link_99"}, "unknown target"),
        ({"level": -1}, "level"),
        ({"policy": "expart"}, "unknown policy"),
        ({"config": {"episode_stepz": 3}}, "episode_steps"),
    ):
        with pytest.raises((ConfigError, UnknownNameError), match=message):
            save_episode_picture(tmp_path / "a.png", episode(**wrong), PictureStyle(**SMALL), 1)
    assert not list(tmp_path.iterdir())


STYLE = PictureStyle(width=60, height=45)


def test_rows_and_moments(tmp_path: Path) -> None:
    demos = load_demo_pack("OpenCabinetDrawer")
    with demos.open(demos.objects[0]) as file:
        numbers = save_demos_picture(tmp_path / "a.png", file, STYLE, count=2, moments=3)
        assert numbers == most_different(file, [0, 1, 2, 3], 2)
        assert len(set(numbers)) == 2
        picture = np.asarray(Image.open(tmp_path / "a.png"))
        assert picture.shape == (2 * 45 + 6, 3 * 60 + 12, 3)
        first, last = picture[:30, :60].astype(int), picture[:30, -60:].astype(int)
        assert np.abs(first - last).mean() > 1  # something happens
        style = PictureStyle(width=60, height=45, viewpoint=Viewpoint(azimuth_deg=90))
        assert save_demos_picture(tmp_path / "b.jpg", file, style, count=9, moments=2) == [0, 1, 2, 3]


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
                save_demos_picture(tmp_path / path, file, STYLE, **changes)
    assert not list(tmp_path.iterdir())


class Seeing(StillActor):
    obs_mode, sampling = "pointcloud", Sampling(num_points=96)


def test_an_episode_gives_a_policy_the_points_that_it_declares() -> None:
    env = EpisodeChoice("OpenCabinetDrawer", "cabinet-0005").make_env(Seeing())
    observation, _ = env.reset(options={"level": 0})
    assert observation["pointcloud"]["xyz"].shape == (96, 3)


def test_these_points_are_shown_before_the_first_step_too(tmp_path: Path) -> None:
    style = PictureStyle(view="points")
    many, few = (
        shown(save_episode_picture(tmp_path / "a.png", episode(policy=policy), style))
        for policy in ("still", Seeing())
    )
    dark, half = 40, many.shape[1] // 2
    drawn = [(picture[:300, half + GAP_PX :] > dark).any(axis=-1).sum() for picture in (many, few)]
    assert 0 < drawn[1] < drawn[0]

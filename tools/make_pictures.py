"""Make the films of the package's policies, the strips of tasks and demonstrations, and the replays anew.

`python tools/make_pictures.py` makes all, `... strips` only those. They are small: pages should load fast.
"""

import argparse
import re
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from artiskill.demos.demos import load_demo_pack
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.evaluation.evaluate import run_episode
from artiskill.evaluation.pictures import EpisodeChoice, save_demos_picture
from artiskill.evaluation.plan import plan_evaluation
from artiskill.evaluation.policies import load_policy
from artiskill.evaluation.recording import LAST_FRAME_S, EpisodeRecorder, draw_moments, film_style
from artiskill.evaluation.scene_pictures import PictureStyle
from artiskill.evaluation.video import write_video
from artiskill.viewer.playback import LiveEpisode
from artiskill.viewer.replay import export_episode

# of objects that the package's policies have never met: task, object, level
FILMED = (
    ("OpenCabinetDrawer", "cabinet-0003", 0),
    ("OpenCabinetDoor", "cabinet-0056", 0),
    ("OpenCabinetDrawer", "cabinet-0015", 0),
)
FAILED = (
    ("OpenCabinetDoor", "cabinet-0042", 2),
    ("OpenCabinetDrawer", "cabinet-0092", 1),
    ("MoveBucket", "bucket-0045", 36),
)
WIDTH, HEIGHT = 640, 480  # as drawn; smaller in the files
FILM_SCALE, EVERY, FRAMES_PER_S = 0.65, 3, 4
IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
FILMS = {"drawers": (FILMED, EVERY), "failures": (FAILED, 2 * EVERY)}
REPLAYS = IMAGES.parent / "replays"
# task -> an object that it has never trained on, and a level
STRIPS = {
    "OpenCabinetDrawer": ("cabinet-0005", 1),
    "OpenCabinetDoor": ("cabinet-0056", 0),
    "PushChair": ("chair-0029", 4),
    "MoveBucket": ("bucket-0004", 5),
}
# of the demo pack: docs/images/demos_<name>.jpg
DEMOS = {
    "chair": ("PushChair", "chair-0013"),
    "door": ("OpenCabinetDoor", "cabinet-0006"),
    "bucket": ("MoveBucket", "bucket-0014"),
}
STRIP_FRAMES, STRIP_SIZE = 4, (360, 270)


def main(arguments: list[str]) -> None:
    """The films, then the strips of tasks and of demonstrations, then the replays; or what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="?", choices=MAKERS, help="(default: all)")
    what = parser.parse_args(arguments).what
    for name in [what] if what else MAKERS:
        MAKERS[name]()


def make_replays() -> None:
    """One of each task."""
    for task in STRIPS:
        path = make_replay(task, REPLAYS)
        print(f"{path}: {path.stat().st_size / 1e6:.1f} MB")


def make_replay(task: str, folder: Path) -> Path:
    """The expert's episode of the strip as a page that needs no server; returns its path."""
    object_id, level = STRIPS[task]
    return export_episode(LiveEpisode(EpisodeChoice(task, object_id, level=level)), folder / f"{snake(task)}.html")


def snake(task: str) -> str:
    """A task's name as files have it."""
    return re.sub("(?<!^)(?=[A-Z])", "_", task).lower()


def make_strips() -> None:
    """Those of the tasks and of the demonstrations."""
    for task, (object_id, level) in STRIPS.items():
        path = IMAGES / f"{snake(task)}.png"
        print(f"{path}: {make_strip(path, task, object_id, level)}")
    for name, (task, object_id) in DEMOS.items():
        with load_demo_pack(task).open(object_id) as file:
            path = IMAGES / f"demos_{name}.jpg"
            print(f"{path}: {save_demos_picture(path, file, PictureStyle(width=240, height=180), count=4)}")


def play(task: str, object_id: str, level: int) -> tuple[ManipulationEnv, EpisodeRecorder, str]:
    """The expert's episode, and how it ended."""
    env, film = ManipulationEnv(task, objects=object_id), EpisodeRecorder(PictureStyle(width=WIDTH, height=HEIGHT))
    result = run_episode(env, load_policy("expert"), level, film.record)
    return env, film, f"{result.length} steps, {'solved' if result.success else 'not solved'}"


def make_strip(path: Path, task: str, object_id: str, level: int) -> str:
    """Pictures of the expert's episode side by side, evenly spaced; tells how it ended."""
    env, film, end = play(task, object_id, level)
    chosen = [film.moments[k] for k in np.linspace(0, len(film.moments) - 1, STRIP_FRAMES).astype(int)]
    style = PictureStyle(width=WIDTH, height=HEIGHT)
    frames = draw_moments(env.task, env.scene, env.save_state().target, chosen, style)
    picture = Image.fromarray(np.concatenate([smaller(frame, STRIP_SIZE) for frame in frames], axis=1))
    picture.save(path, optimize=True)
    return end


def make_films() -> None:
    """Of successes and of failures."""
    for name in FILMS:
        make_film(name)


def make_film(name: str) -> None:
    """Episodes of the package's policies with the points that they see, the last frame for a second."""
    (filmed, every), frames, path = FILMS[name], [], IMAGES / f"{name}.gif"
    for task, object_id, level in filmed:
        (batch,) = plan_evaluation(task, "pretrained", [object_id], 1).batches
        env, film = batch.make_env(), EpisodeRecorder(film_style(batch))
        result = run_episode(env, load_policy(batch.policy), level, film.record)
        drawn = film.draw()[: len(film.moments)]
        frames += [*drawn[:-1:every], *[drawn[-1]] * round(LAST_FRAME_S * FRAMES_PER_S)]
        print(f"{object_id}: {result.length} steps, {'solved' if result.success else 'not solved'}")
    height, width = frames[0].shape[:2]
    size = 2 * round(FILM_SCALE * width / 2), 2 * round(FILM_SCALE * height / 2)
    write_video(path, [smaller(frame, size) for frame in frames], FRAMES_PER_S)
    print(f"{path}: {len(frames)} frames, {path.stat().st_size / 1e6:.1f} MB")


def smaller(frame: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """A frame scaled down."""
    return np.asarray(Image.fromarray(frame).resize(size, Image.Resampling.LANCZOS))


MAKERS = {"films": make_films, "strips": make_strips, "replays": make_replays}

if __name__ == "__main__":
    main(sys.argv[1:])

"""Make the README's moving picture and the tasks' strips anew: `python tools/make_pictures.py`.

They are small: pages should load fast.
"""

import re
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageSequence

from artiskill.envs.manipulation import ManipulationEnv
from artiskill.evaluation.plan import make_plan
from artiskill.evaluation.policies import load_policy
from artiskill.evaluation.recording import record_video
from artiskill.evaluation.video import write_video

OBJECTS = ("cabinet-0003", "cabinet-0005", "cabinet-0015")
WIDTH, HEIGHT = 448, 336
EVERY, FRAMES_PER_S = 2, 5
IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
OUT = IMAGES / "drawers.gif"
# task -> an object that it has never trained on, and a level in which the camera sees well
STRIPS = {
    "OpenCabinetDrawer": ("cabinet-0005", 1),
    "OpenCabinetDoor": ("cabinet-0056", 0),
    "PushChair": ("chair-0029", 4),
    "MoveBucket": ("bucket-0004", 5),
}
STRIP_FRAMES, STRIP_SIZE = 4, (360, 270)


def main() -> None:
    """The film, then the strips."""
    make_film()
    for task, (object_id, level) in STRIPS.items():
        path = IMAGES / f"{re.sub('(?<!^)(?=[A-Z])', '_', task).lower()}.png"
        print(f"{path}: {make_strip(path, task, object_id, level)}")


def make_strip(path: Path, task: str, object_id: str, level: int) -> str:
    """Pictures of the expert's episode side by side, evenly spaced; tells how it ended."""
    env, expert = ManipulationEnv(task, objects=object_id, render_mode="rgb_array"), load_policy("expert")
    observation, info = env.reset(seed=level)
    expert.reset(env, observation, info)
    frames, done = [env.render()], False
    while not done:
        observation, _, done, truncated, _ = env.step(expert.act(env, observation))
        frames.append(env.render())
        if truncated:
            break
    chosen = [frames[i] for i in np.linspace(0, len(frames) - 1, STRIP_FRAMES).astype(int)]
    small = [np.asarray(Image.fromarray(f).resize(STRIP_SIZE, Image.Resampling.LANCZOS)) for f in chosen]
    picture = Image.fromarray(np.concatenate(small, axis=1)).quantize(256, dither=Image.Dither.FLOYDSTEINBERG)
    picture.save(path, optimize=True)
    return f"{len(frames) - 1} steps, {'solved' if done else 'not solved'}"


def make_film() -> None:
    """Record the expert on three test cabinets and shrink the film."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "episodes.webp"
        record_video(make_plan("OpenCabinetDrawer", "expert", list(OBJECTS), episodes=1), path, count=len(OBJECTS))
        with Image.open(path) as film:
            frames = [
                np.asarray(frame.convert("RGB").resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS))
                for i, frame in enumerate(ImageSequence.Iterator(film))
                if i % EVERY == 0
            ]
    write_video(OUT, frames, FRAMES_PER_S)
    print(f"{OUT}: {len(frames)} frames, {OUT.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
